"""Listeners: message queues, which a program reads when it has time, and functions (document 4.1); and reports.

Rule of this file: a listener never raises into the thread that delivers, and what it loses is counted and reported.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from queue import Empty, SimpleQueue
from typing import Generic, NamedTuple, TypeAlias, TypeVar

from eurobot_od.support.texts import amount, one_line


class Event(Enum):
    """What happened."""

    LISTENER_FAILED = "listener failed"
    LISTENER_SLOW = "listener slow"
    LISTENER_STUCK = "listener stuck"
    QUEUE_OVERFLOW = "queue overflow"
    FRAME_REFUSED = "frame refused"
    FRAME_DROPPED = "frame dropped"
    BUS_FAILED = "bus failed"
    BUS_OFF = "bus off"
    BUS_BACK = "bus back"
    BUS_SILENT = "bus silent"
    FRAMES_LOST = "frames lost"
    END_FAILED = "end failed"
    NODE_ALARM = "node alarm"
    NODE_FAILED = "node failed"


@dataclass(frozen=True)
class Report:
    """One event: the `name` of a listener, message, identifier or bus, what happened to it, and when in seconds.

    `timestamp` is that of the frame concerned; `error` is the exception, for a caller that wants its traceback. `str()`
    is one line for a person.
    """

    event: Event
    name: str
    text: str
    timestamp: float
    error: BaseException | None = None

    def __str__(self) -> str:
        return one_line(f"{self.event.value}: {self.name}: {' '.join(self.text.split())}")


Reporter: TypeAlias = Callable[[Report], object]
"""Takes a report, on the thread where it happened; it must neither raise nor wait."""


def has_doubled(count: int) -> bool:
    """Tell whether the count of a lasting condition has to be reported: at 1, 2, 4, 8, ..."""
    # A power of two has one bit set: a million losses make twenty reports.
    return count.bit_count() == 1


T = TypeVar("T")

Function: TypeAlias = Callable[[T, float], object]
"""Gets what it listens to, and the time of that in the bus's seconds."""


class Received(NamedTuple, Generic[T]):
    """A message in a queue, with its time in the bus's seconds."""

    message: T
    timestamp: float


class ListenerStatistics(NamedTuple):
    """A listener's counts: messages delivered and lost, calls that failed, and calls that held up the others."""

    name: str
    delivered: int
    lost: int
    failed: int = 0
    slow: int = 0


class MessageQueue(Generic[T]):
    """A FIFO of received messages, at most `maxsize` (0: any number). One thread puts, any number may get.

    When the queue is full, the oldest message makes room: the newest position or goto is the one that counts.
    """

    def __init__(self, name: str, maxsize: int, report: Reporter) -> None:
        self.name, self.maxsize = name, maxsize
        self.delivered = self.lost = 0
        self._report = report
        # Its `put` never waits, and may be interrupted by another one: a program must never hold up the bus's thread.
        self._items: SimpleQueue[tuple[T, float]] = SimpleQueue()

    def __len__(self) -> int:
        return self._items.qsize()

    def put(self, message: T, timestamp: float) -> None:
        """Append a message, without waiting."""
        # Full, unless a reader has made room meanwhile.
        if 0 < self.maxsize <= self._items.qsize() and self.get_nowait() is not None:
            self.lost += 1
            if has_doubled(self.lost):
                text = f"full with {self.maxsize} messages, {self.lost} lost so far; the newest are kept"
                self._report(Report(Event.QUEUE_OVERFLOW, self.name, text, timestamp))
        self._items.put((message, timestamp))  # the reading program makes a Received of it, not the bus's thread
        self.delivered += 1

    def get(self, timeout: float | None = None) -> Received[T] | None:
        """Take the oldest message, waiting up to `timeout` seconds (None: for ever); None if none came."""
        try:
            return Received(*self._items.get(timeout=None if timeout is None else max(timeout, 0)))
        except Empty:
            return None

    def get_nowait(self) -> Received[T] | None:
        """Take the oldest message, None if there is none."""
        return self.get(timeout=0.0)

    def drain(self) -> list[Received[T]]:
        """Take all messages that are waiting, the oldest first."""
        return list(iter(self.get_nowait, None))

    def statistics(self) -> ListenerStatistics:
        """Return the counts so far."""
        return ListenerStatistics(self.name, self.delivered, self.lost)


class FunctionListener(Generic[T]):
    """A function with its name and counts; a call that takes longer than `slow_after` seconds is reported."""

    def __init__(
        self, name: str, function: Function[T], report: Reporter, clock: Callable[[], float], slow_after: float
    ) -> None:
        self.name = name
        self.delivered = self.lost = self.failed = self.slow = 0
        self._function, self._report, self._clock, self._slow_after = function, report, clock, slow_after

    def call(self, message: T, timestamp: float) -> None:
        """Call the function; an exception of its own ends here."""
        # Not the message's timestamp: that is when the frame came, and it may have waited.
        begin = self._clock()
        try:
            self._function(message, timestamp)
        except (Exception, SystemExit) as error:  # whatever it is, the other listeners get their message
            self.has_failed(error, timestamp)
        self.delivered += 1
        seconds = self._clock() - begin
        if seconds > self._slow_after:
            self.slow += 1
            if has_doubled(self.slow):
                text = f"held up the others for {seconds * 1000:.1f} ms, {amount(self.slow, 'time')} so far"
                self._report(Report(Event.LISTENER_SLOW, self.name, text, timestamp))

    def has_failed(self, error: BaseException, timestamp: float) -> None:
        """Note that a call raised an exception."""
        self.failed += 1
        text = f"{type(error).__name__}: {error}"
        self._report(Report(Event.LISTENER_FAILED, self.name, text, timestamp, error))

    def has_lost(self, timestamp: float) -> None:
        """Note that a message was dropped before the function could be called with it."""
        self.lost += 1
        if has_doubled(self.lost):
            text = f"too many calls wait, {amount(self.lost, 'message')} lost so far; the newest are kept"
            self._report(Report(Event.QUEUE_OVERFLOW, self.name, text, timestamp))

    def statistics(self) -> ListenerStatistics:
        """Return the counts so far."""
        return ListenerStatistics(self.name, self.delivered, self.lost, self.failed, self.slow)
