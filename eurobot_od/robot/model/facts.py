"""The facts of a robot and its match: body, field, barriers, tasks, the other robots, the duration.

They come from a file, `robot.yaml` (see `robot_file`), and are nowhere repeated. Lengths are in mm, angles in degrees.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Annotated, NamedTuple, TypeAlias

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.robot.model.places import Point, Pose, normalise
from eurobot_od.robot.model.values import FLAGGED, Barriers, Passage, Source, TeamColour
from eurobot_od.support.declared import Listed, Within

SIDE, ANGLE = Within(0, 100_000, "mm"), Within(0, 359, "degrees")
"""Places on a side of the largest field, and headings."""

OnField: TypeAlias = Annotated[Point, Listed(SIDE, SIDE)]
Radius: TypeAlias = Annotated[float, Within(10, 1000, "mm")]

# Tasks


class Worth(Enum):
    """What a task brings."""

    POINTS = "points"
    FRUIT = "fruit"
    """Pieces of fruit, to be carried to the basket."""
    HARVEST = "harvest"
    """A point for each piece of fruit that the robot has with it."""


class Stand(NamedTuple):
    """Where a robot stands and looks for a task: mm and degrees, whole numbers as in a goto."""

    x: int
    y: int
    angle: int


class Task(NamedTuple):
    """Something to do at a place.

    It takes `seconds`. Each of `tries` succeeds with the probability `chance`, and then brings `points`. A task that is
    `shared` can be done once, by whoever comes first; any other once by each robot.
    """

    name: str
    at: Annotated[Stand, Listed(SIDE, SIDE, ANGLE)]
    seconds: Annotated[float, Within(0, 1000, "s")]
    tries: Annotated[int, Within(1, 1000)]
    points: Annotated[int, Within(0, 10_000)]
    chance: Annotated[float, Within(0, 1)]
    worth: Worth = Worth.POINTS
    shared: bool = False

    @property
    def pose(self) -> Pose:
        """The pose in which to do it."""
        return Pose(*self.at)

    @property
    def expected(self) -> float:
        """What it brings on average: points, or fruit."""
        return self.tries * self.chance * self.points


FROM_MIDDLE = Within(-1000, 1000, "mm")
Corner: TypeAlias = Annotated[Point, Listed(FROM_MIDDLE, FROM_MIDDLE)]


class Wheels(NamedTuple):
    """The two driven wheels: the distance between them, and their diameter."""

    track: Annotated[float, Within(1, 2000, "mm")]
    diameter: Annotated[float, Within(1, 1000, "mm")]


@dataclass(frozen=True)
class RobotShape:
    """The shape of our robot: the `radius` of the circle around the middle between its wheels, mm.

    `outline` has the corners of its true shape within that circle, x ahead and y to the left; it is empty for a round
    robot.
    """

    radius: float
    outline: tuple[Point, ...] = ()
    wheels: Wheels | None = None

    def corners(self, pose: Pose) -> list[Point]:
        """Return the corners of the outline for the robot's pose."""
        return _placed(pose, self.outline)

    def tracks(self, pose: Pose) -> list[tuple[Point, Point]]:
        """Return back and front of each wheel for the robot's pose."""
        if self.wheels is None:
            return []
        side, half = self.wheels.track / 2, self.wheels.diameter / 2
        left, right = ([Point(-half, y), Point(half, y)] for y in (side, -side))
        (one, two), (three, four) = _placed(pose, left), _placed(pose, right)
        return [(one, two), (three, four)]


def _placed(pose: Pose, points: Iterable[Point]) -> list[Point]:
    """Return points of a robot as places on the field."""
    cos, sin = math.cos(math.radians(pose.angle)), math.sin(math.radians(pose.angle))
    return [Point(pose.x + x * cos - y * sin, pose.y + x * sin + y * cos) for x, y in points]


# The field


class Zone(NamedTuple):
    """A rectangle on the field by its edges, mm."""

    left: float
    lower: float
    right: float
    upper: float


class Start(NamedTuple):
    """Where a team starts: its zone, and the robot's place in it."""

    zone: Annotated[Zone, Listed(SIDE, SIDE, SIDE, SIDE)]
    pose: Annotated[Pose, Listed(SIDE, SIDE, ANGLE)]


class Trees(NamedTuple):
    """Trees at the border: the radius of their trunks and their places."""

    radius: Annotated[float, Within(1, 1000, "mm")]
    places: tuple[OnField, ...]


NO_TREES = Trees(0, ())


@dataclass(frozen=True)
class Field:
    """The playing field: its size along x and y, how thick its border is drawn, the teams' starts, trees."""

    width: float
    height: float
    border: float
    starts: Mapping[TeamColour, Start]
    trees: Trees = NO_TREES

    def contains(self, point: Point, edge: float = 0.0) -> bool:
        """Tell whether a point is on the field, at least `edge` mm from its edges."""
        return edge <= point.x <= self.width - edge and edge <= point.y <= self.height - edge

    def seen_by(self, team: TeamColour, point: Point) -> Point:
        """Return a team's view of a place of the red team: yellow plays the mirror image."""
        return point if team is TeamColour.RED else Point(self.width - point.x, point.y)


# Barriers


class BarrierShape(Enum):
    """The shape of a barrier from above."""

    DISC = "disc"
    TRIANGLE = "triangle"
    SQUARE = "square"


AROUND = {BarrierShape.DISC: 2, BarrierShape.TRIANGLE: math.sqrt(3), BarrierShape.SQUARE: math.sqrt(2)}
"""The size of a shape, its diameter or side, as a multiple of the radius of the circle around it."""


class BarrierKind(NamedTuple):
    """A kind of barrier: its shape and size (diameter or side), and whether a robot pushes it along."""

    name: str
    shape: BarrierShape
    size: Annotated[float, Within(1, 5000, "mm")]
    pushed: bool = False

    @property
    def radius(self) -> float:
        """Radius of the circle around it, mm."""
        return self.size / AROUND[self.shape]


class Barrier(NamedTuple):
    """A barrier: its `name`, its `number` in the flags of Goto XY, its kind, and its centre in mm."""

    name: str
    number: Annotated[int, Within(1, FLAGGED)]
    kind: BarrierKind
    x: float
    y: float

    @property
    def point(self) -> Point:
        """Its centre."""
        return Point(self.x, self.y)


# All facts


def _leads_somewhere(rounds: tuple[Point, ...]) -> tuple[Point, ...]:
    if len(rounds) < 2:
        raise LocalError("rounds has less than 2 places")
    return rounds


class OtherRobot(NamedTuple):
    """Another robot of a simulated match: its radius, and the way points of its rounds when our team is red."""

    radius: Radius
    rounds: Annotated[tuple[OnField, ...], _leads_somewhere]


@dataclass(frozen=True)
class Facts:
    """Everything in a robot's file; `barriers` are in the order of their numbers, `duration` is in seconds.

    `red_tasks` are the tasks of the red team by name, `others` the other robots, by whom our navigation takes them for.
    """

    body: RobotShape
    field: Field
    barriers: tuple[Barrier, ...]
    red_tasks: Mapping[str, Task]
    others: Mapping[Source, OtherRobot]
    duration: int

    def start(self, team: TeamColour) -> Pose:
        """Return where a team's robot starts."""
        return self.field.starts[team].pose

    def barrier(self, name: str) -> Barrier:
        """Return a barrier by its name as people write it: `fire 2`, `fire-2`, `Pool_1`; raises UnknownName."""
        names = {each.name: each for each in self.barriers}
        # On a command line a name with a space needs quotes, so `fire-2` is accepted.
        plain = name.strip().lower().replace("-", " ").replace("_", " ")
        if plain not in names:
            raise UnknownName("barrier", name, names)
        return names[plain]

    def flagged(self, flags: Barriers) -> Iterator[tuple[Barrier, Passage]]:
        """Yield each barrier for which a goto's flags are set, and its passage."""
        for barrier in self.barriers:
            if passage := flags.passage(barrier.number):
                yield barrier, passage

    def words(self, flags: Barriers) -> str:
        """Describe a goto's flags by the names of the barriers: `fire 2:forced, pool 1:normal`, or `none`."""
        texts = (f"{barrier.name}:{passage.name.lower()}" for barrier, passage in self.flagged(flags))
        return ", ".join(texts) or "none"

    def tasks(self, team: TeamColour) -> dict[str, Task]:
        """Return the tasks of a team's robot, by name."""
        if team is TeamColour.RED:
            return dict(self.red_tasks)
        tasks = {}
        for task in self.red_tasks.values():
            at = Stand(int(self.field.width) - task.at.x, task.at.y, int(normalise(180 - task.at.angle)))
            # The mirrored place keeps its own name: yellow's `fire 1` is where red's is.
            there = (each.name for each in self.red_tasks.values() if each.at[:2] == at[:2])
            name = next(there, task.name)
            tasks[name] = task._replace(name=name, at=at)
        return tasks
