"""A bus that is lost while nodes run on it, and comes back."""

from __future__ import annotations

import can
import pytest
from can.interfaces.virtual import VirtualBus

from eurobot_od.bus.live import Driver, Live
from eurobot_od.controller import Controller, Event
from eurobot_od.errors import BusError
from eurobot_od.od.standard import ErrorCode
from tests.bus.live.loose import LONG, Cable, Reports, wait_for
from tests.kit import lift
from tests.kit.lift import (
    Cabin,
    CheckCabinRequest,
    CheckCabinResponse,
    Halt,
    MoveConfirm,
    MoveTo,
    Ride,
    StateRequest,
)

PROTOCOL = lift.protocol()
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
    reports, controller = Reports(), Controller(PROTOCOL)
    answers = controller.add_queue(CheckCabinResponse)
    cabin = Live.node(cable.open(), Cabin(lift.dictionary("cabin")), opener=cable.open, report=reports)
    with cabin, Live(VirtualBus(cable.channel), controller) as tester:
        cable.error = UNPLUGGED
        lost = reports.wait_for(Event.BUS_FAILED)
        cable.error = None
        back = reports.wait_for(Event.BUS_BACK)
        tester.send(CheckCabinRequest())
        assert answers.get(LONG) is not None
        assert (cabin.failure, cabin.gaps.number, cabin.bus) == (None, 1, cable.buses[-1])
        assert cabin.gaps.seconds == pytest.approx(back.timestamp - lost.timestamp, abs=0.5)
    assert str(lost) == (
        f"bus failed: Virtual bus channel {cable.channel}: the bus Virtual bus channel {cable.channel} failed: "
        "[Errno 100] Network is down; it is opened again"
    )
    assert "after a gap of " in back.text
    assert all(bus.closed for bus in cable.buses)


def test_receive_filters_are_set_again(cable: Cable, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(can.interfaces.BACKENDS, "socketcan", ("tests.bus.live.loose", "LooseBus"))
    reports = Reports()
    controller = Controller(PROTOCOL, report=reports)
    controller.add_queue(Halt)
    with Live(cable.open(), controller, opener=cable.open):
        cable.error = UNPLUGGED
        reports.wait_for(Event.BUS_FAILED)
        cable.error = None
        reports.wait_for(Event.BUS_BACK)
    assert cable.buses[-1].applied == controller.filters() != []


def test_of_what_is_sent_meanwhile_stops_are_kept_and_nothing_else(cable: Cable) -> None:
    reports = Reports()
    controller = Controller(PROTOCOL, report=reports)
    with VirtualBus(cable.channel) as other, Live(cable.open(), controller, opener=cable.open) as live:
        cable.error = UNPLUGGED
        reports.wait_for(Event.BUS_FAILED)
        for message in (MoveTo(500, Ride.NORMAL, 50), Halt(), StateRequest()):
            live.send(message)
        cable.error = None
        assert reports.wait_for(Event.BUS_BACK).text.endswith("in which 2 frames were not sent")
        live.send(CheckCabinRequest())
        heard = [message.arbitration_id for message in (other.recv(LONG), other.recv(LONG)) if message is not None]
    assert heard == [PROTOCOL.cob_id(Halt), PROTOCOL.cob_id(CheckCabinRequest)]


def test_a_cabin_brakes_when_its_bus_is_lost_and_says_so_when_it_is_back(cable: Cable) -> None:
    reports, node = Reports(), Cabin(lift.dictionary("cabin"))
    cabin = Live.node(cable.open(), node, opener=cable.open, report=reports)
    with VirtualBus(cable.channel) as other, cabin, Live(VirtualBus(cable.channel), Controller(PROTOCOL)) as tester:
        tester.send(MoveTo(1500, Ride.NORMAL, 50))
        wait_for(other, PROTOCOL.cob_id(MoveConfirm))
        cable.error = UNPLUGGED
        reports.wait_for(Event.BUS_FAILED)
        assert not node.moving
        cable.error = None
        emergency = wait_for(other, 0x082)
    assert int.from_bytes(emergency[:2], "little") == ErrorCode.BUS_LOST


REFUSED = can.CanOperationError("Failed to transmit: Network is down", 100)
REFUSED.__cause__ = UNPLUGGED


def test_a_drivers_can_error_on_sending_becomes_a_failure(cable: Cable) -> None:
    """SocketCAN turns what the kernel says into a CanError."""
    reports = Reports()
    with Live(cable.open(), Controller(PROTOCOL, report=reports), opener=cable.open) as live:
        cable.error = REFUSED
        live.send(Halt())
        assert "Network is down" in reports.wait_for(Event.BUS_FAILED).text
        cable.error = None
        reports.wait_for(Event.BUS_BACK)


def test_without_an_opener_the_failure_lasts(channel: str) -> None:
    cable, reports = Cable(channel), Reports()
    with Live(cable.open(), Controller(PROTOCOL, report=reports)) as live:
        cable.error = UNPLUGGED
        assert not reports.wait_for(Event.BUS_FAILED).text.endswith("opened again")
        assert isinstance(live.failure, BusError)
        cable.error = None
    assert len(cable.buses) == 1


def test_the_end_does_not_wait_for_a_bus_that_stays_away(channel: str) -> None:
    cable, reports = Cable(channel), Reports()
    with Live(cable.open(), Controller(PROTOCOL, report=reports), opener=cable.open) as live:
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
