"""The mailboxes of a robot's node on a simulated bus: what finds none for 50 ms is dropped."""

from __future__ import annotations

import pytest

from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.controller import Event
from eurobot_od.frame import Frame
from eurobot_od.robot.nodes.node import RobotNode
from tests.robot.nodes.harness import DICTIONARIES


class Wire:
    """A node that says what it is told, beside a silent one, on a bus that is idle at 0.1 s."""

    def __init__(self) -> None:
        self.network = Simulation()
        self.node = RobotNode(DICTIONARIES["core"])
        self.frames = list[Frame]()
        for node in (self.node, RobotNode(DICTIONARIES["drive"])):
            self.network.attach(node)
        self.network.run(0.1)
        self.network.observers.append(lambda _, frame: self.frames.append(frame))

    def say(self, *frames: Frame) -> None:
        for frame in frames:
            self.node.put(frame)

    def run(self, until: float) -> list[Frame]:
        """Return the frames but heartbeats."""
        self.network.run(until)
        return [frame for frame in self.frames if not 0x700 < frame.cob_id < 0x780]


def test_a_frame_that_finds_no_mailbox_for_50_ms_is_dropped_and_reported() -> None:
    wire = Wire()
    urgent = [Frame(0x680, bytes(8))] * 300
    wire.say(*urgent, Frame(0x6FF))
    sent = wire.run(0.2)
    drops = [report for report in wire.network.reports if report.event is Event.FRAME_DROPPED]
    assert "0x6FF" in {report.name for report in drops}
    assert {round(report.timestamp, 3) for report in drops} == {0.15}
    assert len(sent) + len(drops) == len(urgent) + 1


@pytest.mark.parametrize("count", [1, 3, 100])
def test_frames_that_can_leave_in_50_ms_are_not_lost(count: int) -> None:
    wire = Wire()
    wire.say(*(Frame(0x680 + number, bytes(8)) for number in range(count)))
    assert len(wire.run(0.2)) == count
    assert wire.network.reports == []


def test_messages_sent_while_the_bus_is_off_are_dropped() -> None:
    wire = Wire()
    wire.network.cut(0.5)
    frames = [Frame(0x680 + number) for number in range(5)]
    wire.say(*frames)
    assert wire.run(0.6) == frames[:3]
    assert [report.name for report in wire.network.reports] == ["0x683", "0x684"]  # a heartbeat waits
