"""An I/O module of CiA 401: outputs with polarity, filter and error values, inputs by waveforms, what causes a TPDO."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from eurobot_od.device.nmt import NmtCommand, NmtState, error_control
from eurobot_od.device.profiles import SimulatedModule, simulated_kind
from eurobot_od.device.simulated import Waveform, ramp, square, steps
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address
from eurobot_od.od.words import words
from tests.device.master import NodeWire
from tests.eds_text import pdo, record, variable

NODE_ID, WATCHED = 5, 9
COMMANDS, INPUTS, ANALOGUE = 0x205, 0x185, 0x285
FIRST_OUT, SECOND_OUT, FIRST_IN, LEVEL = (0x6200, 1), (0x6200, 2), (0x6000, 1), (0x6401, 1)

TEXT = (
    "[1000]\nParameterName=Device type\nDataType=0x0007\nAccessType=ro\nDefaultValue=0x000F0191\n"
    + record(0x1016, "Consumer heartbeat time", (0, "UNSIGNED8", "1"), (1, "UNSIGNED32", "0"))
    + variable("1029sub0", "Number", "UNSIGNED8", "1").replace(
        "[1029sub0]", "[1029]\nParameterName=Error behaviour\nObjectType=8\nSubNumber=2\n[1029sub0]"
    )
    + variable("1029sub1", "Communication error", "UNSIGNED8", "1")
    + record(0x6000, "Digital inputs", (0, "UNSIGNED8", "1"), (1, "UNSIGNED8", "0"))
    + record(0x6002, "Polarity of inputs", (0, "UNSIGNED8", "1"), (1, "UNSIGNED8", "0"))
    + variable("6005", "Interrupts of digital inputs", "UNSIGNED8", "1")
    + record(0x6006, "Any change", (0, "UNSIGNED8", "1"), (1, "UNSIGNED8", "0xFF"))
    + record(0x6007, "Rising edge", (0, "UNSIGNED8", "1"), (1, "UNSIGNED8", "0"))
    + record(0x6008, "Falling edge", (0, "UNSIGNED8", "1"), (1, "UNSIGNED8", "0"))
    + record(0x6200, "Digital outputs", (0, "UNSIGNED8", "2"), (1, "UNSIGNED8", "0"), (2, "UNSIGNED8", "0"))
    + record(0x6202, "Polarity of outputs", (0, "UNSIGNED8", "2"), (1, "UNSIGNED8", "0"), (2, "UNSIGNED8", "0"))
    + record(0x6206, "Error mode", (0, "UNSIGNED8", "2"), (1, "UNSIGNED8", "0xFF"), (2, "UNSIGNED8", "0xFF"))
    + record(0x6207, "Error value", (0, "UNSIGNED8", "2"), (1, "UNSIGNED8", "0"), (2, "UNSIGNED8", "0"))
    + record(0x6208, "Filter", (0, "UNSIGNED8", "2"), (1, "UNSIGNED8", "0xFF"), (2, "UNSIGNED8", "0xFF"))
    + record(0x6401, "Analogue inputs", (0, "UNSIGNED8", "1"), (1, "INTEGER16", "0"))
    + record(0x6411, "Analogue outputs", (0, "UNSIGNED8", "1"), (1, "INTEGER16", "0"))
    + record(0x6421, "Trigger", (0, "UNSIGNED8", "1"), (1, "UNSIGNED8", "4"))
    + variable("6423", "Interrupts of analogue inputs", "BOOLEAN", "0")
    + record(0x6424, "Upper limit", (0, "UNSIGNED8", "1"), (1, "INTEGER32", "0"))
    + record(0x6425, "Lower limit", (0, "UNSIGNED8", "1"), (1, "INTEGER32", "0"))
    + record(0x6426, "Delta", (0, "UNSIGNED8", "1"), (1, "UNSIGNED32", "100"))
    + record(0x6443, "Error mode of analogue outputs", (0, "UNSIGNED8", "1"), (1, "UNSIGNED8", "1"))
    + record(0x6444, "Error value of analogue outputs", (0, "UNSIGNED8", "1"), (1, "INTEGER32", "-7"))
    + pdo(0x1400, "0x62000108", "0x62000208", "0x64110110", settings={2: "255"})
    + pdo(0x1800, "0x60000108", settings={2: "255", 3: "0", 5: "0"})
    + pdo(0x1801, "0x64010110", settings={2: "255", 3: "0", 5: "0"})
)

DICTIONARY = Dictionary.read(TEXT.encode(), Path("module.eds"), NODE_ID)


def module(waveforms: Mapping[Any, Waveform] | None = None, start: bool = True) -> tuple[NodeWire, SimulatedModule]:
    made = SimulatedModule(DICTIONARY, waveforms=waveforms)
    wire = NodeWire(made)
    if start:
        wire.command(NmtCommand.START)
    return wire, made


def sent(wire: NodeWire, cob_id: int) -> list[str]:
    return [each.data.hex() for each in wire.sent() if each.cob_id == cob_id]


def test_the_device_type_says_that_it_is_a_module() -> None:
    assert simulated_kind(DICTIONARY) is SimulatedModule


# Outputs


OUTPUTS = [
    # polarity, filter: the terminals after 0x0F was written and then 0xF0
    (0x00, 0xFF, 0x0F, 0xF0),
    (0xFF, 0xFF, 0xF0, 0x0F),
    (0x81, 0xFF, 0x8E, 0x71),
    (0x00, 0x3C, 0x0C, 0x30),  # what the filter holds back stays as it was
    (0xFF, 0x0F, 0xF0, 0xFF),
]


@pytest.mark.parametrize(("polarity", "passes", "first", "second"), OUTPUTS)
def test_terminals_are_what_is_written_by_polarity_and_filter(
    polarity: int, passes: int, first: int, second: int
) -> None:
    wire, made = module()
    wire.write(0x6202, 1, polarity, size=1)
    wire.write(0x6208, 1, passes, size=1)
    wire.write(*FIRST_OUT, 0x0F, size=1)
    assert made.outputs[FIRST_OUT] == first
    wire.write(*FIRST_OUT, 0xF0, size=1)
    assert made.outputs[FIRST_OUT] == second
    assert wire.read(*FIRST_OUT) == 0xF0  # the object is what was written


def test_an_rpdo_sets_outputs() -> None:
    wire, made = module()
    wire.send(Frame(COMMANDS, bytes.fromhex("AA55E803")))
    assert made.outputs == {FIRST_OUT: 0xAA, SECOND_OUT: 0x55, (0x6411, 1): 1000}


LOSSES = {
    "a heartbeat is lost": lambda wire: wire.run(1),
    "the module is stopped": lambda wire: wire.command(NmtCommand.STOP),
    "the bus is lost": lambda wire: wire.node.bus_lost(wire.now),
}


@pytest.mark.parametrize("loss", LOSSES.values(), ids=LOSSES)
def test_on_an_error_outputs_take_their_error_values(loss: Any) -> None:
    wire, made = module()
    wire.write(0x1016, 1, WATCHED << 16 | 200)
    wire.send(error_control(WATCHED, NmtState.OPERATIONAL))
    wire.write(0x6206, 1, 0xF0, size=1)  # these take their error value, the others keep what they have
    wire.write(0x6207, 1, 0x50, size=1)
    wire.write(0x6206, 2, 0x00, size=1)
    wire.send(Frame(COMMANDS, bytes.fromhex("FFFFE803")))
    loss(wire)
    assert made.outputs == {FIRST_OUT: 0x5F, SECOND_OUT: 0xFF, (0x6411, 1): -7}


def test_outputs_are_commanded_again_after_a_start() -> None:
    wire, made = module()
    wire.write(*FIRST_OUT, 0x0F, size=1)
    wire.command(NmtCommand.STOP)
    assert made.outputs[FIRST_OUT] == 0
    wire.command(NmtCommand.START)
    assert made.outputs[FIRST_OUT] == 0x0F


# Inputs


def test_inputs_are_the_terminals_by_their_polarity() -> None:
    wire, _ = module({FIRST_IN: lambda _: 0b0011})
    assert wire.read(*FIRST_IN) == 0b0011
    wire.write(0x6002, 1, 0b0110, size=1)
    assert wire.read(*FIRST_IN) == 0b0101


def test_a_change_of_an_input_is_sent() -> None:
    wire, _ = module({FIRST_IN: square(0, 1, 0.2)})
    wire.run(0.55)
    assert sent(wire, INPUTS) == ["00", "01", "00", "01", "00", "01"]


MASKS = [
    # global, any change, rising, falling: what a square wave of bit 1 sends after the first frame, while bit 0 is on
    (1, 0xFF, 0, 0, ["03", "01", "03", "01", "03"]),
    (0, 0xFF, 0xFF, 0xFF, []),
    (1, 0xFD, 0, 0, []),
    (1, 0, 2, 0, ["03", "03", "03"]),
    (1, 0, 0, 2, ["01", "01"]),
]


@pytest.mark.parametrize(("enabled", "change", "rising", "falling", "frames"), MASKS)
def test_the_masks_say_which_edge_is_sent(
    enabled: int, change: int, rising: int, falling: int, frames: list[str]
) -> None:
    wire, _ = module({FIRST_IN: square(1, 3, 0.2)}, start=False)
    for index, value in ((0x6006, change), (0x6007, rising), (0x6008, falling)):
        wire.write(index, 1, value, size=1)
    wire.write(0x6005, 0, enabled, size=1)
    wire.command(NmtCommand.START)
    assert sent(wire, INPUTS) == ["01"]  # the first is sent whatever the masks say
    wire.run(0.55)
    assert sent(wire, INPUTS) == frames


def test_analogue_inputs_cause_no_tpdo_before_they_are_enabled() -> None:
    wire, _ = module({LEVEL: ramp(0, 1000, 1)})
    wire.sent()
    wire.run(0.9)
    assert sent(wire, ANALOGUE) == []
    assert wire.read(*LEVEL) > 800


LEVELS = [
    # trigger, upper, lower, delta: which of 0, 50, 120, 190, 19 are sent
    (0b100, 0, 0, 100, [120, 19]),
    (0b100, 0, 0, 0, [50, 120, 190, 19]),
    (0b001, 100, 0, 0, [120, 190]),
    (0b010, 0, 60, 0, [50, 19]),
    (0b000, 0, 0, 0, []),
]


@pytest.mark.parametrize(("by", "upper", "lower", "delta", "values"), LEVELS)
def test_limits_and_delta_say_what_is_sent(by: int, upper: int, lower: int, delta: int, values: list[int]) -> None:
    wire, _ = module({LEVEL: steps([0, 50, 120, 190, 19], 0.1)}, start=False)
    wire.write(0x6421, 1, by, size=1)
    for index, value in ((0x6424, upper), (0x6425, lower), (0x6426, delta)):
        wire.write(index, 1, value)
    wire.write(0x6423, 0, 1, size=1)
    wire.command(NmtCommand.START)
    wire.sent()
    wire.run(0.45)
    assert [int.from_bytes(bytes.fromhex(each), "little") for each in sent(wire, ANALOGUE)] == values


IO = Dictionary.load(Path(__file__).parents[3] / "docs" / "io.eds", NODE_ID)
"""A module with scaling and filters."""

SCALES = [
    # factor, offset: the object and the terminal of 100
    (1, 0, 100),
    (3, 0, 300),
    (1, -7, 93),
    (-2, 50, -150),
    (1000, 0, 32767),  # what is too large ends where the object's type does
]


@pytest.mark.parametrize(("factor", "offset", "value"), SCALES)
def test_an_analogue_input_is_multiplied_and_then_the_offset_added(factor: int, offset: int, value: int) -> None:
    wire = NodeWire(SimulatedModule(IO, waveforms={LEVEL: lambda _: 100}))
    wire.write(0x6432, 1, factor & 0xFFFFFFFF)
    wire.write(0x6431, 1, offset & 0xFFFFFFFF)
    assert int.from_bytes(wire.read(*LEVEL).to_bytes(2, "little"), "little", signed=True) == value


def test_an_analogue_input_of_32_bits_is_multiplied_too() -> None:
    fields = ((0x6402, "INTEGER32", 0), (0x6431, "INTEGER32", 7), (0x6432, "INTEGER32", 3))
    objects = (record(index, "Channel", (0, "UNSIGNED8", "1"), (1, kind, str(n))) for index, kind, n in fields)
    text = variable("1000", "Device type", "UNSIGNED32", "0x40191") + "".join(objects)
    wire = NodeWire(SimulatedModule(Dictionary.read(text.encode(), Path("wide.eds"), NODE_ID), waveforms={
        (0x6402, 1): lambda _: 70_000
    }))  # fmt: skip
    assert wire.read(0x6402, 1) == 210_007


@pytest.mark.parametrize(("factor", "offset", "value"), SCALES[:-1])
def test_an_analogue_output_is_scaled(factor: int, offset: int, value: int) -> None:
    made = SimulatedModule(IO)
    wire = NodeWire(made)
    wire.write(0x6447, 1, factor & 0xFFFFFFFF)
    wire.write(0x6446, 1, offset & 0xFFFFFFFF)
    wire.write(0x6411, 1, 100, size=2)
    assert made.outputs[0x6411, 1] == value


def spike(begin: float, end: float) -> Waveform:
    return lambda time: 0b11 if begin <= time < end else 0


@pytest.mark.parametrize(
    ("filtered", "length", "seen"),
    [
        (0b00, 0.011, ["00", "03", "00"]),
        (0b01, 0.011, ["00", "02", "00"]),  # the first bit is filtered, and so short a pulse is not seen
        (0b10, 0.101, ["00", "01", "03", "02", "00"]),  # a longer one comes later, and goes later
    ],
)
def test_a_filtered_input_shows_what_stays(filtered: int, length: float, seen: list[str]) -> None:
    wire = NodeWire(SimulatedModule(IO, waveforms={FIRST_IN: spike(0.105, 0.105 + length)}))
    wire.write(0x6003, 1, filtered, size=1)
    wire.command(NmtCommand.START)
    wire.run(0.5)
    assert [each[:2] for each in sent(wire, INPUTS)] == seen


def test_an_input_without_a_waveform_has_polarity_too() -> None:
    wire, made = module()
    made.set_value(FIRST_IN, 0b0011)
    wire.write(0x6002, 1, 0b0110, size=1)
    assert wire.read(*FIRST_IN) == 0b0101


# Words

WORDS: dict[Address, tuple[int, str]] = {
    FIRST_IN: (0b101, "1 3 on"),
    FIRST_OUT: (0, "none on"),
    (0x6443, 1): (1, "takes its error value"),
    (0x6421, 1): (0b101, "upper limit exceeded, changed by more than delta"),
    (0x6000, 0): (1, ""),
}


@pytest.mark.parametrize(("address", "value", "text"), [(a, *said) for a, said in WORDS.items()])
def test_values_of_a_module_have_words(address: Address, value: int, text: str) -> None:
    variable = DICTIONARY.variable(address)
    assert variable is not None
    assert words(variable, value) == text
