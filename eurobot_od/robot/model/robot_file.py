"""Reads `robot.yaml`: the facts of a robot and its match, with a place in the file for whatever is wrong.

The shipped file says what each key is. It stands beside the EDS files of a robot, in their folder or the one above.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import yaml

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.robot import dialects
from eurobot_od.robot.model.facts import (
    NO_TREES,
    SIDE,
    Barrier,
    BarrierKind,
    Corner,
    Facts,
    Field,
    OnField,
    OtherRobot,
    Radius,
    RobotShape,
    Start,
    Task,
    Trees,
    Wheels,
)
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import FLAGGED, Source, TeamColour
from eurobot_od.support.declared import ByName, Listed, Within
from eurobot_od.support.files import read_whole
from eurobot_od.support.yaml_places import STRING, Problems, ReadError, compose, refuse, refuse_aliases, shown, telling
from eurobot_od.support.yaml_shapes import Shape, shape_of

NAME = "robot.yaml"

SECTIONS = ("body", "match", "field", "barriers", "tasks", "robots")
"""The first words of what can be changed by its name, such as `body.radius`."""

Changes = tuple[tuple[str, str], ...]
"""Facts in place of the file's, by their names in it: `("body.radius", "250")`."""


def is_fact(name: str) -> bool:
    """Tell whether a name is one of a fact, such as `body.radius`, and not of a node's setting."""
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
        facts = FACTS.read(root, problems)
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
        return FACTS.read(root, problems)
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


FACTS: Shape[Facts] = shape_of(_facts)
