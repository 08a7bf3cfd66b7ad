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
    seen = []
    for other in others:
        dx, dy = other.point.x - body.point.x, other.point.y - body.point.y
        apart = math.hypot(dx, dy)
        gap = apart - body.radius - other.radius
        if other is body or gap > distance:  # most are farther: the angle is worked out for those that are near
            continue
        bearing = turn(body.angle, math.degrees(math.atan2(dy, dx)))
        half = math.degrees(math.asin(min(other.radius / apart, 1.0)))
        # Any part of it counts: the middle of a wide robot close by may well lie outside of the cone.
        if abs(bearing) - half <= angle:
            what = Obstacle.ENEMY if isinstance(other, RobotBody) else Obstacle.OBJECT
            seen.append(Detection(what, max(gap, 0.0), bearing))
    return min(seen, key=lambda each: each.distance, default=None)
