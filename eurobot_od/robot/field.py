"""The playing field of Eurobot 2014: its size, its angles, its barriers and the two places where a robot starts.

Facts of the field and plain geometry, in millimetres and degrees. How far a robot stays off a barrier is not a fact of
the field: that follows from its own radius, a setting of the drive.
"""

from __future__ import annotations

import math
from enum import Enum
from typing import NamedTuple, TypeAlias

from eurobot_od.robot.values import BARRIER_NAMES, TeamColour

WIDTH = 3000.0
"""Length of the field along x, mm; the origin is its lower left corner (document section 1, Figure 1)."""

HEIGHT = 2000.0
"""Length of the field along y, mm."""


# Angles and places


def normalise(angle: float) -> float:
    """Bring any angle in degrees into [0, 360)."""
    return angle % 360.0 % 360.0  # twice: a tiny negative angle gives 360.0 the first time


def turn(start: float, end: float) -> float:
    """Tell the shortest way to turn from one angle to another: degrees in (-180, 180], counter-clockwise positive."""
    left = normalise(end - start)
    return left - 360.0 if left > 180.0 else left


Place: TypeAlias = tuple[float | None, float | None, float | None]
"""Where something is, mm and degrees; None for what is unknown."""


def is_near(here: Place, there: Place, distance: float, angle: float) -> bool:
    """Tell whether two places are at most `distance` mm and `angle` degrees apart.

    An unknown place is near an unknown one only; an unknown angle is near any.
    """
    if None in (*here[:2], *there[:2]):
        return here[:2] == there[:2]
    apart = math.hypot(*(a - b for a, b in zip(here[:2], there[:2]) if a is not None and b is not None))
    turned = 0.0 if here[2] is None or there[2] is None else abs(turn(here[2], there[2]))
    return apart <= distance and turned <= angle


class Point(NamedTuple):
    """A place on the field, mm."""

    x: float
    y: float


class Pose(NamedTuple):
    """A place in mm and a heading in degrees of the unit circle: 0 along +x, counter-clockwise (document section 1)."""

    x: float
    y: float
    angle: float

    @property
    def point(self) -> Point:
        """The place without the heading."""
        return Point(self.x, self.y)

    def distance(self, point: Point) -> float:
        """Tell how far away `point` is, mm."""
        return math.hypot(point.x - self.x, point.y - self.y)

    def bearing(self, point: Point) -> float:
        """Tell the direction of `point` from here, degrees in [0, 360); 0 for this very place."""
        return normalise(math.degrees(math.atan2(point.y - self.y, point.x - self.x)))

    def moved(self, distance: float, turn: float) -> Pose:
        """Follow an arc of `distance` mm (negative: tail first) on which the heading changes by `turn` degrees."""
        half = math.radians(turn) / 2
        chord = distance * (math.sin(half) / half if half else 1.0)
        direction = math.radians(self.angle) + half
        x, y = self.x + chord * math.cos(direction), self.y + chord * math.sin(direction)
        return Pose(x, y, normalise(self.angle + turn))


# Barriers


class BarrierKind(Enum):
    """What stands on the field (document Figure 2)."""

    FIRE = "fire"
    POOL = "pool"


RADII = {
    BarrierKind.FIRE: 140.0 / math.sqrt(3),
    BarrierKind.POOL: 150.0,
}
"""The circle around the real thing, mm: a fire is a triangle with sides of 140 mm, a fire pool a disc."""


class Barrier(NamedTuple):
    """One of the eight barriers: its `number` 1..8 in the flags of Goto XY, what it is and its centre in mm."""

    number: int
    kind: BarrierKind
    x: float
    y: float

    @property
    def name(self) -> str:
        """The name of the barrier, such as `fire 2`."""
        return BARRIER_NAMES[self.number - 1]


BARRIERS = (
    Barrier(1, BarrierKind.FIRE, 900.0, 1400.0),
    Barrier(2, BarrierKind.FIRE, 2100.0, 1400.0),
    Barrier(3, BarrierKind.FIRE, 400.0, 900.0),
    Barrier(4, BarrierKind.FIRE, 2600.0, 900.0),
    Barrier(5, BarrierKind.FIRE, 900.0, 400.0),
    Barrier(6, BarrierKind.FIRE, 2100.0, 400.0),
    Barrier(7, BarrierKind.POOL, 900.0, 900.0),
    Barrier(8, BarrierKind.POOL, 2100.0, 900.0),
)
"""The barriers in the order of their numbers (document Figure 2)."""

# Start places

START_POSES = {
    TeamColour.RED: Pose(200.0, HEIGHT - 200.0, 0.0),
    TeamColour.YELLOW: Pose(WIDTH - 200.0, HEIGHT - 200.0, 180.0),
}
"""Red starts upper left, yellow upper right, both looking along the field (document section 1).

The document names the corners only. 200 mm from both edges is the nearest place where a robot of the largest
usual diameter, 400 mm, can still turn.
"""
