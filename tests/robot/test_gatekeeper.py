"""The gatekeeper: registration, filters, delivery, harm done by listeners and frames, and sending."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import can
import pytest

from eurobot_od.controller import (
    Event,
    FunctionListener,
    ListenerStatistics,
    MessageQueue,
    Received,
    Report,
    TransmitStatistics,
)
from eurobot_od.errors import FieldError, ListenerError, StateError, UnknownName
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.gatekeeper import Gatekeeper
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    EmergencyStop,
    GotoConfirm,
    GotoStateResponse,
    GotoXY,
    StopDrive,
)
from eurobot_od.robot.model.values import Obstacle
from eurobot_od.robot.protocol import EurobotProtocol

PROTOCOL = EurobotProtocol.load()
GOTO = GotoXY(x=1234, y=567, angle=89, speed=75)
GOTO_FRAME = PROTOCOL.encode(GOTO)
STOP_FRAME = PROTOCOL.encode(StopDrive())
SHORT_GOTO_FRAME = Frame(GOTO_FRAME.cob_id, GOTO_FRAME.data[:5])


class Heard(list[Received[Any]]):
    """A listener that keeps what it is called with."""

    def __call__(self, message: object, timestamp: float) -> None:
        self.append(Received(message, timestamp))


def ignore(*_: object) -> None:
    """A listener that does nothing."""


class Clock:
    """A clock that goes on only when told."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now

    def run(self, seconds: float) -> None:
        self.now += seconds


class Broken(Exception):
    """What a broken listener raises."""


def broken(*_: object) -> None:
    raise Broken("lamp\nis gone")


# Registration

REGISTRATIONS: dict[str, Callable[[Gatekeeper], object]] = {
    "queue of Goto XY": lambda gatekeeper: gatekeeper.add_queue(GotoXY),
    "gotos": lambda gatekeeper: gatekeeper.add_queue(GotoXY, name="gotos"),
    "ignore": lambda gatekeeper: gatekeeper.add_function(GotoXY, ignore),
    "dict.setdefault": lambda gatekeeper: gatekeeper.add_function(GotoXY, dict[Any, Any]().setdefault),
    "lamp": lambda gatekeeper: gatekeeper.add_function(GotoXY, ignore, "lamp"),
    "functools.partial(": lambda gatekeeper: gatekeeper.add_function(GotoXY, partial(ignore, 1)),
    "print": lambda gatekeeper: gatekeeper.add_frames(lambda: (0x008,), ignore, "print"),
    "drive": lambda gatekeeper: gatekeeper.add_node(lambda: (0x008,), ignore, "drive"),
    "queue of all messages": lambda gatekeeper: gatekeeper.add_queue(None),
    "log": lambda gatekeeper: gatekeeper.add_function(None, ignore, "log"),
}


@pytest.mark.parametrize(("name", "register"), REGISTRATIONS.items())
def test_registration_after_the_start_names_the_listener(name: str, register: Callable[[Gatekeeper], object]) -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    gatekeeper.start()
    with pytest.raises(ListenerError, match="the controller has started") as error:
        register(gatekeeper)
    assert str(error.value).startswith(name)


@pytest.mark.parametrize(("name", "register"), REGISTRATIONS.items())
def test_registration_in_a_full_table_names_listener_and_size(
    name: str, register: Callable[[Gatekeeper], object]
) -> None:
    gatekeeper = Gatekeeper(PROTOCOL, table_size=2)
    gatekeeper.add_queue(StopDrive)
    gatekeeper.add_function(StopDrive, ignore)
    with pytest.raises(ListenerError, match="full, it has 2 places") as error:
        register(gatekeeper)
    assert str(error.value).startswith(name)


@pytest.mark.parametrize("register", [Gatekeeper.add_queue, partial(Gatekeeper.add_function, function=ignore)])
def test_registration_for_a_type_that_is_no_message(register: Callable[..., object]) -> None:
    with pytest.raises(UnknownName, match="Clock"):
        register(Gatekeeper(PROTOCOL), message_type=Clock)


def test_start_twice_is_a_state_error() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    gatekeeper.start()
    with pytest.raises(StateError, match="started already"):
        gatekeeper.start()


# Filters


def test_filters_are_the_identifiers_listened_to_and_no_others() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    gatekeeper.add_queue(GotoXY)
    gatekeeper.add_function(GotoXY, ignore)
    gatekeeper.add_frames(lambda: (0x605, 0x000, 0x605), ignore)
    assert gatekeeper.start() == [
        {"can_id": cob_id, "can_mask": 0x7FF, "extended": False} for cob_id in (0x000, 0x008, 0x605)
    ]


def test_frames_of_a_node_are_those_it_wants_at_the_start() -> None:
    wanted = [0x605]
    gatekeeper = Gatekeeper(PROTOCOL)
    gatekeeper.add_frames(lambda: wanted, ignore)
    wanted[:] = [0x606]
    assert [each["can_id"] for each in gatekeeper.start()] == [0x606]


def test_filters_are_what_python_can_understands() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    gatekeeper.add_queue(GotoXY)
    channel = test_filters_are_what_python_can_understands.__name__
    with can.Bus(channel, interface="virtual") as ours, can.Bus(channel, interface="virtual") as theirs:
        ours.set_filters(gatekeeper.start())
        for cob_id, extended in ((0x009, False), (0x008, True), (0x008, False)):
            theirs.send(can.Message(arbitration_id=cob_id, is_extended_id=extended))
        message = ours.recv(1.0)
        assert message is not None
        assert (message.arbitration_id, message.is_extended_id) == (0x008, False)
        assert ours.recv(0) is None


# Delivery


def test_all_queues_and_functions_of_a_message_get_it() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    first, second = Heard(), Heard()
    queues = [gatekeeper.add_queue(GotoXY), gatekeeper.add_queue(GotoXY)]
    gatekeeper.add_function(GotoXY, first)
    gatekeeper.add_function(GotoXY, second)
    gatekeeper.start()
    gatekeeper.receive(GOTO_FRAME, 1.5)
    expected = [Received(GOTO, 1.5)]
    assert [first, second, *(queue.drain() for queue in queues)] == [expected] * 4


def test_listeners_get_only_their_message() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    queue = gatekeeper.add_queue(GotoXY)
    gatekeeper.add_queue(StopDrive)
    gatekeeper.start()
    gatekeeper.receive(STOP_FRAME, 1.0)
    assert queue.drain() == []


def test_nodes_are_served_first_then_queues_then_functions_each_in_the_order_of_registration() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    order: list[str] = []

    def note(name: str) -> Callable[..., object]:
        return lambda *_: order.append(f"{name}, {len(queue)} queued")

    gatekeeper.add_function(GotoXY, note("function 1"))
    queue = gatekeeper.add_queue(GotoXY)
    gatekeeper.add_node(lambda: (0x008,), note("node 1"), "node 1")
    gatekeeper.add_function(GotoXY, note("function 2"))
    gatekeeper.add_node(lambda: (0x008,), note("node 2"), "node 2")
    gatekeeper.start()
    gatekeeper.receive(GOTO_FRAME, 1.0)
    assert order == ["node 1, 0 queued", "node 2, 0 queued", "function 1, 1 queued", "function 2, 1 queued"]


def test_a_listener_without_a_type_gets_every_message() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    heard = Heard()
    queue: MessageQueue[Message] = gatekeeper.add_queue(None)
    gatekeeper.add_function(None, heard)
    assert [each["can_id"] for each in gatekeeper.start()] == [each.cob_id for each in PROTOCOL.bindings]
    gatekeeper.receive(GOTO_FRAME, 1.0)
    gatekeeper.receive(STOP_FRAME, 2.0)
    assert heard == queue.drain() == [Received(GOTO, 1.0), Received(StopDrive(), 2.0)]


def test_functions_run_in_their_executor_nodes_and_queues_in_place() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    node, function, frames = Heard(), Heard(), Heard()
    gatekeeper.add_function(GotoXY, function)
    gatekeeper.add_frames(lambda: (0x008,), frames)
    gatekeeper.add_node(lambda: (0x008,), node, "drive")
    queue = gatekeeper.add_queue(GotoXY)
    later: list[tuple[FunctionListener[Any], object, float]] = []
    gatekeeper.call_function = lambda *call: later.append(call)
    gatekeeper.start()
    gatekeeper.receive(GOTO_FRAME, 1.0)
    assert (node, queue.drain(), frames, function) == ([(GOTO_FRAME, 1.0)], [(GOTO, 1.0)], [], [])
    for listener, heard, timestamp in later:
        listener.call(heard, timestamp)
    assert (frames, function) == ([(GOTO_FRAME, 1.0)], [(GOTO, 1.0)])


# What a driver hands over, in a buffer of its own.
BUFFERS = {"whole": GOTO_FRAME.data, "without the optional fields": GOTO_FRAME.data[:6]}


@pytest.mark.parametrize("data", BUFFERS.values(), ids=BUFFERS)
def test_data_of_listeners_does_not_change_with_the_driver_s_buffer(data: bytes) -> None:
    gatekeeper = Gatekeeper(PROTOCOL, clock=Clock())
    nodes, function = Heard(), Heard()
    gatekeeper.add_node(lambda: (0x008,), nodes, "node 1")
    gatekeeper.add_node(lambda: (0x008,), nodes, "node 2")
    gatekeeper.add_function(GotoXY, function)
    queue = gatekeeper.add_queue(GotoXY)
    gatekeeper.start()
    buffer = bytearray(data)
    gatekeeper.receive_data(0x008, buffer, 1.0)
    buffer[:] = b"\x55" * len(buffer)
    assert nodes == [Received(Frame(0x008, data), 1.0)] * 2
    assert {type(each.message.data) for each in nodes} == {bytes}
    assert function == queue.drain() == [Received(GOTO, 1.0)]


def test_a_node_gets_the_frames_of_all_its_identifiers_once() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    heard = Heard()
    gatekeeper.add_frames(lambda: (0x000, 0x008, 0x008), heard)
    gatekeeper.start()
    frames = [(Frame(0x000, b"\x01\x00"), 1.0), (GOTO_FRAME, 2.0)]
    for frame, timestamp in frames:
        gatekeeper.receive(frame, timestamp)
    assert heard == frames


def test_frames_before_the_start_and_of_others_are_only_counted() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    queue = gatekeeper.add_queue(GotoXY)
    gatekeeper.receive(GOTO_FRAME, 1.0)
    gatekeeper.start()
    gatekeeper.receive(STOP_FRAME, 2.0)
    gatekeeper.receive(Frame(0x7FF), 3.0)
    assert (len(queue), gatekeeper.statistics().unheard, list(gatekeeper.reports)) == (0, 3, [])


# Faults of the 2014 robot


def test_2014_a_dataless_message_never_carries_the_data_of_the_one_before() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    heard = Heard()
    gatekeeper.add_function(GotoXY, heard)
    gatekeeper.add_function(StopDrive, heard)
    gatekeeper.start()
    gatekeeper.receive(GOTO_FRAME, 1.0)
    gatekeeper.receive(STOP_FRAME, 2.0)
    assert heard == [Received(GOTO, 1.0), Received(StopDrive(), 2.0)]


def test_2014_listener_21_and_later_are_heard_or_refused_by_name() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    queues = [gatekeeper.add_queue(GotoXY) for _ in range(50)]
    gatekeeper.start()
    gatekeeper.receive(GOTO_FRAME, 1.0)
    assert [len(queue) for queue in queues] == [1] * 50

    table_of_2014 = Gatekeeper(PROTOCOL, table_size=20)
    for number in range(1, 21):
        table_of_2014.add_queue(GotoXY, name=f"listener {number}")
    with pytest.raises(ListenerError, match="listener 21: the listener table is full, it has 20 places"):
        table_of_2014.add_queue(GotoXY, name="listener 21")


def test_2014_a_full_queue_keeps_the_newer_message_and_says_so() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    queue = gatekeeper.add_queue(GotoStateResponse, maxsize=2)
    gatekeeper.start()
    for time in range(3):
        gatekeeper.receive(PROTOCOL.encode(GotoStateResponse(time)), float(time))
    assert [each.message.time for each in queue.drain()] == [1, 2]
    assert [str(each) for each in gatekeeper.reports] == [
        "queue overflow: queue of Goto State Response: full with 2 messages, 1 lost so far; the newest are kept"
    ]


# Listeners that do harm


def test_a_listener_that_raises_is_named_and_the_others_get_the_message() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    heard = Heard()
    gatekeeper.add_function(GotoXY, broken)
    gatekeeper.add_function(GotoXY, heard)
    gatekeeper.start()
    for timestamp in (1.0, 2.0):
        gatekeeper.receive(GOTO_FRAME, timestamp)
    assert heard == [Received(GOTO, 1.0), Received(GOTO, 2.0)]
    assert [str(each) for each in gatekeeper.reports] == ["listener failed: broken: Broken: lamp is gone"] * 2
    assert isinstance(gatekeeper.reports[0].error, Broken)
    assert gatekeeper.statistics().listeners[0] == ListenerStatistics("broken", delivered=2, lost=0, failed=2)


def test_a_slow_listener_is_reported_at_growing_intervals() -> None:
    clock = Clock()
    gatekeeper = Gatekeeper(PROTOCOL, clock=clock, slow_after=0.010)
    gatekeeper.add_function(GotoXY, lambda *_: clock.run(0.020), "slow")
    gatekeeper.start()
    for timestamp in range(9):
        gatekeeper.receive(GOTO_FRAME, float(timestamp))
    assert [each.timestamp for each in gatekeeper.reports] == [0.0, 1.0, 3.0, 7.0]
    assert str(gatekeeper.reports[0]) == "listener slow: slow: held up the others for 20.0 ms, 1 time so far"
    assert gatekeeper.statistics().listeners == (ListenerStatistics("slow", delivered=9, lost=0, slow=9),)


def test_a_listener_as_quick_as_allowed_is_not_slow() -> None:
    clock = Clock()
    gatekeeper = Gatekeeper(PROTOCOL, clock=clock, slow_after=0.5)
    gatekeeper.add_function(GotoXY, lambda *_: clock.run(0.5))
    gatekeeper.start()
    gatekeeper.receive(GOTO_FRAME, 1.0)
    assert list(gatekeeper.reports) == []


def test_a_slow_node_is_named() -> None:
    clock = Clock()
    gatekeeper = Gatekeeper(PROTOCOL, clock=clock)
    gatekeeper.add_node(lambda: (0x008,), lambda *_: clock.run(1.0), "drive")
    gatekeeper.start()
    gatekeeper.receive(GOTO_FRAME, 1.0)
    assert [(each.event, each.name) for each in gatekeeper.reports] == [(Event.LISTENER_SLOW, "drive")]


# Frames that do harm

REFUSED = {
    "nothing": Frame(GOTO_FRAME.cob_id, b""),
    "shorter than the speed": SHORT_GOTO_FRAME,
    "half of the barriers": Frame(GOTO_FRAME.cob_id, GOTO_FRAME.data[:7]),
}


@pytest.mark.parametrize("frame", REFUSED.values(), ids=REFUSED)
def test_a_frame_too_short_is_counted_and_reported_and_only_a_node_gets_it(frame: Frame) -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    heard = Heard()
    queue = gatekeeper.add_queue(GotoXY)
    gatekeeper.add_function(GotoXY, broken)
    gatekeeper.add_frames(lambda: (0x008,), heard)
    gatekeeper.start()
    gatekeeper.receive(frame, 1.0)
    assert (heard, queue.drain(), gatekeeper.statistics().refused) == ([(frame, 1.0)], [], 1)
    [report] = gatekeeper.reports
    assert str(report).startswith(f"frame refused: 0x008: Goto XY (0x008): {len(frame.data)} bytes of data")


def test_a_frame_that_only_a_node_wants_is_not_decoded() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    gatekeeper.add_frames(lambda: (0x008,), ignore)
    gatekeeper.start()
    gatekeeper.receive(SHORT_GOTO_FRAME, 1.0)
    assert (gatekeeper.statistics().refused, list(gatekeeper.reports)) == (0, [])


def test_longer_frames_are_read() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    queue = gatekeeper.add_queue(EmergencyStop)
    gatekeeper.start()
    gatekeeper.receive(Frame(0x002, b"\x01\xff"), 1.0)
    assert [each.message for each in queue.drain()] == [EmergencyStop(Obstacle.ENEMY)]


# Reports and counts


def test_reports_go_to_the_function_given() -> None:
    reports: list[Report] = []
    gatekeeper = Gatekeeper(PROTOCOL, report=reports.append)
    gatekeeper.add_function(GotoXY, broken)
    gatekeeper.start()
    gatekeeper.receive(GOTO_FRAME, 1.0)
    assert [each.event for each in reports] == [Event.LISTENER_FAILED]
    assert list(gatekeeper.reports) == []


def test_statistics_count_each_listener_once_however_many_identifiers_it_has() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    gatekeeper.add_queue(GotoXY, maxsize=1)
    gatekeeper.add_node(lambda: (0x004, 0x008), ignore, "drive")
    gatekeeper.start()
    for frame in (GOTO_FRAME, GOTO_FRAME, STOP_FRAME, SHORT_GOTO_FRAME, Frame(0x7FF)):
        gatekeeper.receive(frame, 1.0)
    statistics = gatekeeper.statistics()
    assert set(statistics.listeners) == {
        ListenerStatistics("queue of Goto XY", delivered=2, lost=1),
        ListenerStatistics("drive", delivered=4, lost=0),
    }
    assert (statistics.refused, statistics.unheard) == (1, 1)


# Sending


def test_messages_leave_by_their_priority() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    messages: list[Message] = [CheckDriveRequest(), GOTO, GotoConfirm(), StopDrive()]
    for message in messages:
        gatekeeper.send(message, 0.0)
    assert [frame.cob_id for frame in gatekeeper.mailboxes.load(0.0)] == [0x004, 0x008, 0x00C]


def test_frames_and_messages_share_the_mailboxes() -> None:
    gatekeeper = Gatekeeper(PROTOCOL, mailboxes=1)
    gatekeeper.send(GOTO, 0.0)
    gatekeeper.mailboxes.submit(STOP_FRAME, 0.0)
    assert gatekeeper.mailboxes.load(0.0) == [STOP_FRAME]
    assert gatekeeper.statistics().transmit == TransmitStatistics(2, completed=0, dropped=0, waiting=1, loaded=1)


def test_a_frame_dropped_is_reported_with_the_others() -> None:
    gatekeeper = Gatekeeper(PROTOCOL, mailboxes=1, mailbox_wait=0.020)
    gatekeeper.send(StopDrive(), 0.0)
    gatekeeper.mailboxes.load(0.0)
    gatekeeper.send(GotoConfirm(), 0.0)
    gatekeeper.mailboxes.expire(0.020)
    assert [str(each) for each in gatekeeper.reports] == [
        "frame dropped: 0x00C: 00C# found no mailbox for 20 ms, 1 dropped so far"
    ]


def test_a_message_that_cannot_be_encoded_is_an_error_and_nothing_is_sent() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    with pytest.raises(FieldError, match="speed"):
        gatekeeper.send(GOTO._replace(speed=101), 0.0)
    assert gatekeeper.statistics().transmit.submitted == 0


def test_the_latest_thousand_unread_reports_are_kept() -> None:
    gatekeeper = Gatekeeper(PROTOCOL)
    for number in range(1002):
        gatekeeper.report(Report(Event.BUS_OFF, "can0", "", number))
    assert [report.timestamp for report in gatekeeper.reports] == [*range(2, 1002)]
