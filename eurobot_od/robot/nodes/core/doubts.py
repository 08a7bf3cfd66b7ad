"""Decides what the core must not believe.

These are confirms that it has not asked for, and places that the robot cannot have reached.

Rule of this file: numbers and times in, a verdict out; the consequences are the core's.
"""

from __future__ import annotations

import math

from eurobot_od.robot.model.places import Place
from eurobot_od.robot.nodes.estimate import TOP_SPEED

DOUBLED = 0.02
"""Longest time between two copies of a frame that a bus may deliver twice, in s."""

LARGEST_DEVIATIONS = 180.0
"""Largest distance in mm between two right positions because of their deviations: a drive stands if its deviation is
over 90 mm, and each of the two may be off by that much.
"""


class GotoConfirms:
    """The confirms of one goto: at most as many as the goto was sent, each `wait` s from `started`."""

    def __init__(self, started: float, wait: float, transmissions: int) -> None:
        self._started = started
        self._wait = wait
        self._transmissions = transmissions
        self._confirmed: float | None = None
        self._sent = self._heard = 0

    def is_asked_for(self, now: float) -> bool:
        """Count a confirm; return whether the goto explains it."""
        if self._confirmed is None:  # from now on the goto is not sent again
            self._sent = min(1 + int((now - self._started) / self._wait), self._transmissions)
            self._confirmed = now
            return True
        doubled, self._confirmed = now - self._confirmed <= DOUBLED, now
        self._heard += not doubled
        return self._heard < self._sent


def jumps(before: Place, after: Place, seconds: float) -> bool:
    """Return whether no robot can have driven from one place to the other in that time; False for unknown places."""
    if before[0] is None or before[1] is None or after[0] is None or after[1] is None:
        return False
    way = math.hypot(after[0] - before[0], after[1] - before[1])
    return way > TOP_SPEED * seconds + LARGEST_DEVIATIONS
