"""Solid bodies on the field, which cannot overlap, and the border around them.

Contact is geometry without time. A body that is moved into another one is pushed out of it along the line between their
centres. So it slides along the other one if they meet at an angle, and stands still if they meet head on.
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
"""Name of the field's border in touches."""


class Weight(Enum):
    """What happens to a body when a robot drives into it."""

    LIGHT = auto()
    """It is pushed away."""
    ROBOT = auto()
    """It yields a little."""
    FIXED = auto()
    """It stays where it is."""


@dataclass
class Body:
    """A disc on the field with its centre and radius in mm; around a `shape` with an outline, its circle."""

    name: str
    point: Point
    radius: float
    weight: Weight
    shape: RobotShape | None = None


class Contact(NamedTuple):
    """How two bodies meet: the direction from one to the other, and the gap between them in mm."""

    x: float
    y: float
    gap: float

    @classmethod
    def of(cls, corners: list[Point], centre: Point, radius: float) -> Contact:
        """Return how an outline meets a disc."""
        near = nearest_on(corners, centre)
        x = centre.x - near.x
        y = centre.y - near.y
        apart = math.dist(centre, near)
        # If the centre is inside the outline, the way out is the nearest edge, so the direction is reversed.
        outwards = -1.0 if contains(corners, centre) else 1.0
        if not apart:  # the centre is on the edge, so any direction will do
            return cls(1.0, 0.0, -radius)
        return cls(outwards * x / apart, outwards * y / apart, outwards * apart - radius)


@dataclass
class RobotBody(Body):
    """A robot: its place and heading, its contacts, and its path.

    `speed` is that of its last step along its heading, in mm/s. `room` is a distance in mm that it can drive without
    meeting anything fixed. `trace` are its true poses with their times in s, one per step.
    """

    angle: float = 0.0
    speed: float = 0.0
    room: float = 0.0
    touching: set[str] = field(default_factory=set)
    trace: list[tuple[float, Pose]] = field(default_factory=list)

    @property
    def pose(self) -> Pose:
        """Place and heading."""
        return Pose(*self.point, self.angle)

    def place(self, pose: Pose) -> None:
        """Put it somewhere."""
        # Room 0 makes the next step check its surroundings.
        self.point = pose.point
        self.angle = pose.angle
        self.room = 0.0

    def go(self, pose: Pose, now: float) -> None:
        """Move it to a pose."""
        self.point, self.angle = pose.point, pose.angle
        self.trace.append((now, pose))

    def corners(self, pose: Pose) -> list[Point]:
        """Return the corners of its outline at a pose; empty if it is round."""
        return self.shape.corners(pose) if self.shape else []

    def gap(self, pose: Pose, other: Body) -> float:
        """Return the gap between it at a pose and another body, in mm; negative if they overlap."""
        return self._contact(pose, other).gap if self.shape or other.shape else gap(pose, self.radius, other)

    def out_of(self, pose: Pose, other: Body) -> Point:
        """Return the nearest place to a pose where it only touches a body that it overlaps."""
        contact = self._contact(pose, other)
        return Point(pose.x + contact.gap * contact.x, pose.y + contact.gap * contact.y)

    def pushes(self, pose: Pose, other: Body) -> Point:
        """Return the place of a body that it pushes out of itself at a pose."""
        contact = self._contact(pose, other)
        return Point(other.point.x - contact.gap * contact.x, other.point.y - contact.gap * contact.y)

    def inside(self, pose: Pose, field: Field, margin: float = 0.0) -> Point:
        """Return the nearest place to a pose where it is inside the field's border."""
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
        """Return the point of its edge that is nearest to another point."""
        corners = self.corners(self.pose)
        if corners:
            return nearest_on(corners, towards)
        return Pose(*self.point, self.pose.bearing(towards)).moved(self.radius, 0).point

    def _contact(self, pose: Pose, other: Body) -> Contact:
        """Return the contact with a body at a pose; if both have an outline, the other counts as round."""
        if corners := self.corners(pose):
            return Contact.of(corners, other.point, other.radius)
        if isinstance(other, RobotBody) and (corners := other.corners(other.pose)):
            x, y, apart = Contact.of(corners, pose.point, self.radius)
            return Contact(-x, -y, apart)
        apart = pose.distance(other.point)
        reach = self.radius + other.radius
        if not apart:  # both centres are equal, so any direction will do
            return Contact(1.0, 0.0, -reach)
        return Contact((other.point.x - pose.x) / apart, (other.point.y - pose.y) / apart, apart - reach)

    def approach(self, other: Body) -> float:
        """Return its speed towards another body, in mm/s; negative if away from it."""
        bearing = math.radians(self.angle - self.pose.bearing(other.point))
        # Only the part along the line between the two.
        return self.speed * math.cos(bearing)


def standing(barriers: Iterable[Barrier]) -> list[Body]:
    """Return the bodies of barriers at the start of a match."""
    weights = {True: Weight.LIGHT, False: Weight.FIXED}
    return [Body(each.name, each.point, each.kind.radius, weights[each.kind.pushed]) for each in barriers]


def nearest_on(corners: list[Point], point: Point) -> Point:
    """Return the point of an outline that is nearest to another point."""
    on_sides = []
    for start, end in pairwise([*corners, corners[0]]):
        dx, dy = end.x - start.x, end.y - start.y
        # The foot of the perpendicular, limited to the side; 1.0 is for a side without length.
        along = ((point.x - start.x) * dx + (point.y - start.y) * dy) / (dx * dx + dy * dy or 1.0)
        share = min(max(along, 0.0), 1.0)
        on_sides.append(Point(start.x + share * dx, start.y + share * dy))
    return min(on_sides, key=partial(math.dist, point))


def contains(corners: list[Point], point: Point) -> bool:
    """Return whether a point is inside an outline: a ray from it crosses an odd number of sides."""
    # A corner at the height of the point counts for one of its two sides only, as the ray crosses the outline there
    # once.
    sides = [side for side in pairwise([*corners, corners[0]]) if (side[0].y > point.y) != (side[1].y > point.y)]
    crossings = (one.x + (point.y - one.y) / (two.y - one.y) * (two.x - one.x) for one, two in sides)
    return sum(x > point.x for x in crossings) % 2 == 1


def gap(point: Point | Pose, radius: float, other: Body) -> float:
    """Return the gap between a disc and a body, in mm; negative if they overlap."""
    return math.hypot(point.x - other.point.x, point.y - other.point.y) - radius - other.radius


def inside(point: Point | Pose, radius: float, field: Field) -> Point:
    """Return the nearest place where a disc is inside the field's border."""
    return Point(min(max(point.x, radius), field.width - radius), min(max(point.y, radius), field.height - radius))


# Obstacles ahead, without a sensor's errors


def nearest_ahead(body: RobotBody, others: Iterable[Body], distance: float, angle: float) -> Detection | None:
    """Return the nearest body of which a part is within `distance` mm and `angle` degrees to either side."""
    seen = []
    for other in others:
        dx, dy = other.point.x - body.point.x, other.point.y - body.point.y
        apart = math.hypot(dx, dy)
        gap = apart - body.radius - other.radius
        if other is body or gap > distance:  # most bodies are farther away, so the angle is computed only for near ones
            continue
        bearing = turn(body.angle, math.degrees(math.atan2(dy, dx)))
        half = math.degrees(math.asin(min(other.radius / apart, 1.0)))
        # Any part, as the centre of a wide robot may be outside the cone.
        if abs(bearing) - half <= angle:
            what = Obstacle.ENEMY if isinstance(other, RobotBody) else Obstacle.OBJECT
            seen.append(Detection(what, max(gap, 0.0), bearing))
    return min(seen, key=lambda each: each.distance, default=None)


SHOVE = 0.3
"""Share of a push by which a robot yields to another one."""

WEDGED = 1.0
"""A robot stays where it is if it would still overlap something by this depth, in mm, after it was pushed out of the
rest.
"""

RELEASED = 5.0
"""Minimum gap at which a contact is over, in mm."""

AT_FAULT = 20.0
"""Minimum speed of approach of a robot that was moving, in mm/s."""


class Touch(NamedTuple):
    """A contact of two bodies.

    It has the time in s, the robot that moved and what it met, both speeds of approach in mm/s, and the place in mm.
    """

    time: float
    robot: str
    thing: str
    speed: float
    met: float
    x: float
    y: float

    def is_fault_of(self, robot: str) -> bool:
        """Return whether a robot drove into the other body."""
        own, other = (self.speed, self.met) if robot == self.robot else (self.met, self.speed)
        return own >= max(other, AT_FAULT)

    def __str__(self) -> str:
        met = f", which came at {self.met:.0f} mm/s" if self.met >= AT_FAULT else ""
        return f"{self.robot} at {self.speed:.0f} mm/s touched {self.thing}{met}"


@dataclass
class Contacts:
    """Moves `robots` among `things`; calls `touched` with each touch, and `pushed` with each thing that is pushed."""

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
            # A contact is over only at RELEASED mm, so that a robot that jitters at an edge touches it once.
            bodies = [*self.things, *self.robots.values()]
            near = {each.name for each in bodies if body.gap(body.pose, each) < RELEASED}
            if body.inside(body.pose, self.field, RELEASED) != body.point:
                near.add(BORDER)
            body.touching &= near

    def stir(self) -> None:
        """Make all robots check their surroundings, as something has moved."""
        for robot in self.robots.values():
            robot.room = 0.0

    def _clear(self, body: RobotBody, wanted: Pose) -> Pose:
        """Return the nearest pose to the wanted one where a robot overlaps nothing; push what can be pushed."""
        point = body.inside(wanted, self.field)
        if point != wanted[:2]:
            self._touch(body, BORDER, wanted.point)
        pose = Pose(*point, wanted.angle)
        near: list[Body] = [each for each in self.robots.values() if each is not body]
        body.room -= math.dist(body.point, point)
        if body.room <= 0:  # a fixed body may be in reach: measure the room again, and check all bodies
            body.room = min((gap(point, body.radius, each) for each in self.things), default=0.0)
            near += self.things
        met = [each for each in near if body.gap(pose, each) < 0]
        for each in met:
            pose = Pose(*self._meet(body, pose, each), wanted.angle)
        # Without light things, which have been pushed away.
        heavy = [each for each in near if each.weight is not Weight.LIGHT] if met else []
        # The robot is wedged between two bodies.
        if any(body.gap(pose, each) < -WEDGED for each in heavy):
            # A disc can always turn on the spot; the corner of an outline could turn into an obstacle.
            return Pose(*body.point, body.angle if body.shape else wanted.angle)
        return Pose(*body.inside(pose, self.field), wanted.angle) if met else pose

    def _meet(self, body: RobotBody, pose: Pose, other: Body) -> Point:
        """Make a robot meet a body at a pose; return the robot's place then."""
        self._touch(body, other.name, other.point)
        if other.weight is Weight.LIGHT:
            other.point = inside(body.pushes(pose, other), 0, self.field)
            self.stir()  # it may be in another robot's room now
            self.pushed(other)
            return pose.point
        if isinstance(other, RobotBody):
            # It yields a little, which its wheels do not measure.
            x, y = (old + SHOVE * (new - old) for old, new in zip(other.point, body.pushes(pose, other)))
            there = Pose(x, y, other.angle)
            fixed = [each for each in self.things if each.weight is Weight.FIXED]
            # A robot that is pushed against something fixed stays, and stops the other one.
            if all(other.gap(there, each) >= 0 for each in fixed):
                other.go(Pose(*other.inside(there, self.field), other.angle), self.clock())
                other.room = 0.0
        return body.out_of(pose, other)

    def _touch(self, body: RobotBody, thing: str, towards: Point) -> None:
        """Report that a robot meets something in the direction of a point, unless they already touch."""
        if thing in body.touching:
            return
        body.touching.add(thing)
        place = body.edge(towards)
        other = self.robots.get(thing)
        speed = abs(body.speed)
        met = 0.0
        # Noted for both, so that the other one does not report the same contact.
        if other is not None:
            other.touching.add(body.name)
            speed, met = body.approach(other), other.approach(body)
        self.touched(Touch(self.clock(), body.name, thing, speed, met, *place))


# A thing that falls over in front of our robot, once per match, so that it has to stop for an object


AHEAD = 230.0
"""Distance from the edge of a driving robot to the fallen thing, in mm."""

FAST = 200.0
"""Minimum speed of the robot for which it falls, in mm/s."""

FROM_BORDER = 100.0
"""Minimum distance of the fallen thing from the border, in mm."""

RADIUS = 30.0

REMOVED_AFTER = 1.0
"""Time until the fallen thing is removed, in s."""


class FallenThing:
    """The thing: `body` while it lies on the field, None before and after."""

    def __init__(self, contacts: Contacts) -> None:
        self.body: Body | None = None
        self._contacts = contacts
        self._fell: float | None = None

    def look_at(self, robot: RobotBody, now: float) -> None:
        """Fall in front of a robot that drives fast enough; later be removed."""
        if self._fell is not None:
            if self.body is not None and now - self._fell > REMOVED_AFTER:
                self._contacts.things.remove(self.body)
                self.body = None
        elif robot.speed >= FAST:
            point = robot.pose.moved(robot.radius + AHEAD + RADIUS, 0).point
            # Without room it falls later, so that every match has its fall.
            if inside(point, FROM_BORDER, self._contacts.field) == point:
                self._fell = now
                self.body = Body("fallen thing", point, RADIUS, Weight.LIGHT)
                self._contacts.things.append(self.body)
                self._contacts.stir()
