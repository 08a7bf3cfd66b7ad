"""A controller and its node on a python-can bus, with real time and real threads; or a group of nodes in one thread.

The package's docstring explains the threads, the locks and who wakes whom.

Rule of this file: submitting a frame never waits for the bus.
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
from eurobot_od.errors import BusError, NodeFailed, StateError
from eurobot_od.frame import HIGHEST_IDENTIFIER, MOST_BYTES, Data, Frame, RemoteFrame
from eurobot_od.od.standard import ErrorCode
from eurobot_od.pdo.kinds import Message
from eurobot_od.support.connections import Backoff

if TYPE_CHECKING:
    import can

    from eurobot_od.device.node import Node
    from eurobot_od.device.station import NodeGroup, Station

PATIENCE = 1.0
"""Seconds that the end waits for each thread."""


TAKEN_WITHIN = 1.0
"""Seconds in which a driver has to take a frame."""

ERROR_FRAMES = (
    (0x004, 0x03, ErrorCode.OVERRUN),
    (0x004, 0x30, ErrorCode.ERROR_PASSIVE),
    (0x100, 0x00, ErrorCode.RECOVERED_FROM_BUS_OFF),
)
"""Error frames that become an EMCY, in the form of Linux's `can/error.h`, which python-can's drivers pass on.

Each has a class bit in the identifier, bits of data byte 1 of which one is set (0: any or none), and our error code.
"""


BUS_OFF = 1 << 6
"""Class bit of the error frame that says that the controller is bus-off."""

BUS_OFF_HINT = (
    "the controller has left the bus; SocketCAN restarts it with `ip link set CHANNEL type can restart-ms 100`"
)


class _NoThreads:
    """Takes the place of the lock in a forked child, which has none of the threads that would do the work."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __enter__(self) -> None:
        raise StateError(f"{self._name}: belongs to the process that has forked; open a bus of your own after the fork")

    def __exit__(self, *_: object) -> None:
        """Nothing was entered."""


def _refuse(started: weakref.ref[Live]) -> None:
    """Have every call to a `Live` and its node refused in a forked child."""
    live = started()
    if live is not None:
        live.refuse()


class Live:
    """A controller, and the node of a station if there is one, running on a bus; a context manager.

    `clock` gives the time in seconds that nodes and listeners see. `foreign` counts what came from the bus and is not a
    classic base data frame, `missed` what came while the process stood still and is not acted on. A bus that fails is
    opened again by `opener`, if there is one; `gaps` says how often and for how long. `failure` is why it
    cannot go on, None while it can. All this is reported, too. The bus is shut down at the end.
    """

    def __init__(
        self,
        bus: can.BusABC,
        controller: Controller,
        station: Station | None = None,
        clock: Callable[[], float] = time.perf_counter,
        opener: Opener | None = None,
    ) -> None:
        self.controller, self.station, self.clock = controller, station, clock
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
        """Return a node ready to run on a bus; `options` are those of Station."""
        from eurobot_od.device.station import OnError, Station  # a controller alone needs no nodes

        station = Station(node, **{"on_error": OnError.RESTART} | options)
        return cls(bus, station.controller, station, clock, opener)

    @property
    def bus(self) -> can.BusABC:
        """The bus as it is opened now."""
        return self._driver.bus

    @property
    def gaps(self) -> Gaps:
        """How often the bus was lost and came back, and for how long."""
        return self._connection.gaps

    @property
    def overflow(self) -> int:
        """How many received frames have found no room in the driver's queue; 0 if it does not tell."""
        return self._connection.overflow

    @property
    def failure(self) -> BusError | NodeFailed | None:
        """Why it cannot go on: the bus has failed and is not opened again, or the node has ended."""
        return self._failure or (None if self.station is None else self.station.failure)

    # Life

    def start(self) -> Live:
        """Hand the receive filters to the bus, switch the node on, start reading."""
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
        """Hand the receive filters to the bus if its driver filters: python-can's own filtering saves nothing.

        Raises BusError.
        """
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
        """Let the node say goodbye, end the threads and shut the bus down.

        Frames still waiting are sent first if the bus takes them. Waits for a function that does not return no longer
        than `PATIENCE`. Raises what the node could not bring to its end; BusError if the bus fails only now; NodeFailed
        if the node has failed meanwhile and no `report` of its owner's was told, even if it was restarted.
        """
        if self._forked:
            return  # the bus is the other process's
        try:
            # First: what a node does before it is switched off, such as to stop, needs the threads.
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
        """End the threads and shut the bus down, whatever became of the leave."""
        try:
            self._functions.stop()  # first: what the last functions send still needs the other two threads
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
            # The error that has ended the block is the one to be seen. A robot that does not stand is worse than that.
            self.controller.report(Report(Event.END_FAILED, self.name, str(error), self.clock(), error))

    def refuse(self) -> None:
        """Raise StateError for every send and every call of the node: for a process without its threads."""
        refusal: Any = _NoThreads(self.name)
        self._lock, self._forked = refusal, True
        if self.station is not None:
            self.station.node.guard = refusal

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()

    def _lost(self, why: BusError, opened_again: bool) -> None:
        """Report that the adapter was pulled out, the server went away, the driver failed, and let the node stand.

        Until the bus is back, only stops are kept for it.
        """
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
        """Encode a message and leave it to the queue; never waits. Raises FieldError for a value out of range.

        With a node, the node sends it: raises StateError if it has no such TPDO or its NMT state does not allow it; and
        in any case when the `Live` has ended, or in a forked child.
        """
        with self._lock:
            if self._ended:
                raise StateError(f"{self.name}: the bus is closed; nothing is sent any more")
            if self.station is not None:
                self.station.node.send(message)  # and that wakes the keeper
                return
            self.controller.send(message, self.clock())
        if self._driver.prompt:
            self._sender.pump()  # here and now: to wake the keeper takes as long as the frame on the bus
        else:
            self._wake()

    # The reader's thread

    def _receive(self, cob_id: int, data: Data, now: float) -> None:
        """Deliver a frame, let the keeper know when to look again, and send the answers.

        In this order: as soon as an answer is out, the thread that waited for it competes with this one for the
        interpreter, and what is left to do here takes twice as long.
        """
        self.controller.receive_data(cob_id, data, now)
        self._answered()

    def _answered(self) -> None:
        if self.station is not None and self.station.plan.soonest < self._looks_at:
            self._wake()
        self._sender.pump()

    def _note_foreign(self, message: can.Message | None) -> None:
        """Count what is not a classic base data frame; the node gets remote frames and what the controller reports."""
        self.foreign += 1
        if message is not None and message.is_error_frame and message.arbitration_id & BUS_OFF:
            now = self.clock()
            if self.station is not None:  # it cannot be commanded now; its recovery is an error frame, too
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
        """Report frames that waited while the process stood still: an old goto must not be carried out now."""
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
        """Return when there is something to do again; called with the lock held, so that no wake-up is missed."""
        now = self.clock()
        looks = [now + POLL]
        if self.station is not None:
            looks.append(self.station.next_wakeup)
        if self._sender.blocked:
            looks += [now + self._sender.pause, self.controller.queue.next_expiry]
        elif self.controller.queue.waiting and not self._sender.busy:
            return now  # frames wait that no thread is at: submitted after the sender has looked
        return min(looks)


class LiveGroup:
    """A group of nodes on one bus, in one thread: a whole network of simulated devices.

    A bus that fails is opened again by `opener`, if there is one, and the nodes go on; `report` is told. `sent` and
    `received` count frames. A context manager, which shuts the bus down.
    """

    def __init__(
        self,
        bus: can.BusABC,
        group: NodeGroup,
        clock: Callable[[], float] = time.perf_counter,
        opener: Opener | None = None,
        report: Callable[[Report], object] = lambda _: None,
    ) -> None:
        self.group, self.clock, self.name = group, clock, str(bus.channel_info)
        self._opener, self._report, self._backoff = opener, report, Backoff()
        self.sent = self.received = 0
        self._driver, self._silence = Driver(bus), BusSilence()

    def run(self, end: float) -> None:
        """Switch the nodes on, and run them until a time of the clock. Raises BusError."""
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
        """Run the nodes until the end or the bus's failure, which raises BusError."""
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
        """Open the bus again, trying until the end."""
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
        """Wait for a frame up to some seconds; None for none, and for one that is not classic CAN with 11 bits."""
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
            while not self._driver.send(frame):  # its queue is full until the bus has taken a frame
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
