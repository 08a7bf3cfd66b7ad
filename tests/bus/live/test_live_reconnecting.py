"""A bus that is lost while nodes run on it, and comes back."""

from __future__ import annotations

import can
import pytest
from can.interfaces.virtual import VirtualBus

from eurobot_od.bus.live import Driver, Live
from eurobot_od.errors import BusError
from eurobot_od.gatekeeper import Event, Gatekeeper
from eurobot_od.od.standard import ErrorCode
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    CheckDriveResponse,
    GotoConfirm,
    GotoStateRequest,
    GotoXY,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.values import Outcome, TeamColour
from eurobot_od.robot.nodes import Core, Drive, Navigation
from eurobot_od.robot.protocol import EurobotProtocol
from tests.bus.live.loose import LONG, Cable, Reports, wait_for

PROTOCOL = EurobotProtocol.load()
UNPLUGGED = OSError(100, "Network is down")


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    """A bus of the test's own."""
    name: str = request.node.name
    return name


@pytest.fixture(params=[False, True], ids=["does not open", "opens and fails when read"])
def cable(request: pytest.FixtureRequest, channel: str) -> Cable:
    return Cable(channel, request.param)


def test_an_interface_that_goes_down_and_up_again_leaves_no_deaf_node(cable: Cable) -> None:
    reports, gatekeeper = Reports(), Gatekeeper(PROTOCOL)
    answers = gatekeeper.add_queue(CheckDriveResponse)
    drive = Live.node(cable.open(), Drive(dialects.load("drive")), opener=cable.open, report=reports)
    with drive, Live(VirtualBus(cable.channel), gatekeeper) as tester:
        cable.error = UNPLUGGED
        lost = reports.wait_for(Event.BUS_FAILED)
        cable.error = None
        back = reports.wait_for(Event.BUS_BACK)
        tester.send(CheckDriveRequest())
        assert answers.get(LONG) is not None
        assert (drive.failure, drive.gaps.number, drive.bus) == (None, 1, cable.buses[-1])
        assert drive.gaps.seconds == pytest.approx(back.timestamp - lost.timestamp, abs=0.5)
    assert str(lost) == (
        f"bus failed: Virtual bus channel {cable.channel}: the bus Virtual bus channel {cable.channel} failed: "
        "[Errno 100] Network is down; it is opened again"
    )
    assert "after a gap of " in back.text
    assert all(bus.closed for bus in cable.buses)


def test_receive_filters_are_set_again(cable: Cable, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(can.interfaces.BACKENDS, "socketcan", ("tests.bus.live.loose", "LooseBus"))
    reports = Reports()
    gatekeeper = Gatekeeper(PROTOCOL, report=reports)
    gatekeeper.add_queue(StopDrive)
    with Live(cable.open(), gatekeeper, opener=cable.open):
        cable.error = UNPLUGGED
        reports.wait_for(Event.BUS_FAILED)
        cable.error = None
        reports.wait_for(Event.BUS_BACK)
    assert cable.buses[-1].applied == gatekeeper.filters() != []


def test_of_what_is_sent_meanwhile_stops_are_kept_and_nothing_else(cable: Cable) -> None:
    reports = Reports()
    gatekeeper = Gatekeeper(PROTOCOL, report=reports)
    with VirtualBus(cable.channel) as other, Live(cable.open(), gatekeeper, opener=cable.open) as live:
        cable.error = UNPLUGGED
        reports.wait_for(Event.BUS_FAILED)
        for message in (GotoXY(500, 500, 0, 50), StopDrive(), GotoStateRequest()):
            live.send(message)
        cable.error = None
        assert reports.wait_for(Event.BUS_BACK).text.endswith("in which 2 frames were not sent")
        live.send(CheckDriveRequest())
        heard = [message.arbitration_id for message in (other.recv(LONG), other.recv(LONG)) if message is not None]
    assert heard == [PROTOCOL.cob_id(StopDrive), PROTOCOL.cob_id(CheckDriveRequest)]


def test_a_drive_brakes_when_its_bus_is_lost_and_says_so_when_it_is_back(cable: Cable) -> None:
    reports, node = Reports(), Drive(dialects.load("drive"))
    drive = Live.node(cable.open(), node, opener=cable.open, report=reports)
    with VirtualBus(cable.channel) as other, drive, Live(VirtualBus(cable.channel), Gatekeeper(PROTOCOL)) as tester:
        tester.send(StartConfigurationSet(TeamColour.RED, 0, 0, 0, 0))
        tester.send(GotoXY(1500, 1000, 0, 50))
        wait_for(other, PROTOCOL.cob_id(GotoConfirm))
        cable.error = UNPLUGGED
        reports.wait_for(Event.BUS_FAILED)
        assert node.goto is None
        cable.error = None
        emergency = wait_for(other, 0x082)
    assert int.from_bytes(emergency[:2], "little") == ErrorCode.BUS_LOST


def test_a_core_ends_its_goto_and_recovers_before_the_next(channel: str) -> None:
    cable, reports, core = Cable(channel), Reports(), Core(dialects.load("core"))
    with (
        Live.node(VirtualBus(channel), Drive(dialects.load("drive"))),
        Live.node(VirtualBus(channel), Navigation(dialects.load("navigation"))),
        Live.node(cable.open(), core, opener=cable.open, report=reports),
    ):
        core.check_nodes().result(LONG)
        core.configure_start(TeamColour.RED).result(LONG)
        goto = core.goto(1500, 1000, 0, 50)
        cable.error = UNPLUGGED
        assert goto.result(LONG).outcome is Outcome.LOST
        cable.error = None
        reports.wait_for(Event.BUS_BACK)
        core.stop().result(LONG)
        assert core.goto(350, 1750, 0, 100).result(LONG).outcome is not Outcome.LOST


REFUSED = can.CanOperationError("Failed to transmit: Network is down", 100)
REFUSED.__cause__ = UNPLUGGED


def test_a_drivers_can_error_on_sending_becomes_a_failure(cable: Cable) -> None:
    """SocketCAN turns what the kernel says into a CanError."""
    reports = Reports()
    with Live(cable.open(), Gatekeeper(PROTOCOL, report=reports), opener=cable.open) as live:
        cable.error = REFUSED
        live.send(StopDrive())
        assert "Network is down" in reports.wait_for(Event.BUS_FAILED).text
        cable.error = None
        reports.wait_for(Event.BUS_BACK)


def test_without_an_opener_the_failure_lasts(channel: str) -> None:
    cable, reports = Cable(channel), Reports()
    with Live(cable.open(), Gatekeeper(PROTOCOL, report=reports)) as live:
        cable.error = UNPLUGGED
        assert not reports.wait_for(Event.BUS_FAILED).text.endswith("opened again")
        assert isinstance(live.failure, BusError)
        cable.error = None
    assert len(cable.buses) == 1


def test_the_end_does_not_wait_for_a_bus_that_stays_away(channel: str) -> None:
    cable, reports = Cable(channel), Reports()
    with Live(cable.open(), Gatekeeper(PROTOCOL, report=reports), opener=cable.open) as live:
        cable.error = UNPLUGGED
        reports.wait_for(Event.BUS_FAILED)
    assert live.gaps.number == 0


class StubbornBus(VirtualBus):
    """A bus whose end fails, as python-can-remote's does when its server has gone."""

    def shutdown(self) -> None:
        raise OSError(107, "Transport endpoint is not connected")


def test_a_lost_bus_that_cannot_be_shut_down_is_not_shut_down_again(channel: str) -> None:
    """It ended in a traceback, when python-can tried again at a time of its own."""
    stubborn = StubbornBus(channel)
    driver = Driver(stubborn)
    driver.replace(lambda: VirtualBus(channel))
    stubborn.__del__()
    driver.bus.shutdown()
