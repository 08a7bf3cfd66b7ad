"""The bus of a check, with the nodes under test and the trace of all frames on it, each with its time.

Frames are kept in the order in which they came and are never taken away: a reader says from which number on it looks.
Only one step runs at a time, so there is only one to wake.

A frame's time is that of its arrival, however late it is read. That none has come by a time is said only when all that
came until then has been read.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from typing import NamedTuple, Protocol

from eurobot_od.errors import BusError
from eurobot_od.frame import Frame

BEHIND = 1.0
"""For this long at most, in s, a reader that is behind is waited for."""

TICK = 0.02
"""Time in s between two looks at how late the tester itself is."""


class SeenFrame(NamedTuple):
    """A frame, its time in seconds by the loop's clock, and whether the tester sent it."""

    time: float
    frame: Frame
    own: bool = False


class Trace:
    """The frames of a run; made inside the event loop."""

    def __init__(self) -> None:
        self.frames: list[SeenFrame] = []
        self._loop = asyncio.get_running_loop()
        self.heard: Callable[[Frame], object] = lambda _: None
        """Called with each frame of the others as it comes."""
        self._waiting: asyncio.Future[None] | None = None
        self._failure: BusError | None = None
        self.read_to = inf
        """The time up to which all frames have been read, on a bus that is read by another thread."""

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def now(self) -> float:
        """The time in seconds."""
        return self._loop.time()

    def add(self, seen: SeenFrame) -> None:
        """Take in a frame."""
        self.frames.append(seen)
        if not seen.own:
            self.read_to = max(self.read_to, seen.time)
            self.heard(seen.frame)
        self._wake()

    def caught_up(self, now: float) -> None:
        """Note that no frame was waiting to be read at a time."""
        self.read_to = max(self.read_to, now)
        self._wake()

    def fail(self, failure: BusError) -> None:
        """End all waiting: the bus is gone."""
        self._failure = failure
        self._wake()

    def recover(self) -> None:
        """Note that the bus is open again."""
        self._failure = None

    def _wake(self) -> None:
        if self._waiting is not None and not self._waiting.done():  # two frames may come in one turn of the loop
            self._waiting.set_result(None)

    async def first(self, cob_ids: frozenset[int], start: int, deadline: float) -> int | None:
        """Return the number of the first foreign frame with one of these identifiers, from number `start` on.

        Waits for it until the time is `deadline`; None if none came by then. Raises BusError.
        """
        while True:
            for number in range(start, len(self.frames)):
                time, frame, own = self.frames[number]
                # By the frame's own time, not by that of looking: late is late, and in time is in time.
                if time > deadline:
                    return None
                if frame.cob_id in cob_ids and not own:
                    return number
            start = len(self.frames)
            if not await self._news(start, deadline, BEHIND if cob_ids else 0.0):
                return None

    async def _news(self, known: int, deadline: float, behind: float) -> bool:
        """Wait for more than the `known` frames, until all of a time have been read; raises BusError."""
        while self._failure is None and len(self.frames) == known:
            now = self._loop.time()
            end = deadline if now < deadline or self.read_to >= deadline else deadline + behind
            if now >= end:
                return False
            self._waiting = self._loop.create_future()
            timer = self._loop.call_at(end, self._wake)
            try:
                await self._waiting
            finally:  # also if the step is interrupted: a timer left behind would wake the next one too early
                timer.cancel()
                self._waiting = None
        if self._failure is not None:
            raise self._failure
        return True

    async def sleep(self, seconds: float) -> None:
        """Let time pass; raises BusError if the bus fails meanwhile."""
        await self.first(frozenset(), len(self.frames), self.now + seconds)

    @contextmanager
    def lateness(self) -> Iterator[Callable[[], float]]:
        """Measure how late the tester itself is at the worst, in s: what delays it may delay a frame, too."""
        worst, due = 0.0, self.now + TICK
        timer: asyncio.TimerHandle

        def look() -> None:
            nonlocal worst, due, timer
            worst, due = max(worst, self.now - due), self.now + TICK
            timer = self._loop.call_at(due, look)

        timer = self._loop.call_at(due, look)
        try:
            yield lambda: worst
        finally:
            timer.cancel()


class Bench(Protocol):
    """A bus with the nodes under test; the tester is another participant, with no node of its own."""

    trace: Trace
    """Every frame of the others, once the bench has begun."""

    async def begin(self) -> None:
        """Return when the nodes are up; called once."""

    async def send(self, frame: Frame) -> float:
        """Send a frame and return, once it is on its way, its time by the loop's clock; raises BusError."""

    async def recover(self) -> bool:
        """Open a bus that has failed again; return whether it works before all patience is at an end."""
