"""Reads `robot.yaml`: the facts of a robot and its match, with a place in the file for whatever is wrong.

The shipped file says what each key is. It stands beside the EDS files of a robot, in their folder or the one above.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import yaml

from eurobot_od.errors import DictionaryError, LocalError, UnknownName
from eurobot_od.robot import dialects
from eurobot_od.robot.model.facts import (
    NO_TREES,
    Barrier,
    BarrierKind,
    BarrierShape,
    Facts,
    Field,
    OtherRobot,
    RobotShape,
    Start,
    Task,
    Trees,
    Wheels,
    Worth,
    Zone,
)
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.values import FLAGGED, Source, TeamColour
from eurobot_od.support import bounded
from eurobot_od.support.yaml_places import (
    STRING,
    NodeReader,
    Problems,
    ReadError,
    compose,
    listing,
    mapping,
    record,
    refuse,
    refuse_aliases,
    shown,
    text,
)

NAME = "robot.yaml"

SECTIONS = ("body", "match", "field", "barriers", "tasks", "robots")
"""The first words of what can be changed by its name, such as `body.radius`."""

Changes = tuple[tuple[str, str], ...]
"""Facts in place of the file's, by their names in it: `("body.radius", "250")`."""

SIDE = (0, 100_000)
"""Places on a side of the largest field, mm."""

T = TypeVar("T")
EnumT = TypeVar("EnumT", bound=Enum)
NUMBER = re.compile(r"-?(0|[1-9][0-9]{0,8})(\.[0-9]{1,9})?")


def is_fact(name: str) -> bool:
    """Tell whether a name is one of a fact, such as `body.radius`, and not of a node's setting."""
    return name.partition(".")[0] in SECTIONS


def names() -> list[str]:
    """Return the names of the facts that the shipped file has: `body.radius` and so on."""
    source = bounded.read(dialects.eds_folder() / NAME).decode()
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

    Raises DictionaryError with the line of what is wrong in the file, LocalError for a change, OSError.
    """
    path = dialects.eds_folder() / NAME if file is None else Path(file)
    return parse(bounded.read(path).decode("utf-8", "replace"), str(path), tuple(changes))


@lru_cache(16)
def parse(source: str, file: str, changes: Changes = ()) -> Facts:
    """Return the facts that a text says, changed; raises as `read`."""
    problems: Problems = []
    try:
        root = compose(source, problems)
        refuse_aliases(root, problems)
        facts = FACTS(root, problems)
    except ReadError as error:
        place, what = min(problems)
        raise DictionaryError(f"{file}:{place.line}", None, what) from error
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
        return FACTS(root, problems)
    except ReadError as error:
        raise LocalError(f"{name}={value}: {problems[0].what}") from error


def _entries(node: yaml.Node, problems: Problems) -> dict[str, tuple[yaml.Node, yaml.Node]]:
    if not isinstance(node, yaml.MappingNode):
        refuse(node, problems, f"{shown(node)} is a single value, which is given as a whole")
    return {key.value: (key, value) for key, value in node.value}


# Readers of values: one line says what is wrong, with the field's name, its value and what is allowed


def _real(name: str, low: float, high: float, unit: str = "mm") -> NodeReader[float]:
    allowed = f"{low:g}..{high:g} {unit}".rstrip()

    def read_real(node: yaml.Node, problems: Problems) -> float:
        # YAML 1.1 reads 010 as 8 and 12:30 as 750: only a plain decimal number is taken for one.
        plain = isinstance(node, yaml.ScalarNode) and not node.style and NUMBER.fullmatch(node.value)
        if not plain or not low <= float(node.value) <= high:
            refuse(node, problems, f"{name} = {shown(node)} is not allowed; allowed: {allowed}")
        return float(node.value)

    return read_real


def _whole(name: str, low: int, high: int, unit: str = "") -> NodeReader[int]:
    read_number = _real(name, low, high, unit)

    def read_whole(node: yaml.Node, problems: Problems) -> int:
        value = read_number(node, problems)
        if value != int(value):
            refuse(node, problems, f"{name} = {shown(node)} is not allowed; allowed: whole numbers {low}..{high}")
        return int(value)

    return read_whole


def _one_of(name: str, members: Mapping[str, T]) -> NodeReader[T]:
    def read_member(node: yaml.Node, problems: Problems) -> T:
        if not isinstance(node, yaml.ScalarNode) or node.value not in members:
            refuse(node, problems, f"{name} = {shown(node)} is not allowed; allowed: {', '.join(members)}")
        return members[node.value]

    return read_member


def _tuple(make: Callable[..., T], *readers: NodeReader[Any]) -> NodeReader[T]:
    """Make a reader of a list with a reader for each of its items."""

    def read_tuple(node: yaml.Node, problems: Problems) -> T:
        if not isinstance(node, yaml.SequenceNode) or len(node.value) != len(readers):
            refuse(node, problems, f"expected a list of {len(readers)} numbers, found {shown(node)}")
        return make(*(each(part, problems) for each, part in zip(readers, node.value)))

    return read_tuple


def _checked(reader: NodeReader[T], wrong: Callable[[T], str | None]) -> NodeReader[T]:
    """Make a reader of what may contradict itself; `wrong` says how."""

    def read_checked(node: yaml.Node, problems: Problems) -> T:
        value = reader(node, problems)
        if (what := wrong(value)) is not None:
            refuse(node, problems, what)
        return value

    return read_checked


# The file's parts

X, Y = _real("x", *SIDE), _real("y", *SIDE)
POINT = _tuple(Point, X, Y)
ANGLE = _real("angle", 0, 359, "degrees")
YES_OR_NO = {"true": True, "false": False}

CORNER = _tuple(Point, _real("x", -1000, 1000), _real("y", -1000, 1000))
WHEELS = record(Wheels, {"track": _real("track", 1, 2000), "diameter": _real("diameter", 1, 1000)}, {})


def _body(radius: float | None = None, outline: tuple[Point, ...] = (), wheels: Wheels | None = None) -> RobotShape:
    # Rounded up: a circle smaller than the outline by a fraction of a millimetre would be refused below.
    around = max((math.hypot(*corner) for corner in outline), default=0.0)
    return RobotShape(math.ceil(around) if radius is None else radius, outline, wheels)


def _wrong_body(body: RobotShape) -> str | None:
    if not body.radius:
        return "key 'radius' is missing, or 'outline'"
    if body.outline and len(body.outline) < 3:
        return f"outline has {len(body.outline)} corners; allowed: 3 or more"
    around = max((math.hypot(*corner) for corner in body.outline), default=0.0)
    if around > body.radius:
        return f"radius = {body.radius:g} mm is less than that of a corner of the outline, {around:.1f} mm"
    return None


BODY = _checked(
    record(_body, {}, {"radius": _real("radius", 10, 1000), "outline": listing(CORNER), "wheels": WHEELS}), _wrong_body
)

# At most what the object 0x2105 holds, 16 bits.
MATCH = record(lambda duration: duration, {"duration": _whole("duration", 1, 0xFFFF, "s")}, {})

TEAMS = {team.name.lower(): team for team in TeamColour}
START = record(Start, {"zone": _tuple(Zone, X, Y, X, Y), "pose": _tuple(Pose, X, Y, ANGLE)}, {})
STARTS = record(
    lambda **starts: {TEAMS[team]: start for team, start in starts.items()}, dict.fromkeys(TEAMS, START), {}
)
SIZE = _tuple(lambda *size: size, _real("size along x", 100, SIDE[1]), _real("size along y", 100, SIDE[1]))
TREES = record(Trees, {"radius": _real("radius", 1, 1000), "places": listing(POINT)}, {})


FIELD = _checked(
    record(
        lambda size, border, start, trees=NO_TREES: Field(size[0], size[1], border, start, trees),
        {"size": SIZE, "border": _real("border", 0, 1000), "start": STARTS},
        {"trees": TREES},
    ),
    lambda field: next(
        (
            f"the start of {team.name.lower()}, {start.pose[:2]}, is outside of the field"
            for team, start in field.starts.items()
            if not field.contains(start.pose.point)
        ),
        None,
    ),
)

KIND: NodeReader[dict[str, Any]] = record(
    dict,
    {"shape": _one_of("shape", {each.value: each for each in BarrierShape}), "size": _real("size", 1, 5000)},
    {"pushed": _one_of("pushed", YES_OR_NO)},
)
BARRIER: NodeReader[dict[str, Any]] = record(
    dict, {"number": _whole("number", 1, FLAGGED), "kind": text, "at": POINT}, {}
)


def _wrong_barriers(section: dict[str, dict[str, dict[str, Any]]]) -> str | None:
    numbers: dict[int, str] = {}
    for name, each in section["places"].items():
        if each["kind"] not in section["kinds"]:
            return f"{name}: {UnknownName('kind', str(each['kind']), section['kinds'])}"
        if (other := numbers.setdefault(each["number"], name)) is not name:
            return f"{name}: number {each['number']} is taken by {other}"
    return None


BARRIERS: NodeReader[dict[str, Any]] = _checked(
    record(dict, {"kinds": mapping(KIND), "places": mapping(BARRIER)}, {}), _wrong_barriers
)

TASK: NodeReader[dict[str, Any]] = record(
    dict,
    {
        "at": _tuple(
            lambda *at: at,
            _whole("x", *SIDE),
            _whole("y", *SIDE),
            _whole("angle", 0, 359, "degrees"),
        ),
        "seconds": _real("seconds", 0, 1000, "s"),
        "tries": _whole("tries", 1, 1000),
        "points": _whole("points", 0, 10_000),
        "chance": _real("chance", 0, 1, ""),
    },
    {
        "worth": _one_of("worth", {each.value: each for each in Worth}),
        "shared": _one_of("shared", YES_OR_NO),
    },
)


OTHERS = {"enemy 1": Source.ENEMY_1, "enemy 2": Source.ENEMY_2, "confederate": Source.CONFEDERATE}
OTHER = _checked(
    record(OtherRobot, {"radius": _real("radius", 10, 1000), "rounds": listing(POINT)}, {}),
    lambda other: None if len(other.rounds) > 1 else "rounds has less than 2 places",
)
ROBOTS = record(
    lambda **robots: {OTHERS[name]: robot for name, robot in robots.items()}, dict.fromkeys(OTHERS, OTHER), {}
)


def _facts(
    body: RobotShape,
    match: int,
    field: Field,
    barriers: dict[str, Any],
    tasks: dict[str, Any],
    robots: Mapping[Source, OtherRobot],
) -> Facts:
    # Plain texts from here on: those that the reader gives carry their place in the file.
    kinds = {str(name): BarrierKind(str(name), **kind) for name, kind in barriers["kinds"].items()}
    standing = [
        Barrier(str(name), each["number"], kinds[each["kind"]], *each["at"])
        for name, each in barriers["places"].items()
    ]
    todo = {str(name): Task(str(name), *each.pop("at"), **each) for name, each in tasks.items()}
    return Facts(body, field, tuple(sorted(standing, key=lambda each: each.number)), todo, robots, match)


def _outside(facts: Facts) -> str | None:
    """Say what does not stand on the field, None if all does."""
    places = [(each.name, each.point) for each in facts.barriers]
    places += [(f"task {each.name}", each.pose.point) for each in facts.red_tasks.values()]
    for name, point in places:
        if not facts.field.contains(point):
            size = f"{facts.field.width:g} x {facts.field.height:g} mm"
            return f"{name} at ({point.x:g}, {point.y:g}) is outside of the field of {size}"
    return None


FACTS = _checked(
    record(
        _facts,
        {"body": BODY, "match": MATCH, "field": FIELD, "barriers": BARRIERS, "tasks": mapping(TASK), "robots": ROBOTS},
        {},
    ),
    _outside,
)
