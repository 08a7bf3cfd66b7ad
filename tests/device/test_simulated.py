"""A device from anybody's file: where its values come from, when its PDOs go, and what its own program does."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any, ClassVar

import pytest

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.simulated import (
    SimulatedDevice,
    Waveform,
    constant,
    fitted,
    ramp,
    read_waveforms,
    sine,
    square,
    steps,
    walk,
)
from eurobot_od.errors import Cause, DictionaryError, FieldError, LocalError, Refused, YamlError
from eurobot_od.frame import Frame
from eurobot_od.od.values import REAL32, UNSIGNED8, Address
from eurobot_od.sdo.wire import AbortCode
from tests.device.io_module import BIG, CYCLIC, NODE_ID, ON_CHANGE, ON_REQUEST, TEXT, module
from tests.device.master import NodeWire
from tests.eds_text import DEVICE_TYPE, pdo, variable

SYNC, COMMAND = Frame(0x080), 0x200 + NODE_ID
CHANGED, CYCLICAL, REQUESTED = 0x180 + NODE_ID, 0x280 + NODE_ID, 0x380 + NODE_ID
LABEL = b"valve A\0"


def operational(kind: type[SimulatedDevice] = SimulatedDevice, text: str = TEXT, **options: Any) -> NodeWire:
    wire = module(kind, text, **options)
    wire.command(NmtCommand.START)
    return wire


def sent(wire: NodeWire, cob_id: int) -> list[str]:
    """Return the data of the frames so far with a COB-ID, and forget all."""
    return [frame.data.hex() for frame in wire.sent() if frame.cob_id == cob_id]


# TPDOs on change


def test_an_event_driven_tpdo_goes_when_it_may_and_then_with_each_change() -> None:
    wire = module()
    wire.write(0x2100, 0, 1, size=2)
    assert sent(wire, CHANGED) == []
    wire.command(NmtCommand.START)
    assert sent(wire, CHANGED) == ["fbff0100"]
    wire.write(0x2100, 0, 2, size=2)
    wire.write(0x2100, 0, 2, size=2)
    wire.write(0x2000, 3, 0, size=1)
    assert sent(wire, CHANGED) == ["fbff0200"]


def test_an_rpdo_counts_as_a_change() -> None:
    wire = operational()
    wire.send(Frame(COMMAND, b"\xfe\xff"))
    assert sent(wire, CHANGED) == ["fbff0000", "fbfffeff"]
    assert wire.read(0x2100) == 0xFFFE


def test_of_what_the_inhibit_time_holds_back_the_newest_goes() -> None:
    wire = module()
    wire.write(ON_CHANGE, 1, 1 << 31 | CHANGED)
    wire.write(ON_CHANGE, 3, 1000, size=2)  # 100 ms
    wire.write(ON_CHANGE, 1, CHANGED)
    wire.command(NmtCommand.START)
    for value in (1, 2, 3):
        wire.run(0.02)
        wire.write(0x2100, 0, value, size=2)
    wire.run(0.039)
    assert sent(wire, CHANGED) == ["fbff0000"]
    wire.run(0.002)
    assert sent(wire, CHANGED) == ["fbff0300"]


def test_the_event_timer_begins_anew_with_each_change() -> None:
    wire = operational()
    wire.write(ON_CHANGE, 5, 100, size=2)
    wire.run(0.09)
    wire.write(0x2100, 0, 1, size=2)
    wire.run(0.09)
    assert sent(wire, CHANGED) == ["fbff0000", "fbff0100"]
    wire.run(0.02)
    assert sent(wire, CHANGED) == ["fbff0100"]


def test_a_change_of_another_pdo_repeats_nothing() -> None:
    wire = operational()
    wire.sent()
    wire.write(CYCLIC, 2, 2, size=2)
    assert sent(wire, CHANGED) == []


# TPDOs by SYNC and by remote frame

SYNC_TYPES = [
    (0, ["0000c03f01", "0000003f01"], "only after a change"),
    (1, ["0000c03f01", "0000003f01", "0000003f01"], "each"),
    (2, ["0000003f01"], "every second"),
]


@pytest.mark.parametrize(("transmission_type", "expected", "why"), SYNC_TYPES)
def test_a_synchronous_tpdo(transmission_type: int, expected: list[str], why: str) -> None:
    wire = module()
    wire.write(CYCLIC, 2, transmission_type, size=2)
    wire.command(NmtCommand.START)
    wire.send(SYNC)
    wire.sdo.sdo.download(0x2000, 2, b"\x00\x00\x00\x3f")
    wire.send(SYNC)
    wire.send(SYNC)
    assert sent(wire, CYCLICAL) == expected, why


def request(wire: NodeWire, cob_id: int) -> list[Frame]:
    return wire.node.requested(cob_id, wire.now)


def test_a_remote_frame_gets_the_tpdo_that_goes_no_other_way() -> None:
    wire = operational()
    wire.run(1.0)
    assert sent(wire, REQUESTED) == []
    assert request(wire, REQUESTED) == [Frame(REQUESTED, LABEL)]


def test_a_sampled_tpdo_has_the_values_of_the_last_sync() -> None:
    wire = module()
    wire.write(ON_REQUEST, 2, 252, size=2)
    wire.command(NmtCommand.START)
    wire.send(SYNC)
    wire.sdo.sdo.download(0x2000, 4, b"valve B")
    assert request(wire, REQUESTED) == [Frame(REQUESTED, LABEL)]
    wire.send(SYNC)
    assert request(wire, REQUESTED) == [Frame(REQUESTED, b"valve B\0")]


def not_allowed(wire: NodeWire) -> None:
    wire.write(ON_REQUEST, 1, 1 << 31 | REQUESTED)
    wire.write(ON_REQUEST, 1, 1 << 30 | REQUESTED)


UNANSWERED: list[tuple[Callable[[NodeWire], object], int, str]] = [
    (lambda wire: wire.command(NmtCommand.STOP), REQUESTED, "STOPPED"),
    (not_allowed, REQUESTED, "no remote frames, says its COB-ID"),
    (lambda _: None, COMMAND, "an RPDO"),
    (lambda _: None, 0x123, "nobody's"),
]


@pytest.mark.parametrize(("change", "cob_id", "why"), UNANSWERED)
def test_a_remote_frame_without_an_answer(change: Callable[[NodeWire], object], cob_id: int, why: str) -> None:
    wire = operational()
    change(wire)
    assert request(wire, cob_id) == [], why


def test_without_remote_frames_there_is_no_type_for_them() -> None:
    wire = module()
    not_allowed(wire)
    assert wire.refused((ON_REQUEST, 2), 252, size=2) == AbortCode.VALUE


# RPDOs


def test_an_rpdo_that_does_not_come_in_time_is_reported_until_it_comes() -> None:
    wire = operational()
    emergencies = 0x080 + NODE_ID
    wire.run(1.0)
    assert sent(wire, emergencies) == [], "not missed before its first frame"
    wire.send(Frame(COMMAND, bytes(2)))
    wire.run(0.19)
    wire.send(Frame(COMMAND, bytes(2)))
    wire.run(0.21)
    assert sent(wire, emergencies) == ["5082110502000000"]
    wire.send(Frame(COMMAND, bytes(2)))
    assert sent(wire, emergencies) == ["0000000000000000"]


def test_a_deadline_ends_with_operational() -> None:
    wire = operational()
    wire.send(Frame(COMMAND, bytes(2)))
    wire.command(NmtCommand.ENTER_PRE_OPERATIONAL)
    wire.run(1.0)
    assert sent(wire, 0x080 + NODE_ID) == []


# Values


def test_values_of_all_types_go_over_sdo() -> None:
    sdo = module().sdo.sdo
    assert [sdo.upload(0x2000, sub) for sub in range(1, 5)] == [b"\xfb\xff", b"\x00\x00\xc0\x3f", b"\x01", b"valve A"]
    assert sdo.upload(0x2200, 0) == BIG


def test_a_time_of_day_is_read_and_written() -> None:
    sdo = module().sdo.sdo
    assert sdo.upload(0x2201, 0) == b"\7\0\0\0\0\0"  # 7 ms after midnight of the first day
    noon = (43_200_250).to_bytes(4, "little") + (15_666).to_bytes(2, "little")
    sdo.download(0x2201, 0, noon)
    assert sdo.upload(0x2201, 0) == noon


@pytest.mark.parametrize(
    ("type_", "default", "served"),
    [
        ("TIME_OF_DAY", "2014-05-28 12:00:00.250", "fa2e9302612b"),
        ("TIME_DIFFERENCE", "1d 02:03:04.567", "f7ad70000100"),
        ("TIME_DIFFERENCE", "0x100000005", "050000000100"),
    ],
)
def test_a_time_that_a_file_writes_as_text_is_served(type_: str, default: str, served: str) -> None:
    wire = module(text=DEVICE_TYPE + variable("2000", "When", type_, default))
    assert wire.sdo.sdo.upload(0x2000, 0).hex() == served


def test_values_of_all_types_come_by_pdo() -> None:
    types = {"INTEGER8": "80", "BOOLEAN": "01", "UNSIGNED16": "3412", "OCTET_STRING": "abcd"}
    bits = (8, 8, 16, 16)
    text = DEVICE_TYPE + "".join(variable(f"{0x2000 + n:X}", f"V{n}", type_) for n, type_ in enumerate(types))
    text += pdo(0x1400, *(hex((0x2000 + n) << 16 | bits[n]) for n in range(4)), settings={2: "255"})
    wire = operational(text=text)
    wire.send(Frame(COMMAND, bytes.fromhex("".join(types.values()))))
    assert [wire.sdo.sdo.upload(0x2000 + n, 0).hex() for n in range(4)] == list(types.values())


def test_objects_come_beside_each_other_in_as_many_bits_as_they_are_mapped_with() -> None:
    mapped = [("BOOLEAN", 1, "01"), ("UNSIGNED8", 3, "05"), ("INTEGER8", 4, "fd"), ("REAL32", 32, "0000c03f")]
    objects = [variable(f"{0x2000 + n:X}", f"V{n}", type_) for n, (type_, _, _) in enumerate(mapped)]
    entries = [hex((0x2000 + n) << 16 | bits) for n, (_, bits, _) in enumerate(mapped)]
    wire = operational(text=DEVICE_TYPE + "".join(objects) + pdo(0x1400, *entries, settings={2: "255"}))
    wire.send(Frame(COMMAND, bytes([0b1101_101_1]) + b"\x00\x00\xc0\x3f"))
    assert [wire.sdo.sdo.upload(0x2000 + n, 0).hex() for n in range(4)] == [held for _, _, held in mapped]


def test_given_values_count_in_place_of_the_files_also_after_a_reset() -> None:
    wire = module(given={"Set point": -7, (0x1017, 0): 100})
    wire.run(0.15)
    assert sent(wire, 0x700 + NODE_ID) == ["00", "7f"]
    for command in (NmtCommand.RESET_COMMUNICATION, NmtCommand.RESET_NODE):
        wire.write(0x2100, 0, 1, size=2)
        wire.write(0x1017, 0, 0, size=2)
        wire.command(command)
        assert wire.read(0x1017) == 100
    assert wire.read(0x2100) == 0xFFF9


def test_waveforms_are_sampled_sent_on_change_and_begin_anew_with_a_reset() -> None:
    wire = operational(waveforms={"Channel.Entry 1": square(-1, 1, 0.2)})
    wire.run(0.25)
    assert sent(wire, CHANGED) == ["ffff0000", "01000000", "ffff0000"]
    wire.run(0.1)
    assert wire.read(0x2000, 1) == 1
    wire.command(NmtCommand.RESET_NODE)
    assert wire.read(0x2000, 1) == 0xFFFF


def test_a_waveform_ends_where_its_type_ends() -> None:
    wire = module(waveforms={"Channel.Entry 1": ramp(0, 1e6, 1.0)})
    wire.run(0.5)
    assert wire.read(0x2000, 1) == 0x7FFF


class Oven(SimulatedDevice):
    """Heats to its set point at once, and takes none above 300."""

    heat = 20.0
    READERS: ClassVar = {"Channel.Entry 1": lambda oven: oven.heat, "Channel.Entry 2": lambda oven: oven.now}
    WRITERS: ClassVar = {"Set point": lambda oven, value: oven.set_heat(value)}

    def set_heat(self, value: int) -> None:
        if value > 300:
            raise Refused(Cause.VALUES, "too hot")
        self.heat = value


def test_a_class_gives_and_takes_values_by_sdo_and_pdo() -> None:
    wire = operational(Oven)
    wire.write(0x2100, 0, 250, size=2)
    assert wire.read(0x2000, 1) == 250
    wire.send(Frame(COMMAND, b"\x64\x00"))
    assert wire.read(0x2000, 1) == 100
    assert sent(wire, CHANGED) == ["14000000", "fa00fa00", "64006400"]


def test_a_reader_of_another_type_is_told_to_whoever_runs_the_device() -> None:
    class Fast(SimulatedDevice):
        """Reads a text where a number is."""

        READERS: ClassVar = {"Channel.Entry 1": lambda _: "fast"}

    device = module(Fast).node
    assert isinstance(device, Fast)
    with pytest.raises(LocalError, match=r"^READERS: 0x2000:1: Channel\.Entry 1 = 'fast' is not allowed; allowed: "):
        device.value("Channel.Entry 1")


def test_a_class_may_have_no_value_now() -> None:
    class Blind(SimulatedDevice):
        """Sees nothing at the moment."""

        READERS: ClassVar = {"Channel.Entry 1": lambda _: None}

    device = module(Blind).node
    assert isinstance(device, Blind)
    assert device.value("Channel.Entry 1") is None


def test_a_value_refused_by_a_class_aborts_and_changes_nothing() -> None:
    wire = operational(Oven)
    assert wire.refused((0x2100, 0), 301, size=2) == AbortCode.INCOMPATIBLE
    wire.send(Frame(COMMAND, b"\xff\x7f"))
    assert wire.read(0x2100) == 0
    assert wire.read(0x2000, 1) == 20


def test_a_program_sets_and_reads_values() -> None:
    wire = operational()
    device = wire.node
    assert isinstance(device, SimulatedDevice)
    device.set_value("Set point", 3)
    wire.run(0.0)
    assert sent(wire, CHANGED) == ["fbff0000", "fbff0300"]
    assert (device.value("Set point"), device.value((0x2000, 4))) == (3, "valve A")


UNKNOWN: list[tuple[str | Address, str]] = [
    ("Colour", "no object is named 'Colour'"),
    ((0x2000, 9), "0x2000: sub 9 is missing"),
]


@pytest.mark.parametrize(("name", "complaint"), UNKNOWN)
def test_an_object_that_the_file_does_not_have_is_refused(name: str | Address, complaint: str) -> None:
    with pytest.raises(DictionaryError, match=complaint):
        module(given={name: 1})


@pytest.mark.parametrize("value", ["fast", 1.5, 1 << 32])
def test_a_value_of_another_type_is_refused(value: Any) -> None:
    device = operational().node
    assert isinstance(device, SimulatedDevice)
    for refused in (lambda: device.set_value("Set point", value), lambda: module(given={"Set point": value})):
        with pytest.raises(FieldError, match="Set point = "):
            refused()


def test_a_file_is_not_a_dictionary() -> None:
    with pytest.raises(LocalError, match=r"^'oven\.eds' is not a Dictionary; `SimulatedDevice\.load\(file, node_id\)`"):
        SimulatedDevice("oven.eds")  # type: ignore[arg-type]


SHAPES = [
    (constant(7), [7, 7, 7, 7, 7]),
    (ramp(0, 8, 2.0), [0, 2, 4, 6, 0]),
    (square(-1, 1, 2.0), [-1, -1, 1, 1, -1]),
    (steps([5, 6, 7], 0.5), [5, 6, 7, 5, 6]),
    (sine(0, 10, 2.0), [5, 10, 5, 0, 5]),
]


@pytest.mark.parametrize(("waveform", "values"), SHAPES)
def test_the_values_of_a_waveform_every_half_second(waveform: Waveform, values: list[float]) -> None:
    assert [waveform(n / 2) for n in range(5)] == pytest.approx(values)


def test_a_walk_is_the_same_for_the_same_seed_also_begun_anew() -> None:
    times = [n / 10 for n in range(100)]
    one, other = walk(0, 1, 0.1, seed=3), walk(0, 1, 0.1, seed=3)
    first = list(map(one, times))
    assert first == list(map(other, times)) == list(map(one, times))
    assert first != list(map(walk(0, 1, 0.1, seed=4), times))


def test_a_walk_stays_inside_and_goes_in_small_steps() -> None:
    places = list(map(walk(5, 1, 1.0, low=4, high=6), range(1000)))
    assert (min(places), max(places)) == (4, 6)
    assert max(abs(after - before) for before, after in pairwise(places)) <= 1


FITTED = [(1.4, UNSIGNED8, 1), (-3.0, UNSIGNED8, 0), (1e9, UNSIGNED8, 255), (float("nan"), UNSIGNED8, 0)]


@pytest.mark.parametrize(("value", "type_", "expected"), [*FITTED, (1.4, REAL32, 1.4)])
def test_an_integer_is_rounded_and_ends_where_its_type_ends(value: float, type_: object, expected: float) -> None:
    assert fitted(value, type_) == expected  # type: ignore[arg-type]


def test_a_file_of_waveforms() -> None:
    text = """\
Temperature: 21.5
Motor.Speed: {sine: {low: 0, high: 3000, period: 2 s}}
0x6000:1: {square: {low: 0, high: 1, period: 500 ms}}
State: {steps: {values: [0, 0x10, -7], every: 1 s}}
Noise: {walk: {start: 20, step: 0.5, every: 100 ms, seed: 7, low: 10, high: 30}}
"""
    found = read_waveforms(text, "values.yaml")
    assert list(found) == ["Temperature", "Motor.Speed", "0x6000:1", "State", "Noise"]
    assert [each(1.5) for each in found.values()][:4] == pytest.approx([21.5, 0, 0, 16])


WRONG = [
    ("", "1:1: the file is empty"),
    ("[1]", "1:1: expected a mapping, `key: value`, found a list"),
    ("A: x", "1:4: expected a number, found 'x'"),
    ("A: nan", "1:4: expected a number, found 'nan'"),
    ("A: 1\nA: 2", "2:1: key 'A' is given twice"),
    ("A: {saw: {}}", "1:4: expected a number or one of ramp, sine, square, steps, walk, found saw"),
    ("A: {ramp: {low: 0, high: 1}}", "1:11: key 'period' is missing"),
    ("A: {ramp: {low: 0, high: 1, period: 5}}", "1:37: '5' is not a duration"),
    ("A: {ramp: {low: 0, high: 1, period: 0 s}}", "1:37: this time has to be longer than 0"),
    ("A: {steps: {values: [], every: 1 s}}", "1:21: expected at least one entry"),
    ("A: &a {ramp: {low: 0, high: 1, period: 1 s}}\nB: *a", "1:4: an alias refers to this; write it out"),
]


@pytest.mark.parametrize(("text", "complaint"), WRONG)
def test_a_file_that_says_no_waveforms_is_refused_with_its_line(text: str, complaint: str) -> None:
    with pytest.raises(YamlError) as refusal:
        read_waveforms(text, "values.yaml")
    assert str(refusal.value).startswith(f"values.yaml:{complaint}")
