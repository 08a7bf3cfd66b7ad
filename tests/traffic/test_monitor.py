"""The model of the live table: counts, periods, load, nodes, faults, order and selection."""

from __future__ import annotations

import tracemalloc
from collections.abc import Generator
from time import monotonic

import can
import pytest

from eurobot_od.bus import frame_bits
from eurobot_od.errors import BusError
from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.traffic.entries import Damage, Foreign, LogEntry, Timed
from eurobot_od.traffic.monitor import (
    HEADINGS,
    SORTS,
    BusSource,
    LogSource,
    MeanPeriod,
    Traffic,
    cells,
    health,
    plain_table,
    selected,
)
from tests.kit import plant
from tests.kit.plant import messages as m

DECODER = plant.decoder()
REQUEST = DECODER.protocol.encode(m.PlaceRequest())
MOVE = DECODER.protocol.encode(m.MoveTo(1, 2, 3, 4))
BEAT = Frame(0x702, b"\5")


@pytest.fixture
def traffic() -> Traffic:
    return Traffic(DECODER, 500_000)


def test_count_last_values_and_age(traffic: Traffic) -> None:
    for time in (1.0, 2.0, 3.0):
        traffic.take(time, DECODER.protocol.encode(m.MoveStateResponse(int(1000 * time))))
    (row,) = traffic.rows.values()
    assert (row.identifier, row.name, row.count, row.last) == (0x282, "Move State Response", 3, 3.0)
    assert row.meaning.message == m.MoveStateResponse(3000)


@pytest.mark.parametrize(
    ("times", "period"),
    [
        ([1.0], None),
        ([1.0, 1.5], MeanPeriod(0.5, 0.0)),
        ([0.0, 0.5, 1.5, 2.0, 3.0], MeanPeriod(0.75, 0.25)),
        # only the last 32 intervals count
        ([*(float(n) for n in range(50)), *(49 + 2.0 * n for n in range(1, 33))], MeanPeriod(2.0, 0.0)),
    ],
)
def test_period_and_jitter(traffic: Traffic, times: list[float], period: MeanPeriod | None) -> None:
    for time in times:
        traffic.take(time, REQUEST)
    assert traffic.rows[REQUEST.cob_id].period == period


def test_load_of_a_full_bus(traffic: Traffic) -> None:
    """Stuff bits count: a bus without a pause between its frames is full."""
    traffic.load(0.0)
    each = frame_bits(MOVE) / 500_000
    number = int(1 / each)
    for n in range(1, number + 1):
        traffic.take(n * each, MOVE)
    share, rate = traffic.load(number * each)
    assert share == pytest.approx(1.0, abs=0.001)
    assert rate == pytest.approx(1 / each, abs=1)


def test_load_is_that_of_the_last_second(traffic: Traffic) -> None:
    traffic.load(0.0)
    for n in range(100):
        traffic.take(n / 100, MOVE)
    assert [traffic.load(second)[1] for second in (1.0, 2.0, 3.0)] == [100.0, 0.0, 0.0]


def test_a_frame_is_counted_to_who_sent_it(traffic: Traffic) -> None:
    for frame in (Frame(0x000, b"\1\0"), Frame(0x602, bytes(8)), Frame(0x582, bytes(8)), RemoteFrame(0x702), BEAT):
        traffic.take(1.0, frame)
    assert [each.node for each in traffic.seen.messages.values()] == ["master", "master", "lift", "master", "lift"]


def test_load_before_any_time_has_passed(traffic: Traffic) -> None:
    assert traffic.load(5.0) == (0.0, 0.0)


def test_faults_are_counted_by_row_and_in_all(traffic: Traffic) -> None:
    traffic.take(1.0, Foreign(Damage.ERROR_FRAME, "20000080#"))
    traffic.take(2.0, Frame(0x123))
    traffic.take(3.0, Frame(0x202, b"\0"))
    traffic.take(4.0, MOVE)
    assert {row.name: row.wrong for row in traffic.rows.values()} == {
        "error frame": 1,
        "unknown identifier": 1,
        "Move To": 1,
    }
    assert traffic.damage.total == 3
    traffic.clear()
    assert (traffic.rows, traffic.seen.messages, traffic.damage.total) == ({}, {}, 0)


def test_nodes(traffic: Traffic) -> None:
    lift = traffic.nodes["lift"]
    assert health("lift", lift, 0.0) == "lift not heard"
    traffic.take(1.0, Frame(0x702, b"\0"))
    assert health("lift", lift, 1.0) == "lift boot-up"
    traffic.take(2.0, BEAT)
    assert health("lift", lift, 2.5) == "lift operational"
    assert health("lift", lift, 4.1) == "lift LOST"
    traffic.take(5.0, Frame(0x082, bytes.fromhex("1082110800030000")))
    assert lift.emergency.startswith("0x8210 pdo too short")
    traffic.take(6.0, Frame(0x082, bytes(8)))
    assert lift.emergency == ""


def test_a_heartbeat_of_wrong_length_says_nothing_of_the_node(traffic: Traffic) -> None:
    traffic.take(1.0, Frame(0x702, b"\5\5"))
    assert traffic.nodes["lift"].pulse.heard is None


def test_a_node_that_no_file_describes_is_known_by_its_heartbeats(traffic: Traffic) -> None:
    for time in (1.0, 1.5, 2.0):
        traffic.take(time, Frame(0x705, b"\5"))
    node = traffic.nodes["node 5"]
    assert health("node 5", node, 2.9) == "node 5 operational"
    assert health("node 5", node, 3.1) == "node 5 LOST"  # twice the period that was heard
    traffic.take(9.0, Frame(0x705, b"\0"))
    assert health("node 5", node, 99.0) == "node 5 boot-up"  # it need not send heartbeats


@pytest.fixture
def busy(traffic: Traffic) -> Traffic:
    for time, frame in ((1.0, MOVE), (2.0, REQUEST), (3.0, REQUEST), (3.1, REQUEST), (4.0, Frame(0x123)), (5.0, BEAT)):
        traffic.take(time, frame)
    return traffic


@pytest.mark.parametrize(
    ("sort", "names"),
    [
        ("identifier", ["unknown identifier", "Move To", "Place Request", "Heartbeat lift"]),
        ("name", ["Heartbeat lift", "Move To", "Place Request", "unknown identifier"]),
        ("count", ["Place Request", "Move To", "unknown identifier", "Heartbeat lift"]),
        ("period", ["Place Request", "Move To", "unknown identifier", "Heartbeat lift"]),
        ("age", ["Heartbeat lift", "unknown identifier", "Place Request", "Move To"]),
        ("wrong", ["unknown identifier", "Move To", "Place Request", "Heartbeat lift"]),
    ],
)
def test_sort(busy: Traffic, sort: str, names: list[str]) -> None:
    assert [row.name for row in selected(busy.rows.values(), sort, "")] == names


def test_every_sort_has_a_case() -> None:
    assert set(SORTS) == {"identifier", "name", "count", "period", "age", "wrong"}


@pytest.mark.parametrize(
    ("part", "names"),
    [
        ("move", ["Move To"]),
        ("PLACES", ["Place Request"]),
        ("canopen", ["Heartbeat lift"]),
        ("lift", ["Move To", "Place Request", "Heartbeat lift"]),
        ("nothing", []),
    ],
)
def test_select(busy: Traffic, part: str, names: list[str]) -> None:
    assert [row.name for row in selected(busy.rows.values(), "identifier", part)] == names


def test_plain_table(busy: Traffic) -> None:
    heading, unknown, move, request, beat = plain_table(selected(busy.rows.values(), "identifier", ""), 5.0)
    assert heading.split() == " ".join(HEADINGS).split()
    assert move.split()[:4] == ["202", "Move", "To", "1"]
    assert "550.0 ± 450.0" in request
    assert "! unknown identifier: 123#: in no file; its identifier is reserved" in unknown
    assert beat.split() == ["702", "Heartbeat", "lift", "1", "0.0", "lift,", "operational"]


@pytest.mark.long
def test_frames_that_are_always_new_take_no_memory_for_ever(traffic: Traffic) -> None:
    """It grew to 110 MB, as the lengths of frames on the wire were remembered with all their bits."""
    taken = []
    tracemalloc.start()
    for number in range(4000):
        traffic.take(number / 1000, Frame(0x7F0, number.to_bytes(8, "little")))
        if number % 2000 == 1999:
            taken.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert taken[1] - taken[0] < 500_000


def entries() -> Generator[tuple[str, LogEntry], None, None]:
    yield from (("a.log", (time - 99, float(time), "", Frame(time))) for time in range(100, 110))


@pytest.mark.parametrize(
    ("speed", "polls"),
    [
        (1.0, [(0.0, 1, 100.0), (1.5, 1, 101.5), (4.0, 3, 104.0), (100.0, 5, 109.0)]),
        (2.0, [(0.0, 1, 100.0), (2.0, 4, 104.0), (100.0, 5, 109.0)]),
        (float("inf"), [(0.0, 10, 109.0)]),
    ],
)
def test_a_log_is_played_at_its_speed(speed: float, polls: list[tuple[float, int, float]]) -> None:
    now = [50.0]
    source = LogSource(entries(), speed, lambda: now[0])
    for after, count, shown in polls:
        now[0] = 50.0 + after
        assert len(list(source.poll())) == count
        assert source.now == shown
        assert source.place == ("a.log", int(shown) - 99)
    assert source.ended


def test_an_empty_log_ends_at_once() -> None:
    nothing: list[tuple[str, LogEntry]] = []
    source = LogSource((each for each in nothing), 1.0)
    assert list(source.poll()) == []
    assert source.ended


class Driver(can.BusABC):
    """A bus with these messages on it, which fails after them."""

    def __init__(self, *messages: can.Message) -> None:
        super().__init__("driver")
        self.channel_info = "driver"
        self._messages = list(messages)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._messages:
            raise can.CanOperationError("pulled out")
        return self._messages.pop(0), False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise NotImplementedError


def receive(source: BusSource, found: list[Timed], count: int) -> None:
    """Append what comes to `found` until there are so many."""
    until = monotonic() + 5
    while len(found) < count and monotonic() < until:
        found.extend(source.poll())


def test_a_bus_is_read_whatever_is_on_it() -> None:
    with can.Bus(interface="virtual", channel="monitor") as sender:
        source = BusSource(can.Bus(interface="virtual", channel="monitor"))
        sender.send(can.Message(arbitration_id=0x182, is_extended_id=False))
        sender.send(can.Message(arbitration_id=0x18FF0001, is_extended_id=True, data=b"\1"))
        found: list[Timed] = []
        receive(source, found, 2)
        assert [raw for _, raw in found] == [Frame(0x182), Frame(EXTENDED | 0x18FF0001, b"\1")]
        source.close()


def test_times_are_the_drivers_until_the_bus_fails() -> None:
    frame = can.Message(timestamp=5.0, arbitration_id=0x182, is_extended_id=False)
    remote = can.Message(timestamp=5.5, arbitration_id=0x182, is_extended_id=False, is_remote_frame=True)
    source = BusSource(Driver(frame, remote), lambda: 70.0)
    found: list[Timed] = []
    with pytest.raises(BusError, match="the bus driver failed: pulled out"):
        receive(source, found, 3)
    assert found == [(5.0, Frame(0x182)), (5.5, RemoteFrame(0x182))]
    assert source.now == 5.5
    source.close()


def test_a_bus_that_is_opened_again_is_read_on_and_the_gap_noted() -> None:
    first, second = (can.Message(timestamp=at, arbitration_id=0x182, is_extended_id=False) for at in (5.0, 6.0))
    too_long = can.Message(timestamp=7.0, arbitration_id=0x182, data=bytes(300), is_extended_id=False)
    source = BusSource(Driver(first), opener=lambda: Driver(second, too_long))
    found: list[Timed] = []
    receive(source, found, 3)
    assert [(time, type(raw)) for time, raw in found] == [(5.0, Frame), (6.0, Frame), (7.0, Foreign)]
    assert source.notes[0] == "the bus driver failed: pulled out; it is opened again"
    assert source.notes[1].startswith("the bus is back after a gap of 0.")
    source.close()


@pytest.mark.parametrize(
    ("frames", "note"),
    [
        ([(0, 0x705), (6, 0x705)], "node 5 is on this bus, nodes 1, 2, 3 are not"),
        ([(0, 0x705), (4, 0x705)], ""),  # too early to say
        ([(0, 0x702), (6, 0x702)], ""),  # no node is there in place of the others
        ([(0, 0x705), (1, 0x701), (2, 0x182), (6, 0x703)], ""),
        ([], ""),
    ],
)
def test_the_node_that_is_heard_in_place_of_those_of_the_files(
    traffic: Traffic, frames: list[tuple[float, int]], note: str
) -> None:
    for time, cob_id in frames:
        traffic.take(time, Frame(cob_id, b"\5" if cob_id > 0x700 else b""))
    assert traffic.presence.note == note


def test_two_buses_are_not_one(traffic: Traffic) -> None:
    for number in range(10):
        traffic.take(number / 20, REQUEST, channel=f"can{number % 2}")
    assert [each.period and each.period.mean for each in traffic.rows.values()] == pytest.approx([0.1, 0.1])
    assert [cells(each, 1.0)[0] for each in traffic.rows.values()] == ["can0 402", "can1 402"]
    assert [seen.messages[REQUEST.cob_id, False].count for seen in traffic.buses.values()] == [5, 5]


def test_a_heartbeat_time_that_is_written_counts_from_then_on(traffic: Traffic) -> None:
    for number in range(10):
        traffic.take(number / 10, Frame(0x702, b"\x05"))
    assert traffic.nodes["lift"].pulse.lost(2.0)
    traffic.take(1.0, Frame(0x602, bytes.fromhex("2B17100010270000")))  # 10 s
    assert traffic.nodes["lift"].pulse.lost(2.0)  # not confirmed yet
    traffic.take(1.01, Frame(0x582, bytes.fromhex("6017100000000000")))
    assert not traffic.nodes["lift"].pulse.lost(2.0)


def test_sent_frames_are_in_bus_order() -> None:
    """A machine that is busy reads late: what came before a frame of ours is read after it was sent."""

    class Slow(can.BusABC):
        channel_info = "slow"

        def __init__(self) -> None:
            super().__init__("slow")
            self.came: list[can.Message] = [can.Message(timestamp=100.0, arbitration_id=0x701, is_extended_id=False)]

        def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
            return (self.came.pop(0), False) if self.came else (None, False)

        def send(self, msg: can.Message, timeout: float | None = None) -> None:
            # The answer is there before `send` returns, and before both something that was read late.
            if msg.arbitration_id == 0x601:
                for at, cob_id in ((100.4, 0x702), (100.5, 0x581)):
                    self.came.append(can.Message(timestamp=at, arbitration_id=cob_id, is_extended_id=False))

    now = [0.0]
    bus = Slow()
    source = BusSource(bus, lambda: now[0])
    found: list[Timed] = []
    receive(source, found, 1)
    now[0] = 0.5
    for frame in (REQUEST, Frame(0x601)):
        source.send(frame, 1.0)
    receive(source, found, 5)
    assert [(time, raw[0]) for time, raw in found] == [
        (100.0, 0x701), (100.4, 0x702), (100.5, REQUEST.cob_id), (100.5, 0x601), (100.5, 0x581),
    ]  # fmt: skip
    source.close()


def test_times_go_on_when_the_clock_is_set_back_and_forth() -> None:
    stamps = (5.0, 4.9997, 5.001, 3.0, 3.1, 3603.2, 3.3)  # all read within a moment
    source = BusSource(
        Driver(*(can.Message(timestamp=at, arbitration_id=0x701, is_extended_id=False) for at in stamps)), lambda: 70.0
    )
    found: list[Timed] = []
    with pytest.raises(BusError):
        receive(source, found, 8)
    assert [time for time, _ in found] == pytest.approx([5.0, 5.0, 5.001, 5.001, 5.101, 5.101, 5.101])
    assert source.notes == [
        f"the clock was set by {by} s; times go on as before" for by in ("-2.0", "3600.1", "-3599.9")
    ]
    source.close()


def test_frames_read_late_are_no_clock_that_is_set() -> None:
    now = iter((0.0, 0.0, 0.0, 9.0, 9.0, 9.0, 9.1, 9.1, *[9.2] * 9))  # it stood still for 9 s
    stamps = (5.0, 5.1, 9.0, 14.1)
    source = BusSource(
        Driver(*(can.Message(timestamp=at, arbitration_id=0x701, is_extended_id=False) for at in stamps)),
        lambda: next(now),
    )
    found: list[Timed] = []
    with pytest.raises(BusError):
        receive(source, found, 5)
    assert [time for time, _ in found] == list(stamps)
    assert source.notes == []
    source.close()
