"""The simulated bus: arbitration, bit times, merged frames, losses, who hears what and when, and how stations live."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf
from typing import NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.bus import INTERMISSION, frame_bits
from eurobot_od.bus.simulated.network import ON_TIME, PROCESSING_TIMES, Bus, Simulation, Transceiver, processing_time
from eurobot_od.device.station import Station
from eurobot_od.frame import Frame
from tests.kit import lift
from tests.kit.bench import Peer
from tests.kit.lift import (
    ROLES,
    Cabin,
    CheckCabinRequest,
    CheckCabinResponse,
    EmergencyOff,
    Halt,
    MoveConfirm,
    MoveTo,
    Ride,
)

PROTOCOL = lift.protocol()
MOVE = PROTOCOL.encode(MoveTo(1500, Ride.NORMAL, 80))

MOVE_TIME = (frame_bits(MOVE) - INTERMISSION) / 500_000
"""Time on the bus to the end of frame, in s."""


class Ear(Peer):
    """A stand-in that remembers what it has looked at, and when."""

    def __init__(self, name: str) -> None:
        super().__init__(lift.dictionary(name))
        self.heard: list[tuple[float, Frame]] = []

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        self.heard.append((now, frame))
        return []

    def looks(self, frame: Frame) -> list[float]:
        """Return when it has looked at such a frame."""
        return [time for time, heard in self.heard if heard == frame]


HEARTBEAT = Frame(0x701, b"\x05")


class Wire:
    """Stand-ins for the three nodes on a bus that is idle at 0.1 s, and the frames since but the panel's heartbeats."""

    def __init__(self, processing: float = 0.0) -> None:
        self.network = Simulation()
        self.panel, self.cabin, self.door = (Ear(name) for name in ROLES)
        nodes = (self.panel, self.cabin, self.door)
        self.stations = [self.network.attach(node, processing=processing) for node in nodes]
        self.network.run(0.1)
        for node in nodes:
            node.heard.clear()
        self.frames: list[tuple[float, Frame]] = []
        self.network.observers.append(self._observe)

    def _observe(self, time: float, frame: Frame) -> None:
        if frame != HEARTBEAT:
            self.frames.append((time, frame))

    def run(self, until: float) -> list[Frame]:
        self.network.run(until)
        return [frame for _, frame in self.frames]

    def sent(self, frame: Frame) -> list[float]:
        """Return when such a frame has ended on the bus."""
        return [time for time, each in self.frames if each == frame]


# Arbitration


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_the_lowest_cob_id_of_all_nodes_wins(order: tuple[int, int, int]) -> None:
    wire = Wire()
    nodes = [wire.panel, wire.cabin, wire.door]
    frames = [Frame(0x001), Frame(0x00C), Frame(0x380)]
    for node, frame in zip((nodes[index] for index in order), frames):
        node.say(frame)
    assert wire.run(0.2) == frames


def test_a_frame_on_the_wire_is_not_interrupted() -> None:
    wire = Wire()
    wire.panel.say(MOVE)
    wire.network.advance(0.1)
    wire.network.run(0.1001)  # in the midst of it
    wire.cabin.say(Frame(0x001))
    assert wire.run(0.2) == [MOVE, Frame(0x001)]


def test_a_nodes_own_frames_leave_by_their_priority() -> None:
    wire = Wire()
    wire.panel.say(CheckCabinRequest(), MOVE, EmergencyOff())
    assert wire.run(0.2) == [PROTOCOL.encode(EmergencyOff()), MOVE, PROTOCOL.encode(CheckCabinRequest())]


def test_equal_frames_merge_into_one_and_count_as_sent_by_both() -> None:
    wire = Wire()
    frame = Frame(0x300)
    wire.cabin.say(frame)
    wire.door.say(frame)
    before = [station.controller.queue.statistics().completed for station in wire.stations]
    assert wire.run(0.2) == [frame]
    after = [station.controller.queue.statistics().completed for station in wire.stations]
    assert [later - earlier for earlier, later in zip(before, after)] == [0, 1, 1]


def test_equal_frames_of_one_node_both_go_out() -> None:
    wire = Wire()
    wire.panel.say(Halt(), Halt())
    assert len(wire.run(0.2)) == 2


def test_a_frame_left_to_a_controller_from_outside_leaves_at_once() -> None:
    wire = Wire()
    wire.stations[0].controller.queue.submit(MOVE, wire.network.now)
    assert wire.network.next_event == wire.network.now
    assert wire.run(0.101) == [MOVE]


# Time


@pytest.mark.parametrize("bitrate", [125_000, 500_000, 1_000_000])
def test_a_frame_takes_its_bits_at_the_bitrate(bitrate: int) -> None:
    network, times = Simulation(bitrate), list[float]()
    peer = Peer(lift.dictionary("panel"))
    network.attach(peer)
    network.run(0.1)
    network.observers.append(lambda time, _: times.append(time))
    peer.say(MOVE, MOVE)
    network.run(0.2)
    ends = [frame_bits(MOVE) - INTERMISSION, 2 * frame_bits(MOVE) - INTERMISSION]
    assert times == pytest.approx([0.1 + end / bitrate for end in ends], abs=1e-9)


def test_time_goes_on_without_events() -> None:
    network = Simulation()
    assert network.next_event == inf
    assert not network.advance(5.0)
    assert network.now == 5.0


def test_time_never_goes_back() -> None:
    network = Simulation()
    network.run(5.0)
    network.run(3.0)
    assert network.now == 5.0


def test_nodes_boot_when_they_are_switched_on_and_hear_nothing_before() -> None:
    network, frames = Simulation(), list[tuple[float, Frame]]()
    network.observers.append(lambda time, frame: frames.append((round(time, 3), frame)))
    panel, cabin = Peer(lift.dictionary("panel")), Cabin(lift.dictionary("cabin"))
    network.attach(panel)
    network.attach(cabin, start=0.5)
    network.run(0.1)
    panel.say(CheckCabinRequest())
    network.run(0.6)
    panel.say(CheckCabinRequest())
    network.run(0.7)
    check, answer = PROTOCOL.encode(CheckCabinRequest()), PROTOCOL.encode(CheckCabinResponse())
    assert frames == [
        (0.0, Frame(0x701, b"\0")),
        (0.1, check),
        (0.25, Frame(0x701, b"\5")),
        (0.5, Frame(0x701, b"\5")),
        (0.5, Frame(0x702, b"\0")),
        (0.6, check),
        (0.6, answer),
    ]


def test_a_sender_does_not_hear_its_own_frame() -> None:
    wire, stop = Wire(), Frame(0x000, b"\x02\0")  # all nodes listen to NMT
    wire.panel.say(stop)
    wire.run(0.2)
    assert [len(node.looks(stop)) for node in (wire.panel, wire.cabin, wire.door)] == [0, 1, 1]


def test_a_frame_that_nobody_listens_to_is_on_the_bus_and_reaches_nobody() -> None:
    wire = Wire()
    wire.panel.say(Frame(0x6FF))
    assert wire.run(0.2) == [Frame(0x6FF)]
    assert all(station.controller.statistics().unheard == 0 for station in wire.stations)  # filters stop it


# Nothing is lost


@pytest.mark.parametrize("count", [1, 3, 1000])
def test_a_frame_waits_as_long_as_the_bus_is_full(count: int) -> None:
    wire = Wire()
    wire.panel.say(*(Frame(0x480 + number % 0x200, bytes(8)) for number in range(count)))
    assert len(wire.run(0.5)) == count
    assert wire.network.reports == []


# When a frame is looked at

LOOKS = {
    "at once": (0.0, ON_TIME, [0.0]),
    "after the processing time": (150e-6, ON_TIME, [150e-6]),
    "never, as it is lost": (0.0, (), []),
    "twice, as it is doubled": (0.0, (0.0, 0.001), [0.0, 0.001]),
    "late": (0.0, (2.0,), [2.0]),
    "late, and after the processing time": (200e-6, (2.0,), [2.0002]),
}
"""Processing time, what `disturb` says, and how long after the frame's end the receivers look at it."""


@pytest.mark.parametrize(("processing", "delays", "looks"), LOOKS.values(), ids=LOOKS)
def test_when_a_frame_is_looked_at(processing: float, delays: tuple[float, ...], looks: list[float]) -> None:
    wire = Wire(processing)
    wire.network.disturb = lambda _now, frame: delays if frame == MOVE else ON_TIME
    wire.panel.say(MOVE)
    wire.run(0.9)
    assert wire.sent(MOVE) == pytest.approx([0.1 + MOVE_TIME])  # whatever becomes of it
    assert not wire.stations[0].controller.queue.holds(MOVE)
    wire.run(3.0)
    (end,) = wire.sent(MOVE)
    assert wire.cabin.looks(MOVE) == pytest.approx([end + each for each in looks])
    assert wire.panel.looks(MOVE) == []


def test_disturb_is_asked_with_the_end_of_each_frame() -> None:
    wire, asked = Wire(), list[tuple[float, Frame]]()

    def lose(now: float, frame: Frame) -> tuple[float, ...]:
        asked.append((now, frame))
        return ()

    wire.network.disturb = lose
    wire.panel.say(MOVE, EmergencyOff())
    wire.run(0.2)
    assert asked == wire.frames
    assert len(asked) == 2


def test_frames_that_are_on_time_are_looked_at_in_their_order() -> None:
    wire = Wire(max(PROCESSING_TIMES))
    moves = [PROTOCOL.encode(MoveTo(x, Ride.NORMAL, 80)) for x in range(1000, 1010)]
    wire.panel.say(*moves)
    wire.run(0.2)
    assert [frame for _, frame in wire.cabin.heard] == moves
    times = [time + max(PROCESSING_TIMES) for time, _ in wire.frames]
    assert [time for time, _ in wire.cabin.heard] == pytest.approx(times)  # the bus does not wait for those who look


def test_processing_times_come_from_the_seed_and_differ_from_node_to_node() -> None:
    drawn = {(seed, name): processing_time(seed, name) for seed in range(1, 21) for name in ROLES}
    assert set(drawn.values()) == set(PROCESSING_TIMES)
    assert all(processing_time(*key) == time for key, time in drawn.items())
    assert len({tuple(drawn[seed, name] for name in ROLES) for seed in range(1, 21)}) > 10


# How stations live

CONFIRM = PROTOCOL.encode(MoveConfirm())
DRIVE_HEARTBEAT = Frame(0x702, b"\x05")


class Silence(NamedTuple):
    """What makes a station silent at 0.1 s, and until when."""

    begin: Callable[[Simulation, Station], None]
    until: float

    def fits(self, times: list[float]) -> bool:
        """Return whether something came at these times that comes only from a station that is not silent."""
        return all(time > self.until for time in times) and bool(times) == (self.until < inf)


def freeze_twice(network: Simulation, station: Station) -> None:
    network.freeze(station, 2.5)
    network.freeze(station, 1.0)


SILENCES = {
    "detached": Silence(lambda network, station: network.detach(station), inf),
    "frozen": Silence(lambda network, station: network.freeze(station, 2.5), 2.5),
    "frozen, and again for a shorter time": Silence(freeze_twice, 2.5),
}

silences = pytest.mark.parametrize("silence", SILENCES.values(), ids=SILENCES)


@silences
def test_a_silent_station_sends_neither_heartbeats_nor_what_waits(silence: Silence) -> None:
    wire = Wire()
    cabin = wire.stations[1]
    silence.begin(wire.network, cabin)
    for _ in range(5):  # more than it has mailboxes
        cabin.controller.queue.submit(CONFIRM, wire.network.now)
    wire.run(4.0)
    for frame in (CONFIRM, DRIVE_HEARTBEAT):
        assert silence.fits(wire.sent(frame))


@silences
def test_a_silent_station_hears_nothing(silence: Silence) -> None:
    wire = Wire()
    silence.begin(wire.network, wire.stations[1])
    for time in (2.4, 2.6, 2.7):
        wire.panel.say(MOVE)
        wire.run(time)
    assert silence.fits(wire.cabin.looks(MOVE))


@silences
def test_a_frame_on_the_wire_ends_when_its_sender_falls_silent(silence: Silence) -> None:
    wire = Wire()
    wire.cabin.say(CONFIRM)
    wire.network.advance(0.1)
    silence.begin(wire.network, wire.stations[1])
    assert wire.run(0.2) == [CONFIRM]
    assert len(wire.panel.looks(CONFIRM)) == 1
    assert not wire.stations[1].controller.queue.holds(CONFIRM)


@silences
def test_unread_frames_are_lost(silence: Silence) -> None:
    wire = Wire(processing=200e-6)
    wire.panel.say(MOVE)
    assert wire.run(0.1 + MOVE_TIME + 1e-6) == [MOVE]
    silence.begin(wire.network, wire.stations[1])
    wire.run(4.0)
    assert wire.cabin.looks(MOVE) == []


def test_a_new_node_takes_the_place_of_a_detached_one() -> None:
    wire, cabin = Wire(), Ear("cabin")
    wire.network.detach(wire.stations[1])
    wire.network.attach(cabin, start=0.5)
    wire.run(0.6)
    wire.panel.say(MOVE)
    assert wire.run(0.7) == [Frame(0x702, b"\0"), MOVE]
    assert len(cabin.looks(MOVE)) == 1
    assert wire.cabin.heard == []


def test_a_node_that_is_detached_before_its_start_never_starts() -> None:
    wire = Wire()
    station = wire.network.attach(Cabin(lift.dictionary("cabin")), start=0.5)
    wire.network.detach(station)
    assert wire.run(0.9) == []


# The bus is off


def test_a_frame_on_the_wire_when_the_bus_is_cut_begins_anew_afterwards() -> None:
    wire = Wire()
    wire.panel.say(MOVE)
    wire.network.run(0.1001)  # in the midst of it
    wire.network.cut(0.5)
    assert wire.run(0.4) == []
    assert wire.stations[0].controller.queue.holds(MOVE)
    wire.run(0.6)
    assert wire.sent(MOVE) == pytest.approx([0.5 + MOVE_TIME])
    assert wire.cabin.looks(MOVE) == wire.sent(MOVE)


def test_frames_sent_during_bus_off_leave_by_priority() -> None:
    wire = Wire()
    wire.network.cut(0.5)
    wire.network.cut(0.3)  # does not end the longer one
    frames = [Frame(0x680 + number) for number in range(5)]
    wire.panel.say(*reversed(frames))
    wire.cabin.say(Frame(0x001))
    assert wire.run(0.6) == [Frame(0x001), *frames]
    assert wire.frames[0][0] > 0.5
    assert wire.network.reports == []


BITRATE = 1_000_000
FRAME, URGENT, LATER = Frame(0x555, b"\x55\x0f"), Frame(0x123, b"\x01"), Frame(0x6AB, b"\x02")
END = frame_bits(FRAME) - INTERMISSION


class Frames:
    """Frames in the order in which they are to be sent."""

    def __init__(self) -> None:
        self.waiting: list[Frame] = []

    def urgent(self) -> Frame | None:
        return self.waiting[0] if self.waiting else None

    def complete(self, frame: Frame) -> None:
        self.waiting.remove(frame)


class Ended(NamedTuple):
    """A frame that has ended after so many bits since the beginning, who has sent it and who has it."""

    bit: int
    frame: Frame
    senders: str
    receivers: str


class Scene:
    """Transceivers A, B, ... on one bus, and what has happened on it."""

    def __init__(self, count: int = 3) -> None:
        self.bus = Bus(BITRATE, self._ended)
        self.sources = [Frames() for _ in range(count)]
        self.bus.transceivers += [Transceiver(source) for source in self.sources]
        self.frames: list[Ended] = []
        self.now = 0.0

    def _names(self, controllers: Sequence[Transceiver]) -> str:
        return "".join("ABCDEF"[self.bus.transceivers.index(each)] for each in controllers)

    def _ended(self, frame: Frame, senders: Sequence[Transceiver], receivers: Sequence[Transceiver]) -> None:
        for each in senders:
            each.source.complete(frame)
        self.frames.append(Ended(round(self.now * BITRATE), frame, self._names(senders), self._names(receivers)))

    def say(self, name: str, *frames: Frame) -> None:
        self.sources["ABCDEF".index(name)].waiting += frames

    def run(self, bits: int = 2000) -> list[Ended]:
        """Run for so many bits; return all frames so far."""
        until = self.now + bits / BITRATE
        self.bus.arbitrate(self.now)
        while self.bus.next_event <= until:
            self.now = self.bus.next_event
            self.bus.advance(self.now)
            self.bus.arbitrate(self.now)
        self.now = until
        return self.frames


def test_the_lowest_identifier_wins_and_the_next_arbitration_is_after_the_intermission() -> None:
    scene = Scene()
    scene.say("A", LATER)
    scene.say("B", FRAME)
    assert scene.run() == [
        (END, FRAME, "B", "AC"),
        (frame_bits(FRAME) + frame_bits(LATER) - INTERMISSION, LATER, "A", "BC"),
    ]


def test_equal_frames_go_out_as_one() -> None:
    scene = Scene()
    scene.say("A", FRAME)
    scene.say("B", FRAME)
    assert scene.run() == [(END, FRAME, "AB", "C")]


def test_of_two_frames_with_one_identifier_the_lower_one_goes_first() -> None:
    scene, one, other = Scene(), Frame(0x555, b"\x01"), Frame(0x555, b"\x02")
    scene.say("A", other)
    scene.say("B", one)
    assert [(each.frame, each.senders) for each in scene.run()] == [(one, "B"), (other, "A")]


def test_a_lone_node_sends_again_and_again_and_is_heard_as_soon_as_somebody_is_there() -> None:
    scene = Scene(2)
    scene.bus.transceivers[1].silent_until = 50_000 / BITRATE
    scene.say("A", FRAME)
    assert scene.run(50_000) == []
    ((bit, frame, _, receivers),) = scene.run(1000)
    assert (frame, receivers) == (FRAME, "B")
    assert 50_000 < bit <= 50_000 + 2 * frame_bits(FRAME)


def test_equal_frames_of_all_who_are_there_are_acknowledged_by_nobody() -> None:
    scene = Scene(2)
    scene.say("A", FRAME)
    scene.say("B", FRAME)
    assert scene.run() == []


def test_dropped_frames_are_sent_again() -> None:
    scene = Scene()
    scene.say("A", FRAME)
    scene.run(30)
    scene.bus.drop()
    assert scene.run() == [(30 + END, FRAME, "A", "BC")]


@given(st.lists(st.lists(st.sampled_from([FRAME, URGENT, LATER]), max_size=5), min_size=2, max_size=5))
def test_every_frame_goes_out_once_and_takes_its_bits(said: list[list[Frame]]) -> None:
    scene = Scene(len(said) + 1)  # the last one only listens
    for source, frames in zip(scene.sources, said):
        source.waiting += frames
    ended = scene.run(20_000)
    assert not any(source.waiting for source in scene.sources)
    assert sum(len(each.senders) for each in ended) == sum(map(len, said))
    assert [each.bit for each in ended] == [
        sum(frame_bits(each.frame) for each in ended[: number + 1]) - INTERMISSION for number in range(len(ended))
    ]
