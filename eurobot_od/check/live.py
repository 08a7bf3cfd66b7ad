"""Suites on a real bus: the tester is one more participant on whatever python-can can reach.

The bus is read in a thread (`live.Watch`). What it reads is handed to the event loop, so that only one thread ever
touches the trace.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from eurobot_od import live as runtime
from eurobot_od.check.results import SuiteResult
from eurobot_od.check.runner import Runner, RunOptions
from eurobot_od.check.suite import Suite
from eurobot_od.check.trace import Seen, Trace
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame

if TYPE_CHECKING:
    import can

SEND_WAIT = 0.5
"""Seconds for which a frame is tried again if the driver does not take it."""

RETRY = 0.001
"""Seconds from one try to the next."""


class LiveBench:
    """The bench of a python-can bus; `seen` and `failed` may be called from any thread."""

    def __init__(self, bus: can.BusABC) -> None:
        self._driver = runtime.Driver(bus)
        self._loop = asyncio.get_running_loop()
        self.trace = Trace()

    async def begin(self) -> None:
        """Return at once: nobody knows when the nodes on a real bus are up."""

    def seen(self, now: float, frame: Frame) -> None:
        """Take in a frame."""
        self._loop.call_soon_threadsafe(self.trace.add, Seen(now, frame))

    def failed(self, failure: BusError) -> None:
        """Take in that the bus has failed."""
        self._loop.call_soon_threadsafe(self.trace.fail, failure)

    async def send(self, frame: Frame) -> float:
        """Hand a frame to the driver; raises BusError if it does not take it."""
        begun = now = self._loop.time()
        while not self._driver.send(frame):
            if now > begun + SEND_WAIT:
                raise BusError(f"the bus {self._driver.bus.channel_info} did not take {frame}")
            await asyncio.sleep(RETRY)
            now = self._loop.time()
        return now


def run_live(suite: Suite, options: RunOptions, open_bus: Callable[[], can.BusABC]) -> SuiteResult:
    """Run a suite against the nodes on a bus; raises BusError if it cannot be opened."""

    async def main() -> SuiteResult:
        bus = open_bus()
        bench = LiveBench(bus)
        with runtime.Watch(bus, bench.seen, time.monotonic, bench.failed):
            return await Runner(suite, bench, options).run(f"on {bus.channel_info}")

    return asyncio.run(main())
