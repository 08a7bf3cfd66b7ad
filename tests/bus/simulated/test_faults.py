"""The bus of real nodes when something is wrong with it: parts of a bus, a node that is alone, a babbling node."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from eurobot_od.bus import INTERMISSION, frame_bits
from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.frame import Frame
from eurobot_od.od.standard import ErrorCode
from tests.kit import lift
from tests.kit.bench import Peer
from tests.kit.lift import ROLES

FRAME, OTHER = Frame(0x555, b"\x55\x0f"), Frame(0x6AB, b"\x02")
EMERGENCY = 0x080
BIT = 1 / 500_000


class Ear(Peer):
    """A node that says what it is told, and remembers what it has heard, and when."""

    def __init__(self, name: str) -> None:
        super().__init__(lift.dictionary(name))
        self.heard: list[tuple[float, Frame]] = []
        self._own = self.device.identifiers
        self.device.identifiers = [*range(0x800)]

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        self.heard.append((now, frame))
        return super().receive(frame, now) if frame.cob_id in self._own else []


class Wire:
    """The three nodes, idle at 0.1 s; `frames` are those on the bus since then but heartbeats."""

    def __init__(self, *, monitored: bool = True) -> None:
        self.network = Simulation(monitored=monitored)
        self.nodes = {name: Ear(name) for name in ROLES}
        self.stations = {name: self.network.attach(node) for name, node in self.nodes.items()}
        self.network.run(0.1)
        self.frames: list[tuple[float, Frame]] = []
        self.network.observers.append(self._seen)

    def _seen(self, time: float, frame: Frame) -> None:
        if not 0x700 < frame.cob_id < 0x780:
            self.frames.append((time, frame))

    def say(self, name: str, *frames: Frame) -> None:
        self.nodes[name].say(*frames)

    def run(self, seconds: float) -> None:
        self.network.run(self.network.now + seconds)

    def heard(self, name: str, frame: Frame) -> int:
        return sum(each == frame for _, each in self.nodes[name].heard)

    def emergencies(self, name: str) -> list[int]:
        """Return the error codes that a node has told, in their order."""
        cob_id = EMERGENCY + self.nodes[name].device.node_id
        return [int.from_bytes(frame.data[:2], "little") for _, frame in self.frames if frame.cob_id == cob_id]


# A bus in two parts


class Cut(NamedTuple):
    """When the bus is cut, in bits since the cabin's frame began, and how often door and panel hear the frame."""

    bit: float
    panel: int
    door: int


CUTS = {
    "before the frame": Cut(-1, 0, 1),
    "within it, and it is sent again in its part": Cut(30.5, 0, 1),
    "after it": Cut(frame_bits(FRAME) + 1, 1, 1),
}
"""The cabin, which sends, and door are cut off from the panel."""


@pytest.mark.parametrize("cut", CUTS.values(), ids=CUTS)
def test_a_bus_that_is_cut_within_a_frame(cut: Cut) -> None:
    wire = Wire()
    begin = wire.network.now
    if cut.bit > 0:
        wire.say("cabin", FRAME)
        wire.run(cut.bit * BIT)
    wire.network.split([wire.stations["cabin"], wire.stations["door"]], until=begin + 0.05)
    if cut.bit < 0:
        wire.say("cabin", FRAME)
    wire.run(0.04)
    assert (wire.heard("panel", FRAME), wire.heard("door", FRAME)) == (cut.panel, cut.door)
    wire.run(0.05)
    wire.say("cabin", OTHER)
    wire.run(0.1)
    assert wire.heard("panel", OTHER) == wire.heard("door", OTHER) == 1


def test_two_parts_have_two_frames_at_the_same_time() -> None:
    wire = Wire()
    wire.network.split([wire.stations["cabin"], wire.stations["door"]], until=1.0)
    wire.say("panel", FRAME)
    wire.say("cabin", FRAME._replace(data=b"\x55\x0e"))
    wire.run(0.1)
    (first, _), (second, _) = wire.frames
    assert first == second


def test_parts_that_are_joined_within_frames_send_both_again() -> None:
    wire = Wire()
    joined = wire.network.now + 30.5 * BIT
    wire.network.split([wire.stations["cabin"], wire.stations["door"]], until=joined)
    wire.say("panel", FRAME)
    wire.say("cabin", OTHER)
    wire.run(0.1)
    assert [frame for _, frame in wire.frames] == [FRAME, OTHER]
    assert wire.frames[0][0] == pytest.approx(joined + (frame_bits(FRAME) - INTERMISSION) * BIT)
    assert all(wire.heard(name, FRAME) == 1 for name in ("cabin", "door"))
    assert all(wire.heard(name, OTHER) == 1 for name in ("panel", "door"))


@pytest.mark.parametrize("bit", range(1, frame_bits(FRAME) + 4, 8))
def test_a_sender_that_is_pulled_off_in_any_bit_is_heard_by_all_when_it_is_plugged_in(bit: int) -> None:
    wire = Wire(monitored=False)
    wire.say("cabin", FRAME)
    wire.run((bit + 0.5) * BIT)
    wire.network.split([wire.stations["cabin"]], until=wire.network.now + 0.01)
    wire.run(0.1)
    assert wire.heard("panel", FRAME) == wire.heard("door", FRAME) == 1
    assert not wire.stations["cabin"].controller.queue.holds(FRAME)


def test_a_bus_may_be_cut_within_a_frame_again_and_again() -> None:
    wire = Wire(monitored=False)
    wire.say("cabin", FRAME)
    for name in ("panel", "door", "panel"):
        wire.run(7 * BIT)
        wire.network.split([wire.stations[name]], until=wire.network.now + 100 * BIT)
    wire.run(0.5)
    assert wire.heard("panel", FRAME) + wire.heard("door", FRAME) >= 1
    wire.say("cabin", OTHER)
    wire.run(0.1)
    assert wire.heard("panel", OTHER) == wire.heard("door", OTHER) == 1


def test_a_node_may_be_detached_from_a_part() -> None:
    wire = Wire()
    wire.network.split([wire.stations["cabin"]], until=1.0)
    wire.network.detach(wire.stations["cabin"])
    wire.run(2.0)
    assert wire.heard("panel", FRAME) == 0


@pytest.mark.long
def test_a_node_that_is_off_too_long_is_missed() -> None:
    wire = Wire()
    wire.run(1.0)  # it is watched from its first heartbeat on
    wire.network.split([wire.stations["cabin"]], until=wire.network.now + 2.0)
    wire.run(2.0)
    assert ErrorCode.HEARTBEAT_LOST in wire.emergencies("panel")


# Nobody is there


def test_a_first_node_is_heard_by_the_monitor_only() -> None:
    seen: dict[bool, list[float]] = {}
    for monitored in (True, False):
        network, times = Simulation(monitored=monitored), list[float]()
        network.observers.append(lambda time, _, times=times: times.append(time))  # type: ignore[misc]
        network.attach(Ear("panel"))
        network.attach(Ear("cabin"), start=0.05)
        network.run(0.2)
        seen[monitored] = times
    assert seen[True][0] < 0.001
    assert seen[False][0] > 0.05


# A babbling node


def test_a_babbling_node_takes_the_bus_from_all_with_higher_identifiers() -> None:
    wire = Wire()
    wire.network.babble(Frame(0x000), until=wire.network.now + 0.2)
    wire.say("cabin", FRAME)
    wire.run(0.19)
    assert wire.heard("panel", FRAME) == 0
    wire.run(0.1)
    assert wire.heard("panel", FRAME) == 1


def test_a_babbling_node_with_a_high_identifier_harms_nobody() -> None:
    wire = Wire()
    wire.network.babble(Frame(0x7FF, bytes(8)), until=wire.network.now + 0.2)
    wire.say("cabin", FRAME)
    wire.run(0.01)
    assert wire.heard("panel", FRAME) == 1
