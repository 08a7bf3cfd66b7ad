"""An asyncio event loop on the clock of a simulated bus: `await asyncio.sleep(90)` takes no real time.

The loop never waits: instead of sleeping, it runs events of the network until one of them wakes a task, or the end of
the sleep. `Several` buses may share a clock, such as those of two robots in one match.
"""

from __future__ import annotations

import asyncio
import selectors
from collections.abc import Callable, Coroutine
from contextvars import Context
from math import inf
from typing import Any, TypeAlias, TypeVarTuple

from eurobot_od.bus.live.event_loop import run_in
from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.device.timers import Result
from eurobot_od.errors import EurobotError

Arguments = TypeVarTuple("Arguments")


class Several:
    """Networks that advance together: the one with the next event is always first."""

    def __init__(self, *networks: Simulation) -> None:
        self._networks = networks
        self.now = max(network.now for network in networks)

    @property
    def next_event(self) -> float:
        """Time of the next event on any bus."""
        return min(network.next_event for network in self._networks)

    def advance(self, until: float) -> bool:
        """Run the next event of any bus if it is due by `until`; else advance to `until` and return False."""
        first = min(self._networks, key=lambda network: network.next_event)
        happened = first.advance(until)
        self.now = first.now
        for network in self._networks:
            # The others have no event before that time.
            network.now = max(network.now, self.now)
        return happened


Simulated: TypeAlias = Simulation | Several
"""Anything with a simulated clock and events."""


class NothingHappens(EurobotError):
    """Every task waits, and no node has planned anything: simulated time would advance for ever."""


class _Selector(selectors.DefaultSelector):
    """Runs the network instead of sleeping, until it is `woken` or a registered file is ready."""

    def __init__(self, network: Simulated) -> None:
        super().__init__()
        self._network = network
        self.woken = False

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        until = inf if timeout is None else self._network.now + timeout
        # asyncio's own pipe alone is not polled, which would be a system call for each event.
        is_watched = len(self.get_map()) > 1
        ready = super().select(0) if is_watched else []
        while not (ready or self.woken) and self._network.now < until:
            # No event could end the wait.
            if timeout is None and self._network.next_event == inf:
                raise NothingHappens("every task waits, and no node has anything to do")
            self._network.advance(until)
            ready = super().select(0) if is_watched else ready
        self.woken = False
        return ready


class SimulatedLoop(asyncio.SelectorEventLoop):
    """An event loop on the clock of `network`."""

    def __init__(self, network: Simulated) -> None:
        self._simulated = _Selector(network)
        super().__init__(self._simulated)
        self._network = network

    def call_soon(
        self, callback: Callable[[*Arguments], object], *args: *Arguments, context: Context | None = None
    ) -> asyncio.Handle:
        """Schedule a callback before the next event."""
        # A node's answer wakes its task within the same event, without a delay that no real program has.
        self._simulated.woken = True
        return super().call_soon(callback, *args, context=context)

    call_soon_threadsafe = call_soon  # no system call has to be interrupted

    def time(self) -> float:
        """Return the simulated time in seconds."""
        return self._network.now


def run(network: Simulated, main: Coroutine[Any, Any, Result]) -> Result:
    """Run a coroutine to its end in simulated time, as `live.event_loop.run` does in real time.

    Raises ProgramFailed if it calls `sys.exit`; a watchdog has to detect hangs.
    """
    return run_in(SimulatedLoop(network), main)
