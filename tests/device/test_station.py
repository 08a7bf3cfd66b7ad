"""A station: what its node's settings size, and the way of frames to the node and from it."""

from __future__ import annotations

import math
from typing import ClassVar

import pytest

from eurobot_od.controller import Event, Report
from eurobot_od.device.station import OnError, Station
from eurobot_od.frame import Frame
from eurobot_od.od.values import NOT_VALID
from tests.kit import lift
from tests.kit.lift import Cabin, CheckCabinRequest, CheckCabinResponse, Halt, Handlers, MoveConfirm, MoveTo, Ride

PROTOCOL = lift.protocol()
BOOT_UP = Frame(0x702, b"\x00")


@pytest.fixture
def station() -> Station:
    station = Station(Cabin(lift.dictionary("cabin")))
    station.controller.start()
    return station


def sent(station: Station, now: float = 0.0) -> list[Frame]:
    """Take the frames out of the mailboxes, as a controller without a queue would send them."""
    frames = []
    station.controller.queue.load(now)
    while (frame := station.controller.queue.urgent()) is not None:
        frames.append(frame)
        station.controller.queue.complete(frame)
        station.controller.queue.load(now)
    return frames


def test_frames_of_the_node_go_to_the_mailboxes(station: Station) -> None:
    station.start(0.0)
    assert sent(station) == [BOOT_UP]


def test_a_frame_in_a_mailbox_does_not_expire(station: Station) -> None:
    station.start(0.0)
    assert sent(station, 1.0) == [BOOT_UP]


def test_received_frames_are_handled_and_answers_go_to_the_mailboxes(station: Station) -> None:
    station.start(0.0)
    station.controller.receive(PROTOCOL.encode(CheckCabinRequest()), 0.5)
    station.controller.receive(PROTOCOL.encode(MoveTo(500, Ride.NORMAL, 50)), 0.5)
    answers = [PROTOCOL.encode(MoveConfirm()), PROTOCOL.encode(CheckCabinResponse())]
    assert sent(station) == [*answers, BOOT_UP]  # the most urgent first


def test_a_message_that_a_master_moves_comes_to_the_node_at_its_new_place(station: Station) -> None:
    station.start(0.0)
    for entry in (NOT_VALID | 0x123, 0x123):  # a valid PDO cannot be changed
        station.controller.receive(Frame(0x602, bytes.fromhex("23031401") + entry.to_bytes(4, "little")), 0.5)
    sent(station)
    station.controller.receive(PROTOCOL.encode(MoveTo(500, Ride.NORMAL, 50))._replace(cob_id=0x123), 0.5)
    assert sent(station) == [PROTOCOL.encode(MoveConfirm())]


def test_the_station_wakes_when_its_node_wants_to(station: Station) -> None:
    station.start(0.0)
    sent(station)
    wakeup = station.next_wakeup
    assert wakeup == station.node.next_wakeup == 1.0
    station.tick(1.0)
    assert sent(station, 1.0) == [Frame(0x702, b"\x05")]  # the heartbeat


def test_filters_let_through_what_the_node_listens_to() -> None:
    node = Cabin(lift.dictionary("cabin"))
    station = Station(node)
    filters = [each["can_id"] for each in station.controller.start()]
    assert filters == sorted(node.device.identifiers)
    assert {0x000, PROTOCOL.cob_id(Halt), PROTOCOL.cob_id(MoveTo)} <= set(filters)
    assert PROTOCOL.cob_id(MoveConfirm) not in filters


def test_a_node_wakes_nobody_for_an_answer_that_goes_out_at_once(station: Station) -> None:
    woken: list[float] = []
    station.node.wake = lambda: woken.append(station.node.now)
    station.start(0.0)
    station.controller.receive(PROTOCOL.encode(CheckCabinRequest()), 0.5)
    station.tick(1.0)
    assert woken == []
    station.node.offer(MoveConfirm())  # from outside: nobody else would see to it
    assert woken == [1.0]


class FailingCabin(Cabin):
    """Fails whenever it is checked."""

    HANDLERS: ClassVar[Handlers] = {**Cabin.HANDLERS, CheckCabinRequest: lambda *_: 1 / 0}  # type: ignore[dict-item]


def failing(on_error: OnError | None) -> tuple[Station, list[Report]]:
    reports: list[Report] = []
    # A clock that stands still: on a busy machine the cabin would be reported as slow, too.
    cabin, clock = FailingCabin(lift.dictionary("cabin")), lambda: 0.0
    station = Station(cabin, report=reports.append, clock=clock, on_error=on_error)
    station.controller.start()
    station.start(0.0)
    return station, reports


def check(station: Station, now: float) -> list[Frame]:
    """Make the node fail; return the frames that leave then."""
    sent(station, now)
    station.controller.receive(PROTOCOL.encode(CheckCabinRequest()), now)
    return sent(station, now)


EMCY = Frame(0x082, bytes.fromhex("0061010000000000"))


def test_a_node_that_fails_is_restarted_after_pauses_that_grow_until_it_is_steady() -> None:
    station, reports = failing(OnError.RESTART)
    for now, pause in ((1.0, 0.1), (2.0, 0.2), (3.0, 0.4), (30.0, 0.1)):
        assert check(station, now) == [EMCY]
        assert station.next_wakeup == now + pause
        assert check(station, now) == []  # it is down
        station.tick(now + pause)
        assert sent(station, now + pause) == [BOOT_UP]
        assert str(reports.pop()) == (
            f"node failed: cabin: ZeroDivisionError: division by zero; it is restarted in {pause} s"
        )
    assert station.failure is None
    assert station.controller.statistics().listeners[0].failed == 4


def test_a_node_that_fails_is_ended() -> None:
    station, reports = failing(OnError.END)
    assert check(station, 1.0) == [EMCY]
    assert station.next_wakeup == math.inf
    station.tick(100.0)
    assert sent(station, 100.0) == []
    assert str(station.failure) == "cabin has failed and ended: ZeroDivisionError: division by zero"
    assert str(reports[-1]).endswith("division by zero; it has ended")


def test_in_a_simulation_a_frame_that_makes_a_node_fail_is_reported_and_nothing_else() -> None:
    station, reports = failing(None)
    assert check(station, 1.0) == []
    assert [report.event for report in reports] == [Event.LISTENER_FAILED]


def test_a_flood_of_sdo_blocks_leaves_one_transfer_and_a_cabin_that_answers(station: Station) -> None:
    """The queue grew without a bound, and the cabin did not answer for half a minute."""
    station.start(0.0)
    blocks = [Frame(0x602, bytes.fromhex(data)) for data in ("a4211000 7f000000", "a300000000000000")]
    for _ in range(500):
        for request in blocks:
            station.controller.receive(request, 0.5)
    assert station.controller.queue.statistics().waiting <= 127 + 1  # a block, and the boot-up message
    sent(station, 0.5)
    station.controller.receive(Frame(0x602, bytes.fromhex("4000100000000000")), 0.5)
    assert [frame.data[:4].hex() for frame in sent(station, 0.5)] == ["43001000"]


def test_exceptions_of_handlers_are_logged_with_traceback(caplog: pytest.LogCaptureFixture) -> None:
    class Broken(Cabin):
        def tick(self, now: float) -> list[Frame]:
            super().tick(now)
            raise ZeroDivisionError("of a handler")

    node = Broken(lift.dictionary("cabin"))
    Station(node, on_error=OnError.END).tick(1.0)
    (record,) = (each for each in caplog.records if each.name == "eurobot_od.node")
    assert record.levelname == "ERROR"
    assert record.exc_info is not None
    assert "of a handler" in str(record.exc_info[1])


def test_a_failure_that_comes_again_is_logged_once_and_counted(caplog: pytest.LogCaptureFixture) -> None:
    station, _ = failing(OnError.RESTART)
    for now in (1.0, 2.0, 3.0):
        check(station, now)
        station.tick(now + 0.5)
    assert sum(each.name == "eurobot_od.node" for each in caplog.records) == 1
    assert str(station.last_failure) == "cabin has failed 3 times, last with ZeroDivisionError: division by zero"
