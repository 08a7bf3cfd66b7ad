"""Several simulated buses on one clock: two robots that play each other, each on a bus of its own.

Rule of this file: of all buses, the one with the next event is advanced, so that no bus is ever ahead of another.
"""

from __future__ import annotations

from typing import Protocol

from eurobot_od.bus.simulated.network import Simulation


class Simulated(Protocol):
    """What has a simulated clock, and events on it."""

    now: float
    """The simulated time in seconds."""

    @property
    def next_event(self) -> float:
        """Time of the next event, infinite if nothing will ever happen."""

    def advance(self, until: float) -> bool:
        """Run the next event if it is due by `until`; otherwise let the time pass and return False."""


class Several:
    """Some networks, advanced together."""

    def __init__(self, *networks: Simulation) -> None:
        self._networks = networks
        self.now = max(network.now for network in networks)

    @property
    def next_event(self) -> float:
        """Time of the next event on any bus."""
        return min(network.next_event for network in self._networks)

    def advance(self, until: float) -> bool:
        """Run the next event of any bus if it is due by `until`; otherwise let the time pass and return False."""
        first = min(self._networks, key=lambda network: network.next_event)
        happened = first.advance(until)
        self.now = first.now
        for network in self._networks:
            # Nothing happens on the others before that time, so their clocks may simply follow.
            network.now = max(network.now, self.now)
        return happened
