"""A thing that falls over in front of our robot: once in a match it has to stop for an object."""

from __future__ import annotations

from eurobot_od.robot.world.bodies import Body, RobotBody, Weight, inside

AHEAD = 230.0
"""How far ahead of a driving robot's edge it falls, mm."""

FAST = 200.0
"""The robot is fast enough for it from this speed on, mm/s."""

FROM_BORDER = 100.0
"""It falls no nearer to the border than this, mm."""

RADIUS = 30.0

REMOVED_AFTER = 1.0
"""Seconds until somebody takes it away."""


class FallenThing:
    """The thing: `body` while it lies on the field, None before and after."""

    def __init__(self) -> None:
        self.body: Body | None = None
        self._fell: float | None = None

    def look_at(self, robot: RobotBody, now: float) -> None:
        """Fall over before a robot that drives fast enough; be taken away when the time has come."""
        if self._fell is not None:
            self.body = self.body if now - self._fell <= REMOVED_AFTER else None
        elif robot.speed >= FAST:
            point = robot.pose.moved(robot.radius + AHEAD + RADIUS, 0).point
            if inside(point, FROM_BORDER) == point:
                self._fell, self.body = now, Body("fallen thing", point, RADIUS, Weight.LIGHT)
