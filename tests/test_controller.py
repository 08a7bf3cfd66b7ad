"""The controller of any device: who hears which frame, which frame leaves next, and what is reported."""

from __future__ import annotations

from collections.abc import Iterable
from random import Random
from typing import Any

import pytest

from eurobot_od.controller import Controller, Event, ListenerStatistics, Report, Stay, TransmitQueue, TransmitStatistics
from eurobot_od.errors import ListenerError, LocalError, StateError
from eurobot_od.frame import Frame
from eurobot_od.pdo.protocol import Protocol
from tests.kit import lift
from tests.kit.lift import CheckCabinRequest, Halt

PDO, SDO, HEARTBEAT = Frame(0x185, b"\1"), Frame(0x585, b"\2"), Frame(0x705, b"\5")
NO_MESSAGES, LIFT = Protocol(()), lift.protocol()


def leaving(queue: TransmitQueue, now: float = 0.0) -> list[Frame]:
    """Take all frames out of a queue, as a controller sends them."""
    frames = []
    while (frame := queue.next(now)) is not None:
        frames.append(frame)
        assert queue.complete(frame)
    return frames


# The queue


def test_any_number_of_frames_waits_without_limit_and_leaves_by_priority() -> None:
    queue, frames = TransmitQueue(), [Frame(number % 0x580, bytes([number % 7])) for number in range(5000)]
    for frame in Random(1).sample(frames, len(frames)):
        queue.submit(frame, 0.0)
    queue.load(1e9)
    assert [frame.cob_id for frame in leaving(queue, 1e9)] == sorted(frame.cob_id for frame in frames)
    assert queue.statistics() == TransmitStatistics(5000, 5000, 0, 0)


def test_frames_of_one_identifier_leave_in_the_order_in_which_they_came() -> None:
    queue, frames = TransmitQueue(), [Frame(0x185, bytes([number])) for number in (3, 1, 2)]
    for frame in frames:
        queue.submit(frame, 0.0)
    assert leaving(queue) == frames


def test_an_urgent_frame_overtakes_one_that_the_bus_has_not_taken_yet() -> None:
    queue = TransmitQueue()
    queue.submit(HEARTBEAT, 0.0, Stay.PERIODIC)
    assert queue.next(0.0) == HEARTBEAT
    queue.submit(PDO, 0.0)
    assert queue.next(0.0) == PDO


def test_only_the_newest_heartbeat_waits() -> None:
    queue, newer = TransmitQueue(), HEARTBEAT._replace(data=b"\4")
    for frame in (HEARTBEAT, newer):
        queue.submit(frame, 0.0, Stay.PERIODIC)
    assert leaving(queue) == [newer]
    assert queue.statistics() == TransmitStatistics(submitted=2, completed=1, dropped=1, waiting=0)


def test_a_transfer_lets_everything_else_go_first() -> None:
    queue = TransmitQueue()
    for _ in range(127):
        queue.submit(SDO, 0.0, Stay.TRANSFER)
    queue.submit(HEARTBEAT, 0.0, Stay.PERIODIC)
    queue.submit(PDO, 0.0)
    assert leaving(queue)[:3] == [PDO, HEARTBEAT, SDO]


def test_an_answer_after_its_timeout_is_withdrawn() -> None:
    queue = TransmitQueue()
    for frame, stay in ((SDO, Stay.TRANSFER), (PDO, Stay.SHORT)):
        queue.submit(frame, 0.0, stay)
    queue.withdraw(SDO.cob_id)
    assert leaving(queue) == [PDO]


def test_while_the_bus_is_lost_only_lasting_frames_are_kept() -> None:
    queue, boot_up = TransmitQueue(), Frame(0x705, b"\0")
    queue.submit(PDO, 0.0)
    queue.leave()
    queue.submit(boot_up, 0.1, Stay.LASTING)
    queue.submit(HEARTBEAT, 0.1, Stay.PERIODIC)
    assert queue.come_back() == 2
    queue.submit(SDO, 0.2, Stay.TRANSFER)
    assert queue.holds(boot_up)
    assert leaving(queue) == [boot_up, SDO]


def test_a_frame_that_does_not_wait_cannot_be_complete() -> None:
    assert not TransmitQueue().complete(PDO)


# Listeners


def heard_by(controller: Controller, cob_ids: Iterable[int], name: str = "lamp") -> list[tuple[Frame, float]]:
    """Return a list that gets what a listener of a controller hears."""
    frames: list[tuple[Frame, float]] = []
    controller.add_frames(lambda: cob_ids, lambda frame, time: frames.append((frame, time)), name)
    return frames


def test_filters_pass_only_frames_with_listeners() -> None:
    controller = Controller(NO_MESSAGES)
    lamp, horn = heard_by(controller, [0x185, 0x705]), heard_by(controller, [0x705], "horn")
    assert [each["can_id"] for each in controller.start()] == [0x185, 0x705]
    for frame in (PDO, SDO, HEARTBEAT):
        controller.receive(frame, 1.5)
    assert (lamp, horn) == ([(PDO, 1.5), (HEARTBEAT, 1.5)], [(HEARTBEAT, 1.5)])
    assert (controller.hears(0x705), controller.hears(0x585)) == (True, False)
    assert controller.statistics() == (
        (ListenerStatistics("lamp", 2, 0), ListenerStatistics("horn", 1, 0)),
        0,
        1,
        TransmitStatistics(0, 0, 0, 0),
    )


def test_a_node_gets_a_frame_before_its_watchers() -> None:
    controller, order = Controller(NO_MESSAGES), list[str]()
    controller.add_frames(lambda: [0x185], lambda *_: order.append("watcher"))
    controller.add_node(lambda: [0x185, 0x185], lambda *_: order.append("node"), "motor")
    controller.start()
    controller.receive(PDO, 0.0)
    assert order == ["node", "watcher"]


class Mute(Exception):
    """An exception that nothing can be said about."""

    def __str__(self) -> str:
        raise self


@pytest.mark.parametrize("error", [ZeroDivisionError, Mute])
def test_a_listener_that_raises_is_reported_and_the_others_get_the_frame(error: type[Exception]) -> None:
    def broken(*_: object) -> None:
        raise error

    reports: list[Report] = []
    controller = Controller(NO_MESSAGES, report=reports.append)
    controller.add_frames(lambda: [0x185], broken, "broken")
    lamp = heard_by(controller, [0x185])
    controller.start()
    controller.receive(PDO, 0.5)
    assert lamp == [(PDO, 0.5)]
    assert [(each.event, each.name, each.timestamp) for each in reports] == [(Event.LISTENER_FAILED, "broken", 0.5)]


def test_listeners_are_added_only_before_the_start() -> None:
    controller = Controller(NO_MESSAGES)
    heard = [heard_by(controller, [0x185], f"lamp {number}") for number in range(100)]
    controller.start()
    controller.receive(PDO, 0.0)
    assert all(heard)
    with pytest.raises(ListenerError, match=r"^horn: the controller has started; listeners are registered before"):
        heard_by(controller, [0x185], "horn")
    with pytest.raises(StateError, match="has started already"):
        controller.start()


@pytest.mark.parametrize(
    ("function", "said"),
    [
        (lambda _: None, "horn: too many positional arguments; it is called with what has come, and"),
        (lambda _a, _b, _c: None, "horn: missing a required argument: '_c'; it is called with"),
        ("horn", "horn: 'horn' is not a callable object; it is called with"),
    ],
)
def test_a_listener_that_cannot_be_called_is_refused(function: Any, said: str) -> None:
    with pytest.raises(ListenerError, match=f"^{said}"):
        Controller(LIFT).add_function(None, function, "horn")


def test_without_a_function_for_reports_they_are_logged_and_kept(caplog: pytest.LogCaptureFixture) -> None:
    controller = Controller(NO_MESSAGES)
    controller.add_frames(lambda: [0x185], lambda *_: 1 / 0, "horn")
    controller.start()
    controller.receive(PDO, 0.5)
    assert [each.getMessage() for each in caplog.records] == [str(each) for each in controller.reports]
    assert controller.reports[0].name == "horn"


def test_a_text_is_no_message() -> None:
    with pytest.raises(LocalError, match="a message is an object of its class"):
        Controller(LIFT).send("Halt", 0.0)  # type: ignore[arg-type]


# Messages: those of a lift, as a neutral catalogue has them


def test_queues_and_functions_get_decoded_messages() -> None:
    controller, heard = Controller(LIFT), list[object]()
    queue = controller.add_queue(CheckCabinRequest)
    controller.add_function(None, lambda message, _: heard.append(message))
    controller.start()
    for message in (CheckCabinRequest(), Halt()):
        controller.receive(LIFT.encode(message), 2.0)
    assert queue.drain() == [(CheckCabinRequest(), 2.0)]
    assert heard == [CheckCabinRequest(), Halt()]


def test_a_full_queue_makes_room_for_the_newest_message() -> None:
    reports: list[Report] = []
    controller = Controller(LIFT, report=reports.append)
    queue = controller.add_queue(Halt, maxsize=2, name="halts")
    controller.start()
    for time in (1.0, 2.0, 3.0):
        controller.receive(LIFT.encode(Halt()), time)
    assert [each.timestamp for each in queue.drain()] == [2.0, 3.0]
    assert [(each.event, each.name) for each in reports] == [(Event.QUEUE_OVERFLOW, "halts")]


def test_only_a_stop_is_kept_while_the_bus_is_lost() -> None:
    controller = Controller(LIFT)
    for message in (CheckCabinRequest(), Halt()):
        controller.send(message, 0.0)
    controller.queue.leave()
    assert leaving(controller.queue) == [LIFT.encode(Halt())]
    assert [controller.acts_always(LIFT.cob_id(kind)) for kind in (Halt, CheckCabinRequest)] == [True, False]
