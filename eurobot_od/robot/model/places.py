"""Geometry of places, headings and angles, in mm and degrees."""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias


def normalise(angle: float) -> float:
    """Return an angle in degrees in [0, 360)."""
    return angle % 360.0 % 360.0  # twice, as a tiny negative angle gives 360.0 the first time


def turn(start: float, end: float) -> float:
    """Return the shortest turn from one angle to another: degrees in (-180, 180], counter-clockwise positive."""
    left = normalise(end - start)
    return left - 360.0 if left > 180.0 else left


Place: TypeAlias = tuple[float | None, float | None, float | None]
"""A place in mm and degrees; None for unknown values."""


def is_near(here: Place, there: Place, distance: float, angle: float) -> bool:
    """Return whether two places are at most `distance` mm and `angle` degrees apart.

    An unknown place is near only to an unknown one; an unknown angle is near to any.
    """
    # Two unknown places are equal: as far as known, the drive has not moved.
    if None in (*here[:2], *there[:2]):
        return here[:2] == there[:2]
    apart = math.hypot(*(a - b for a, b in zip(here[:2], there[:2]) if a is not None and b is not None))
    turned = 0.0 if here[2] is None or there[2] is None else abs(turn(here[2], there[2]))
    return apart <= distance and turned <= angle


class Point(NamedTuple):
    """A place on the field, in mm."""

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
        """Return the distance to a point, in mm."""
        return math.hypot(point.x - self.x, point.y - self.y)

    def bearing(self, point: Point) -> float:
        """Return the direction of a point, in degrees in [0, 360); 0 for this place."""
        return normalise(math.degrees(math.atan2(point.y - self.y, point.x - self.x)))

    def moved(self, distance: float, turn: float) -> Pose:
        """Return the pose after an arc of `distance` mm; negative is backward.

        The heading changes by `turn` degrees.
        """
        # Exact for any arc: the chord is turned by half of the angle.
        half = math.radians(turn) / 2
        chord = distance * (math.sin(half) / half if half else 1.0)
        direction = math.radians(self.angle) + half
        x, y = self.x + chord * math.cos(direction), self.y + chord * math.sin(direction)
        return Pose(x, y, normalise(self.angle + turn))
