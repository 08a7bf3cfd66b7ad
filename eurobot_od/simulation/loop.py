"""An asyncio event loop whose clock is the simulated bus's: `await asyncio.sleep(90)` takes no time at all.

Rule of this file: the loop never waits. Where an ordinary loop would sleep, events of the network are run until one
of them wakes a task, or the time has come that the loop would have slept to.
"""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Coroutine
from typing import Any, TypeVar

from eurobot_od.errors import EurobotError
from eurobot_od.simulation.network import Network

Result = TypeVar("Result")


class NothingHappens(EurobotError):
    """Every task waits and no node has anything planned: in simulated time that would last for ever."""


class _Selector(selectors.DefaultSelector):
    """Runs the network instead of sleeping."""

    def __init__(self, network: Network) -> None:
        super().__init__()
        self._network = network

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        until = float("inf") if timeout is None else self._network.now + timeout
        ready = super().select(0)
        while not ready and self._network.now < until:
            if timeout is None and self._network.next_event is None:
                raise NothingHappens("every task waits, and no node has anything to do")
            self._network.advance(until)
            ready = super().select(0)
        return ready


class SimulatedLoop(asyncio.SelectorEventLoop):
    """An event loop on the clock of `network`."""

    def __init__(self, network: Network) -> None:
        super().__init__(_Selector(network))
        self._network = network

    def time(self) -> float:
        """Return the simulated time in seconds."""
        return self._network.now


def run(network: Network, main: Coroutine[Any, Any, Result]) -> Result:
    """Run a coroutine to its end in simulated time, as `asyncio.run` does in real time."""
    loop = SimulatedLoop(network)
    try:
        return loop.run_until_complete(main)
    finally:
        _cancel_tasks(loop)
        loop.run_until_complete(loop.shutdown_asyncgens())
        loop.close()


def _cancel_tasks(loop: asyncio.AbstractEventLoop) -> None:
    tasks = asyncio.all_tasks(loop)
    for task in tasks:
        task.cancel()
    if tasks:
        loop.run_until_complete(asyncio.gather(*tasks, return_exceptions=True))
