"""What bodies do to each other: robots stop at fixed things, push light ones, shove one another, and slide.

Every movement is treated alike. If it would end inside something, light things are pushed along, and the robot is
pushed out of everything else: it slides along what it meets at an angle, and stops at what it meets head on. A robot
that is driven into yields a little. The first moment of each contact is a `Touch`.

Most of the time nothing is near. How far a robot may drive before it can meet anything that stands is its `room`; until
that is used up, only the other robots are looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from eurobot_od.robot.model.facts import Field
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.world.bodies import BORDER, Body, RobotBody, Weight, gap, inside

SHOVE = 0.3
"""The share by which a robot yields to one that drives into it."""

WEDGED = 1.0
"""A robot stays put if it would still be this deep in something, mm, after it was pushed out of everything else."""

RELEASED = 5.0
"""A contact is over when the bodies are this far apart, mm."""

AT_FAULT = 20.0
"""A robot that comes nearer at this speed, mm/s, was not standing."""


class Touch(NamedTuple):
    """Two bodies met: when, in s, which robot moved into what, how fast each came nearer, mm/s, and where, mm."""

    time: float
    robot: str
    thing: str
    speed: float
    met: float
    x: float
    y: float

    def is_fault_of(self, robot: str) -> bool:
        """Tell whether a robot drove into the other body, rather than being driven into."""
        own, other = (self.speed, self.met) if robot == self.robot else (self.met, self.speed)
        return own >= max(other, AT_FAULT)

    def __str__(self) -> str:
        met = f", which came at {self.met:.0f} mm/s" if self.met >= AT_FAULT else ""
        return f"{self.robot} at {self.speed:.0f} mm/s touched {self.thing}{met}"


class Contacts:
    """Moves `robots` among `things`; calls `touched` with each touch, and `pushed` with each thing that was pushed."""

    def __init__(
        self,
        field: Field,
        things: list[Body],
        robots: Mapping[str, RobotBody],
        clock: Callable[[], float],
        touched: Callable[[Touch], None],
        pushed: Callable[[Body], None],
    ) -> None:
        self.field, self.things = field, things
        self._robots, self._clock, self._touched, self._pushed = robots, clock, touched, pushed

    def move(self, body: RobotBody, wanted: Pose) -> None:
        """Move a robot to a pose, or as near to it as possible."""
        there = self._clear(body, wanted)
        body.go(there.point, there.angle, self._clock())
        if body.touching:
            # A contact is over only RELEASED mm away: a robot that jitters at an edge touches it once.
            bodies = [*self.things, *self._robots.values()]
            near = {each.name for each in bodies if body.gap(body.pose, each) < RELEASED}
            if body.inside(body.pose, self.field, RELEASED) != body.point:
                near.add(BORDER)
            body.touching &= near

    def stir(self) -> None:
        """Note that something has moved."""
        for robot in self._robots.values():
            robot.room = 0.0

    def _clear(self, body: RobotBody, wanted: Pose) -> Pose:
        """Return the nearest pose to the wanted one where a robot is inside nothing else; push what can be pushed."""
        point = body.inside(wanted, self.field)
        if point != wanted.point:
            self._touch(body, BORDER, wanted.point)
        pose = Pose(*point, wanted.angle)
        near: list[Body] = [each for each in self._robots.values() if each is not body]
        body.room -= body.pose.distance(point)
        if body.room <= 0:  # something that stands may be in reach: measure the room again, and look at everything
            body.room = min((gap(point, body.radius, each) for each in self.things), default=0.0)
            near += self.things
        met = [each for each in near if body.gap(pose, each) < 0]
        for each in met:
            pose = Pose(*self._meet(body, pose, each), wanted.angle)
        # Without the light things, which have already been pushed and do not hold anybody up.
        heavy = [each for each in near if each.weight is not Weight.LIGHT] if met else []
        # Between two bodies: one lets it out where the other holds it.
        if any(body.gap(pose, each) < -WEDGED for each in heavy):
            # A disc can always turn on the spot; a corner of an outline would turn into whatever holds it.
            return Pose(*body.point, body.angle if body.shape else wanted.angle)
        return Pose(*body.inside(pose, self.field), wanted.angle) if met else pose

    def _meet(self, body: RobotBody, pose: Pose, other: Body) -> Point:
        """Let a robot meet a body at a pose; return where the robot is then."""
        self._touch(body, other.name, other.point)
        if other.weight is Weight.LIGHT:
            other.point = inside(body.pushes(pose, other), 0, self.field)
            self.stir()  # it may now lie where another robot counts on room
            self._pushed(other)
            return pose.point
        if isinstance(other, RobotBody):
            # It yields a little, and its wheels do not notice. Only a share: its motors brake, and it is heavy.
            x, y = (old + SHOVE * (new - old) for old, new in zip(other.point, body.pushes(pose, other)))
            there = Pose(x, y, other.angle)
            fixed = [each for each in self.things if each.weight is Weight.FIXED]
            # Not into a wall: a robot shoved against something fixed stays put, and stops the other one.
            if all(other.gap(there, each) >= 0 for each in fixed):
                other.go(other.inside(there, self.field), other.angle, self._clock())
                other.room = 0.0
        return body.out_of(pose, other)

    def _touch(self, body: RobotBody, thing: str, towards: Point) -> None:
        """Report that a robot meets something in the direction of a point, unless it already does."""
        if thing in body.touching:
            return
        body.touching.add(thing)
        place = body.edge(towards)
        other, speed, met = self._robots.get(thing), abs(body.speed), 0.0
        # Both touch: otherwise the other one's next step would report the same contact again.
        if other is not None:
            other.touching.add(body.name)
            speed, met = body.approach(other), other.approach(body)
        self._touched(Touch(self._clock(), body.name, thing, speed, met, *place))


# A thing that falls over in front of our robot: once in a match, it has to stop for an object


AHEAD = 230.0
"""How far ahead of a driving robot's edge it falls, mm."""

FAST = 200.0
"""It falls for a robot with at least this speed, mm/s."""

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
        """Fall in front of a robot that drives fast enough; be taken away when its time has come."""
        if self._fell is not None:
            if self.body is not None and now - self._fell > REMOVED_AFTER:
                self._contacts.things.remove(self.body)
                self.body = None
        elif robot.speed >= FAST:
            point = robot.pose.moved(robot.radius + AHEAD + RADIUS, 0).point
            # Where there is no room it waits for a better place, so that every match has its fall.
            if inside(point, FROM_BORDER, self._contacts.field) == point:
                self._fell, self.body = now, Body("fallen thing", point, RADIUS, Weight.LIGHT)
                self._contacts.things.append(self.body)
                self._contacts.stir()
