"""A drive and a navigation as the robot of 2014 had them: no boot-up, no heartbeats, no SDO; its own bits on the wire.

What it cannot have: nobody misses its nodes, and the drive does not miss the core.
"""

from __future__ import annotations

from concurrent.futures import Future

import pytest

from eurobot_od.bus.simulated.network import ON_TIME, Simulation
from eurobot_od.device.faults import Leaving
from eurobot_od.frame import Frame
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import StopDrive
from eurobot_od.robot.model.values import Outcome, TeamColour
from eurobot_od.robot.nodes import Core, Drive, Navigation
from eurobot_od.robot.nodes.core.flows import GotoReport
from eurobot_od.robot.nodes.node import RobotNode
from eurobot_od.robot.protocol import EurobotProtocol
from tests.kit.bench import put
from tests.robot.document import NAMES

DIALECT = "firmware2014"
PROTOCOL = EurobotProtocol.load(DIALECT)
IDENTIFIERS = {PROTOCOL.cob_id(name) for name in NAMES}


class Old(Leaving, RobotNode):
    """Neither sends nor hears anything but the protocol's messages."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        return super().receive(frame, now) if _is_message(frame) else []

    def outgoing(self, frames: list[Frame]) -> list[Frame]:
        return [frame for frame in frames if _is_message(frame)]


def _is_message(frame: Frame) -> bool:
    return frame.cob_id in IDENTIFIERS


class OldDrive(Old, Drive):
    """The drive of 2014."""


class OldNavigation(Old, Navigation):
    """The navigation of 2014."""


class Robot2014:
    """Our core with the two."""

    def __init__(self) -> None:
        self.network = Simulation()
        self.core = Core(dialects.load("core", DIALECT))
        self.drive = OldDrive(dialects.load("drive", DIALECT))
        put(self.drive, "Estimate.Largest deviation", 0xFFFF)  # its navigation sees nobody
        self.station = self.network.attach(self.core)
        for node in (self.drive, OldNavigation(dialects.load("navigation", DIALECT))):
            self.network.attach(node)
        self.run(2.0)

    def run(self, seconds: float) -> None:
        self.network.run(self.network.now + seconds)

    def drive_off(self) -> Future[GotoReport]:
        call = self.core.goto(2700, 1700, 0, 50)
        self.run(2.0)
        assert self.drive.moving
        return call


@pytest.fixture
def robot() -> Robot2014:
    robot = Robot2014()
    checks = robot.core.check_nodes()
    robot.run(1.0)
    assert set(checks.result(0)) == {"drive", "navigation"}
    configured = robot.core.configure_start(TeamColour.RED)
    robot.run(1.0)  # nobody answers who is asked for the dialect
    assert configured.result(0) < 0.1
    return robot


def test_a_goto_arrives(robot: Robot2014) -> None:
    call = robot.drive_off()
    robot.run(7.0)
    assert call.result(0).outcome is Outcome.ARRIVED


@pytest.mark.parametrize("lost", [0, 1, 3])
def test_stops_are_seen_to_work(robot: Robot2014, lost: int) -> None:
    goto = robot.drive_off()
    left = [lost]
    stop = PROTOCOL.encode(StopDrive())

    def disturb(_: float, frame: Frame) -> tuple[float, ...]:
        if frame != stop or not left[0]:
            return ON_TIME
        left[0] -= 1
        return ()

    robot.network.disturb = disturb
    call = robot.core.stop()
    robot.run(1.5)
    assert goto.result(0).outcome is Outcome.STOPPED
    assert call.done()
    assert not robot.drive.moving


def test_a_cancelled_goto_is_stopped(robot: Robot2014) -> None:
    robot.drive_off().cancel()
    robot.run(1.0)
    assert not robot.drive.moving


def test_the_match_ends(robot: Robot2014) -> None:
    robot.core.start_match(3.0)
    call = robot.drive_off()
    robot.run(2.0)
    assert call.result(0).why == "the match is over"
    assert not robot.drive.moving


def test_a_drive_that_boots_is_known_by_its_answers(robot: Robot2014) -> None:
    call = robot.drive_off()
    robot.drive.reset()
    robot.run(2.0)
    assert (call.result(0).outcome, call.result(0).why) == (Outcome.LOST, "the drive knows of no goto")
    assert not robot.drive.moving


def test_a_drive_of_2014_goes_on_without_the_core(robot: Robot2014) -> None:
    robot.drive_off()
    robot.network.detach(robot.station)
    robot.run(2.0)
    assert robot.drive.moving
