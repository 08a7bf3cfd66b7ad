"""Nodes that raise exceptions: reported, stopped, and ended or restarted; the drive does not go on rolling."""

from __future__ import annotations

from itertools import pairwise
from threading import Event as Flag
from typing import ClassVar

import pytest
from can.interfaces.virtual import VirtualBus

from eurobot_od.bus.live import Live
from eurobot_od.device.station import OnError
from eurobot_od.errors import NodeFailed
from eurobot_od.frame import Frame
from eurobot_od.gatekeeper import Event, Gatekeeper
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import CheckDriveRequest, CheckDriveResponse, GotoXY, StartConfigurationSet
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.nodes import Drive
from eurobot_od.robot.nodes.motion import AT_REST, Odometry, WheelCommand
from eurobot_od.robot.nodes.node import Handlers
from eurobot_od.robot.protocol import EurobotProtocol
from eurobot_od.support.connections import FIRST_PAUSE
from tests.bus.live.loose import LONG, Reports, wait_for

PROTOCOL = EurobotProtocol.load()
BOOT_UP, HARDWARE = b"\x00", b"\x00\x50"


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    """A bus of the test's own."""
    name: str = request.node.name
    return name


class BrokenChassis:
    """Wheels whose controller is gone once they are to roll; `at_rest` is set when they were told to stand after it."""

    def __init__(self) -> None:
        self.broken, self.at_rest = False, Flag()

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        if command == AT_REST:
            if self.broken:
                self.at_rest.set()
            return Odometry(0.0, 0.0)
        self.broken = True
        raise OSError(5, "Input/output error")


@pytest.mark.parametrize("on_error", OnError)
def test_a_chassis_that_raises_os_error_is_reported_and_the_wheels_are_told_to_stand(
    channel: str, on_error: OnError
) -> None:
    """The keeper's thread used to end, and nobody stopped the wheels."""
    chassis, reports = BrokenChassis(), Reports()
    drive = Live.node(VirtualBus(channel), Drive(dialects.load("drive"), chassis), report=reports, on_error=on_error)
    with VirtualBus(channel) as other, drive, Live(VirtualBus(channel), Gatekeeper(PROTOCOL)) as tester:
        wait_for(other, 0x702, BOOT_UP)
        tester.send(StartConfigurationSet(TeamColour.RED, 0, 0, 0, 0))
        tester.send(GotoXY(1500, 1000, 0, 50))
        report = reports.wait_for(Event.NODE_FAILED)
        assert chassis.at_rest.wait(LONG)
        wait_for(other, 0x082, HARDWARE)
        if on_error is OnError.RESTART:
            assert report.text == f"OSError: [Errno 5] Input/output error; it is restarted in {FIRST_PAUSE} s"
            wait_for(other, 0x702, BOOT_UP)
            assert drive.failure is None
        else:
            assert report.text == "OSError: [Errno 5] Input/output error; it has ended"
            assert isinstance(drive.failure, NodeFailed)


class ExplodingDrive(Drive):
    """Raises when it is checked, once."""

    exploded = False
    HANDLERS: ClassVar[Handlers] = {**Drive.HANDLERS, CheckDriveRequest: lambda drive, _: drive.checked()}

    def checked(self) -> CheckDriveResponse:
        if not self.exploded:
            self.exploded = True
            raise SystemExit("lamp is gone")
        return CheckDriveResponse()


def test_an_exception_in_what_a_node_does_with_a_frame_restarts_it(channel: str) -> None:
    reports, gatekeeper = Reports(), Gatekeeper(PROTOCOL)
    answers = gatekeeper.add_queue(CheckDriveResponse)
    drive = Live.node(VirtualBus(channel), ExplodingDrive(dialects.load("drive")), report=reports)
    with VirtualBus(channel) as other, drive, Live(VirtualBus(channel), gatekeeper) as tester:
        wait_for(other, 0x702, BOOT_UP)
        tester.send(CheckDriveRequest())
        assert reports.wait_for(Event.NODE_FAILED).text.startswith("SystemExit: lamp is gone; ")
        wait_for(other, 0x702, BOOT_UP)
        tester.send(CheckDriveRequest())
        assert answers.get(LONG) is not None
    assert drive.gatekeeper.statistics().listeners[0].failed == 1


class TiredDrive(Drive):
    """Fails whenever something is due, and that is always."""

    next_wakeup = 0.0

    def tick(self, now: float) -> list[Frame]:
        raise ValueError("never again")


def test_a_node_that_fails_whenever_it_is_called_is_restarted_after_growing_pauses(channel: str) -> None:
    reports = Reports()
    with Live.node(VirtualBus(channel), TiredDrive(dialects.load("drive")), report=reports):
        times = [reports.wait_for(Event.NODE_FAILED).timestamp for _ in range(3)]
    pauses = [later - earlier for earlier, later in pairwise(times)]
    assert all(pause >= planned for pause, planned in zip(pauses, (FIRST_PAUSE, 2 * FIRST_PAUSE)))
