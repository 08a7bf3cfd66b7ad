"""Suites on a real bus: the tester is one more participant on whatever python-can can reach.

The bus is read in a thread (`live.FrameReader`). What it reads is handed to the event loop, so that only one
thread ever touches the trace.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from contextlib import suppress

import can

from eurobot_od.bus import live as runtime
from eurobot_od.check.bench import SeenFrame, Trace
from eurobot_od.check.results import SuiteResult
from eurobot_od.check.runner import Runner, RunOptions
from eurobot_od.check.suite import Suite
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame

SEND_WAIT = 0.5
"""Seconds for which a frame is tried again if the driver does not take it."""

RETRY = 0.001  # at 1 Mbit/s a bus carries some eight frames in this time
"""Seconds from one try to the next."""

RECOVERY = 12.0
"""Seconds that a bus has to come back for the teardown: the last of the tries to open it again is after 11.3 s."""


class LiveBench:
    """The bench of a python-can bus, opened by `open_bus`; use it as a context manager. Opening raises BusError.

    `seen` and `failed` may be called from any thread.
    """

    def __init__(self, open_bus: Callable[[], can.BusABC]) -> None:
        loop = self._loop = asyncio.get_running_loop()
        self._works = asyncio.Event()
        self._works.set()
        self._watch = runtime.FrameReader(
            open_bus(),
            self.seen,
            time.monotonic,  # the clock of asyncio's loop too, so frames and deadlines have one time
            self.failed,
            opener=open_bus,
            back=lambda _gap: loop.call_soon_threadsafe(self._works.set),
        )
        self.trace = Trace()

    def __enter__(self) -> LiveBench:
        self._watch.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self._watch.__exit__()

    @property
    def name(self) -> str:
        """What the driver calls the bus."""
        return self._watch.name

    async def begin(self) -> None:
        """Return at once: nobody knows when the nodes on a real bus are up."""

    def seen(self, now: float, frame: Frame) -> None:
        """Take in a frame."""
        self._loop.call_soon_threadsafe(self.trace.add, SeenFrame(now, frame))

    def failed(self, failure: BusError) -> None:
        """Take in that the bus has failed."""
        self._loop.call_soon_threadsafe(self._works.clear)
        self._loop.call_soon_threadsafe(self.trace.fail, failure)

    async def recover(self) -> bool:
        """Wait until the bus works again, for the teardown; False if it does not in `RECOVERY` s."""
        with suppress(TimeoutError):
            await asyncio.wait_for(self._works.wait(), RECOVERY)
        # Also if it did not come back: the teardown is skipped then, and nothing waits on the trace any more.
        self.trace.recover()
        return self._works.is_set()

    async def send(self, frame: Frame) -> float:
        """Hand a frame to the driver; raises BusError if it does not take it."""
        begun = now = self._loop.time()
        while not self._watch.send(frame):
            if now > begun + SEND_WAIT:
                raise BusError(f"the bus {self.name} did not take {frame}")
            await asyncio.sleep(RETRY)
            # Taken before the try that succeeds: an answer can never seem to have come before its question.
            now = self._loop.time()
        return now


def run_live(suite: Suite, options: RunOptions, open_bus: Callable[[], can.BusABC]) -> SuiteResult:
    """Run a suite against the nodes on a bus; raises BusError if it cannot be opened."""

    async def main() -> SuiteResult:
        with LiveBench(open_bus) as bench:
            return await Runner(suite, bench, options).run(f"on {bench.name}")

    return asyncio.run(main())
