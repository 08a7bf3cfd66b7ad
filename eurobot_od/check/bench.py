"""The bus of a check: the nodes under test, and the trace of all frames with their times.

The trace keeps frames in the order in which they came and never drops one; a reader says from which number on it
looks. Only one step runs at a time, so only one reader waits.

A frame's time is that of its arrival, however late it is read. The trace reports that no frame came by a time only
after everything up to that time has been read.
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
"""Maximum time to wait for a thread that reads the bus and is behind, in s."""

TICK = 0.02
"""Time between two measurements of how late the tester itself is, in s."""


class SeenFrame(NamedTuple):
    """A frame, its time in s by the loop's clock, and whether the tester sent it."""

    time: float
    frame: Frame
    own: bool = False


class Trace:
    """The frames of a run; must be made inside the event loop."""

    def __init__(self) -> None:
        self.frames: list[SeenFrame] = []
        self._loop = asyncio.get_running_loop()
        self.listener: Callable[[Frame], object] = lambda _: None
        """Called with each frame that a node sends."""
        self._waiting: asyncio.Future[None] | None = None
        self._failure: BusError | None = None
        self.read_to = inf
        """The time up to which all frames have been read, on a bus that is read by another thread."""

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def now(self) -> float:
        """Current time in s, by the loop's clock."""
        return self._loop.time()

    def add(self, seen: SeenFrame) -> None:
        """Add a frame."""
        self.frames.append(seen)
        if not seen.own:
            self.read_to = max(self.read_to, seen.time)
            self.listener(seen.frame)
        self._wake()

    def caught_up(self, now: float) -> None:
        """Note that no frame was waiting to be read at a time."""
        self.read_to = max(self.read_to, now)
        self._wake()

    def fail(self, failure: BusError) -> None:
        """Make every wait raise this error: the bus is lost."""
        self._failure = failure
        self._wake()

    def recover(self) -> None:
        """Note that the bus is open again."""
        self._failure = None

    def _wake(self) -> None:
        if self._waiting is not None and not self._waiting.done():  # two frames may come in one turn of the loop
            self._waiting.set_result(None)

    async def first(self, cob_ids: frozenset[int], start: int, deadline: float) -> int | None:
        """Return the number of the first frame of a node with one of these COB-IDs, from number `start` on.

        Waits for it until the time is `deadline`; returns None if none came by then. Raises BusError.
        """
        while True:
            for number in range(start, len(self.frames)):
                time, frame, own = self.frames[number]
                # The frame's own time decides, not the time at which it is looked at.
                if time > deadline:
                    return None
                if frame.cob_id in cob_ids and not own:
                    return number
            start = len(self.frames)
            if not await self._more_frames(start, deadline, BEHIND if cob_ids else 0.0):
                return None

    async def _more_frames(self, known: int, deadline: float, behind: float) -> bool:
        """Wait until there are more than `known` frames; return whether there are by the deadline.

        A reading thread that has not read up to the deadline gets up to `behind` s more. Raises BusError.
        """
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
        """Wait for a time in s; raises BusError if the bus fails meanwhile."""
        await self.first(frozenset(), len(self.frames), self.now + seconds)

    @contextmanager
    def lateness(self) -> Iterator[Callable[[], float]]:
        """Measure by how much the tester itself is late at most, in s: what delays it may delay a frame, too."""
        worst = 0.0
        due = self.now + TICK
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
    """A bus with the nodes under test. The tester takes part in it without a node of its own."""

    trace: Trace
    """Every frame of the nodes since `begin`."""

    async def begin(self) -> None:
        """Wait until the nodes are up; called once."""

    async def send(self, frame: Frame) -> float:
        """Send a frame; return the time, by the loop's clock, at which it was on its way. Raises BusError."""

    async def recover(self) -> bool:
        """Try to open a failed bus again; return whether it works before the bench gives up."""
