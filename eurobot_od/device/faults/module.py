"""Faults of I/O modules (CiA 401): outputs and inputs that are wrong, settings that they do not heed.

The step that finds each is one of `check --profile 401 --outputs`, with an output of each sort wired to an input.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar, NamedTuple

from eurobot_od.device.faults.fault import Caught, Fault
from eurobot_od.device.faults.hooks import Mixin
from eurobot_od.device.profiles.devices import SimulatedModule
from eurobot_od.device.profiles.inputs_outputs import Inputs, Outputs
from eurobot_od.device.profiles.values import ProfileValues
from eurobot_od.od.profiles.cia401 import DigitalInputs, DigitalOutputs
from eurobot_od.od.values import Address

SUITE = "profile-401"
"""What `check --profile 401` makes."""


class IgnoringValues(NamedTuple):
    """The objects of a module that does not heed some of them: they count as if the file did not have them."""

    values: ProfileValues
    ignored: frozenset[int]

    def has(self, address: Address) -> bool:
        """Tell whether the module has an object, and heeds it."""
        return address[0] not in self.ignored and self.values.has(address)

    def get(self, address: Address) -> int | None:
        """Return its value."""
        return self.values.get(address)

    def put(self, address: Address, value: int) -> None:
        """Keep a value."""
        self.values.put(address, value)

    def unit(self, address: Address) -> str:
        """Return its unit."""
        return self.values.unit(address)


def _ignoring(*indices: int) -> Mixin:
    """Keep what is written to some objects, and do as if they were not there."""

    class Ignoring(SimulatedModule):
        def _profile_values(self) -> ProfileValues:
            return IgnoringValues(super()._profile_values(), frozenset(indices))

    return Ignoring


def _outputs(kind: type[Outputs]) -> Mixin:
    class WithOutputs(SimulatedModule):
        OUTPUTS: ClassVar[type[Outputs]] = kind

    return WithOutputs


def _inputs(kind: type[Inputs]) -> Mixin:
    class WithInputs(SimulatedModule):
        INPUTS: ClassVar[type[Inputs]] = kind

    return WithInputs


class StuckOutputs(Outputs):
    """The third output of each block cannot be switched on."""

    def digital(self, kind: DigitalOutputs, sub: int) -> int:
        return super().digital(kind, sub) & ~0b100


class CrossedInputs(Inputs):
    """The wires of the first two inputs of each block are exchanged."""

    def value(self, address: Address, terminals: int, now: float) -> int:
        crossed = terminals & ~0b11 | (terminals & 1) << 1 | terminals >> 1 & 1
        return super().value(address, crossed if address in self.digital else terminals, now)


class HeldOutputs(Outputs):
    """They stay as they are when the heartbeat is lost."""

    def fail(self) -> None:
        pass


class SilentInputs(Inputs):
    """No change of them causes a TPDO."""

    def caused(self, present: Mapping[Address, int] = MappingProxyType({})) -> set[Address]:
        super().caused(present)
        return set()


class ExchangedEdges(Inputs):
    """Rising edges count as falling ones."""

    def by_edge(self, kind: DigitalInputs, sub: int, last: int, value: int) -> bool:
        return super().by_edge(kind, sub, value, last)


def _step(index: str, topic: str, text: str, mixin: Mixin) -> Fault:
    return Caught(SUITE, f"{index} {topic}: ").fault(text, mixin)


FAULTS: Mapping[str, Fault] = {
    "input-polarity-ignored": _step(
        "0x6002", "Polarity of inputs", "does not heed the polarity of its inputs", _ignoring(0x6002)
    ),
    "output-stuck": _step("0x6200", "Outputs at the terminals", "cannot switch an output on", _outputs(StuckOutputs)),
    "inputs-crossed": _step(
        "0x6200", "Outputs at the terminals", "takes an input for the one beside it", _inputs(CrossedInputs)
    ),
    "output-polarity-ignored": _step(
        "0x6202", "Polarity of outputs", "does not heed the polarity of its outputs", _ignoring(0x6202)
    ),
    "output-filter-ignored": _step(
        "0x6208", "Filter of outputs", "switches outputs that the filter holds", _ignoring(0x6208)
    ),
    "outputs-held": _step(
        "0x6207",
        "Error value of outputs",
        "leaves its outputs as they are when a heartbeat is lost",
        _outputs(HeldOutputs),
    ),
    "error-value-ignored": _step(
        "0x6207", "Error value of outputs", "switches outputs off in place of their error value", _ignoring(0x6207)
    ),
    "error-mode-ignored": _step(
        "0x6206", "Error mode of outputs", "gives outputs their error value that are to keep theirs", _ignoring(0x6206)
    ),
    "input-scaling-ignored": _step(
        "0x6432", "Scaling of inputs at the terminals", "does not multiply its analogue inputs", _ignoring(0x6432)
    ),
    "input-offset-ignored": _step(
        "0x6432", "Scaling of inputs at the terminals", "adds no offset to its analogue inputs", _ignoring(0x6431)
    ),
    "output-scaling-ignored": _step(
        "0x6447", "Scaling of outputs at the terminals", "does not multiply its analogue outputs", _ignoring(0x6447)
    ),
    "analogue-error-value-ignored": _step(
        "0x6444", "Error value of analogue outputs", "sets analogue outputs to 0 on an error", _ignoring(0x6444)
    ),
    "analogue-error-mode-ignored": _step(
        "0x6443",
        "Error mode of analogue outputs",
        "gives analogue outputs their error value that are to keep theirs",
        _ignoring(0x6443),
    ),
    "interrupts-missing": _step(
        "0x6006", "Interrupt on any change", "sends no TPDO when an input changes", _inputs(SilentInputs)
    ),
    "change-mask-ignored": _step(
        "0x6006", "Interrupt on any change", "sends a TPDO for inputs that are masked", _ignoring(0x6006)
    ),
    "rising-mask-ignored": _step(
        "0x6007", "Interrupt on a rising edge", "does not heed the mask of rising edges", _ignoring(0x6007)
    ),
    "edges-exchanged": _step(
        "0x6007", "Interrupt on a rising edge", "takes rising edges for falling ones", _inputs(ExchangedEdges)
    ),
    "falling-mask-ignored": _step(
        "0x6008", "Interrupt on a falling edge", "does not heed the mask of falling edges", _ignoring(0x6008)
    ),
    "interrupt-enable-ignored": _step(
        "0x6005", "Global interrupt of inputs", "sends TPDOs that are switched off", _ignoring(0x6005)
    ),
    "delta-ignored": _step(
        "0x6426", "Delta of analogue interrupts", "sends a TPDO at the least change", _ignoring(0x6426)
    ),
}
