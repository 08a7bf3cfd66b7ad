"""Where the monitor's frames come from: a bus, or logs played at any speed.

Rule of this file: `poll` never waits; it returns what has come since the last time.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator, Iterator
from typing import TYPE_CHECKING, TypeAlias

from eurobot_od.errors import BusError
from eurobot_od.logs.binary import of_message
from eurobot_od.logs.entries import Raw

if TYPE_CHECKING:
    import can

    Timed: TypeAlias = tuple[float, Raw]

POLL = 0.1
"""Seconds after which the thread that reads a bus looks whether it is to end."""

AT_ONCE = 20_000
"""Entries of a log that are played without a refresh of the screen between them."""


class Collector:
    """What python-can's thread gives its messages, and its last error, to."""

    def __init__(self) -> None:
        self.came: deque[can.Message] = deque()
        self.error: Exception | None = None

    def __call__(self, message: can.Message) -> None:
        self.came.append(message)

    def on_error(self, error: Exception) -> None:
        """Keep an error until somebody asks for messages."""
        self.error = error


class BusSource:
    """Frames of a bus, with the driver's times; a thread of python-can's takes them from it."""

    ended = False

    def __init__(self, bus: can.BusABC, clock: Callable[[], float] = time.monotonic) -> None:
        import can

        self._clock = clock
        self._collector = Collector()
        self._last, self._seen = 0.0, clock()
        self._notifier = can.Notifier(bus, [self._collector], timeout=POLL)
        self._bus = bus

    @property
    def now(self) -> float:
        """The present in s, by the driver's clock."""
        return self._last + self._clock() - self._seen

    def pause(self, longest: float) -> float:
        """Return how long to wait before the next poll, s."""
        return longest

    def poll(self) -> Iterator[Timed]:
        """Return the frames; raises BusError if the bus failed."""
        came = self._collector.came
        for _ in range(len(came)):
            message = came.popleft()
            self._last, self._seen = message.timestamp, self._clock()
            yield message.timestamp, of_message(message)
        if self._collector.error is not None:
            raise BusError(f"the bus {self._bus.channel_info} failed: {self._collector.error}")

    def close(self) -> None:
        """Let the bus go."""
        self._notifier.stop(1)
        self._bus.shutdown()


class LogSource:
    """Entries of logs, played so many times faster than they were recorded."""

    def __init__(
        self, entries: Generator[Timed, None, None], speed: float, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.ended = False
        self._entries, self._speed, self._clock = entries, speed, clock
        self._started = clock()
        self._next: Timed | None = next(entries, None)
        self._first = self._last = self._next[0] if self._next else 0.0

    @property
    def now(self) -> float:
        """The present in s, by the log's clock."""
        if self.ended or self._speed == float("inf"):
            return self._last
        return self._first + (self._clock() - self._started) * self._speed

    def pause(self, longest: float) -> float:
        """Return how long to wait before the next poll, s."""
        return 0.0 if self._speed == float("inf") else longest

    def close(self) -> None:
        """Close the logs."""
        self._entries.close()

    def poll(self) -> Iterator[Timed]:
        """Return the entries whose time has come."""
        until = float("inf") if self._speed == float("inf") else self.now
        for _ in range(AT_ONCE):
            if self._next is None or self._next[0] > until:
                break
            self._last = self._next[0]
            yield self._next
            self._next = next(self._entries, None)
        self.ended = self._next is None
