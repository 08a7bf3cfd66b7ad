"""Inputs and outputs of an I/O module of CiA 401: polarity, filter, scaling, error values, what causes a TPDO.

The value on a terminal and the value in an object are two things, and only this file turns one into the other. An
object that the file does not have counts as its default in CiA 401-1.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import NamedTuple

from eurobot_od.device.profiles.values import ProfileValues
from eurobot_od.od.profiles import cia401
from eurobot_od.od.profiles.cia401 import AnalogueInputs, AnalogueOutputs, DigitalInputs, DigitalOutputs
from eurobot_od.od.values import Address

BLOCKS = range(1, 255)
"""Sub-indices of the blocks of inputs and outputs."""

DEFAULT_TRIGGER = 0b111
"""What causes the TPDO of an analogue input without 0x6421: both limits, and the delta."""


def _get(values: ProfileValues, index: int, sub: int, default: int = 0) -> int:
    value = values.get((index, sub)) if values.has((index, sub)) else None
    return default if value is None else value


def _scaled(values: ProfileValues, kind: AnalogueInputs | AnalogueOutputs, sub: int, value: int) -> int:
    """Return a value by the factor and offset of its channel (CiA 401-1, objects 0x6431, 0x6432, 0x6446, 0x6447)."""
    return value * _get(values, kind.scaling, sub, 1) + _get(values, kind.offset, sub)


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
        """Update the terminals from the objects."""
        for digital, sub in self._digital:
            self.terminals[digital.value, sub] = self.digital(digital, sub)
        for analogue, sub in self._analogue:
            # Error mode 0 keeps the value; without the object it is 1 (CiA 401-1, object 0x6443).
            fails = self.failed and _get(self._values, analogue.error_mode, sub, 1) == 1
            index = analogue.error_value if fails else analogue.value
            commanded = _get(self._values, index, sub)
            # The factor comes last, as polarity does for a digital output.
            self.terminals[analogue.value, sub] = _scaled(self._values, analogue, sub, commanded)

    def fail(self) -> None:
        """Give them their error values, because nobody can command them."""
        self.failed = True
        self.refresh()

    def digital(self, kind: DigitalOutputs, sub: int) -> int:
        """Return the value on the terminals of a block."""
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
    """The objects that say when an analogue input causes a TPDO, at the input's sub-index."""

    by: int = cia401.ANALOGUE_TRIGGER
    upper: int = cia401.ANALOGUE_UPPER
    lower: int = cia401.ANALOGUE_LOWER
    delta: int = cia401.ANALOGUE_DELTA
    falling: int = cia401.ANALOGUE_FALL
    rising: int = cia401.ANALOGUE_RISE


TRIGGER = Trigger()

FILTER_TIME = 0.02
"""Seconds that a filtered input has to be steady before it counts; CiA 401-1 leaves the constant to the maker."""


class InputFilter:
    """The filter of a block of digital inputs, bit by bit: it hides what is shorter than `FILTER_TIME`."""

    def __init__(self, terminals: int) -> None:
        self._last = self._steady = terminals
        self._since: dict[int, float] = {}

    def passed(self, terminals: int, now: float) -> int:
        """Return the terminals as they have been for long enough."""
        changed = terminals ^ self._last
        self._since |= {bit: now for bit in range(changed.bit_length()) if changed >> bit & 1}
        self._last = terminals
        for bit in [bit for bit, since in self._since.items() if now - since >= FILTER_TIME - 1e-9]:
            del self._since[bit]
            self._steady = self._steady & ~(1 << bit) | terminals & 1 << bit
        return self._steady


class Inputs:
    """A module's inputs: what its objects say about their terminals, and which of them cause TPDOs."""

    def __init__(self, values: ProfileValues) -> None:
        self._values = values
        self.digital = {
            (kind.value, sub): kind for kind in cia401.DIGITAL_INPUTS for sub in _blocks(values, kind.value)
        }
        self._analogue = {
            (kind.value, sub): kind for kind in cia401.ANALOGUE_INPUTS for sub in _blocks(values, kind.value)
        }
        self._seen: dict[Address, int] = {}
        self._filters: dict[Address, InputFilter] = {}

    @property
    def addresses(self) -> set[Address]:
        """The objects that are inputs."""
        return {*self.digital, *self._analogue}

    def value(self, address: Address, terminals: int, now: float) -> int:
        """Return an input's value from the value on its terminals: filtered and by polarity, or scaled."""
        sub, digital, analogue = address[1], self.digital.get(address), self._analogue.get(address)
        if analogue is not None:
            return _scaled(self._values, analogue, sub, terminals)
        if digital is None:
            return terminals
        filtered = _get(self._values, digital.filter, sub)
        # Always asked, so that a filter that is switched on knows the input's past.
        steady = self._filters.setdefault(address, InputFilter(terminals)).passed(terminals, now)
        return (steady & filtered | terminals & ~filtered) ^ _get(self._values, digital.polarity, sub)

    def forget(self) -> None:
        """Start over: the present inputs cause no TPDO."""
        self._seen.clear()

    def caused(self, present: Mapping[Address, int] = MappingProxyType({})) -> set[Address]:
        """Return the inputs that have caused a TPDO since this was last asked; `present` are their values."""
        causes = {address for address, value in present.items() if self._causes(address, value)}
        # An analogue input is compared with the last value sent, a digital one with its last value.
        taken = {*self.digital, *causes, *(present.keys() - self._seen.keys())}
        self._seen |= {address: value for address, value in present.items() if address in taken}
        return causes

    def _causes(self, address: Address, value: int) -> bool:
        last = self._seen.get(address)
        # The first value after a start causes nothing itself; later ones are compared with it.
        if last is None or last == value:
            return False
        digital = self.digital.get(address)
        return self.by_edge(digital, address[1], last, value) if digital else self._by_level(address[1], last, value)

    def by_edge(self, kind: DigitalInputs, sub: int, last: int, value: int) -> bool:
        """Compare with the masks of change, rising and falling edge (CiA 401-1, objects 0x6005 to 0x6008)."""
        values, every = self._values, (1 << kind.bits) - 1
        if not _get(values, cia401.INTERRUPT_ENABLE, 0, 1):  # on by default
            return False
        change = _get(values, kind.change, sub, every)
        rising, falling = (_get(values, each, sub, 0) for each in (kind.rising, kind.falling))
        return bool((last ^ value) & change | value & ~last & rising | last & ~value & falling)

    def _by_level(self, sub: int, last: int, value: int) -> bool:
        """Compare with the limits and deltas of an analogue input (CiA 401-1, objects 0x6421 to 0x6428)."""
        values = self._values
        if not _get(values, cia401.ANALOGUE_INTERRUPT_ENABLE, 0, 0):  # off by default
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
