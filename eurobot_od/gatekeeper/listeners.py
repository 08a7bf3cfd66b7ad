"""Function listeners: functions called with each message (document 4.1, setFunctionCANListener).

Rule of this file: a listener harms nobody but itself, and runs in one thread at a time. Its exceptions end here. One
that has been slow or stuck is set aside: its messages wait in a queue of its own for a thread other than the
reader's. The thread that is stuck in a call is that thread, as soon as it comes back.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeAlias

from eurobot_od.gatekeeper.baton import Baton, Call
from eurobot_od.gatekeeper.queues import ListenerStatistics, MessageQueue, Received, T
from eurobot_od.gatekeeper.reports import Event, Report, Reporter, has_doubled

BACKLOG = 1000
"""Messages that wait for a listener set aside: one sent every 100 ms fills this in 100 s, longer than a match."""

Aside: TypeAlias = Callable[[Callable[[], None]], object]
"""Runs what it is given on a thread other than the reader's, as `ThreadPoolExecutor().submit` does."""

Function: TypeAlias = Callable[[T, float], object]
"""Gets what it listens to and when that came, in the bus's seconds."""


def in_place(work: Callable[[], None]) -> None:
    """Run the work of a listener set aside here and now, as if it were not."""
    work()


class FunctionListener(Generic[T]):
    """A function with its name; `deliver` is the function, or what leaves the message to `aside` once that is so.

    Who delivers counts that in `delivered`, and tells `has_failed` of an exception.
    """

    def __init__(self, name: str, function: Function[T], report: Reporter, aside: Aside) -> None:
        self.name = name
        self.delivered = self.failed = self.slow = 0
        self.deliver = function
        self._function, self._report, self._aside = function, report, aside
        self._backlog: MessageQueue[T] = MessageQueue(name, BACKLOG, report)
        self._lock = threading.Lock()
        self._working = False  # a thread is at the backlog, or will be
        self._owed = False  # and it is the one that was stuck

    def has_failed(self, error: Exception, timestamp: float) -> None:
        """Note that a call raised an exception."""
        self.failed += 1
        text = f"{type(error).__name__}: {error}"
        self._report(Report(Event.LISTENER_FAILED, self.name, text, timestamp, error))

    def was_slow(self, seconds: float, timestamp: float) -> None:
        """Note that a call held up the reader for `seconds`, and set the listener aside."""
        self.slow += 1
        self.deliver = self._postpone
        if has_doubled(self.slow):
            text = f"held up the others for {seconds * 1000:.1f} ms, {self.slow} times so far"
            self._report(Report(Event.LISTENER_SLOW, self.name, text, timestamp))

    def _postpone(self, message: T, timestamp: float) -> None:
        self._backlog.put(message, timestamp)
        with self._lock:
            idle, self._working = not self._working, True
        if idle:
            self._aside(self._work)

    def _work(self) -> None:
        while (received := self._next()) is not None:
            try:
                self._function(*received)
            except Exception as error:  # the messages behind wait for this thread
                self.has_failed(error, received.timestamp)

    def _next(self) -> Received[T] | None:
        with self._lock:
            received = self._backlog.get_nowait()
            self._working = received is not None
            return received

    # A call that does not return

    def leave(self, baton: Baton, call: Call, timestamp: float) -> bool:
        """Set the listener aside in the midst of a call, by another thread; False if the call has returned by now."""
        with self._lock:
            if not baton.take(call):
                return False
            self._owed, self._working = not self._working, True
            self.deliver = self._postpone
        self._report(Report(Event.LISTENER_STUCK, self.name, "does not return; the others go on without it", timestamp))
        return True

    def come_back(self) -> None:
        """Catch up, in the thread that was stuck, with the messages that came meanwhile."""
        with self._lock:
            owed, self._owed = self._owed, False
        if owed:
            self._work()

    def statistics(self) -> ListenerStatistics:
        """Return the counts so far."""
        return ListenerStatistics(self.name, self.delivered, self._backlog.lost, self.failed, self.slow)


class QueueListener(FunctionListener[T]):
    """Puts messages into a queue; it takes no time, so whatever held up the reader meanwhile was something else."""

    def __init__(self, queue: MessageQueue[T], report: Reporter) -> None:
        super().__init__(queue.name, queue.put, report, in_place)
        self._queue = queue

    def was_slow(self, seconds: float, timestamp: float) -> None:
        """Take no notice."""

    def statistics(self) -> ListenerStatistics:
        """Return the queue's counts."""
        return self._queue.statistics()
