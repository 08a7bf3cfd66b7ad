"""Suites for I/O modules by CiA 401: objects, settings, outputs written and read back.

Over the bus nobody sees a terminal: an output that never switches answers as one that does. So there is only what
objects say.

Rule of this file: nothing switches an output but what needs `--outputs`. CiA 401 has a clause for each object; steps
are named by the object, as the clauses' numbers differ from version to version.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from eurobot_od.check.conformance import step
from eurobot_od.check.conformance.clauses import ANSWERS, Chapter
from eurobot_od.check.conformance.step import Data, Steps, hexadecimal, title
from eurobot_od.check.conformance.subject import Subject, Tier, awake
from eurobot_od.check.conformance.suite import documents
from eurobot_od.od import cia401
from eurobot_od.od.cia401 import AnalogueInputs, AnalogueOutputs, DigitalInputs, DigitalOutputs
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import DEVICE_TYPE
from eurobot_od.od.values import Address, label

Kind: TypeAlias = "DigitalInputs | DigitalOutputs | AnalogueInputs | AnalogueOutputs"


@dataclass(frozen=True)
class TestedModule(Subject):
    """A module under test."""

    def blocks(self, kinds: Sequence[Kind]) -> Iterator[tuple[Kind, Address]]:
        """Give the blocks and channels of some kinds that the file has."""
        present = self.dictionary.members
        return (
            (kind, (kind.value, sub)) for kind in kinds for sub in present.get(kind.value, ()) if sub and sub < 0xFF
        )

    def settings(self, *indices: int) -> list[Address]:
        """Return the addresses of settings that the file has, and that can be written and put back."""
        members = self.dictionary.members
        subs = ((index, sub) for index in indices for sub in members.get(index, ()))
        return [each for each in subs if (each[1] or len(members[each[0]]) == 1) and self.settable(each)]


_INPUTS: tuple[Kind, ...] = (*cia401.DIGITAL_INPUTS, *cia401.ANALOGUE_INPUTS)
_OUTPUTS: tuple[Kind, ...] = (*cia401.DIGITAL_OUTPUTS, *cia401.ANALOGUE_OUTPUTS)

CHAPTER: Chapter[TestedModule] = Chapter("cia401", "I/O module", standard=401)
"""The suite, in the order of this file: what switches nothing comes first."""


# Steps


def _every(bits: int, byte: int = 0xFF) -> int:
    """Return a block that repeats the same byte."""
    return int.from_bytes(bytes([byte]) * (bits // 8), "little")


def _name(module: TestedModule, address: Address) -> str:
    variable = module.find(address)
    return title(variable) if variable else label(address)


def _set(address: Address, value: int) -> Data:
    name = f"{label(address)} = {value:#x}" if value > 9 else f"{label(address)} = {value}"
    return step.write(name, address, value=value)


def _kept(module: TestedModule, address: Address, *steps: Data, name: str = "") -> Data:
    """Do something with an object and give it back its value."""
    variable = module.find(address)
    assert variable is not None
    return step.group(name or title(variable), step.save(variable), *steps, step.put_back(variable))


def _written_and_read(module: TestedModule, address: Address, values: Sequence[int]) -> Data:
    pairs = ((_set(address, each), step.read(f"it is {each:#x}", address, expect=each)) for each in values)
    return _kept(module, address, *(each for pair in pairs for each in pair))


def _without(name: str, index: int) -> Data:
    return step.skip(name, f"the file has no {hexadecimal(index)} that can be written")


# Objects

FUNCTIONS: Mapping[int, tuple[Sequence[Kind], int]] = {
    16: (cia401.DIGITAL_INPUTS, 0x6000),
    17: (cia401.DIGITAL_OUTPUTS, 0x6200),
    18: (cia401.ANALOGUE_INPUTS, 0x6401),
    19: (cia401.ANALOGUE_OUTPUTS, 0x6411),
}
"""What a bit of 0x1000 says that there is, and the object where it usually is."""


@CHAPTER.clause("0x1000", "Device type")
def _device_type(module: TestedModule) -> Steps:
    says = module.number(DEVICE_TYPE)
    yield step.read("an I/O module", DEVICE_TYPE, expect=says)
    for bit, (kinds, usual) in FUNCTIONS.items():
        words, found = cia401.FUNCTION_BITS[bit], [address for _, address in module.blocks(kinds)]
        if says >> bit & 1:  # what is usual is asked for where the file has none: it is not there, and the step is red
            yield step.read(words, found[0] if found else (usual, 1), data="any")
        else:
            yield step.skip(words, f"0x1000 says that it has no {words}")


@CHAPTER.clause("0x6000", "Inputs")
def _inputs(module: TestedModule) -> Steps:
    return [step.read(_name(module, address), address, data="any") for _, address in module.blocks(_INPUTS)]


# Settings that switch nothing


@CHAPTER.clause("0x6002", "Polarity of inputs", Tier.REVERSIBLE)
def _input_polarity(module: TestedModule) -> Steps:
    """Invert one bit after the other; the inputs have to be at rest."""
    for kind, address in module.blocks(cia401.DIGITAL_INPUTS):
        assert isinstance(kind, DigitalInputs)
        polarity, variable = (kind.polarity, address[1]), module.find(address)
        if variable is None or not module.may_be(polarity, _every(kind.bits)):
            yield _without(_name(module, address), kind.polarity)
            continue
        steps = [step.save(variable, "input")]
        for bit in range(kind.bits):
            steps.append(_set(polarity, 1 << bit))
            # It differs, and by the value of this bit: so it is this one, and no other.
            steps.append(step.read(f"bit {bit} is inverted", address, expect="not {input}"))
            steps.append(step.read(f"no other than bit {bit}", address, expect=f"{{input}} +- {1 << bit}"))
        yield _kept(module, polarity, *steps, name=_name(module, address))


SETTINGS: Mapping[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
    "Filter of inputs": ((0x6003, 0x6103, 0x6123), (0x55, 0xAA)),
    "Interrupts of inputs": (
        (0x6006, 0x6007, 0x6008, 0x6106, 0x6107, 0x6108, 0x6126, 0x6127, 0x6128),
        (0x55, 0xAA),
    ),
    "Global interrupt": ((cia401.INTERRUPT_ENABLE, cia401.ANALOGUE_INTERRUPT_ENABLE), (0, 1)),
    "Analogue interrupts": (tuple(range(cia401.ANALOGUE_UPPER, cia401.ANALOGUE_RISE + 1)), (0, 100)),
    "Scaling of inputs": ((0x6431, 0x6432), (1, 2)),
    "Error mode": ((0x6206, 0x6306, 0x6326), (0x00, 0x55)),
    "Error value": ((0x6207, 0x6307, 0x6327), (0x00, 0x55)),
    "Analogue error mode": ((0x6443,), (0, 1)),
    "Analogue error value": ((0x6444,), (0, 100)),
}
"""Settings that only count with an event or an error: their objects, and values that are written and read back."""


def _settings_clause(topic: str, indices: tuple[int, ...], values: tuple[int, ...]) -> None:
    @CHAPTER.clause(hexadecimal(indices[0]), topic, Tier.REVERSIBLE)
    def _steps(module: TestedModule) -> Steps:
        found = [each for each in module.settings(*indices) if module.may_be(each, *values)]
        yield from (_written_and_read(module, each, values) for each in found)
        if not found:
            yield _without("written and read back", indices[0])


for _topic, _row in SETTINGS.items():
    _settings_clause(_topic, *_row)


# Outputs


@CHAPTER.clause("0x6200", "Outputs", Tier.OUTPUTS)
def _outputs(module: TestedModule) -> Steps:
    for kind, address in module.blocks(_OUTPUTS):
        # Each bit both ways, next to bits that differ from it and to bits that do not; off at the end.
        values = [0x55, 0xAA, 0xFF, 0x00] if isinstance(kind, DigitalOutputs) else [1, 100, 0]
        wide = [_every(kind.bits, each) for each in values] if isinstance(kind, DigitalOutputs) else values
        usable = [each for each in wide if module.may_be(address, each)]
        yield _written_and_read(module, address, usable) if usable else _without(_name(module, address), address[0])


# The suite


def text(dictionary: Dictionary, reversible: bool = False, outputs: bool = False) -> str:
    """Return the suite of a module; `reversible` writes settings, `outputs` switches."""
    module = TestedModule(dictionary, Tier.OUTPUTS if outputs else Tier.REVERSIBLE if reversible else Tier.READING)
    settable = [address for _, address in module.blocks(_OUTPUTS) if module.settable(address)] if outputs else []
    off = [
        step.write(f"0x6200 Outputs: {label(each)} as after power-on [outputs]", each, value=module.number(each))
        for each in settable
    ]
    stop = {**step.nmt("pre-operational"), "name": "7.2.8.2.1 NMT: to PRE-OPERATIONAL [outputs]"}
    return documents([CHAPTER.suite(module, "profile", [awake(module, ANSWERS)], [*off, stop] if outputs else [])])
