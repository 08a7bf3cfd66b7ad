"""What is solid on the field: round bodies that cannot be in the same place, and the border around them.

Geometry without time. A body that is moved into another one is pushed out of it along the line of their centres, so
that it slides off what it meets at an angle, and stands still where it meets it head on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum, auto

from eurobot_od.robot.field import BARRIERS, HEIGHT, RADII, WIDTH, BarrierKind, Point, Pose

ROBOT_RADIUS = 140.0
"""Radius of a robot, mm, unless its diameter is known."""

TREE_RADIUS = 75.0
TREES = (Point(0, 700), Point(700, 0), Point(2300, 0), Point(3000, 700))
"""The trunks of the fruit trees at the border of the field (public rules of 2014), mm."""

BORDER = "border"
"""What a robot touches that stands at the edge of the field."""


class Weight(Enum):
    """What happens to a body that a robot drives into."""

    LIGHT = auto()
    """It is pushed along."""
    ROBOT = auto()
    """It hardly yields."""
    FIXED = auto()
    """It stays where it is."""


@dataclass
class Body:
    """A disc on the field: its centre and radius in mm."""

    name: str
    point: Point
    radius: float
    weight: Weight


@dataclass
class RobotBody(Body):
    """A robot: where it is and looks, what it touches, and how it came there.

    `speed` is that of its last step along its heading, mm/s. `room` is how far it may drive before it can meet anything
    that stands, mm, as far as that is known. `trace` has its true poses with their times in s, one for each step.
    """

    angle: float = 0.0
    speed: float = 0.0
    room: float = 0.0
    touching: set[str] = field(default_factory=set)
    trace: list[tuple[float, Pose]] = field(default_factory=list)

    @property
    def pose(self) -> Pose:
        """Where it is, and where it looks."""
        return Pose(*self.point, self.angle)

    def place(self, pose: Pose) -> None:
        """Put it somewhere."""
        self.point, self.angle, self.room = pose.point, pose.angle, 0.0

    def go(self, point: Point, angle: float, now: float) -> None:
        """Let it have come to a place."""
        self.point, self.angle = point, angle
        self.trace.append((now, self.pose))

    def approach(self, other: Body) -> float:
        """Tell how fast it drives towards another body, mm/s; negative if away from it."""
        bearing = math.radians(self.angle - self.pose.bearing(other.point))
        return self.speed * math.cos(bearing)


def things() -> list[Body]:
    """Return what stands on the field at the begin of a match: fires, pools, trees."""
    weights = {BarrierKind.FIRE: Weight.LIGHT, BarrierKind.POOL: Weight.FIXED}
    barriers = [Body(each.name, Point(each.x, each.y), RADII[each.kind], weights[each.kind]) for each in BARRIERS]
    trees = [Body(f"tree {number}", point, TREE_RADIUS, Weight.FIXED) for number, point in enumerate(TREES, 1)]
    return barriers + trees


def gap(point: Point, radius: float, other: Body) -> float:
    """Tell how far a disc is from a body, edge to edge, mm; negative if they overlap."""
    return math.hypot(point.x - other.point.x, point.y - other.point.y) - radius - other.radius


def pushed_out(point: Point, radius: float, other: Body) -> Point:
    """Return the nearest place where a disc that overlaps a body only touches it."""
    apart = math.dist(point, other.point)
    reach = radius + other.radius
    if not apart:  # centre on centre: any direction is as good
        return Point(point.x + reach, point.y)
    share = reach / apart
    return Point(other.point.x + (point.x - other.point.x) * share, other.point.y + (point.y - other.point.y) * share)


def inside(point: Point, radius: float) -> Point:
    """Return the nearest place where a disc is within the border of the field."""
    return Point(min(max(point.x, radius), WIDTH - radius), min(max(point.y, radius), HEIGHT - radius))
