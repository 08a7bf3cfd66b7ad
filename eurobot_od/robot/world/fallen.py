"""A thing that falls over in front of our robot: once in a match it has to stop for an object."""

from __future__ import annotations

from eurobot_od.robot.world.bodies import Body, RobotBody, Weight, inside
from eurobot_od.robot.world.contact import Contacts

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

    def __init__(self, contacts: Contacts) -> None:
        self.body: Body | None = None
        self._contacts = contacts
        self._fell: float | None = None

    def look_at(self, robot: RobotBody, now: float) -> None:
        """Fall over before a robot that drives fast enough; be taken away when the time has come."""
        if self._fell is not None:
            if self.body is not None and now - self._fell > REMOVED_AFTER:
                self._contacts.things.remove(self.body)
                self.body = None
        elif robot.speed >= FAST:
            point = robot.pose.moved(robot.radius + AHEAD + RADIUS, 0).point
            # Too near, and it waits for a better place, so that every match has its fall.
            if inside(point, FROM_BORDER, self._contacts.field) == point:
                self._fell, self.body = now, Body("fallen thing", point, RADIUS, Weight.LIGHT)
                self._contacts.things.append(self.body)
                self._contacts.stir()
