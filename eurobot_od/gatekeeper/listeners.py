"""Function listeners: functions called with each message (document 4.1, setFunctionCANListener).

Rule of this file: a listener harms nobody but itself, and runs in one thread at a time. Its exceptions end here. One
that has been slow or stuck is set aside: its messages then wait in a queue of its own, and a thread other than the
reader's calls it. The thread that is stuck in a call is such a thread, once it comes back.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeAlias

from eurobot_od.gatekeeper.queues import ListenerStatistics, MessageQueue, Received, T
from eurobot_od.gatekeeper.reports import Event, Report, Reporter, has_doubled

BACKLOG = 1000
"""Messages that wait for a listener set aside; at 2014's traffic some ten seconds of everything on the bus."""

Aside: TypeAlias = Callable[[Callable[[], None]], object]
"""Runs what it is given on a thread other than the reader's, such as `ThreadPoolExecutor().submit`."""

Baton: TypeAlias = list[None]
"""One entry; of the threads that pop it exactly one succeeds, and that one goes on with the frame's delivery."""


def in_place(work: Callable[[], None]) -> None:
    """Run the work of a listener set aside here and now, for programs without threads."""
    work()


class FunctionListener(Generic[T]):
    """A function and its name; `deliver` calls it, or lets the message wait for `aside` when it has been set aside."""

    def __init__(self, name: str, function: Callable[[Received[T]], object], report: Reporter, aside: Aside) -> None:
        self.name = name
        self.delivered = self.failed = self.slow = 0
        self.deliver: Callable[[Received[T]], None] = self._call
        self._function, self._report, self._aside = function, report, aside
        self._backlog: MessageQueue[T] = MessageQueue(name, BACKLOG, report)
        self._working = False
        self._lock = threading.Lock()

    def _call(self, received: Received[T]) -> None:
        try:
            self._function(received)
        except Exception as error:  # whatever it is, the other listeners get their message
            self.failed += 1
            text = f"{type(error).__name__}: {error}"
            self._report(Report(Event.LISTENER_FAILED, self.name, text, received.timestamp, error))
        self.delivered += 1

    def was_slow(self, seconds: float, timestamp: float) -> None:
        """Note that a call held up the reader for `seconds`, and set the listener aside."""
        self.slow += 1
        self.deliver = self._postpone
        if has_doubled(self.slow):
            text = f"took {seconds * 1000:.1f} ms, slow {self.slow} times so far; set aside"
            self._report(Report(Event.LISTENER_SLOW, self.name, text, timestamp))

    def leave(self, baton: Baton, timestamp: float) -> bool:
        """Set the listener aside in the midst of a call; the thread in it has to `work` when it comes back.

        False if it has come back already: then the baton is gone.
        """
        with self._lock:
            try:
                baton.pop()
            except IndexError:
                return False
            self._working = True
            self.deliver = self._postpone
        self._report(Report(Event.LISTENER_STUCK, self.name, "does not return; set aside", timestamp))
        return True

    def _postpone(self, received: Received[T]) -> None:
        self._backlog.put(received)
        with self._lock:
            idle, self._working = not self._working, True
        if idle:
            self._aside(self.work)

    def work(self) -> None:
        """Call the function with what waits, the oldest first, until nothing does."""
        while (received := self._next()) is not None:
            self._call(received)

    def _next(self) -> Received[T] | None:
        with self._lock:
            received = self._backlog.get_nowait()
            self._working = received is not None
            return received

    def statistics(self) -> ListenerStatistics:
        """Return the counts so far."""
        return ListenerStatistics(self.name, self.delivered, self._backlog.lost, self.failed, self.slow)
