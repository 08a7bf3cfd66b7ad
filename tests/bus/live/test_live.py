"""Live operation: nodes on a bus, and drivers and listeners that do not behave."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from queue import SimpleQueue
from threading import Event
from typing import Any

import can
import pytest
from can.interfaces.virtual import VirtualBus

from eurobot_od.bus.live import FrameReader, Live
from eurobot_od.bus.live.buses import FIRST_PAUSE, LONGEST_PAUSE
from eurobot_od.bus.live.reader import POLL
from eurobot_od.controller import Controller
from eurobot_od.controller import Event as What
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.errors import BusError, FieldError, LocalError, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import Message
from tests.bus.live.loose import LONG, Reports
from tests.eds_text import DEVICE_TYPE, variable
from tests.kit import lift
from tests.kit.lift import (
    Brake,
    Cabin,
    CheckCabinRequest,
    CheckCabinResponse,
    CheckDoorRequest,
    Door,
    EmergencyOff,
    FloorRequest,
    Halt,
    MoveConfirm,
    MoveTo,
    Panel,
    Ride,
    StateRequest,
    Trouble,
)

PROTOCOL = lift.protocol()


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    """A bus of the test's own."""
    name: str = request.node.name
    return name


def virtual(channel: str) -> can.BusABC:
    return can.Bus(channel, interface="virtual")


# Nodes


def test_two_nodes_answer_a_node_check(channel: str) -> None:
    panel = Panel(lift.dictionary("panel"))
    with (
        Live.node(virtual(channel), Cabin(lift.dictionary("cabin"))),
        Live.node(virtual(channel), Door(lift.dictionary("door"))),
        Live.node(virtual(channel), panel),
    ):
        took = panel.check().result(LONG)
    assert list(took) == ["cabin", "door"]


def test_a_controller_talks_to_a_node(channel: str) -> None:
    controller = Controller(PROTOCOL)
    answers = controller.add_queue(CheckCabinResponse)
    with Live.node(virtual(channel), Cabin(lift.dictionary("cabin"))), Live(virtual(channel), controller) as live:
        live.send(CheckCabinRequest())
        answer = answers.get(LONG)
    assert answer is not None
    assert answer.message == CheckCabinResponse()


def test_a_value_out_of_range_is_the_callers_error_and_sends_nothing(channel: str) -> None:
    with Live(virtual(channel), Controller(PROTOCOL)) as live:
        with pytest.raises(FieldError, match="height = 5000"):
            live.send(MoveTo(5000, Ride.NORMAL, 0))
        assert live.controller.statistics().transmit.submitted == 0


def test_a_node_sends_what_its_eds_has_as_tpdo_and_nothing_else(channel: str) -> None:
    panel = Panel(lift.dictionary("panel"))
    with virtual(channel) as other, Live.node(virtual(channel), panel) as live:
        with pytest.raises(StateError, match="panel has no TPDO for MoveConfirm"):
            live.send(MoveConfirm())
        live.send(FloorRequest())
        while (message := other.recv(LONG)) is not None and message.arbitration_id == 0x701:
            pass  # boot-up, heartbeats
    assert message is not None
    assert message.arbitration_id == PROTOCOL.cob_id(FloorRequest)


def test_other_frames_than_classic_base_frames_are_only_counted(channel: str) -> None:
    controller = Controller(PROTOCOL)
    queue = controller.add_queue(Halt)
    cob_id = PROTOCOL.cob_id(Halt)
    with virtual(channel) as other, Live(virtual(channel), controller) as live:
        for options in ({"is_extended_id": True}, {"is_remote_frame": True}, {"is_error_frame": True}, {"is_fd": True}):
            other.send(can.Message(arbitration_id=cob_id, **({"is_extended_id": False} | options)))
        other.send(can.Message(arbitration_id=cob_id, is_extended_id=False))
        assert queue.get(LONG) is not None
    assert live.foreign == 4
    assert queue.delivered == 1


def test_a_driver_that_keeps_nobody_waiting_has_the_frame_when_send_returns(channel: str) -> None:
    with virtual(channel) as other, Live(virtual(channel), Controller(PROTOCOL)) as live:
        live.send(StateRequest())
        message = other.recv(0)
        assert live.controller.statistics().transmit.completed == 1
    assert message is not None
    assert message.arbitration_id == PROTOCOL.cob_id(StateRequest)


class InterruptedBus(VirtualBus):
    """A driver that is interrupted by Ctrl-C in its `send`, once."""

    interrupts = 1

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.interrupts:
            self.interrupts -= 1
            raise KeyboardInterrupt
        super().send(msg, timeout)


def test_an_interrupt_while_sending_keeps_no_later_frame_back(channel: str) -> None:
    with virtual(channel) as other, Live(InterruptedBus(channel), Controller(PROTOCOL)) as live:
        with pytest.raises(KeyboardInterrupt):
            live.send(Halt())
        live.send(EmergencyOff())
        received = {message and message.arbitration_id for message in (other.recv(LONG), other.recv(LONG))}
    assert received == {PROTOCOL.cob_id(EmergencyOff), PROTOCOL.cob_id(Halt)}


def test_frames_that_do_not_fit_into_the_driver_are_sent_later(channel: str) -> None:
    with (
        can.Bus(channel, interface="virtual", rx_queue_size=1) as other,
        Live(virtual(channel), Controller(PROTOCOL)) as live,
    ):
        for message in URGENT[:3]:  # as many as there are mailboxes
            live.send(message)
        received = [other.recv(LONG) for _ in range(3)]
    assert [each and each.arbitration_id for each in received] == [PROTOCOL.encode(each).cob_id for each in URGENT[:3]]


class FilteringBus(VirtualBus):
    """A driver with filters of its own; `error` is what it raises once it does not take them any more."""

    error: Exception | None = None

    def _apply_filters(self, filters: Any) -> None:
        if self.error is not None:
            raise self.error
        self.applied = filters


@pytest.fixture
def _filtering(monkeypatch: pytest.MonkeyPatch) -> None:
    """Register the driver above with python-can as one of an interface that filters."""
    monkeypatch.setitem(can.interfaces.BACKENDS, "socketcan", (__name__, FilteringBus.__name__))


@pytest.mark.usefixtures("_filtering")
def test_filters_are_for_drivers_that_filter_themselves(channel: str) -> None:
    controller = Controller(PROTOCOL)
    controller.add_queue(Halt)
    with Live(FilteringBus(channel), controller) as live:
        assert isinstance(live.bus, FilteringBus)
        assert live.bus.applied == live.bus.filters == controller.filters() != []


def test_without_such_a_driver_the_controller_alone_sorts_out(channel: str) -> None:
    controller = Controller(PROTOCOL)
    queue = controller.add_queue(Halt)
    with virtual(channel) as other, Live(virtual(channel), controller) as live:
        assert live.bus.filters is None
        other.send(can.Message(arbitration_id=0x7FF, is_extended_id=False))
        other.send(can.Message(arbitration_id=PROTOCOL.cob_id(Halt), is_extended_id=False))
        assert queue.get(LONG) is not None
    assert controller.statistics().unheard == 1


@pytest.mark.usefixtures("_filtering")
def test_a_driver_that_does_not_take_changed_filters_has_failed_and_is_read_on(channel: str) -> None:
    controller, bus = Controller(PROTOCOL), FilteringBus(channel)
    queue = controller.add_queue(Halt)
    controller.add_node(lambda: (0x602,), lambda *_: controller.reroute(PROTOCOL), "master")
    with virtual(channel) as other, Live(bus, controller) as live:
        assert live.failure is None
        bus.error = OSError("no room\nfor filters")
        for cob_id in (0x602, PROTOCOL.cob_id(Halt)):
            other.send(can.Message(arbitration_id=cob_id, is_extended_id=False))
        assert queue.get(LONG) is not None
    assert isinstance(live.failure, BusError)
    assert str(live.failure) == f"the bus {bus.channel_info} failed: no room for filters"


def test_a_watch_sees_every_frame(channel: str) -> None:
    seen: list[tuple[float, Frame]] = []
    done = Event()

    def see(time: float, frame: Frame) -> None:
        seen.append((time, frame))
        if len(seen) == 2:
            done.set()

    with virtual(channel) as other, FrameReader(virtual(channel), see, lambda: 7.0):
        other.send(can.Message(arbitration_id=0x123, data=b"\x01", is_extended_id=False))
        other.send(can.Message(arbitration_id=0x123, is_extended_id=True))
        other.send(can.Message(arbitration_id=0x7FF, is_extended_id=False))
        assert done.wait(LONG)
    assert seen == [(7.0, Frame(0x123, b"\x01")), (7.0, Frame(0x7FF))]


HOSTILE = {
    "300 bytes": can.Message(arbitration_id=0x108, data=bytes(300), dlc=44, is_extended_id=False),
    "negative identifier": can.Message(arbitration_id=-1, is_extended_id=False),
    "identifier too high": can.Message(arbitration_id=0x800, is_extended_id=False),
}
"""What a peer of python-can-remote can send, and no adapter can receive."""


@pytest.mark.parametrize("message", HOSTILE.values(), ids=HOSTILE)
def test_malformed_frames_are_only_counted(channel: str, message: can.Message) -> None:
    controller = Controller(PROTOCOL)
    answers = controller.add_queue(CheckCabinResponse)
    with (
        virtual(channel) as other,
        Live.node(virtual(channel), Cabin(lift.dictionary("cabin"))) as cabin,
        Live(virtual(channel), controller) as tester,
    ):
        other.send(message)
        tester.send(CheckCabinRequest())
        assert answers.get(LONG) is not None
        assert cabin.foreign == 1
    assert cabin.controller.statistics().listeners[0].failed == 0


def test_bus_off_is_told_with_what_helps_and_the_cabin_brakes(channel: str) -> None:
    reports, node = Reports(), Cabin(lift.dictionary("cabin"))
    with virtual(channel) as other, Live.node(virtual(channel), node, report=reports) as live:
        other.send(can.Message(arbitration_id=0x040, is_error_frame=True, is_extended_id=False, data=bytes(8)))
        assert "restart-ms" in reports.wait_for(What.BUS_OFF).text
        assert node.stopped_by == Halt()
        assert live.failure is None


# Drivers that do not behave


class Clock:
    """A clock that goes on only when told."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


class Driver(can.BusABC):
    """A driver without a wire: `error` is what sending raises, `broken` what reading and `stuck` what the end raises.

    `tries` are the frames that it was given, `attempt` is set at each of them; it returns once it `may_go_on`.
    `reader` is the thread that reads, once `entered` is set.
    """

    def __init__(self) -> None:
        super().__init__(channel="nowhere")
        self.channel_info = "nowhere"
        self.error: Exception | None = None
        self.broken: Exception | None = None
        self.stuck: Exception | None = None
        self.tries: list[Frame] = []
        self.attempt, self.may_go_on, self.entered, self._never = Event(), Event(), Event(), Event()
        self.may_go_on.set()
        self.reader = threading.current_thread()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.tries.append(Frame(msg.arbitration_id, bytes(msg.data)))
        self.attempt.set()
        self.may_go_on.wait(LONG)
        if self.error is not None:
            raise self.error

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        self.reader = threading.current_thread()
        self.entered.set()
        if self.broken is not None:
            raise self.broken
        self._never.wait(timeout)
        return None, False

    def shutdown(self) -> None:
        super().shutdown()
        if self.stuck is not None:
            raise self.stuck

    def wait_for_tries(self, count: int) -> None:
        """Wait until it has been given `count` frames more."""
        wanted = len(self.tries) + count
        while len(self.tries) < wanted:
            self.attempt.clear()
            if len(self.tries) < wanted:
                assert self.attempt.wait(LONG)


@pytest.fixture
def driver() -> Iterator[Driver]:
    bus = Driver()
    yield bus
    bus.shutdown()


URGENT: list[Message] = [Brake(Trouble.OBSTACLE), Halt(), StateRequest(), CheckDoorRequest()]


def test_a_driver_that_refuses_costs_no_frame_and_they_leave_by_urgency_when_it_takes_them(
    driver: Driver,
) -> None:
    clock, reports = Clock(), Reports()
    driver.error = can.CanOperationError("transmit buffer full")
    with Live(driver, Controller(PROTOCOL, report=reports), clock=clock) as live:
        for message in URGENT:
            live.send(message)
        driver.wait_for_tries(3)
        clock.now = 0.9
        driver.wait_for_tries(3)
        assert live.controller.statistics().transmit == (len(URGENT), 0, 0, len(URGENT), 0)
        driver.error = None
        driver.tries.clear()
    assert driver.tries[-len(URGENT) :] == sorted(map(PROTOCOL.encode, URGENT))
    assert reports.empty()
    assert live.failure is None  # a full buffer is not a failure of the bus


def test_a_driver_that_blocks_keeps_no_caller_waiting_and_what_waits_leaves_by_urgency(driver: Driver) -> None:
    first, *others = reversed(URGENT)
    driver.may_go_on.clear()
    with Live(driver, Controller(PROTOCOL)) as live:
        live.send(first)
        assert driver.attempt.wait(LONG)
        for message in others:
            live.send(message)  # returns although the driver has not
        assert live.controller.statistics().transmit.submitted == len(URGENT)
        assert len(driver.tries) == 1
        driver.may_go_on.set()
    assert driver.tries == [PROTOCOL.encode(first), *sorted(map(PROTOCOL.encode, others))]


def test_a_frame_that_finds_a_mailbox_is_not_dropped_however_late_the_driver_is(driver: Driver) -> None:
    clock, reports = Clock(), Reports()
    driver.may_go_on.clear()
    with Live(driver, Controller(PROTOCOL, report=reports), clock=clock) as live:
        live.send(Halt())
        assert driver.attempt.wait(LONG)
        live.send(CheckDoorRequest())
        clock.now = 1.0
        driver.may_go_on.set()
    assert driver.tries == [PROTOCOL.encode(Halt()), PROTOCOL.encode(CheckDoorRequest())]
    assert reports.empty()


def test_a_bus_that_fails_while_reading_is_a_bus_error_and_is_reported(driver: Driver) -> None:
    reports = Reports()
    driver.broken = OSError("adapter\nwas pulled out")
    with Live(driver, Controller(PROTOCOL, report=reports)) as live:
        report = reports.wait_for(What.BUS_FAILED)
        assert isinstance(live.failure, BusError)
    assert str(live.failure) == "the bus nowhere failed: adapter was pulled out"
    assert str(report) == f"bus failed: nowhere: {live.failure}"


def test_a_bus_that_fails_while_sending_is_reported_once_and_keeps_the_stop(driver: Driver) -> None:
    reports = Reports()
    driver.error = OSError("write failed")
    with Live(driver, Controller(PROTOCOL, report=reports)) as live:
        live.send(Halt())
        driver.wait_for_tries(3)
        assert reports.wait_for(What.BUS_FAILED).text == "the bus nowhere failed: write failed"
        driver.error = None  # the adapter is back
        driver.wait_for_tries(1)
    assert live.controller.statistics().transmit.completed == 1
    assert reports.empty()
    assert str(live.failure) == "the bus nowhere failed: write failed"


def test_a_bus_that_fails_at_the_end_is_a_bus_error(driver: Driver) -> None:
    driver.stuck = OSError("no answer")
    with pytest.raises(BusError, match="the bus nowhere failed: no answer"), Live(driver, Controller(PROTOCOL)):
        pass
    driver.stuck = None


def test_a_bus_that_fails_at_the_end_does_not_replace_the_cause(driver: Driver) -> None:
    driver.stuck = OSError("no answer")
    with pytest.raises(ZeroDivisionError), Live(driver, Controller(PROTOCOL)):
        raise ZeroDivisionError
    driver.stuck = None


def test_a_watch_tells_that_the_bus_has_failed(driver: Driver) -> None:
    driver.broken = OSError("adapter was pulled out")
    failures: list[BusError] = []
    with FrameReader(driver, lambda *_: None, Clock(), failures.append):
        assert driver.entered.wait(LONG)
        driver.reader.join(LONG)
    assert list(map(str, failures)) == ["the bus nowhere failed: adapter was pulled out"]


def test_frames_that_wait_at_the_end_are_sent(driver: Driver) -> None:
    with Live(driver, Controller(PROTOCOL)) as live:
        for message in URGENT * 3:
            live.send(message)
    assert live.controller.statistics().transmit.completed == len(driver.tries) == 12


def test_frames_left_at_the_end_are_sent_by_the_closing_thread(driver: Driver) -> None:
    live = Live(driver, Controller(PROTOCOL))  # without its threads, as a keeper that has not had its turn
    live.send(Halt())
    assert driver.tries == []
    live.stop()
    assert [frame.cob_id for frame in driver.tries] == [PROTOCOL.cob_id(Halt)]


# Listeners that do not behave


def test_a_function_that_hangs_is_reported_and_stops_neither_node_nor_queue(channel: str) -> None:
    entered, release, reports = Event(), Event(), Reports()

    def stuck(*_: object) -> None:
        entered.set()
        release.wait(LONG)

    cabin = Live.node(virtual(channel), Cabin(lift.dictionary("cabin")), report=reports)
    cabin.controller.add_function(CheckCabinRequest, stuck, "stuck")
    heard: SimpleQueue[float] = SimpleQueue()
    cabin.controller.add_function(CheckCabinRequest, lambda _, timestamp: heard.put(timestamp))
    queue = cabin.controller.add_queue(CheckCabinRequest)
    controller = Controller(PROTOCOL)
    answers = controller.add_queue(CheckCabinResponse)
    with cabin, Live(virtual(channel), controller) as live:
        live.send(CheckCabinRequest())
        assert entered.wait(LONG)
        live.send(CheckCabinRequest())
        assert None not in (answers.get(LONG), answers.get(LONG), queue.get(LONG), queue.get(LONG))
        assert reports.wait_for(What.LISTENER_STUCK).name == "stuck"
        assert heard.empty()
        release.set()
        assert heard.get(timeout=LONG) < heard.get(timeout=LONG)


def test_a_function_that_hangs_does_not_keep_the_end(channel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eurobot_od.bus.live.reader.PATIENCE", 0.01)
    entered, release = Event(), Event()

    def stuck(*_: object) -> None:
        entered.set()
        release.wait(LONG)

    controller = Controller(PROTOCOL)
    controller.add_function(Halt, stuck)
    with Live(virtual(channel), Controller(PROTOCOL)) as other, Live(virtual(channel), controller):
        other.send(Halt())
        assert entered.wait(LONG)
    assert not release.is_set()
    release.set()


def test_a_listener_that_raises_does_not_stop_the_node(channel: str) -> None:
    reports = Reports()

    def broken(*_: object) -> None:
        raise ValueError("lamp is gone")

    cabin = Live.node(virtual(channel), Cabin(lift.dictionary("cabin")), report=reports)
    cabin.controller.add_function(CheckCabinRequest, broken, "lamp")
    controller = Controller(PROTOCOL)
    answers = controller.add_queue(CheckCabinResponse)
    with cabin, Live(virtual(channel), controller) as live:
        live.send(CheckCabinRequest())
        assert answers.get(LONG) is not None
        assert reports.wait_for(What.LISTENER_FAILED).name == "lamp"


# When the keeper looks again


def test_a_keeper_with_nothing_to_do_looks_now_and_then(driver: Driver) -> None:
    assert Live(driver, Controller(PROTOCOL), clock=lambda: 5.0)._next_look() == 5.0 + POLL


def test_timers_set_by_a_frame_act_at_once(channel: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The keeper, who is asleep, hears that the heartbeat is switched on."""
    monkeypatch.setattr("eurobot_od.bus.live.live.POLL", 10 * LONG)
    text = DEVICE_TYPE + variable("1017", "Producer heartbeat time", "UNSIGNED16", "0")
    device = SimulatedDevice(Dictionary.read(text.encode(), Path("a.eds"), 5))
    with VirtualBus(channel) as other, Live.node(VirtualBus(channel), device):
        other.send(can.Message(arbitration_id=0x605, data=b"\x2b\x17\x10\0\x14\0\0\0", is_extended_id=False))
        came: set[int] = set()
        while not came & {0x04, 0x05, 0x7F}:
            message = other.recv(LONG)
            assert message is not None
            came |= {message.data[0]} if message.arbitration_id == 0x705 else set()


def test_a_waiting_frame_without_a_sending_thread_is_due_now(driver: Driver) -> None:
    controller = Controller(PROTOCOL)
    live = Live(driver, controller, clock=lambda: 5.0)
    controller.send(CheckCabinRequest(), 5.0)
    assert live._next_look() == 5.0


def test_frames_refused_by_the_driver_are_retried_after_a_pause(driver: Driver) -> None:
    driver.error = can.CanOperationError("transmit buffer full")
    live = Live(driver, Controller(PROTOCOL), clock=lambda: 5.0)
    live.send(CheckCabinRequest())
    live._sender.retry()
    assert live._next_look() == 5.0 + FIRST_PAUSE
    while live._sender.pause < LONGEST_PAUSE:
        live._sender.retry()
    assert live._next_look() == 5.0 + min(LONGEST_PAUSE, POLL)


def test_a_bus_in_the_place_of_a_node_is_refused() -> None:
    with pytest.raises(LocalError, match=r"^NoneType is not a node: write Live\.node\(bus, node\)$"):
        Live.node(None, None)  # type: ignore[arg-type]
