"""Threads that read a bus and call users' functions."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from contextlib import nullcontext, suppress
from math import inf
from queue import Empty, SimpleQueue
from struct import error as StructError  # noqa: N812 (a class with a small name)
from typing import TYPE_CHECKING, Any, NamedTuple

from eurobot_od.bus.live.buses import Connection, Driver, Opener, failure, shut_down
from eurobot_od.controller import Event, FunctionListener, Report, Reporter
from eurobot_od.errors import BusError
from eurobot_od.frame import HIGHEST_IDENTIFIER, MOST_BYTES, Data, Frame
from eurobot_od.od.values import ERROR_CONTROL_BASE, NODE_IDS

if TYPE_CHECKING:
    import can


POLL = 0.1
"""Longest time that a thread waits before it checks whether it has to end, in s."""


MALFORMED = (ValueError, TypeError, LookupError, AssertionError, StructError)
"""Exceptions of drivers for a malformed frame; a failed bus raises others."""

ENDURED = 100
"""Number of malformed frames in a row after which the bus has failed."""


OLD = 1.0
"""Longest time that a frame may wait in the driver's queue, in s."""


class Backlog:
    """Detects old frames by the driver's time stamps; `ended` is called with their number after each standstill.

    Frames that came while the process stood still (SIGSTOP, a suspended computer) are too old to be used. Frames are
    old only after a standstill, until one is fresh or none is waiting, so that setting the clock does not drop frames.

    `longest` is the longest time in s between two calls by a running reader.
    """

    def __init__(self, longest: float, ended: Callable[[int], object]) -> None:
        self._longest, self._ended = longest, ended
        self._last, self._usual = inf, inf
        self._waits, self._count = False, 0

    def is_old(self, now: float, stamp: float) -> bool:
        """Return whether a frame read `now` is too old; `stamp` is 0.0 if the driver gives none."""
        self._waits = self._waits or now - self._last > self._longest
        self._last = now
        if self._waits and stamp:
            if now - stamp > self._usual + OLD:
                self._count += 1
                return True
            self._end()
        self._usual = now - stamp
        return False

    def is_empty(self, now: float) -> None:
        """Note that no frame is waiting."""
        stood_still = now - self._last > self._longest
        self._last = now
        if stood_still:
            self._waits = True  # frames that came meanwhile are still to be read
        elif self._waits:
            self._end()

    def _end(self) -> None:
        self._waits = False
        count = self._count
        self._count = 0
        if count:
            self._ended(count)


SILENT_AFTER = 5.0
"""Time without a frame after which a bus with regular heartbeats is silent, in s."""

REGULAR = SILENT_AFTER / 3
"""Longest time between two heartbeats, of any nodes, that are regular, in s."""

NOTHING_HEARD = (
    "nothing has been heard for {:.0f} s, not even a heartbeat; all others are off, or what is between does not deliver"
)
HEARD_AGAIN = "frames are heard again"


class BusSilence:
    """Detects that no frames arrive although nothing has failed, such as after a bus server has lost its clients.

    Times are in s. A bus is silent only if heartbeats were regular before.
    """

    def __init__(self) -> None:
        self._last = self._looked = self._beat = -inf
        self._is_regular = self._is_told = False

    def heard(self, cob_id: int, now: float) -> None:
        """Note a frame."""
        self._last = now
        if cob_id - ERROR_CONTROL_BASE in NODE_IDS:
            self._is_regular = self._is_regular or now - self._beat < REGULAR
            self._beat = now

    def watch(self, bus: str, report: Reporter, now: float, is_open: bool = True) -> None:
        """Report if a bus has become silent, or is heard again; one that is not open is not silent."""
        if not is_open or now - self._looked > SILENT_AFTER / 2:  # this process may have stood still
            self._last = now
        self._looked = now
        quiet = now - self._last
        if self._is_regular and (quiet > SILENT_AFTER) is not self._is_told:
            self._is_told = not self._is_told
            text = NOTHING_HEARD.format(quiet) if self._is_told else HEARD_AGAIN
            report(Report(Event.BUS_SILENT, bus, text, now))


class Reader:
    """Passes each classic data frame with an 11-bit identifier to `receive`, and any other frame to `foreign`.

    `receive` is called with COB-ID, the data in the driver's buffer, and the time in s by `clock`, or else by the
    driver's time stamps. `foreign` is called with None for a malformed frame. `missed` is called with the number of
    frames that were dropped because they came while the process stood still; frames whose COB-ID `lasts` are kept.
    `idle` is called when no frame has come for a while.
    """

    def __init__(
        self,
        connection: Connection,
        receive: Callable[[int, Data, float], object],
        clock: Callable[[], float] | None,
        foreign: Callable[[can.Message | None], object],
        missed: Callable[[int], object] | None = None,
        lasts: Callable[[int], bool] = lambda _: False,
        idle: Callable[[], object] = lambda: None,
    ) -> None:
        self._connection = connection
        self._receive = receive
        self._clock = clock
        self._foreign = foreign
        self._idle = idle
        self._backlog = None if missed is None else Backlog(POLL + OLD, missed)
        self._lasts = lasts
        self.silence = BusSilence()

    def read(self) -> None:
        """Read in this thread until the connection is closed, or has failed for good."""
        connection = self._connection
        going_on = True
        while going_on:
            bus = connection.driver.bus
            try:
                self._read(bus)
            except BaseException as error:  # drivers raise OSError, CanError, ctypes' errors, ...
                connection.fail(failure(bus, error))
            going_on = connection.reopen()

    def _read(self, bus: can.BusABC) -> None:
        """Read while the connection is up; raises any exception of the driver."""
        connection, recv, receive, clock = self._connection, bus.recv, self._receive, self._clock
        nonsense = 0
        backlog = self._backlog
        heard = self.silence.heard
        now = 0.0
        while connection.up:
            try:
                message = recv(POLL)
            except MALFORMED:
                nonsense += 1
                if nonsense == ENDURED:
                    raise
                self._foreign(None)
                continue
            nonsense = 0
            if connection.failure is not None:
                connection.works()
            now = clock() if clock else 0.0
            if message is None:
                self._idle()
                if backlog is not None:
                    backlog.is_empty(now)
                continue
            heard(message.arbitration_id, now)
            if message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd:
                self._foreign(message)
            elif len(message.data) > MOST_BYTES or not 0 <= message.arbitration_id <= HIGHEST_IDENTIFIER:
                self._foreign(message)  # impossible from an adapter, but not from a network peer
            elif backlog is None or not backlog.is_old(now, message.timestamp) or self._lasts(message.arbitration_id):
                receive(message.arbitration_id, message.data, now if clock else message.timestamp)


class FrameReader:
    """Calls `seen` with the time and every classic base data frame on a bus; a context manager.

    `clock`, `foreign` and `idle` are those of Reader; `opener`, `failed` and `back` those of Connection.
    """

    def __init__(
        self,
        bus: can.BusABC,
        seen: Callable[[float, Frame], object],
        clock: Callable[[], float] | None,
        failed: Callable[[BusError], object] = lambda _: None,
        foreign: Callable[[can.Message | None], object] = lambda _: None,
        opener: Opener | None = None,
        back: Callable[[float], object] = lambda _: None,
        idle: Callable[[], object] = lambda: None,
    ) -> None:
        def receive(cob_id: int, data: Data, now: float) -> None:
            seen(now, Frame(cob_id, bytes(data)))

        def lost(why: BusError, _: bool) -> None:
            failed(why)

        driver = Driver(bus)
        self._connection = Connection(driver, opener, time.monotonic, lost, lambda: None, back)
        reader = Reader(self._connection, receive, clock, foreign, idle=idle)
        self._thread = threading.Thread(target=reader.read, name=f"{bus.channel_info} watch", daemon=True)

    @property
    def bus(self) -> can.BusABC:
        """The present bus."""
        return self._connection.driver.bus

    @property
    def name(self) -> str:
        """The driver's name of the bus."""
        return str(self.bus.channel_info)

    def send(self, frame: Frame, timeout: float | None = None) -> bool:
        """Send a frame as `Driver.send` does; after a failure the bus is reopened."""
        try:
            return self._connection.driver.send(frame, timeout)
        except BusError as failed:
            self._connection.fail(failed)
            raise

    def overflow(self) -> int:
        """Return the number of received frames that the driver has dropped; 0 if it does not report them."""
        self._connection.count_overflow()
        return self._connection.overflow

    def __enter__(self) -> FrameReader:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()
        self._connection.count_overflow()  # while there is a socket to ask
        self._thread.join(10 * POLL)
        # Shutting down a failed bus fails for the same reason.
        with suppress(Exception) if self._connection.failure else nullcontext():
            shut_down(self._connection.driver.bus)


BACKLOG = 1000
"""Largest number of queued calls: with a message every 10 ms, a function may take 10 s."""

STUCK_AFTER = 0.25
"""Time after which a call that has not returned is reported, in s."""

PATIENCE = 1.0
"""Longest wait for the remaining calls at the end, in s."""


class DueCall(NamedTuple):
    """A queued call."""

    listener: FunctionListener[Any]
    message: Any
    timestamp: float


class FunctionThread:
    """Makes calls in the order of their submission; with `backlog` queued calls, the oldest is dropped.

    `clock` is the controller's, and also measures slow calls.
    """

    def __init__(self, name: str, report: Reporter, clock: Callable[[], float], backlog: int = BACKLOG) -> None:
        self._report, self._clock, self._backlog = report, clock, backlog
        self._waiting: SimpleQueue[DueCall | None] = SimpleQueue()
        self._running: tuple[DueCall, float] | None = None
        """The present call and its start; one value, because another thread reads it."""
        self._reported: DueCall | None = None
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread, a daemon, so that a function that never returns does not keep the process alive."""
        self._thread.start()

    def submit(self, listener: FunctionListener[Any], message: Any, timestamp: float) -> None:
        """Queue the call of a function; never blocks."""
        if self._waiting.qsize() >= self._backlog and (oldest := self._take()) is not None:
            oldest.listener.has_lost(oldest.timestamp)
        self._waiting.put(DueCall(listener, message, timestamp))

    def _take(self) -> DueCall | None:
        try:
            return self._waiting.get_nowait()
        except Empty:  # the thread was quicker
            return None

    def _run(self) -> None:
        while (call := self._waiting.get()) is not None:
            self._running = call, self._clock()
            try:
                call.listener.call(call.message, call.timestamp)
            except BaseException as error:
                call.listener.has_failed(error, call.timestamp)
            self._running = None

    def watch(self) -> None:
        """Report a call that does not return, once; called by the keeper."""
        running = self._running
        if running is None or running[0] is self._reported or self._clock() - running[1] <= STUCK_AFTER:
            return
        call = self._reported = running[0]
        text = "does not return; other functions wait for it, nodes and queues do not"
        self._report(Report(Event.LISTENER_STUCK, call.listener.name, text, call.timestamp))

    def stop(self) -> None:
        """Make the remaining calls for at most `PATIENCE`, and count the others as lost."""
        self._waiting.put(None)
        if self._thread.is_alive() and self._thread is not threading.current_thread():  # a function may end the program
            self._thread.join(PATIENCE)
        while (left := self._take()) is not None:
            left.listener.lost += 1
        self._waiting.put(None)  # for a function that returns later
