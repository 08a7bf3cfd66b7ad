"""The solid bodies on the field, which are round and cannot be in the same place, and the border around them.

Contact is geometry without time. A body that is moved into another one is pushed out of it along the line of their
centres, so that it slides off when they meet at an angle, and stands still when they meet head on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum, auto
from functools import partial
from itertools import pairwise
from typing import NamedTuple

from eurobot_od.robot.model.places import Point, Pose, turn
from eurobot_od.robot.model.robot_file import Barrier, Field, RobotShape
from eurobot_od.robot.model.values import Obstacle
from eurobot_od.robot.nodes.node import Detection

BORDER = "border"
"""What a robot touches at the edge of the field."""


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
    """A disc on the field with its centre and radius in mm; if its `shape` has an outline, the circle around that."""

    name: str
    point: Point
    radius: float
    weight: Weight
    shape: RobotShape | None = None


class Contact(NamedTuple):
    """How two bodies meet: the direction from the one to the other, and the gap between them, mm."""

    x: float
    y: float
    gap: float

    @classmethod
    def of(cls, corners: list[Point], centre: Point, radius: float) -> Contact:
        """Work out how an outline meets a disc."""
        near = nearest_on(corners, centre)
        x, y, apart = centre.x - near.x, centre.y - near.y, math.dist(centre, near)
        # With the centre inside the outline, the nearest edge is the way out, so the direction is reversed.
        outwards = -1.0 if contains(corners, centre) else 1.0
        if not apart:  # the centre is on the edge: any direction is as good
            return cls(1.0, 0.0, -radius)
        return cls(outwards * x / apart, outwards * y / apart, outwards * apart - radius)


@dataclass
class RobotBody(Body):
    """A robot: its place and heading, what it touches, and how it came there.

    `speed` is that of its last step along its heading, mm/s. `room` is how far it may drive before it can meet anything
    that stands, mm, as far as is known. `trace` has its true poses with their times in seconds, one for each step.
    """

    angle: float = 0.0
    speed: float = 0.0
    room: float = 0.0
    touching: set[str] = field(default_factory=set)
    trace: list[tuple[float, Pose]] = field(default_factory=list)

    @property
    def pose(self) -> Pose:
        """Its place and heading."""
        return Pose(*self.point, self.angle)

    def place(self, pose: Pose) -> None:
        """Put it somewhere."""
        # Room 0: its surroundings have to be looked at before the next step.
        self.point, self.angle, self.room = pose.point, pose.angle, 0.0

    def go(self, pose: Pose, now: float) -> None:
        """Move it to where it has driven."""
        self.point, self.angle = pose.point, pose.angle
        self.trace.append((now, pose))

    def corners(self, pose: Pose) -> list[Point]:
        """Return the corners of its outline at a pose; none if it is round."""
        return self.shape.corners(pose) if self.shape else []

    def gap(self, pose: Pose, other: Body) -> float:
        """Return the gap between it at a pose and another body, edge to edge, mm; negative if they overlap."""
        return self._contact(pose, other).gap if self.shape or other.shape else gap(pose, self.radius, other)

    def out_of(self, pose: Pose, other: Body) -> Point:
        """Return the nearest place to a pose where it merely touches a body that it overlaps."""
        contact = self._contact(pose, other)
        return Point(pose.x + contact.gap * contact.x, pose.y + contact.gap * contact.y)

    def pushes(self, pose: Pose, other: Body) -> Point:
        """Return the place of a body that it pushes out of itself at a pose."""
        contact = self._contact(pose, other)
        return Point(other.point.x - contact.gap * contact.x, other.point.y - contact.gap * contact.y)

    def inside(self, pose: Pose, field: Field, margin: float = 0.0) -> Point:
        """Return the nearest place to a pose where it is within the border of the field."""
        corners = self.corners(pose)
        if not corners:
            return inside(pose, self.radius + margin, field)
        x, y = zip(*corners)
        low, high = Point(pose.x - min(x), pose.y - min(y)), Point(max(x) - pose.x, max(y) - pose.y)
        return Point(
            min(max(pose.x, low.x + margin), field.width - high.x - margin),
            min(max(pose.y, low.y + margin), field.height - high.y - margin),
        )

    def edge(self, towards: Point) -> Point:
        """Return the place on its edge that is nearest to a point."""
        corners = self.corners(self.pose)
        if corners:
            return nearest_on(corners, towards)
        return Pose(*self.point, self.pose.bearing(towards)).moved(self.radius, 0).point

    def _contact(self, pose: Pose, other: Body) -> Contact:
        """Return how it would meet a body at a pose; if both have an outline, the other counts as round."""
        if corners := self.corners(pose):
            return Contact.of(corners, other.point, other.radius)
        if isinstance(other, RobotBody) and (corners := other.corners(other.pose)):
            x, y, apart = Contact.of(corners, pose.point, self.radius)
            return Contact(-x, -y, apart)
        apart, reach = pose.distance(other.point), self.radius + other.radius
        if not apart:  # both centres coincide: any direction is as good
            return Contact(1.0, 0.0, -reach)
        return Contact((other.point.x - pose.x) / apart, (other.point.y - pose.y) / apart, apart - reach)

    def approach(self, other: Body) -> float:
        """Return how fast it drives towards another body, mm/s; negative if away from it."""
        bearing = math.radians(self.angle - self.pose.bearing(other.point))
        # Only the part along the line between the two: a robot that passes by does not come nearer.
        return self.speed * math.cos(bearing)


def standing(barriers: Iterable[Barrier]) -> list[Body]:
    """Return what stands on the field at the start of a match."""
    weights = {True: Weight.LIGHT, False: Weight.FIXED}
    return [Body(each.name, each.point, each.kind.radius, weights[each.kind.pushed]) for each in barriers]


def nearest_on(corners: list[Point], point: Point) -> Point:
    """Return the place on an outline that is nearest to a point."""
    on_sides = []
    for start, end in pairwise([*corners, corners[0]]):
        dx, dy = end.x - start.x, end.y - start.y
        # The foot of the perpendicular, kept between the corners; 1.0 is for a side without length.
        along = ((point.x - start.x) * dx + (point.y - start.y) * dy) / (dx * dx + dy * dy or 1.0)
        share = min(max(along, 0.0), 1.0)
        on_sides.append(Point(start.x + share * dx, start.y + share * dy))
    return min(on_sides, key=partial(math.dist, point))


def contains(corners: list[Point], point: Point) -> bool:
    """Return whether a point is inside an outline: a ray from it crosses an odd number of sides."""
    # A corner at exactly the height of the point counts for only one of its two sides: the ray crosses the outline
    # there once.
    sides = [side for side in pairwise([*corners, corners[0]]) if (side[0].y > point.y) != (side[1].y > point.y)]
    crossings = (one.x + (point.y - one.y) / (two.y - one.y) * (two.x - one.x) for one, two in sides)
    return sum(x > point.x for x in crossings) % 2 == 1


def gap(point: Point | Pose, radius: float, other: Body) -> float:
    """Return the gap between a disc and a body, edge to edge, mm; negative if they overlap."""
    return math.hypot(point.x - other.point.x, point.y - other.point.y) - radius - other.radius


def inside(point: Point | Pose, radius: float, field: Field) -> Point:
    """Return the nearest place where a disc is within the border of the field."""
    return Point(min(max(point.x, radius), field.width - radius), min(max(point.y, radius), field.height - radius))


# What a robot has ahead of it, without the errors of a sensor


def nearest_ahead(body: RobotBody, others: Iterable[Body], distance: float, angle: float) -> Detection | None:
    """Return the nearest body with any part within `distance` mm and `angle` degrees to either side."""
    seen = []
    for other in others:
        dx, dy = other.point.x - body.point.x, other.point.y - body.point.y
        apart = math.hypot(dx, dy)
        gap = apart - body.radius - other.radius
        if other is body or gap > distance:  # most are farther away: the angle is computed only for near ones
            continue
        bearing = turn(body.angle, math.degrees(math.atan2(dy, dx)))
        half = math.degrees(math.asin(min(other.radius / apart, 1.0)))
        # Any part counts: the middle of a wide robot close by may well lie outside the cone.
        if abs(bearing) - half <= angle:
            what = Obstacle.ENEMY if isinstance(other, RobotBody) else Obstacle.OBJECT
            seen.append(Detection(what, max(gap, 0.0), bearing))
    return min(seen, key=lambda each: each.distance, default=None)


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
        """Return whether a robot drove into the other body, rather than being driven into."""
        own, other = (self.speed, self.met) if robot == self.robot else (self.met, self.speed)
        return own >= max(other, AT_FAULT)

    def __str__(self) -> str:
        met = f", which came at {self.met:.0f} mm/s" if self.met >= AT_FAULT else ""
        return f"{self.robot} at {self.speed:.0f} mm/s touched {self.thing}{met}"


@dataclass
class Contacts:
    """Moves `robots` among `things`; calls `touched` with each touch, and `pushed` with each thing that was pushed."""

    field: Field
    things: list[Body]
    robots: Mapping[str, RobotBody]
    clock: Callable[[], float]
    touched: Callable[[Touch], None]
    pushed: Callable[[Body], None]

    def move(self, body: RobotBody, wanted: Pose) -> None:
        """Move a robot to a pose, or as near to it as possible."""
        body.go(self._clear(body, wanted), self.clock())
        if body.touching:
            # A contact is over only RELEASED mm away: a robot that jitters at an edge touches it once.
            bodies = [*self.things, *self.robots.values()]
            near = {each.name for each in bodies if body.gap(body.pose, each) < RELEASED}
            if body.inside(body.pose, self.field, RELEASED) != body.point:
                near.add(BORDER)
            body.touching &= near

    def stir(self) -> None:
        """Note that something has moved."""
        for robot in self.robots.values():
            robot.room = 0.0

    def _clear(self, body: RobotBody, wanted: Pose) -> Pose:
        """Return the nearest pose to the wanted one where a robot is inside nothing else; push what can be pushed."""
        point = body.inside(wanted, self.field)
        if point != wanted[:2]:
            self._touch(body, BORDER, wanted.point)
        pose = Pose(*point, wanted.angle)
        near: list[Body] = [each for each in self.robots.values() if each is not body]
        body.room -= math.dist(body.point, point)
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
            self.pushed(other)
            return pose.point
        if isinstance(other, RobotBody):
            # It yields a little, and its wheels do not notice. Only a share: its motors brake, and it is heavy.
            x, y = (old + SHOVE * (new - old) for old, new in zip(other.point, body.pushes(pose, other)))
            there = Pose(x, y, other.angle)
            fixed = [each for each in self.things if each.weight is Weight.FIXED]
            # Not into a wall: a robot shoved against something fixed stays put, and stops the other one.
            if all(other.gap(there, each) >= 0 for each in fixed):
                other.go(Pose(*other.inside(there, self.field), other.angle), self.clock())
                other.room = 0.0
        return body.out_of(pose, other)

    def _touch(self, body: RobotBody, thing: str, towards: Point) -> None:
        """Report that a robot meets something in the direction of a point, unless it already does."""
        if thing in body.touching:
            return
        body.touching.add(thing)
        place = body.edge(towards)
        other, speed, met = self.robots.get(thing), abs(body.speed), 0.0
        # Both touch: otherwise the other one's next step would report the same contact again.
        if other is not None:
            other.touching.add(body.name)
            speed, met = body.approach(other), other.approach(body)
        self.touched(Touch(self.clock(), body.name, thing, speed, met, *place))


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
