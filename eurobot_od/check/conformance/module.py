"""Suites for I/O modules by CiA 401: objects, settings, outputs written, outputs seen at inputs that are wired to them.

Theory of operation. Over the bus nobody sees a terminal: an output that never switches answers as one that does. So
whatever an output does is looked at where a wire leads from it to an input. Without `wires` there is only what objects
say, and the rest is skipped with that reason.

Rule of this file: nothing switches an output but what needs `--outputs`. CiA 401 has a clause for each object; steps
are named by the object, as the clauses' numbers differ from version to version.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple, TypeAlias

from eurobot_od.check.conformance.profile import Needs, ProfileClauses, allowed_steps
from eurobot_od.check.conformance.subject import (
    Subject,
    awake,
    expect,
    group,
    never,
    nmt,
    put_back,
    read,
    save,
    sent,
    skip,
    title,
    wait,
    write,
)
from eurobot_od.check.conformance.writing import Data, documents, hexadecimal
from eurobot_od.check.format import VERSION
from eurobot_od.device.nmt import NmtState
from eurobot_od.errors import LocalError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import encode
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.profiles import cia401
from eurobot_od.od.profiles.cia401 import AnalogueInputs, AnalogueOutputs, DigitalInputs, DigitalOutputs
from eurobot_od.od.standard import CONSUMED_HEARTBEATS, DEVICE_TYPE
from eurobot_od.od.values import ERROR_CONTROL_BASE, Address, PdoDirection, label
from eurobot_od.sdo.wire import ClientCommand, carrying

TAG = "profile"

SETTLED = "50 ms"
"""How long a terminal may take to follow its object, and an input to follow its terminal."""

SOON, QUIET = "1 s", "200 ms"
"""How long a TPDO may take, and how long none may come."""

WATCHED, MISSED = 200, "500 ms"
"""Milliseconds of the heartbeat that is lost, and when it is."""

EVENT_DRIVEN = (254, 255)
"""Transmission types of TPDOs that go on an event (CiA 301, Table 70)."""

LEVEL = 1000
"""Value of an analogue output that is looked at: little, whatever its unit."""

Kind: TypeAlias = "DigitalInputs | DigitalOutputs | AnalogueInputs | AnalogueOutputs"


class Wired(NamedTuple):
    """An output, and the input that is wired to it: their kinds and addresses."""

    output: DigitalOutputs | AnalogueOutputs
    here: Address
    input: DigitalInputs | AnalogueInputs
    there: Address


class TestedModule(NamedTuple):
    """A module under test, and which steps may be done; `wires` lead from outputs to inputs."""

    subject: Subject
    allowed: frozenset[Needs]
    wires: Mapping[Address, Address]

    def blocks(self, kinds: Sequence[Kind]) -> Iterator[tuple[Kind, Address]]:
        """Give the blocks and channels of some kinds that the file has."""
        present = self.subject.dictionary.members
        return (
            (kind, (kind.value, sub)) for kind in kinds for sub in present.get(kind.value, ()) if sub and sub < 0xFF
        )

    def wired(self, digital: bool) -> list[Wired]:
        """Return the wires between digital blocks, or between analogue channels."""
        kinds = _DIGITAL if digital else _ANALOGUE
        found = {address: kind for kind, address in self.blocks(kinds)}
        return [
            Wired(found[here], here, found[there], there)  # type: ignore[arg-type]  # which is which was checked
            for here, there in self.wires.items()
            if here in found
        ]

    def settings(self, *indices: int) -> list[Address]:
        """Return the addresses of settings that the file has, and that can be written and put back."""
        members = self.subject.dictionary.members
        subs = ((index, sub) for index in indices for sub in members.get(index, ()))
        return [each for each in subs if (each[1] or len(members[each[0]]) == 1) and self.subject.settable(each)]

    def tpdo(self, address: Address) -> tuple[Pdo | None, str]:
        """Return the TPDO that goes when an input changes; or why none can be looked at."""
        mapping = [
            each
            for each in self.subject.pdos
            if each.direction is PdoDirection.TPDO and address in (entry.address for entry in each.mapping)
        ]
        for pdo in mapping:
            why = self.subject.why_not_seen(pdo)
            if not why and pdo.transmission_type in EVENT_DRIVEN and not pdo.event_timer:
                return pdo, ""
        return None, f"no TPDO with {label(address)} goes on a change alone"

    def check_wires(self) -> None:
        """Raise LocalError unless each leads from an output to an input of the same width, digital or analogue."""
        widths: list[tuple[Kind, Kind]] = [
            *zip(cia401.DIGITAL_OUTPUTS, cia401.DIGITAL_INPUTS),
            *zip(cia401.ANALOGUE_OUTPUTS, cia401.ANALOGUE_INPUTS),
        ]
        found = {address: kind for kind, address in self.blocks([each for pair in widths for each in pair])}
        for here, there in self.wires.items():
            if (found.get(here), found.get(there)) not in widths:
                what = f"no wire can lead from {label(here)} to {label(there)}: an output, and an input as wide"
                raise LocalError(f"{self.subject.dictionary.file}: {what}")


_INPUTS: tuple[Kind, ...] = (*cia401.DIGITAL_INPUTS, *cia401.ANALOGUE_INPUTS)
_OUTPUTS: tuple[Kind, ...] = (*cia401.DIGITAL_OUTPUTS, *cia401.ANALOGUE_OUTPUTS)
_DIGITAL: tuple[Kind, ...] = (*cia401.DIGITAL_INPUTS, *cia401.DIGITAL_OUTPUTS)
_ANALOGUE: tuple[Kind, ...] = (*cia401.ANALOGUE_INPUTS, *cia401.ANALOGUE_OUTPUTS)

CLAUSES: ProfileClauses[TestedModule] = ProfileClauses()
"""The suite, in the order of this file: what switches nothing comes first."""

_clause = CLAUSES.clause


# Steps


def _every(bits: int, byte: int = 0xFF) -> int:
    """Return a block that repeats the same byte."""
    return int.from_bytes(bytes([byte]) * (bits // 8), "little")


def _name(module: TestedModule, address: Address) -> str:
    variable = module.subject.find(address)
    return title(variable) if variable else label(address)


def _set(address: Address, value: int) -> Data:
    return write(f"{label(address)} = {value:#x}" if value > 9 else f"{label(address)} = {value}", address, value=value)


def _kept(module: TestedModule, address: Address, *steps: Data, name: str = "") -> Data:
    """Do something with an object and give it back its value."""
    variable = module.subject.find(address)
    assert variable is not None
    return group(name or title(variable), save(variable), *steps, put_back(variable))


def _written_and_read(module: TestedModule, address: Address, values: Sequence[int]) -> Data:
    pairs = ((_set(address, each), read(f"it is {each:#x}", address, expect=each)) for each in values)
    return _kept(module, address, *(step for pair in pairs for step in pair))


def _without(name: str, *indices: int) -> Data:
    return skip(name, f"the file has no {', '.join(map(hexadecimal, indices))} that can be written")


# Objects

FUNCTIONS: Mapping[int, tuple[str, Sequence[Kind], int]] = {
    16: (cia401.FUNCTION_BITS[16], cia401.DIGITAL_INPUTS, 0x6000),
    17: (cia401.FUNCTION_BITS[17], cia401.DIGITAL_OUTPUTS, 0x6200),
    18: (cia401.FUNCTION_BITS[18], cia401.ANALOGUE_INPUTS, 0x6401),
    19: (cia401.FUNCTION_BITS[19], cia401.ANALOGUE_OUTPUTS, 0x6411),
}
"""What a bit of 0x1000 says that there is, and the object where it usually is."""


@_clause("0x1000", "Device type", Needs.READING)
def _device_type(module: TestedModule) -> Iterator[Data]:
    kind = module.subject.number(DEVICE_TYPE)
    yield read("an I/O module", DEVICE_TYPE, expect=kind)
    for bit, (words, kinds, usual) in FUNCTIONS.items():
        found = [address for _, address in module.blocks(kinds)]
        if kind >> bit & 1:  # what is usual is asked for where the file has none: it is not there, and the step is red
            yield read(words, found[0] if found else (usual, 1), data="any")
        else:
            yield skip(words, f"0x1000 says that it has no {words}")


@_clause("0x6000", "Inputs", Needs.READING)
def _inputs(module: TestedModule) -> Iterator[Data]:
    for _, address in module.blocks(_INPUTS):
        yield read(_name(module, address), address, data="any")


# Settings that switch nothing


@_clause("0x6002", "Polarity of inputs", Needs.REVERSIBLE)
def _input_polarity(module: TestedModule) -> Iterator[Data]:
    """Invert one bit after the other; the inputs have to be at rest."""
    for kind, address in module.blocks(cia401.DIGITAL_INPUTS):
        assert isinstance(kind, DigitalInputs)
        polarity, variable = (kind.polarity, address[1]), module.subject.find(address)
        if variable is None or not module.subject.may_be(polarity, _every(kind.bits)):
            yield _without(_name(module, address), kind.polarity)
            continue
        steps = [save(variable, "input")]
        for bit in range(kind.bits):
            steps.append(_set(polarity, 1 << bit))
            # It differs, and by the value of this bit: so it is this one, and no other.
            steps.append(read(f"bit {bit} is inverted", address, expect="not {input}"))
            steps.append(read(f"no other than bit {bit}", address, expect=f"{{input}} +- {1 << bit}"))
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
    @_clause(hexadecimal(indices[0]), topic, Needs.REVERSIBLE)
    def _steps(module: TestedModule) -> Iterator[Data]:
        found = [each for each in module.settings(*indices) if all(module.subject.may_be(each, v) for v in values)]
        yield from (_written_and_read(module, each, values) for each in found)
        if not found:
            yield _without("written and read back", indices[0])


for _topic, _row in SETTINGS.items():
    _settings_clause(_topic, *_row)


# Outputs


@_clause("0x6200", "Outputs", Needs.OUTPUTS)
def _outputs(module: TestedModule) -> Iterator[Data]:
    for kind, address in module.blocks(_OUTPUTS):
        # Each bit both ways, next to bits that differ from it and to bits that do not; off at the end.
        values = [0x55, 0xAA, 0xFF, 0x00] if isinstance(kind, DigitalOutputs) else [1, 100, 0]
        wide = [_every(kind.bits, each) for each in values] if isinstance(kind, DigitalOutputs) else values
        usable = [each for each in wide if module.subject.may_be(address, each)]
        yield _written_and_read(module, address, usable) if usable else _without(_name(module, address), address[0])


OnWire: TypeAlias = "Callable[[TestedModule, Wired], Data]"


def _on_wires(number: str, topic: str, digital: bool) -> Callable[[OnWire], OnWire]:
    """Enter a function as a clause that is looked at on each wire."""

    def enter(steps: OnWire) -> OnWire:
        @_clause(number, topic, Needs.OUTPUTS)
        def _each(module: TestedModule) -> Iterator[Data]:
            wires = module.wired(digital)
            yield from (steps(module, each) for each in wires)
            if not wires:
                what = "digital" if digital else "analogue"
                yield skip("at the terminals", f"no {what} output is wired to an input (--wired)")

        return steps

    return enter


def _title(wire: Wired) -> str:
    return f"{label(wire.here)} at {label(wire.there)}"


def _seen(wire: Wired, name: str, value: int) -> Iterator[Data]:
    """Look at the input of a wire when it has settled; of an analogue one to a twentieth, and ten."""
    near = f"{value} +- {abs(value) // 20 + 10}"
    yield wait(SETTLED)
    yield read(name, wire.there, expect=near if isinstance(wire.input, AnalogueInputs) else value)


def _switched(module: TestedModule, wire: Wired, name: str, *steps: Data, settings: Sequence[Address]) -> Data:
    """Do something with an output and with settings of it, then give them the values of power-on."""
    lacks = [index for index, sub in settings if not module.subject.settable((index, sub))]
    if lacks:
        return _without(name, *lacks)
    # Last the output itself, by the settings that it had before.
    off = [_set(each, module.subject.number(each)) for each in (*settings, wire.here)]
    return group(name, *steps, *off)


def _bits(wire: Wired) -> int:
    assert isinstance(wire.output, DigitalOutputs)
    return wire.output.bits


@_on_wires("0x6200", "Outputs at the terminals", digital=True)
def _terminals(module: TestedModule, wire: Wired) -> Data:
    steps: list[Data] = []
    # One at a time: two wires that are crossed would look right with all outputs on.
    for bit in range(_bits(wire)):
        steps += [_set(wire.here, 1 << bit), *_seen(wire, f"bit {bit} alone", 1 << bit)]
    return _switched(module, wire, _title(wire), *steps, settings=[])


@_on_wires("0x6202", "Polarity of outputs", digital=True)
def _polarity(module: TestedModule, wire: Wired) -> Data:
    assert isinstance(wire.output, DigitalOutputs)
    polarity, bits = (wire.output.polarity, wire.here[1]), _bits(wire)
    steps = [_set(polarity, _every(bits, 0x0F)), _set(wire.here, _every(bits, 0x33))]
    at_last = [read("the object is what was written", wire.here, expect=_every(bits, 0x33))]
    inverted = _seen(wire, "the lower half is inverted", _every(bits, 0x3C))
    return _switched(module, wire, _title(wire), *steps, *inverted, *at_last, settings=[polarity])


@_on_wires("0x6208", "Filter of outputs", digital=True)
def _filter(module: TestedModule, wire: Wired) -> Data:
    assert isinstance(wire.output, DigitalOutputs)
    passes, bits = (wire.output.filter, wire.here[1]), _bits(wire)
    steps = [_set(wire.here, 0), _set(passes, _every(bits, 0x0F))]
    steps += [_set(wire.here, _every(bits)), *_seen(wire, "a 0 holds the output", _every(bits, 0x0F))]
    return _switched(module, wire, _title(wire), *steps, settings=[passes])


def _fails(module: TestedModule, wire: Wired, name: str, settings: Mapping[Address, int], on: int, after: int) -> Data:
    """Command an output, lose the heartbeat, look at the terminal, and see that a start has it commanded again."""
    watch, another = (CONSUMED_HEARTBEATS, 1), module.subject.another
    if not module.subject.may_be(watch, another << 16 | WATCHED):
        return _without(name, CONSUMED_HEARTBEATS)
    steps = (
        *(_set(each, value) for each, value in settings.items()),
        nmt("start"),
        _set(wire.here, on),
        *_seen(wire, "commanded", on),
        # A node is watched from its first heartbeat on (CiA 301, 7.5.2.19): this one sends that and no second one.
        write(f"watch node {another}", watch, value=another << 16 | WATCHED),
        {**sent("x", ERROR_CONTROL_BASE + another, bytes([NmtState.OPERATIONAL])), "name": "its one heartbeat"},
        wait(MISSED),
        *_seen(wire, "after the heartbeat is lost", after),
        write("watch nobody", watch, value=0),
        nmt("pre-operational"),
        nmt("start"),
        _set(wire.here, on),
        *_seen(wire, "commanded again", on),
    )
    return _switched(module, wire, name, *steps, settings=[*settings])


@_on_wires("0x6207", "Error value of outputs", digital=True)
def _error_value(module: TestedModule, wire: Wired) -> Data:
    assert isinstance(wire.output, DigitalOutputs)
    (_, sub), bits = wire.here, _bits(wire)
    value = _every(bits, 0x5A)
    settings = {(wire.output.error_mode, sub): _every(bits), (wire.output.error_value, sub): value}
    return _fails(module, wire, _title(wire), settings, _every(bits, 0x33), value)


@_on_wires("0x6206", "Error mode of outputs", digital=True)
def _error_mode(module: TestedModule, wire: Wired) -> Data:
    """Let half of the outputs keep what they have."""
    assert isinstance(wire.output, DigitalOutputs)
    (_, sub), bits = wire.here, _bits(wire)
    settings = {(wire.output.error_mode, sub): _every(bits, 0x0F), (wire.output.error_value, sub): _every(bits, 0x5A)}
    return _fails(module, wire, _title(wire), settings, _every(bits, 0x33), _every(bits, 0x3A))


# Analogue outputs


@_on_wires("0x6411", "Analogue outputs at the terminals", digital=False)
def _analogue(module: TestedModule, wire: Wired) -> Data:
    levels = (LEVEL, -LEVEL, LEVEL // 2)
    steps = [
        step
        for each in levels
        if module.subject.may_be(wire.here, each)
        for step in (write(f"{each}", wire.here, value=each), *_seen(wire, f"it is {each}", each))
    ]
    return _switched(module, wire, _title(wire), *steps, settings=[])


SCALED = (3, 500)
"""A factor and an offset; the value is multiplied first."""


def _scaling(module: TestedModule, wire: Wired, factor: Address, offset: Address) -> Data:
    by, more = SCALED
    name, value = _title(wire), LEVEL // 2
    steps = (
        _set(wire.here, value),
        write(f"factor {by}", factor, value=by),
        *_seen(wire, "multiplied", by * value),
        write(f"offset {more}", offset, value=more),
        *_seen(wire, "and the offset added", by * value + more),
    )
    return _switched(module, wire, name, *steps, settings=[factor, offset])


@_on_wires("0x6432", "Scaling of inputs at the terminals", digital=False)
def _input_scaling(module: TestedModule, wire: Wired) -> Data:
    assert isinstance(wire.input, AnalogueInputs)
    return _scaling(module, wire, (wire.input.scaling, wire.there[1]), (wire.input.offset, wire.there[1]))


@_on_wires("0x6447", "Scaling of outputs at the terminals", digital=False)
def _output_scaling(module: TestedModule, wire: Wired) -> Data:
    assert isinstance(wire.output, AnalogueOutputs)
    return _scaling(module, wire, (wire.output.scaling, wire.here[1]), (wire.output.offset, wire.here[1]))


@_on_wires("0x6444", "Error value of analogue outputs", digital=False)
def _analogue_error_value(module: TestedModule, wire: Wired) -> Data:
    assert isinstance(wire.output, AnalogueOutputs)
    mode, value = (wire.output.error_mode, wire.here[1]), (wire.output.error_value, wire.here[1])
    return _fails(module, wire, _title(wire), {mode: 1, value: LEVEL // 4}, LEVEL, LEVEL // 4)


@_on_wires("0x6443", "Error mode of analogue outputs", digital=False)
def _analogue_error_mode(module: TestedModule, wire: Wired) -> Data:
    assert isinstance(wire.output, AnalogueOutputs)
    mode, value = (wire.output.error_mode, wire.here[1]), (wire.output.error_value, wire.here[1])
    return _fails(module, wire, _title(wire), {mode: 0, value: LEVEL // 4}, LEVEL, LEVEL)


# Interrupts


class Edge(NamedTuple):
    """What an output is set to, and whether that causes a TPDO."""

    value: int
    causes: bool


def _interrupts(
    module: TestedModule, wire: Wired, settings: Mapping[Address, int], edges: Sequence[Edge], name: str = ""
) -> Data:
    """Change an output and see which changes of its input cause the TPDO."""
    pdo, why = module.tpdo(wire.there)
    if pdo is None:
        return skip(_title(wire), why)
    frame = {"raw": f"{pdo.cob_id:03X}#{'??' * pdo.length}"}
    steps = [_set(wire.here, 0), *(_set(each, value) for each, value in settings.items())]
    steps += [nmt("pre-operational"), nmt("start"), wait(QUIET)]  # the first TPDO goes whatever caused it
    for value, causes in edges:
        steps.append(_switch(module, wire, value))
        look, words, time = (expect, "causes a TPDO", SOON) if causes else (never, "causes none", QUIET)
        steps += [look(f"{value:#x} {words}", frame, time), wait(SETTLED)]
    return _switched(module, wire, f"{_title(wire)}{name}", *steps, settings=[*settings])


def _switch(module: TestedModule, wire: Wired, value: int) -> Data:
    """Write an output, and wait for no answer: the TPDO may come before it, as its identifier is lower."""
    variable = module.subject.find(wire.here)
    assert variable is not None
    data = carrying(ClientCommand.DOWNLOAD, wire.here, encode(variable, value))
    return {"name": f"{label(wire.here)} = {value}", **module.subject.request(data)}


def _masks(wire: Wired, change: int, rising: int, falling: int) -> dict[Address, int]:
    assert isinstance(wire.input, DigitalInputs)
    kind, sub = wire.input, wire.there[1]
    return {(kind.change, sub): change, (kind.rising, sub): rising, (kind.falling, sub): falling}


ENABLE: Address = (cia401.INTERRUPT_ENABLE, 0)


@_on_wires("0x6006", "Interrupt on any change", digital=True)
def _any_change(module: TestedModule, wire: Wired) -> Data:
    edges = [Edge(1, True), Edge(0, True), Edge(2, False), Edge(0, False)]
    return _interrupts(module, wire, _masks(wire, 0x01, 0, 0), edges)


@_on_wires("0x6007", "Interrupt on a rising edge", digital=True)
def _rising(module: TestedModule, wire: Wired) -> Data:
    return _interrupts(module, wire, _masks(wire, 0, 0x01, 0), [Edge(1, True), Edge(0, False), Edge(1, True)])


@_on_wires("0x6008", "Interrupt on a falling edge", digital=True)
def _falling(module: TestedModule, wire: Wired) -> Data:
    return _interrupts(module, wire, _masks(wire, 0, 0, 0x01), [Edge(1, False), Edge(0, True), Edge(1, False)])


@_on_wires("0x6005", "Global interrupt of inputs", digital=True)
def _no_interrupts(module: TestedModule, wire: Wired) -> Data:
    settings = {**_masks(wire, 0xFF, 0, 0), ENABLE: 0}
    return _interrupts(module, wire, settings, [Edge(1, False), Edge(0, False)])


def _levels(wire: Wired, by: int, **limits: int) -> dict[Address, int]:
    at = {"upper": cia401.ANALOGUE_UPPER, "lower": cia401.ANALOGUE_LOWER, "delta": cia401.ANALOGUE_DELTA}
    sub = wire.there[1]
    given = {(at[name], sub): value for name, value in limits.items()}
    return {(cia401.ANALOGUE_TRIGGER, sub): by, **given, (cia401.ANALOGUE_INTERRUPT_ENABLE, 0): 1}


@_on_wires("0x6426", "Delta of analogue interrupts", digital=False)
def _delta(module: TestedModule, wire: Wired) -> Data:
    edges = [Edge(LEVEL // 4, False), Edge(LEVEL, True), Edge(LEVEL * 5 // 4, False)]
    return _interrupts(module, wire, _levels(wire, 1 << 2, delta=LEVEL // 2), edges)


@_on_wires("0x6424", "Upper limit of analogue interrupts", digital=False)
def _upper(module: TestedModule, wire: Wired) -> Data:
    edges = [Edge(LEVEL // 4, False), Edge(LEVEL, True), Edge(LEVEL // 4, False)]
    return _interrupts(module, wire, _levels(wire, 1 << 0, upper=LEVEL // 2), edges)


@_on_wires("0x6425", "Lower limit of analogue interrupts", digital=False)
def _lower(module: TestedModule, wire: Wired) -> Data:
    edges = [Edge(LEVEL, False), Edge(LEVEL // 4, True), Edge(LEVEL, False)]
    return _interrupts(module, wire, _levels(wire, 1 << 1, lower=LEVEL // 2), edges)


@_on_wires("0x6423", "Global interrupt of analogue inputs", digital=False)
def _no_analogue_interrupts(module: TestedModule, wire: Wired) -> Data:
    settings = {**_levels(wire, 1 << 2, delta=0), (cia401.ANALOGUE_INTERRUPT_ENABLE, 0): 0}
    return _interrupts(module, wire, settings, [Edge(LEVEL, False), Edge(0, False)])


# The suite


def text(
    dictionary: Dictionary,
    reversible: bool = False,
    outputs: bool = False,
    wires: Mapping[Address, Address] | None = None,
) -> str:
    """Return the suite of a module; `reversible` writes settings, `outputs` switches, `wires` lead to inputs.

    Raises LocalError for a wire that leads from no output of the file, or to no input of the same sort.
    """
    subject = Subject(dictionary)
    module = TestedModule(subject, allowed_steps(reversible, Needs.OUTPUTS if outputs else None), wires or {})
    module.check_wires()
    suite: Data = {
        "spec": VERSION,
        "name": "CiA 401, I/O module",
        "node": dictionary.name,
        "tags": [TAG, "cia401"],
        "setup": [{**awake(subject), "name": "7.2.4.3.5 SDO: the device answers [reading]"}],
        "steps": [*CLAUSES.named(module)],
    }
    settable = [address for _, address in module.blocks(_OUTPUTS) if subject.settable(address)]
    off = [
        write(f"0x6200 Outputs: {label(each)} as after power-on [outputs]", each, value=subject.number(each))
        for each in settable
    ]
    stop = {**nmt("pre-operational"), "name": "7.2.8.2.1 NMT: to PRE-OPERATIONAL [outputs]"}
    return documents([{**suite, "teardown": [*off, stop]} if outputs else suite])
