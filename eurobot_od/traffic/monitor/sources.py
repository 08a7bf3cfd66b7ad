"""Where the monitor's frames come from: a bus, or logs played at any speed.

Rule of this file: `poll` never waits, as the monitor waits for keys; it returns what has come since the last time.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, TypeAlias

from eurobot_od.bus.live import FrameReader, Opener
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame
from eurobot_od.traffic.entries import Damage, Foreign, LogEntry, Raw, shortened
from eurobot_od.traffic.formats.python_can import of_message

if TYPE_CHECKING:
    import can

Timed: TypeAlias = tuple[float, Raw]
"""A time in s, and what came then."""

Place: TypeAlias = tuple[str, int]
"""A log, and a line of it."""

AT_ONCE = 20_000
"""Entries of a log that are played without a refresh of the screen between them."""


class BusSource:
    """Frames of a bus, with the driver's times, which are more exact than ours; a thread reads them.

    A bus that is lost is opened again by `opener`, if there is one; meanwhile `trouble` says why. `notes` say when it
    was lost, for how long, and how many frames were lost because the driver's queue was full.
    """

    ended = False
    place: Place | None = None

    def __init__(
        self, bus: can.BusABC, clock: Callable[[], float] = time.monotonic, opener: Opener | None = None
    ) -> None:
        self.notes: list[str] = []
        self.trouble = ""
        self._clock, self._opener = clock, opener
        self._came: deque[Timed] = deque()
        self._failures: list[BusError] = []
        self._last, self._seen = 0.0, clock()
        self._offset, self._reopened = 0.0, False
        self._overflow = 0
        self._leaving = ExitStack()

        def take(time: float, frame: Frame) -> None:
            self._came.append((self._continued(time), frame))

        def back(gap: float) -> None:
            self.trouble, self._reopened = "", True
            self.notes.append(f"the bus is back after a gap of {gap:.1f} s")

        watch = FrameReader(bus, take, None, self._fail, self._take_foreign, opener=opener, back=back)
        self._watch = self._leaving.enter_context(watch)

    def _fail(self, why: BusError) -> None:
        self.trouble = str(why)
        if self._opener is None:  # raised by `poll`: this is the thread that reads
            self._failures.append(why)
        else:
            self.notes.append(f"{why}; it is opened again")

    def _note_overflow(self) -> None:
        self._overflow = self._watch.overflow()
        self.notes.append(f"{self._overflow} frames have been lost so far because the driver's queue was full")

    def _take_foreign(self, message: can.Message | None) -> None:
        if message is None:
            self._came.append((self.now, Foreign(Damage.UNREADABLE, "the driver cannot read it")))
            return
        try:
            raw = of_message(message)
        except ValueError:  # what no adapter could receive, a peer behind a network can send
            raw = Foreign(Damage.UNREADABLE, shortened(str(message)))
        self._came.append((self._continued(message.timestamp), raw))

    def _continued(self, stamp: float) -> float:
        """Return a time stamp by the clock before the bus was opened again: a driver's may start anywhere each time."""
        if self._reopened and stamp + self._offset < self._last:
            self._offset = self.now - stamp
        self._reopened = False
        return stamp + self._offset

    def send(self, frame: Frame, timeout: float) -> bool:
        """Send on the same bus; False if the driver does not take the frame in `timeout` s. Raises BusError."""
        return self._watch.send(frame, timeout)

    @property
    def now(self) -> float:
        """The present in s, by the driver's clock."""
        return self._last + self._clock() - self._seen

    def pause(self, longest: float) -> float:
        """Return how long to wait before the next poll, s."""
        return longest

    def poll(self) -> Iterator[Timed]:
        """Return the frames; raises BusError if the bus failed."""
        for _ in range(len(self._came)):  # not until it is empty: on a full bus the screen would never be drawn
            timed = self._came.popleft()
            self._last, self._seen = timed[0], self._clock()
            yield timed
        # One more binary digit: told when the number has doubled, as a flood would fill the screen with notes.
        if self._watch.overflow().bit_length() > self._overflow.bit_length():
            self._note_overflow()
        if self._failures:
            raise self._failures[0]

    def close(self) -> None:
        """Close the bus."""
        # What was lost since the last note: asked for now, as a closed bus cannot tell.
        if self._watch.overflow() > self._overflow:
            self._note_overflow()
        self._leaving.close()


class LogSource:
    """Entries of logs, with the logs' names, played `speed` times faster than they were recorded.

    `place` is where the entry stands that `poll` gave last.
    """

    notes: Sequence[str] = ()

    def __init__(
        self,
        entries: Generator[tuple[str, LogEntry], None, None],
        speed: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.ended = False
        self.place: Place | None = None
        self._entries, self._speed, self._clock = entries, speed, clock
        self._started = clock()
        self._next = next(entries, None)
        self._first = self._last = self._next[1][1] if self._next else 0.0

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
            if self._next is None or self._next[1][1] > until:
                break
            log, (line, self._last, _, raw) = self._next
            self.place = log, line
            yield self._last, raw
            self._next = next(self._entries, None)
        self.ended = self._next is None
