"""Reads `robot.yaml`, the facts of a robot and its match; problems have their place in the file.

The shipped file explains each key. A robot's file is in the folder of its EDS files or the one above.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cache, lru_cache
from pathlib import Path
from typing import Annotated, Literal, NamedTuple, TypeAlias

import yaml

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.robot import dialects
from eurobot_od.robot.model.places import Point, Pose, normalise
from eurobot_od.robot.model.values import FLAGGED, Barriers, Passage, Source, TeamColour
from eurobot_od.support.declared import ByName, Listed, Within
from eurobot_od.support.files import read_whole
from eurobot_od.support.yaml_places import (
    STRING,
    PlacedError,
    Problems,
    ReadError,
    compose,
    refuse,
    refuse_aliases,
    shown,
    telling,
)
from eurobot_od.support.yaml_shapes import TEXT, Shape, shape_of

SIDE, ANGLE = Within(0, 100_000, "mm"), Within(0, 359, "degrees")
"""Ranges of coordinates on the field, and of headings."""

OnField: TypeAlias = Annotated[Point, Listed(SIDE, SIDE)]
Radius: TypeAlias = Annotated[float, Within(10, 1000, "mm")]

# Tasks


class Worth(Enum):
    """What a task is worth."""

    POINTS = "points"
    FRUIT = "fruit"
    """Pieces of fruit, to be brought to the basket."""
    HARVEST = "harvest"
    """One point per piece of fruit that the robot carries."""


class Stand(NamedTuple):
    """The robot's place and heading for a task: mm and degrees, integers as in a goto."""

    x: int
    y: int
    angle: int


class Task(NamedTuple):
    """Something to do at a place.

    It takes `seconds`. Each of `tries` succeeds with the probability `chance`, and then gives `points`. A `shared` task
    can be done once by the first robot, any other once by each robot.
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
        """The robot's pose for it."""
        return Pose(*self.at)

    @property
    def expected(self) -> float:
        """The expected result: points, or fruit."""
        return self.tries * self.chance * self.points


class TasksByName(dict[str, Task]):
    """Tasks by name; a strategy's mistake in a name gets those that there are."""

    def __missing__(self, name: str) -> Task:
        raise UnknownName("task", name, self)


FROM_MIDDLE = Within(-1000, 1000, "mm")
Corner: TypeAlias = Annotated[Point, Listed(FROM_MIDDLE, FROM_MIDDLE)]


class Wheels(NamedTuple):
    """The two driven wheels: their distance, and their diameter."""

    track: Annotated[float, Within(1, 2000, "mm")]
    diameter: Annotated[float, Within(1, 1000, "mm")]


@dataclass(frozen=True)
class RobotShape:
    """The shape of our robot: the `radius` of the circle around the middle between its wheels, in mm.

    `outline` are the corners of its true shape in that circle, x forward and y to the left; empty for a round robot.
    """

    radius: float
    outline: tuple[Point, ...] = ()
    wheels: Wheels | None = None

    def corners(self, pose: Pose) -> list[Point]:
        """Return the corners of the outline at a pose."""
        return _placed(pose, self.outline)

    def tracks(self, pose: Pose) -> list[tuple[Point, Point]]:
        """Return back and front of each wheel at a pose."""
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
    """A rectangle on the field by its edges, in mm."""

    left: float
    lower: float
    right: float
    upper: float


class Start(NamedTuple):
    """A team's start: its zone, and the robot's pose."""

    zone: Annotated[Zone, Listed(SIDE, SIDE, SIDE, SIDE)]
    pose: Annotated[Pose, Listed(SIDE, SIDE, ANGLE)]


class Trees(NamedTuple):
    """Trees at the border: the radius of the trunks, and their places."""

    radius: Annotated[float, Within(1, 1000, "mm")]
    places: tuple[OnField, ...]


NO_TREES = Trees(0, ())


@dataclass(frozen=True)
class Field:
    """The playing field: its size in x and y, the width of its border in drawings, the teams' starts, trees."""

    width: float
    height: float
    border: float
    starts: Mapping[TeamColour, Start]
    trees: Trees = NO_TREES

    def contains(self, point: Point, edge: float = 0.0) -> bool:
        """Return whether a point is on the field, at least `edge` mm from its edges."""
        return edge <= point.x <= self.width - edge and edge <= point.y <= self.height - edge

    def seen_by(self, team: TeamColour, point: Point) -> Point:
        """Return a team's place for a place of the red team: yellow plays the mirror image."""
        return point if team is TeamColour.RED else Point(self.width - point.x, point.y)


# Barriers


class BarrierShape(Enum):
    """The shape of a barrier from above."""

    DISC = "disc"
    TRIANGLE = "triangle"
    SQUARE = "square"


AROUND = {BarrierShape.DISC: 2, BarrierShape.TRIANGLE: math.sqrt(3), BarrierShape.SQUARE: math.sqrt(2)}
"""Diameter or side of a shape, as a multiple of the radius of the circle around it."""


class BarrierKind(NamedTuple):
    """A kind of barrier: its shape and size (diameter or side), and whether robots can push it."""

    name: str
    shape: BarrierShape
    size: Annotated[float, Within(1, 5000, "mm")]
    pushed: bool = False

    @property
    def radius(self) -> float:
        """Radius of the circle around it, in mm."""
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


def _two_or_more(rounds: tuple[Point, ...]) -> tuple[Point, ...]:
    if len(rounds) < 2:
        raise LocalError("rounds has less than 2 places")
    return rounds


class OtherRobot(NamedTuple):
    """Another robot of a simulated match: its radius, and the way points of its rounds if our team is red."""

    radius: Radius
    rounds: Annotated[tuple[OnField, ...], _two_or_more]


@dataclass(frozen=True)
class Facts:
    """Everything in a robot's file; `barriers` are sorted by number, `duration` is in s.

    `red_tasks` are the tasks of the red team by name, `others` the other robots by source.
    """

    body: RobotShape
    field: Field
    barriers: tuple[Barrier, ...]
    red_tasks: Mapping[str, Task]
    others: Mapping[Source, OtherRobot]
    duration: int

    def start(self, team: TeamColour) -> Pose:
        """Return the start pose of a team's robot."""
        return self.field.starts[team].pose

    def barrier(self, name: str) -> Barrier:
        """Return a barrier by its name, in forms such as `fire 2`, `fire-2`, `Pool_1`; raises UnknownName."""
        names = {each.name: each for each in self.barriers}
        # `fire-2` needs no quotes on a command line.
        plain = name.strip().lower().replace("-", " ").replace("_", " ")
        if plain not in names:
            raise UnknownName("barrier", name, names)
        return names[plain]

    def flagged(self, flags: Barriers) -> Iterator[tuple[Barrier, Passage]]:
        """Yield each barrier with flags in a goto, and its passage."""
        for barrier in self.barriers:
            if passage := flags.passage(barrier.number):
                yield barrier, passage

    def words(self, flags: Barriers) -> str:
        """Return a goto's flags as text: `fire 2:forced, pool 1:normal`, or `none`."""
        texts = (f"{barrier.name}:{passage.name.lower()}" for barrier, passage in self.flagged(flags))
        return ", ".join(texts) or "none"

    def tasks(self, team: TeamColour) -> dict[str, Task]:
        """Return the tasks of a team's robot, by name; looking up any other name raises UnknownName."""
        tasks = TasksByName()
        if team is TeamColour.RED:
            tasks.update(self.red_tasks)
            return tasks
        for task in self.red_tasks.values():
            at = Stand(int(self.field.width) - task.at.x, task.at.y, int(normalise(180 - task.at.angle)))
            # A task keeps the name of its place: yellow's `fire 1` is where red's is.
            there = (each.name for each in self.red_tasks.values() if each.at[:2] == at[:2])
            name = next(there, task.name)
            tasks[name] = task._replace(name=name, at=at)
        return tasks


NAME = "robot.yaml"

SECTIONS = ("body", "match", "field", "barriers", "tasks", "robots")
"""First parts of the names of facts, such as in `body.radius`."""

Changes = tuple[tuple[str, str], ...]
"""Changed facts by name: `("body.radius", "250")`."""


def is_fact(name: str) -> bool:
    """Return whether a name is that of a fact, such as `body.radius`, not of a node's setting."""
    return name.partition(".")[0] in SECTIONS


def names() -> list[str]:
    """Return the names of the facts in the shipped file: `body.radius` and so on."""
    source = read_whole(dialects.eds_folder() / NAME).decode()
    return [*_names_in(compose(source, []))]


def _names_in(node: yaml.Node, before: str = "") -> Iterator[str]:
    if not isinstance(node, yaml.MappingNode):
        return
    for key, value in node.value:
        yield f"{before}{key.value}"
        yield from _names_in(value, f"{before}{key.value}.")


def file_for(eds: str | Path) -> Path:
    """Return the robot's file beside an EDS file or a folder of them; the shipped one if there is none.

    Raises LocalError for a file with a name that is almost right.
    """
    folder = Path(eds) if Path(eds).is_dir() else Path(eds).parent
    for each in (folder, folder.parent):
        if (each / NAME).is_file():
            return each / NAME
        if (wrong := (each / NAME).with_suffix(".yml")).is_file():
            raise LocalError(f"{wrong} is not read: its name has to be {NAME}")
    return dialects.eds_folder() / NAME


def read(file: str | Path | None = None, changes: Iterable[tuple[str, str]] = ()) -> Facts:
    """Return the facts of a file, by default of the shipped one, with some changes.

    Raises YamlError for problems in the file, LocalError for those of a change, FileError.
    """
    path = dialects.eds_folder() / NAME if file is None else Path(file)
    return parse(read_whole(path).decode("utf-8", "replace"), str(path), tuple(changes))


@lru_cache(16)
def parse(source: str, file: str, changes: Changes = ()) -> Facts:
    """Return the facts of a text, with changes; raises as `read`."""
    with telling(file) as problems:
        root = compose(source, problems)
        refuse_aliases(root, problems)
        facts = _shape().read(root, problems)
    for name, value in changes:
        # One at a time, so that an error names the change that contradicts the file.
        facts = _changed(root, name, value)
    return facts


def _changed(root: yaml.Node, name: str, value: str) -> Facts:
    """Replace the value with this name, and read everything again."""
    problems: Problems = []
    try:
        *path, key = name.split(".")
        node = root
        for each in path:
            within = _entries(node, problems)
            if each not in within:
                refuse(node, problems, str(UnknownName("key", each, within)))
            node = within[each][1]
        entries = _entries(node, problems)
        given = compose(value, problems)
        entries[key] = yaml.ScalarNode(STRING, key, given.start_mark, given.end_mark), given
        node.value = [*entries.values()]
        return _shape().read(root, problems)
    except ReadError as error:
        raise LocalError(f"{name}={value}: {problems[0].what}") from error


def _entries(node: yaml.Node, problems: Problems) -> dict[str, tuple[yaml.Node, yaml.Node]]:
    if not isinstance(node, yaml.MappingNode):
        refuse(node, problems, f"{shown(node)} is a single value, which is given as a whole")
    return {key.value: (key, value) for key, value in node.value}


# Parts of the file that differ from the facts


class _Match(NamedTuple):
    duration: Annotated[int, Within(1, 0xFFFF, "s")]  # the range of object 0x2105


def _body(radius: Radius | None = None, outline: tuple[Corner, ...] = (), wheels: Wheels | None = None) -> RobotShape:
    around = max((math.hypot(*corner) for corner in outline), default=0.0)
    if radius is None and not outline:
        raise LocalError("key 'radius' is missing, or 'outline'")
    if outline and len(outline) < 3:
        raise LocalError(f"outline has {len(outline)} corners; allowed: 3 or more")
    if radius is not None and around > radius:
        raise LocalError(f"radius = {radius:g} mm is less than that of a corner of the outline, {around:.1f} mm")
    # Rounded up, so that the circle includes the corners.
    return RobotShape(math.ceil(around) if radius is None else radius, outline, wheels)


class _Size(NamedTuple):
    width: float
    height: float


def _field(
    size: Annotated[_Size, Listed(SIDE._replace(low=100), SIDE._replace(low=100))],
    border: Annotated[float, Within(0, 1000, "mm")],
    start: Mapping[Literal["red", "yellow"], Start],
    trees: Trees = NO_TREES,
) -> Field:
    field = Field(*size, border, {TeamColour[name.upper()]: each for name, each in start.items()}, trees)
    for name, each in start.items():
        if not field.contains(each.pose.point):
            raise LocalError(f"the start of {name}, {each.pose[:2]}, is outside of the field")
    return field


class _Standing(NamedTuple):
    number: Annotated[int, Within(1, FLAGGED)]
    kind: str
    at: OnField


def _barriers(
    kinds: Annotated[Sequence[BarrierKind], ByName()], places: Mapping[Annotated[str, TEXT], _Standing]
) -> tuple[Barrier, ...]:
    known = {each.name: each for each in kinds}
    found = dict[int, Barrier]()
    for name, each in places.items():
        if each.kind not in known:
            raise PlacedError(name, f"{name}: {UnknownName('kind', each.kind, known)}")
        if each.number in found:
            raise PlacedError(name, f"{name}: number {each.number} is taken by {found[each.number].name}")
        found[each.number] = Barrier(name, each.number, known[each.kind], *each.at)
    return tuple(found[number] for number in sorted(found))


def _facts(
    body: Annotated[RobotShape, shape_of(_body)],
    match: _Match,
    field: Annotated[Field, shape_of(_field)],
    barriers: Annotated[tuple[Barrier, ...], shape_of(_barriers)],
    tasks: Annotated[Sequence[Task], ByName()],
    robots: Mapping[Literal["enemy 1", "enemy 2", "confederate"], OtherRobot],
) -> Facts:
    places = [(each.name, "", each.point) for each in barriers]
    places += [(each.name, "task ", each.pose.point) for each in tasks]
    for name, what, (x, y) in places:
        if not field.contains(Point(x, y)):
            size = f"{field.width:g} x {field.height:g} mm"
            raise PlacedError(name, f"{what}{name} at ({x:g}, {y:g}) is outside of the field of {size}")
    others = {Source[name.upper().replace(" ", "_")]: each for name, each in robots.items()}
    # Without their places in the file, as names go into results.
    standing = tuple(each._replace(name=str(each.name)) for each in barriers)
    red_tasks = {str(each.name): each._replace(name=str(each.name)) for each in tasks}
    return Facts(body, field, standing, red_tasks, others, match.duration)


@cache
def _shape() -> Shape[Facts]:
    return shape_of(_facts)  # cached and late, as it takes longer than the rest of this module
