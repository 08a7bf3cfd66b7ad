"""The thread in which functions of users run, so that one that hangs blocks neither the node nor a queue."""

from __future__ import annotations

import threading
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Any, NamedTuple

from eurobot_od.gatekeeper import Event, FunctionListener, Report, Reporter

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

    `clock` is the gatekeeper's, by which slow calls are measured too.
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
