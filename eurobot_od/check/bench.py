"""The bus of a check, with the nodes under test and the trace of all frames on it, each with its time.

Frames are kept in the order in which they came and are never taken away: a reader says from which number on it looks.
Only one step runs at a time, so there is only one to wake.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import NamedTuple, Protocol

from eurobot_od.errors import BusError
from eurobot_od.frame import Frame


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

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def now(self) -> float:
        """The time in seconds."""
        return self._loop.time()

    def add(self, seen: SeenFrame) -> None:
        """Take in a frame."""
        self.frames.append(seen)
        self._wake()
        if not seen.own:
            self.heard(seen.frame)

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
            if not await self._news(start, deadline):
                return None

    async def _news(self, known: int, deadline: float) -> bool:
        """Wait for more than the `known` frames until a time; raises BusError."""
        self._waiting = self._loop.create_future()
        timer = self._loop.call_at(deadline, self._wake)
        try:
            if self._failure is None and self._loop.time() < deadline:
                await self._waiting
        finally:  # also if the step is interrupted: a timer left behind would wake the next one too early
            timer.cancel()
            self._waiting = None
        if self._failure is not None:
            raise self._failure
        return len(self.frames) > known or self._loop.time() < deadline

    async def sleep(self, seconds: float) -> None:
        """Let time pass; raises BusError if the bus fails meanwhile."""
        await self.first(frozenset(), len(self.frames), self.now + seconds)


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
