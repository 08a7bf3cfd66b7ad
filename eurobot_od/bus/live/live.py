"""A controller and its node on a python-can bus, in real time with threads; or a group of nodes in one thread.

The package's docstring explains threads and locks. Submitting a frame never waits for the bus.
"""

from __future__ import annotations

import os
import threading
import time
import weakref
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any

from eurobot_od.bus.live.buses import Connection, Driver, Gaps, Opener, Sender, failure, shut_down
from eurobot_od.bus.live.reader import POLL, BusSilence, FunctionThread, Reader
from eurobot_od.controller import Controller, Event, Report
from eurobot_od.errors import BusError, LocalError, NodeFailed, StateError
from eurobot_od.frame import HIGHEST_IDENTIFIER, MOST_BYTES, Data, Frame, RemoteFrame
from eurobot_od.od.standard import ErrorCode
from eurobot_od.pdo.kinds import Message
from eurobot_od.support.connections import Backoff

if TYPE_CHECKING:
    import can

    from eurobot_od.device.node import Node
    from eurobot_od.device.station import NodeGroup, Station

PATIENCE = 1.0
"""Longest wait for each thread at the end, in s."""


TAKEN_WITHIN = 1.0
"""Time for a driver to accept a frame, in s."""

ERROR_FRAMES = (
    (0x004, 0x03, ErrorCode.OVERRUN),
    (0x004, 0x30, ErrorCode.ERROR_PASSIVE),
    (0x100, 0x00, ErrorCode.RECOVERED_FROM_BUS_OFF),
)
"""Error frames that cause an EMCY, in the format of Linux's `can/error.h`, which python-can's drivers use.

Each row has a class bit of the identifier, bits of data byte 1 (0: any), and our error code.
"""


BUS_OFF = 1 << 6
"""Class bit of the error frame for bus-off."""

BUS_OFF_HINT = (
    "the controller has left the bus; SocketCAN restarts it with `ip link set CHANNEL type can restart-ms 100`"
)


class _NoThreads:
    """Replaces the lock in a forked child: the thread that holds it does not exist there."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __enter__(self) -> None:
        raise StateError(f"{self._name}: belongs to the process that has forked; open a bus of your own after the fork")

    def __exit__(self, *_: object) -> None:
        """Do nothing: `__enter__` always raises."""


def _refuse(started: weakref.ref[Live]) -> None:
    """Make all calls of a `Live` and its node raise in a forked child."""
    live = started()
    if live is not None:
        live.refuse()


class Live:
    """A controller, and a station with its node if there is one, running on a bus; a context manager.

    `foreign` is the number of received frames that are not classic base data frames, `missed` the number of frames
    ignored because they came while the process stood still. `gaps` has the number and length of the times without a
    bus, `failure` the reason for its end, or None. All of these are also reported.

    Args:
        bus: the bus, which is shut down at the end
        controller: listeners and queue
        station: the node with its controller, None without a node
        clock: returns the time in s for nodes and listeners
        opener: opens a bus that fails again; None: it stays closed
    """

    def __init__(
        self,
        bus: can.BusABC,
        controller: Controller,
        station: Station | None = None,
        clock: Callable[[], float] = time.perf_counter,
        opener: Opener | None = None,
    ) -> None:
        self.controller = controller
        self.station = station
        self.clock = clock
        self.name = str(bus.channel_info)
        self.foreign = self.missed = 0
        self._failure: BusError | None = None
        self._lock = threading.RLock()
        self._changed = threading.Condition(self._lock)
        self._driver = Driver(bus)
        self._connection = Connection(self._driver, opener, clock, self._lost, self._filter, self._back)
        fail = self._connection.fail
        self._sender = Sender(self._driver, controller.queue, self._lock, clock, fail, self._wake)
        receive = controller.receive_data if station is None else self._receive  # no node, no answers to send
        foreign, missed = self._note_foreign, self._note_missed
        self._reader = Reader(self._connection, receive, clock, foreign, missed, controller.acts_always)
        self._functions = FunctionThread(f"{self.name} functions", controller.report, controller.clock)
        controller.call_function = self._functions.submit
        self._running = self._ended = self._forked = False
        self._looks_at = 0.0
        self._threads: list[threading.Thread] = []
        if station is not None:
            station.node.guard = self._lock
            station.node.wake = self._wake

    @classmethod
    def node(
        cls,
        bus: can.BusABC,
        node: Node,
        clock: Callable[[], float] = time.perf_counter,
        opener: Opener | None = None,
        **options: Any,
    ) -> Live:
        """Return a node ready to run on a bus.

        Args:
            bus: as in `Live`
            node: the node
            clock: as in `Live`
            opener: as in `Live`
            options: options of `Station`, such as `report` and `on_error`
        """
        from eurobot_od.device.node import Node
        from eurobot_od.device.station import OnError, Station  # a controller alone needs no nodes

        if not isinstance(node, Node):
            raise LocalError(f"{type(node).__name__} is not a node: write Live.node(bus, node)")

        station = Station(node, **{"on_error": OnError.RESTART} | options)
        return cls(bus, station.controller, station, clock, opener)

    @property
    def bus(self) -> can.BusABC:
        """The present bus."""
        return self._driver.bus

    @property
    def gaps(self) -> Gaps:
        """Number and total length of the bus's interruptions."""
        return self._connection.gaps

    @property
    def overflow(self) -> int:
        """Number of received frames that the driver has dropped; 0 if it does not report them."""
        return self._connection.overflow

    @property
    def failure(self) -> BusError | NodeFailed | None:
        """Reason for its end: the bus has failed and is not reopened, or the node has ended; else None."""
        return self._failure or (None if self.station is None else self.station.failure)

    # Life

    def start(self) -> Live:
        """Set the receive filters, switch the node on, and start the threads."""
        self._running = True
        self.controller.rerouted = self._refilter
        self.controller.start()
        if self.station is not None:
            self.station.start(self.clock())
        if hasattr(os, "register_at_fork"):  # not on Windows, where nothing forks
            os.register_at_fork(after_in_child=partial(_refuse, weakref.ref(self)))
        self._functions.start()
        for run in (self._reader.read, self._keep):
            thread = threading.Thread(target=run, name=f"{self.name} {run.__name__}", daemon=True)
            self._threads.append(thread)
            thread.start()
        return self

    def _filter(self) -> None:
        """Set the bus's receive filters if its driver filters; raises BusError."""
        try:
            self.bus.set_filters(self.controller.filters() if self._driver.filters else None)
        except Exception as error:  # drivers raise OSError, CanError, ctypes' errors, ...
            raise failure(self.bus, error) from error

    def _refilter(self) -> None:
        try:
            self._filter()
        except BusError as error:
            self._connection.fail(error)

    def stop(self) -> None:
        """Switch the node off, end the threads and shut the bus down.

        Queued frames are sent first if the bus accepts them. A function that does not return is awaited for `PATIENCE`.
        Raises the error of the node's last action; BusError if the bus fails only now; NodeFailed if the node has
        failed before and the owner had no `report`, even if it was restarted.
        """
        if self._forked:
            return  # the bus belongs to the parent process
        try:
            # First, because the node's last actions, such as stopping, need the threads.
            goodbye = self.station.node.leave() if self.station and not self.station.failure and self._running else None
            if goodbye is not None:
                goodbye.result()
        except BaseException:
            with suppress(BusError):
                self._end()
            raise
        self._end()
        untold = any(each.event is Event.NODE_FAILED for each in self.controller.reports)
        if untold and self.station is not None and self.station.last_failure is not None:
            raise self.station.last_failure

    def _end(self) -> None:
        """End the threads and shut the bus down."""
        try:
            self._functions.stop()  # first, because the last functions may send by the other two threads
            self._sender.retry()
            self._connection.close()
            with self._changed:
                self._running, self._ended = False, True
                self._changed.notify_all()
            for thread in self._threads:
                if thread is not threading.current_thread():
                    thread.join(PATIENCE)
            if self.station is not None:
                self.station.node.switched_off()
        finally:
            self._connection.count_overflow()
            if self.overflow:
                self._report_overflow()
            try:
                shut_down(self.bus)
            except Exception as error:
                if self._connection.failure is None:  # else it is only a consequence
                    self._failure = failure(self.bus, error)
                    raise self._failure from error

    def __enter__(self) -> Live:
        return self.start()

    def __exit__(self, cause: object, *_: object) -> None:
        try:
            self.stop()
        except (BusError, NodeFailed) as error:
            if cause is None:
                raise
            # The error that has ended the block has priority, but a robot that does not stop must be reported.
            self.controller.report(Report(Event.END_FAILED, self.name, str(error), self.clock(), error))

    def refuse(self) -> None:
        """Make every send and every call of the node raise StateError, in a process without the threads."""
        refusal: Any = _NoThreads(self.name)
        self._lock = refusal
        self._forked = True
        if self.station is not None:
            self.station.node.guard = refusal

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def _lost(self, why: BusError, opened_again: bool) -> None:
        """Report the failure of the bus, and notify the node; until it is back, only stop messages are queued."""
        if not self._running:
            return
        now = self.clock()
        with self._lock:
            if opened_again:
                self.controller.queue.leave()
            else:
                self._failure = why
            if self.station is not None:
                self.station.bus_lost(now)
        text = f"{why}; it is opened again" if opened_again else str(why)
        self.controller.report(Report(Event.BUS_FAILED, self.name, text, now))

    def _back(self, gap: float) -> None:
        now = self.clock()
        with self._lock:
            dropped = self.controller.queue.come_back()
            if self.station is not None:
                self.station.bus_error(ErrorCode.BUS_LOST, now)
        text = f"after a gap of {gap:.1f} s, in which {dropped} frames were not sent"
        self.controller.report(Report(Event.BUS_BACK, self.name, text, now))
        self._sender.retry()

    def _report_overflow(self) -> None:
        text = f"{self.overflow} received frames have found no room in the driver's queue so far"
        self.controller.report(Report(Event.FRAMES_LOST, self.name, text, self.clock()))

    # Sending

    def send(self, message: Message) -> None:
        """Encode a message and queue it; never blocks. Raises FieldError for a value out of range.

        With a node, the node sends it, and StateError is raised if it has no such TPDO or its NMT state does not allow
        it. StateError is also raised after the end of the `Live`, or in a forked child.
        """
        with self._lock:
            if self._ended:
                raise StateError(f"{self.name}: the bus is closed; nothing is sent any more")
            if self.station is not None:
                self.station.node.send(message)  # wakes the keeper
                return
            self.controller.send(message, self.clock())
        if self._driver.prompt:
            self._sender.pump()  # in this thread, because waking the keeper takes as long as a frame on the bus
        else:
            self._wake()

    # The reader's thread

    def _receive(self, cob_id: int, data: Data, now: float) -> None:
        """Deliver a frame, wake the keeper if needed, and send the answers.

        The answers come last, because the thread that waits for one then competes for the interpreter.
        """
        self.controller.receive_data(cob_id, data, now)
        self._answered()

    def _answered(self) -> None:
        if self.station is not None and self.station.plan.soonest < self._looks_at:
            self._wake()
        self._sender.pump()

    def _note_foreign(self, message: can.Message | None) -> None:
        """Count a frame that is not a classic base data frame; remote and error frames are passed to the node."""
        self.foreign += 1
        if message is not None and message.is_error_frame and message.arbitration_id & BUS_OFF:
            now = self.clock()
            if self.station is not None:  # its recovery is an error frame, too
                self.station.bus_lost(now)
            self.controller.report(Report(Event.BUS_OFF, self.name, BUS_OFF_HINT, now))
        if self.station is None or message is None:
            return
        if message.is_error_frame:
            details = int.from_bytes(message.data[1:2], "little")
            for class_bit, bits, code in ERROR_FRAMES:
                if message.arbitration_id & class_bit and (details & bits or not bits):
                    self.station.bus_error(code, self.clock())
        elif message.is_remote_frame and not message.is_extended_id:
            self.station.requested(message.arbitration_id, self.clock())
            self._answered()

    def _note_missed(self, count: int) -> None:
        """Report frames that came while the process stood still; old commands must not be executed now."""
        self.missed += count
        text = f"{count} frames came while the process stood still, and are ignored"
        self.controller.report(Report(Event.FRAMES_LOST, self.name, text, self.clock()))

    # The keeper's thread

    def _keep(self) -> None:
        while self._running:
            if self.station is not None and self.station.next_wakeup <= self.clock():
                self.station.tick(self.clock())
            self._sender.retry()
            self._functions.watch()
            if self._connection.count_overflow():
                if self.station is not None:
                    self.station.bus_error(ErrorCode.OVERRUN, self.clock())
                self._report_overflow()
            is_open = self._connection.failure is None
            self._reader.silence.watch(self.name, self.controller.report, self.clock(), is_open)
            with self._changed:
                self._looks_at = self._next_look()
                pause = self._looks_at - self.clock()
                if self._running and pause > 0:
                    self._changed.wait(pause)

    def _next_look(self) -> float:
        """Return when the keeper has to check again; called with the lock held, so that no wake-up is missed."""
        now = self.clock()
        looks = [now + POLL]
        if self.station is not None:
            looks.append(self.station.next_wakeup)
        if self._sender.blocked:
            looks += [now + self._sender.pause, self.controller.queue.next_expiry]
        elif self.controller.queue.waiting and not self._sender.busy:
            return now  # frames were queued after the sender's last check
        return min(looks)


class LiveGroup:
    """A group of nodes on one bus in one thread, such as a network of simulated devices; a context manager.

    A bus that fails is reopened by `opener`, if there is one, and the nodes continue; `report` is called. `sent` and
    `received` are numbers of frames. The bus is shut down at the end.
    """

    def __init__(
        self,
        bus: can.BusABC,
        group: NodeGroup,
        clock: Callable[[], float] = time.perf_counter,
        opener: Opener | None = None,
        report: Callable[[Report], object] = lambda _: None,
    ) -> None:
        self.group = group
        self.clock = clock
        self.name = str(bus.channel_info)
        self._opener = opener
        self._report = report
        self._backoff = Backoff()
        self.sent = self.received = 0
        self._driver = Driver(bus)
        self._silence = BusSilence()

    def run(self, end: float) -> None:
        """Switch the nodes on, and run them until a time of the clock; raises BusError."""
        first: Callable[[float], list[Frame]] = self.group.start
        while self.clock() < end:
            try:
                self._send(first(self.clock()))
                self._exchange(end)
            except BusError as why:
                if self._opener is None:
                    raise
                self._reopen(why, self._opener, end)
                first = self.group.bus_back

    def _exchange(self, end: float) -> None:
        """Run the nodes until the end, or until the bus fails, which raises BusError."""
        while (now := self.clock()) < end:
            self._silence.watch(self.name, self._report, now)
            if self.group.next_wakeup <= now:
                self._send(self.group.tick(now))
            frame = self._received(min(self.group.next_wakeup, end, now + POLL) - self.clock())
            if frame is not None:
                self.received += 1
                self._silence.heard(frame.cob_id, now)
                self._send(self.group.receive(frame, self.clock()))

    def _reopen(self, why: BusError, opener: Opener, end: float) -> None:
        """Reopen the bus, retrying until the end."""
        lost_at = self.clock()
        self._report(Report(Event.BUS_FAILED, self.name, f"{why}; it is opened again", lost_at))
        self.group.bus_lost(lost_at)
        while (now := self.clock()) < end:
            time.sleep(min(self._backoff.pause(now), end - now))
            try:
                self._driver.replace(opener)
            except BusError:
                continue
            gap = self.clock() - lost_at
            self._report(Report(Event.BUS_BACK, self.name, f"after a gap of {gap:.1f} s", self.clock()))
            return

    def _received(self, wait: float) -> Frame | None:
        """Wait up to `wait` s for a frame; None if none came, or not a classic frame with 11 bits."""
        bus = self._driver.bus
        try:
            message = bus.recv(max(wait, 0.0))
        except Exception as error:  # drivers raise OSError, CanError, ctypes' errors, ...
            raise failure(bus, error) from error
        if message is None or message.is_extended_id or message.is_error_frame or message.is_fd:
            return None
        if len(message.data) > MOST_BYTES or not 0 <= message.arbitration_id <= HIGHEST_IDENTIFIER:
            return None
        if message.is_remote_frame:
            return RemoteFrame(message.arbitration_id, bytes(message.dlc))
        return Frame(message.arbitration_id, bytes(message.data))

    def _send(self, frames: list[Frame]) -> None:
        for frame in frames:
            tried = self.clock()
            while not self._driver.send(frame):  # the driver's queue may be full
                if self.clock() - tried > TAKEN_WITHIN:
                    raise self._driver.stuck(TAKEN_WITHIN)
            self.sent += 1

    def __enter__(self) -> LiveGroup:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            shut_down(self._driver.bus)
        except Exception as error:
            raise BusError(f"the bus {self.name} cannot be shut down: {error}") from error
