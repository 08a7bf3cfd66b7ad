"""Nodes that raise exceptions: reported, stopped, and ended or restarted; the cabin does not go on moving."""

from __future__ import annotations

from itertools import pairwise
from threading import Event as Flag
from typing import ClassVar

import pytest
from can.interfaces.virtual import VirtualBus

from eurobot_od.bus.live import Live
from eurobot_od.controller import Controller, Event
from eurobot_od.device.station import OnError
from eurobot_od.errors import NodeFailed
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from eurobot_od.support.connections import FIRST_PAUSE
from tests.bus.live.loose import LONG, Reports, wait_for
from tests.kit import lift
from tests.kit.lift import Cabin, CheckCabinRequest, CheckCabinResponse, Handlers, MoveTo, Ride

PROTOCOL = lift.protocol()
BOOT_UP, HARDWARE = b"\x00", b"\x00\x50"


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    """A bus of the test's own."""
    name: str = request.node.name
    return name


class BrokenCabin(Cabin):
    """A cabin whose motor is gone once it is to move; `at_rest` is set when it was told to stand after that."""

    def __init__(self) -> None:
        self.broken, self.at_rest = False, Flag()
        super().__init__(lift.dictionary("cabin"))

    def _control(self, now: float) -> None:
        if self.moving:
            self.broken = True
            raise OSError(5, "Input/output error")
        super()._control(now)

    def stop(self, why: Message) -> None:
        if self.broken:
            self.at_rest.set()
        super().stop(why)


@pytest.mark.parametrize("on_error", OnError)
def test_a_motor_that_raises_os_error_is_reported_and_told_to_stand(channel: str, on_error: OnError) -> None:
    """The keeper's thread used to end, and nobody stopped the motor."""
    node, reports = BrokenCabin(), Reports()
    cabin = Live.node(VirtualBus(channel), node, report=reports, on_error=on_error)
    with VirtualBus(channel) as other, cabin, Live(VirtualBus(channel), Controller(PROTOCOL)) as tester:
        wait_for(other, 0x702, BOOT_UP)
        tester.send(MoveTo(1500, Ride.NORMAL, 50))
        report = reports.wait_for(Event.NODE_FAILED)
        assert node.at_rest.wait(LONG)
        wait_for(other, 0x082, HARDWARE)
        if on_error is OnError.RESTART:
            assert report.text == f"OSError: [Errno 5] Input/output error; it is restarted in {FIRST_PAUSE} s"
            wait_for(other, 0x702, BOOT_UP)
            assert cabin.failure is None
        else:
            assert report.text == "OSError: [Errno 5] Input/output error; it has ended"
            assert isinstance(cabin.failure, NodeFailed)


class ExplodingCabin(Cabin):
    """Raises when it is checked, once."""

    exploded = False
    HANDLERS: ClassVar[Handlers] = {**Cabin.HANDLERS, CheckCabinRequest: lambda cabin, _: cabin.checked()}

    def checked(self) -> CheckCabinResponse:
        if not self.exploded:
            self.exploded = True
            raise SystemExit("lamp is gone")
        return CheckCabinResponse()


def test_an_exception_in_what_a_node_does_with_a_frame_restarts_it(channel: str) -> None:
    reports, controller = Reports(), Controller(PROTOCOL)
    answers = controller.add_queue(CheckCabinResponse)
    cabin = Live.node(VirtualBus(channel), ExplodingCabin(lift.dictionary("cabin")), report=reports)
    with VirtualBus(channel) as other, cabin, Live(VirtualBus(channel), controller) as tester:
        wait_for(other, 0x702, BOOT_UP)
        tester.send(CheckCabinRequest())
        assert reports.wait_for(Event.NODE_FAILED).text.startswith("SystemExit: lamp is gone; ")
        wait_for(other, 0x702, BOOT_UP)
        tester.send(CheckCabinRequest())
        assert answers.get(LONG) is not None
    assert cabin.controller.statistics().listeners[0].failed == 1


class TiredCabin(Cabin):
    """Fails whenever something is due, and that is always."""

    next_wakeup = 0.0

    def tick(self, now: float) -> list[Frame]:
        super().tick(now)
        raise ValueError("never again")


def test_a_node_that_fails_whenever_it_is_called_is_restarted_after_growing_pauses(channel: str) -> None:
    reports = Reports()
    with Live.node(VirtualBus(channel), TiredCabin(lift.dictionary("cabin")), report=reports):
        times = [reports.wait_for(Event.NODE_FAILED).timestamp for _ in range(3)]
    pauses = [later - earlier for earlier, later in pairwise(times)]
    assert all(pause >= planned for pause, planned in zip(pauses, (FIRST_PAUSE, 2 * FIRST_PAUSE)))


def test_a_program_whose_node_has_failed_does_not_end_as_if_all_were_well(
    channel: str, caplog: pytest.LogCaptureFixture
) -> None:
    """The node is restarted, and nobody is told by a `report`: the block ends with what has failed."""
    controller = Controller(PROTOCOL)
    answers = controller.add_queue(CheckCabinResponse)
    cabin = Live.node(VirtualBus(channel), ExplodingCabin(lift.dictionary("cabin")))
    with Live(VirtualBus(channel), controller) as tester, VirtualBus(channel) as other:
        cabin.start()
        for _ in range(2):  # it is restarted, and answers
            wait_for(other, 0x702, BOOT_UP)
            tester.send(CheckCabinRequest())
        assert answers.get(LONG) is not None
        with pytest.raises(NodeFailed, match=r"^cabin has failed 1 time, last with SystemExit: lamp is gone$"):
            cabin.stop()
    assert [each.levelname for each in caplog.records if each.name == "eurobot_od.node"] == ["ERROR"]
