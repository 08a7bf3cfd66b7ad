"""Reading a bus in a thread: the loop that every received frame goes through, and the thread that calls functions."""

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
"""Longest time in seconds that a thread waits before it looks whether it is to end."""


MALFORMED = (ValueError, TypeError, LookupError, AssertionError, StructError)
"""What drivers raise about a frame that makes no sense to them; about a bus they raise other errors."""

ENDURED = 100
"""This many in a row are no longer garbled frames: the bus has failed."""


OLD = 1.0
"""Seconds that a frame may have waited in the driver's queue."""


class Backlog:
    """Finds old frames by the driver's time stamps; `ended` gets their number after each standstill.

    Frames that came while the process stood still (SIGSTOP, a suspended computer) are too old to be acted on. Only
    after a standstill can a frame be old, until one is fresh or none is waiting: so setting the clock does not make a
    node deaf.

    `longest` is the longest time in seconds that a running reader takes from one call to the next.
    """

    def __init__(self, longest: float, ended: Callable[[int], object]) -> None:
        self._longest, self._ended = longest, ended
        self._last, self._usual = inf, inf
        self._waits, self._count = False, 0

    def is_old(self, now: float, stamp: float) -> bool:
        """Return whether a frame read `now` has waited too long; `stamp` is 0.0 if the driver gives none."""
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
            self._waits = True  # the wait for a frame has run out meanwhile: those that have come are still to be read
        elif self._waits:
            self._end()

    def _end(self) -> None:
        self._waits, count, self._count = False, self._count, 0
        if count:
            self._ended(count)


SILENT_AFTER = 5.0
"""Seconds without a frame after which a bus with regular heartbeats is silent."""

REGULAR = SILENT_AFTER / 3
"""Longest time in seconds between two heartbeats, of anybody, that are regular."""

NOTHING_HEARD = (
    "nothing has been heard for {:.0f} s, not even a heartbeat; all others are off, or what is between does not deliver"
)
HEARD_AGAIN = "frames are heard again"


class BusSilence:
    """Notices that nothing more is heard, when nothing has failed: as if a bus server had forgotten its clients.

    Times are in seconds. Only where heartbeats were regular does silence mean anything.
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
        """Report what is new about a bus of that name, mostly nothing; one that is not open is not silent."""
        if not is_open or now - self._looked > SILENT_AFTER / 2:  # or this process itself has stood still
            self._last = now
        self._looked, quiet = now, now - self._last
        if self._is_regular and (quiet > SILENT_AFTER) is not self._is_told:
            self._is_told = not self._is_told
            text = NOTHING_HEARD.format(quiet) if self._is_told else HEARD_AGAIN
            report(Report(Event.BUS_SILENT, bus, text, now))


class Reader:
    """Gives each classic data frame with an 11-bit identifier to `receive`, and any other frame to `foreign`.

    `receive` takes the COB-ID, the data in the driver's buffer, and when the frame was read, in seconds of `clock`;
    without one the driver's time stamps count, which start anywhere. `foreign` gets None for a frame of which the
    driver can make no sense. `missed` gets how many frames were passed over because they came while the process stood
    still; those whose COB-ID `lasts` are never. `idle` is called whenever no frame has come for a while.
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
        self._connection, self._receive, self._clock, self._foreign = connection, receive, clock, foreign
        self._idle = idle
        self._backlog = None if missed is None else Backlog(POLL + OLD, missed)
        self._lasts = lasts
        self.silence = BusSilence()

    def read(self) -> None:
        """Read in this thread until the connection is closed, or lost for good."""
        connection, going_on = self._connection, True
        while going_on:
            bus = connection.driver.bus
            try:
                self._read(bus)
            except BaseException as error:  # drivers raise OSError, CanError, ctypes' errors, ...
                connection.fail(failure(bus, error))
            going_on = connection.reopen()

    def _read(self, bus: can.BusABC) -> None:
        """Read as long as the connection is up; raises whatever the driver raises."""
        connection, recv, receive, clock = self._connection, bus.recv, self._receive, self._clock
        nonsense, backlog, heard, now = 0, self._backlog, self.silence.heard, 0.0
        while connection.up:
            try:
                message = recv(POLL)
            except MALFORMED:
                nonsense += 1
                if nonsense == ENDURED:
                    raise
                self._foreign(None)
                continue
            nonsense = 0  # garbled frames are not a failure unless nothing else comes
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
                self._foreign(message)  # what an adapter cannot receive, a peer behind a network can send
            elif backlog is None or not backlog.is_old(now, message.timestamp) or self._lasts(message.arbitration_id):
                receive(message.arbitration_id, message.data, now if clock else message.timestamp)


class FrameReader:
    """Calls `seen` with the time and every classic base data frame on a bus; a context manager.

    `clock`, `foreign` and `idle` are those of the Reader, `opener`, `failed` and `back` the Connection's.
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

        driver, lost = Driver(bus), lambda why, _: failed(why)
        self._connection = Connection(driver, opener, time.monotonic, lost, lambda: None, back)
        reader = Reader(self._connection, receive, clock, foreign, idle=idle)
        self._thread = threading.Thread(target=reader.read, name=f"{bus.channel_info} watch", daemon=True)

    @property
    def bus(self) -> can.BusABC:
        """The bus as it is opened now."""
        return self._connection.driver.bus

    @property
    def name(self) -> str:
        """What the driver calls the bus."""
        return str(self.bus.channel_info)

    def send(self, frame: Frame, timeout: float | None = None) -> bool:
        """Hand a frame to the driver, as `Driver.send` does; when that fails, the bus is opened again as well."""
        try:
            return self._connection.driver.send(frame, timeout)
        except BusError as failed:
            self._connection.fail(failed)
            raise

    def overflow(self) -> int:
        """Return how many frames have found no room in the driver's queue so far; 0 if it does not tell."""
        self._connection.count_overflow()
        return self._connection.overflow

    def __enter__(self) -> FrameReader:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()
        self._connection.count_overflow()  # while there is a socket to ask
        self._thread.join(10 * POLL)
        # The end of a bus that has failed can only fail for the same reason.
        with suppress(Exception) if self._connection.failure else nullcontext():
            shut_down(self._connection.driver.bus)


BACKLOG = 1000
"""Calls that wait: with a message every 10 ms, a function that takes 10 s loses none."""

STUCK_AFTER = 0.25
"""Seconds after which a call that has not returned is reported."""

PATIENCE = 1.0
"""Seconds that the end waits for the calls that are left."""


class DueCall(NamedTuple):
    """A call that is due."""

    listener: FunctionListener[Any]
    message: Any
    timestamp: float


class FunctionThread:
    """Makes calls in the order in which they are submitted; when `backlog` of them wait, the oldest makes room.

    `clock` is the controller's, by which slow calls are measured too.
    """

    def __init__(self, name: str, report: Reporter, clock: Callable[[], float], backlog: int = BACKLOG) -> None:
        self._report, self._clock, self._backlog = report, clock, backlog
        self._waiting: SimpleQueue[DueCall | None] = SimpleQueue()
        self._running: tuple[DueCall, float] | None = None
        """The call under way and since when; one value, as another thread reads it."""
        self._reported: DueCall | None = None
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread. It is a daemon: a function that never returns must not keep the process."""
        self._thread.start()

    def submit(self, listener: FunctionListener[Any], message: Any, timestamp: float) -> None:
        """Have a function called soon; never waits."""
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
        """Report a call that does not return, once; for the thread that keeps the time."""
        running = self._running
        if running is None or running[0] is self._reported or self._clock() - running[1] <= STUCK_AFTER:
            return
        call = self._reported = running[0]
        text = "does not return; other functions wait for it, nodes and queues do not"
        self._report(Report(Event.LISTENER_STUCK, call.listener.name, text, call.timestamp))

    def stop(self) -> None:
        """Make the calls that are left, for at most `PATIENCE` seconds, and count those not made as lost."""
        self._waiting.put(None)
        if self._thread.is_alive() and self._thread is not threading.current_thread():  # a function may end the program
            self._thread.join(PATIENCE)
        while (left := self._take()) is not None:
            left.listener.lost += 1
        self._waiting.put(None)  # for a function that returns later
