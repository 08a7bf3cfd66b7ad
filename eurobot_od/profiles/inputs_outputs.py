"""Inputs and outputs of an I/O module as CiA 401 has them: polarity, filter, error values, and what causes a TPDO.

Rule of this file: what is on a terminal and what stands in an object are two things, and only here one becomes the
other. An object that the file does not have counts as its default in CiA 401-1.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

from eurobot_od.od.values import Address
from eurobot_od.profiles import cia401
from eurobot_od.profiles.cia401 import DigitalInputs, DigitalOutputs
from eurobot_od.profiles.values import ProfileValues

BLOCKS = range(1, 255)
"""Sub-indices of the blocks of inputs and outputs."""

DEFAULT_TRIGGER = 0b111
"""What causes the TPDO of an analogue input without 0x6421: both limits, and delta."""


def _get(values: ProfileValues, index: int, sub: int, default: int = 0) -> int:
    value = values.get((index, sub)) if values.has((index, sub)) else None
    return default if value is None else value


def _blocks(values: ProfileValues, index: int) -> Iterator[int]:
    return (sub for sub in BLOCKS if values.has((index, sub)))


# Outputs


class Outputs:
    """The terminals of a module's outputs; `failed` tells whether they have their error values."""

    def __init__(self, values: ProfileValues) -> None:
        self._values = values
        self._digital = [(kind, sub) for kind in cia401.DIGITAL_OUTPUTS for sub in _blocks(values, kind.value)]
        self._analogue = [(kind, sub) for kind in cia401.ANALOGUE_OUTPUTS for sub in _blocks(values, kind.value)]
        self.terminals: dict[Address, int] = {}
        self.failed = False
        self.refresh()

    def refresh(self) -> None:
        """Take over what stands in the objects."""
        for digital, sub in self._digital:
            self.terminals[digital.value, sub] = self._of_digital(digital, sub)
        for analogue, sub in self._analogue:
            # Error mode 0 keeps the value; without the object it is 1 (CiA 401-1, object 0x6443).
            fails = self.failed and _get(self._values, analogue.error_mode, sub, 1) == 1
            index = analogue.error_value if fails else analogue.value
            self.terminals[analogue.value, sub] = _get(self._values, index, sub)

    def _of_digital(self, kind: DigitalOutputs, sub: int) -> int:
        values, every = self._values, (1 << kind.bits) - 1
        value = _get(values, kind.value, sub)
        if self.failed:
            # Bit by bit: a 1 in the error mode has the output take its error value (CiA 401-1, object 0x6206).
            mode = _get(values, kind.error_mode, sub, every)
            value = value & ~mode | _get(values, kind.error_value, sub, 0) & mode
        # Polarity comes last, so an error value is inverted as well; a 0 in the filter holds what is on the terminal.
        terminal = (value ^ _get(values, kind.polarity, sub, 0)) & every
        passes = _get(values, kind.filter, sub, every)
        return terminal & passes | self.terminals.get((kind.value, sub), 0) & ~passes


# Inputs


class Trigger(NamedTuple):
    """The objects that say when an analogue input causes a TPDO, at its sub-index."""

    by: int = cia401.ANALOGUE_TRIGGER
    upper: int = cia401.ANALOGUE_UPPER
    lower: int = cia401.ANALOGUE_LOWER
    delta: int = cia401.ANALOGUE_DELTA
    falling: int = 0x6427
    rising: int = 0x6428


TRIGGER = Trigger()


class Inputs:
    """What of a module's inputs causes TPDOs."""

    def __init__(self, values: ProfileValues) -> None:
        self._values = values
        self._digital = {
            (kind.value, sub): kind for kind in cia401.DIGITAL_INPUTS for sub in _blocks(values, kind.value)
        }
        self._analogue = {
            (kind.value, sub): kind for kind in cia401.ANALOGUE_INPUTS for sub in _blocks(values, kind.value)
        }
        self._seen: dict[Address, int] = {}

    @property
    def addresses(self) -> set[Address]:
        """The objects that are inputs."""
        return {*self._digital, *self._analogue}

    def polarity(self, address: Address) -> int:
        """Return the bits of an input that are inverted on their way from the terminal."""
        kind = self._digital.get(address)
        return _get(self._values, kind.polarity, address[1], 0) if kind else 0

    def forget(self) -> None:
        """Begin anew: what the inputs are now causes no TPDO."""
        self._seen.clear()

    def caused(self, present: Mapping[Address, int] = MappingProxyType({})) -> set[Address]:
        """Return the inputs that cause a TPDO since this was asked last; `present` are their values."""
        causes = {address for address, value in present.items() if self._causes(address, value)}
        # An analogue input is compared with what was sent last, a digital one with what it was last.
        taken = {*self._digital, *causes, *(present.keys() - self._seen.keys())}
        self._seen |= {address: value for address, value in present.items() if address in taken}
        return causes

    def _causes(self, address: Address, value: int) -> bool:
        last = self._seen.get(address)
        if last is None or last == value:
            return False
        digital = self._digital.get(address)
        return self._by_edge(digital, address[1], last, value) if digital else self._by_level(address[1], last, value)

    def _by_edge(self, kind: DigitalInputs, sub: int, last: int, value: int) -> bool:
        """Compare with the masks of change, rising and falling edge (CiA 401-1, objects 0x6005 to 0x6008)."""
        values, every = self._values, (1 << kind.bits) - 1
        if not _get(values, cia401.INTERRUPT_ENABLE, 0, 1):  # on, unless it is switched off
            return False
        change = _get(values, kind.change, sub, every)
        rising, falling = (_get(values, each, sub, 0) for each in (kind.rising, kind.falling))
        return bool((last ^ value) & change | value & ~last & rising | last & ~value & falling)

    def _by_level(self, sub: int, last: int, value: int) -> bool:
        """Compare with the limits and deltas of an analogue input (CiA 401-1, objects 0x6421 to 0x6428)."""
        values = self._values
        if not _get(values, cia401.ANALOGUE_INTERRUPT_ENABLE, 0, 0):  # off, unless it is switched on
            return False
        by = _get(values, TRIGGER.by, sub, DEFAULT_TRIGGER)
        upper, lower, delta, falling, rising = (_get(values, each, sub, 0) for each in TRIGGER[1:])
        held = (
            value > upper,
            value < lower,
            abs(value - last) > delta,
            last - value > falling,
            value - last > rising,
        )
        return any(by >> bit & 1 and holds for bit, holds in enumerate(held))
