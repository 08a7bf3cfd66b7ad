"""Where the robots are: the positions that came last, and where another robot really is by all that came of it.

The beacons now and then see a robot somewhere else, take it for another one, or do not see it. What they say of the
others is not filtered on its way. So a place that is further from the last one than a robot can have driven meanwhile
is believed only when the next one agrees with it, and one that is unknown changes nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Point

TOP_SPEED = 800.0
"""No robot drives faster, mm/s."""

SPREAD = 50.0
"""Two right places of a robot that stands are never further apart, mm."""


class Sighting(NamedTuple):
    """A position as it was received, and when, in seconds of the node's time."""

    position: messages.PositionResponse
    time: float


class Seen(NamedTuple):
    """A place in mm where a robot was at a time in s."""

    point: Point
    time: float

    def agrees(self, earlier: Seen | None) -> bool:
        """Tell whether a robot that was seen earlier can be here by now."""
        if earlier is None:
            return False
        return math.dist(self.point, earlier.point) <= SPREAD + TOP_SPEED * (self.time - earlier.time)


class Track:
    """Where a robot is; `last` is where it was seen last, None before."""

    def __init__(self) -> None:
        self.last: Seen | None = None
        self._doubted: Seen | None = None

    def saw(self, sighting: Sighting) -> None:
        """Take in a position."""
        x, y, *_ = sighting.position
        if x is None or y is None:
            return
        seen = Seen(Point(x, y), sighting.time)
        if self.last is None or seen.agrees(self.last) or seen.agrees(self._doubted):
            self.last, self._doubted = seen, None
        else:
            self._doubted = seen
