"""Message queues: the listener that a program reads when it has time (document 4.1, setQueueCANListener).

Rule of this file: the newest message is never the one that is lost. One thread puts, any number may get.
"""

from __future__ import annotations

from queue import Empty, SimpleQueue
from typing import Generic, TypeVar, overload

from typing_extensions import NamedTuple

from eurobot_od.gatekeeper.reports import Event, Report, Reporter, has_doubled

T = TypeVar("T")


class Received(NamedTuple, Generic[T]):
    """A message as it waits in a queue, and when it came, in the bus's seconds."""

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
    """A FIFO of received messages, at most `maxsize` (0: any number); the oldest makes room when it is full."""

    def __init__(self, name: str, maxsize: int, report: Reporter) -> None:
        self.name, self.maxsize = name, maxsize
        self.delivered = self.lost = 0
        self._report = report
        self._items: SimpleQueue[Received[T]] = SimpleQueue()

    def __len__(self) -> int:
        return self._items.qsize()

    def put(self, message: T, timestamp: float) -> None:
        """Append a message; never waits."""
        if 0 < self.maxsize <= self._items.qsize():
            self._drop_oldest(timestamp)
        self._items.put(Received(message, timestamp))
        self.delivered += 1

    def _drop_oldest(self, now: float) -> None:
        if self.get_nowait() is None:
            return  # a reader has made room in the meantime
        self.lost += 1
        if has_doubled(self.lost):
            text = f"full with {self.maxsize} messages, {self.lost} lost so far; the newest are kept"
            self._report(Report(Event.QUEUE_OVERFLOW, self.name, text, now))

    @overload
    def get(self) -> Received[T]: ...

    @overload
    def get(self, timeout: None) -> Received[T]: ...

    @overload
    def get(self, timeout: float) -> Received[T] | None: ...

    def get(self, timeout: float | None = None) -> Received[T] | None:
        """Take the oldest message, waiting at most `timeout` seconds for one (None: for ever); None if none came."""
        try:
            return self._items.get(timeout=timeout)
        except Empty:
            return None

    def get_nowait(self) -> Received[T] | None:
        """Take the oldest message, None if there is none."""
        try:
            return self._items.get_nowait()
        except Empty:
            return None

    def drain(self) -> list[Received[T]]:
        """Take all messages that are there, the oldest first."""
        return list(iter(self.get_nowait, None))

    def statistics(self) -> ListenerStatistics:
        """Return the counts so far."""
        return ListenerStatistics(self.name, self.delivered, self.lost)
