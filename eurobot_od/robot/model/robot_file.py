"""Reads `robot.yaml`: the facts of a robot and its match, with a place in the file for whatever is wrong.

The shipped file says what each key is. It stands beside the EDS files of a robot, in their folder or the one above.
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
from eurobot_od.support.yaml_places import STRING, Problems, ReadError, compose, refuse, refuse_aliases, shown, telling
from eurobot_od.support.yaml_shapes import Shape, shape_of

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
        """Return whether a point is on the field, at least `edge` mm from its edges."""
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


NAME = "robot.yaml"

SECTIONS = ("body", "match", "field", "barriers", "tasks", "robots")
"""The first words of what can be changed by its name, such as `body.radius`."""

Changes = tuple[tuple[str, str], ...]
"""Facts in place of the file's, by their names in it: `("body.radius", "250")`."""


def is_fact(name: str) -> bool:
    """Return whether a name is one of a fact, such as `body.radius`, and not of a node's setting."""
    return name.partition(".")[0] in SECTIONS


def names() -> list[str]:
    """Return the names of the facts that the shipped file has: `body.radius` and so on."""
    source = read_whole(dialects.eds_folder() / NAME).decode()
    return [*_names_in(compose(source, []))]


def _names_in(node: yaml.Node, before: str = "") -> Iterator[str]:
    for key, value in node.value if isinstance(node, yaml.MappingNode) else ():
        yield f"{before}{key.value}"
        yield from _names_in(value, f"{before}{key.value}.")


def file_for(eds: str | Path) -> Path:
    """Return the robot's file beside an EDS file or a folder of them; the shipped one, if there is none."""
    folder = Path(eds) if Path(eds).is_dir() else Path(eds).parent
    beside = (each / NAME for each in (folder, folder.parent))
    return next((each for each in beside if each.is_file()), dialects.eds_folder() / NAME)


def read(file: str | Path | None = None, changes: Iterable[tuple[str, str]] = ()) -> Facts:
    """Return the facts of a file, of the shipped one without, with some of them changed.

    Raises YamlError for what is wrong in the file, LocalError for a change, FileError.
    """
    path = dialects.eds_folder() / NAME if file is None else Path(file)
    return parse(read_whole(path).decode("utf-8", "replace"), str(path), tuple(changes))


@lru_cache(16)
def parse(source: str, file: str, changes: Changes = ()) -> Facts:
    """Return the facts that a text says, changed; raises as `read`."""
    with telling(file) as problems:
        root = compose(source, problems)
        refuse_aliases(root, problems)
        facts = _shape().read(root, problems)
    for name, value in changes:
        # One at a time, reading everything anew: a change that contradicts the file is refused by its own name.
        facts = _changed(root, name, value)
    return facts


def _changed(root: yaml.Node, name: str, value: str) -> Facts:
    """Put a value in place of the one with this name, and read all anew."""
    problems: Problems = []
    try:
        *path, key = name.split(".")
        node = root
        for each in path:
            within = _entries(node, problems)
            if each not in within:
                refuse(node, problems, str(UnknownName("key", each, within)))
            node = within[each][1]
        entries, given = _entries(node, problems), compose(value, problems)
        entries[key] = yaml.ScalarNode(STRING, key, given.start_mark, given.end_mark), given
        node.value = [*entries.values()]
        return _shape().read(root, problems)
    except ReadError as error:
        raise LocalError(f"{name}={value}: {problems[0].what}") from error


def _entries(node: yaml.Node, problems: Problems) -> dict[str, tuple[yaml.Node, yaml.Node]]:
    if not isinstance(node, yaml.MappingNode):
        refuse(node, problems, f"{shown(node)} is a single value, which is given as a whole")
    return {key.value: (key, value) for key, value in node.value}


# The file's parts, where they are not those of the facts


class _Match(NamedTuple):
    duration: Annotated[int, Within(1, 0xFFFF, "s")]  # what the object 0x2105 holds


def _body(radius: Radius | None = None, outline: tuple[Corner, ...] = (), wheels: Wheels | None = None) -> RobotShape:
    around = max((math.hypot(*corner) for corner in outline), default=0.0)
    if radius is None and not outline:
        raise LocalError("key 'radius' is missing, or 'outline'")
    if outline and len(outline) < 3:
        raise LocalError(f"outline has {len(outline)} corners; allowed: 3 or more")
    if radius is not None and around > radius:
        raise LocalError(f"radius = {radius:g} mm is less than that of a corner of the outline, {around:.1f} mm")
    # Rounded up: a circle smaller than the outline by a fraction of a millimetre would cut off a corner.
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
    kinds: Annotated[Sequence[BarrierKind], ByName()], places: Mapping[str, _Standing]
) -> tuple[Barrier, ...]:
    known, found = {each.name: each for each in kinds}, dict[int, Barrier]()
    for name, each in places.items():
        if each.kind not in known:
            raise LocalError(f"{name}: {UnknownName('kind', each.kind, known)}")
        if each.number in found:
            raise LocalError(f"{name}: number {each.number} is taken by {found[each.number].name}")
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
    places = [(each.name, each.point) for each in barriers] + [(f"task {each.name}", each.pose.point) for each in tasks]
    for name, (x, y) in places:
        if not field.contains(Point(x, y)):
            size = f"{field.width:g} x {field.height:g} mm"
            raise LocalError(f"{name} at ({x:g}, {y:g}) is outside of the field of {size}")
    others = {Source[name.upper().replace(" ", "_")]: each for name, each in robots.items()}
    return Facts(body, field, barriers, {each.name: each for each in tasks}, others, match.duration)


@cache
def _shape() -> Shape[Facts]:
    return shape_of(_facts)  # takes longer than the rest of this file: not before a robot.yaml is read
