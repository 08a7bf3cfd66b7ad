"""What a robot has ahead of it: plain geometry, without the errors of a sensor."""

from __future__ import annotations

import math
from collections.abc import Iterable

from eurobot_od.robot.model.places import turn
from eurobot_od.robot.model.values import Obstacle
from eurobot_od.robot.nodes.equipment import Detection
from eurobot_od.robot.world.bodies import Body, RobotBody


def nearest_ahead(body: RobotBody, others: Iterable[Body], distance: float, angle: float) -> Detection | None:
    """Return the nearest body of which any part is within `distance` mm and `angle` degrees to either side."""
    sights = (_look(body, other, distance, angle) for other in others if other is not body)
    return min(filter(None, sights), key=lambda seen: seen.distance, default=None)


def _look(body: RobotBody, other: Body, distance: float, angle: float) -> Detection | None:
    dx, dy = other.point.x - body.point.x, other.point.y - body.point.y
    apart = math.hypot(dx, dy)
    gap = apart - body.radius - other.radius
    if gap > distance:  # most are: the angle is worked out for those that are near
        return None
    bearing = turn(body.angle, math.degrees(math.atan2(dy, dx)))
    half = math.degrees(math.asin(min(other.radius / apart, 1.0)))
    # Any part of it counts: of a wide robot close by, the middle may well lie outside of the cone.
    if abs(bearing) - half > angle:
        return None
    what = Obstacle.ENEMY if isinstance(other, RobotBody) else Obstacle.OBJECT
    return Detection(what, max(gap, 0.0), bearing)
