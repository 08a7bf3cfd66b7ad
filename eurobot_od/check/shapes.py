"""Shapes of YAML: a reader and the JSON Schema that says the same, put together from small ones.

Rule of this file: a reader is made together with its schema, so that editor and checker cannot disagree.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Generic, TypeAlias, TypeVar

import yaml

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.support import durations, yaml_places
from eurobot_od.support.yaml_places import NodeReader, PlacedText, Problem, Problems, ReadError, refuse

T = TypeVar("T")
S = TypeVar("S")
Schema: TypeAlias = "dict[str, Any]"

LONGEST_TIME = 86_400.0
"""The longest time in s that a step may take for anything it does once."""


@dataclass(frozen=True)
class Shape(Generic[T]):
    """What may stand at a place: `read` takes it from the YAML, `schema` describes it."""

    read: NodeReader[T]
    schema: Schema


@dataclass(frozen=True)
class Key:
    """One key of a mapping: its shape, what it is for, and whether it has to be there."""

    shape: Shape[Any]
    help: str
    needed: bool = False

    @property
    def schema(self) -> Schema:
        """The shape's schema with the explanation."""
        return self.shape.schema | {"description": self.help}


Keys: TypeAlias = Mapping[str, Key]


@contextmanager
def refusing(node: yaml.Node, problems: Problems) -> Iterator[None]:
    """Have a LocalError noted as a problem of a node; raises ReadError then."""
    try:
        yield
    except LocalError as error:
        refuse(node, problems, str(error))


def converted(shape: Shape[T], convert: Callable[[T], S], schema: Schema | None = None) -> Shape[S]:
    """Make a shape of what `convert` makes from another; it raises LocalError for what it does not take."""

    def read(node: yaml.Node, problems: Problems) -> S:
        value = shape.read(node, problems)
        with refusing(node, problems):
            return convert(value)

    return Shape(read, shape.schema if schema is None else schema)


TEXT = Shape(yaml_places.any_text, {"type": "string"})
NAME = Shape(
    yaml_places.matching(r"[A-Za-z_][A-Za-z0-9_]*", "a name of letters, digits and _"),
    {"type": "string", "pattern": "^[A-Za-z_][A-Za-z0-9_]*$"},
)
# Our reader takes the text of a number as it stands; an editor sees a number.
SCALAR = Shape(yaml_places.scalar, {"type": ["string", "number"]})
NUMBER = Shape(yaml_places.number, {"type": ["integer", "string"], "pattern": "^(0x[0-9A-Fa-f]+|[0-9]+)$"})


def _duration(text: str) -> float:
    seconds = durations.seconds(text)
    if seconds > LONGEST_TIME:
        raise LocalError(f"{text} is too long: at most {durations.text(LONGEST_TIME)}, a day")
    return seconds


DURATION = converted(SCALAR, _duration, {"type": "string", "pattern": "^[0-9.]+ *(us|ms|s|min)$"})


def _some_time(seconds: float) -> float:
    if seconds == 0:
        raise LocalError("this time has to be longer than 0")
    return seconds


SOME_TIME = converted(DURATION, _some_time)


def whole(low: int, high: int) -> Shape[int]:
    """Make a shape of a whole number in a range, both ends included."""

    def read(node: yaml.Node, problems: Problems) -> int:
        value = yaml_places.number(node, problems)
        if not low <= value <= high:
            refuse(node, problems, f"{node.value} is not in {low}..{high}")
        return int(value)

    return Shape(read, {"type": "integer", "minimum": low, "maximum": high})


def named(table: Mapping[str, T], kind: str) -> Shape[T]:
    """Make a shape of one of a table's names, read as what the table has for it."""

    def find(text: PlacedText) -> T:
        if text not in table:
            raise UnknownName(kind, str(text), table)
        return table[text]

    return converted(Shape(yaml_places.scalar, {}), find, {"enum": list(table)})


def listing(item: Shape[T]) -> Shape[tuple[T, ...]]:
    """Make a shape of a list."""
    return Shape(yaml_places.listing(item.read), {"type": "array", "items": item.schema})


def one_or_more(item: Shape[T]) -> Shape[tuple[T, ...]]:
    """Make a shape of one item, or of a list of them."""
    return Shape(yaml_places.one_or_more(item.read), {"anyOf": [item.schema, listing(item).schema]})


def mapping(key: Shape[Any], value: Shape[T]) -> Shape[dict[PlacedText, T]]:
    """Make a shape of a mapping whose keys have a shape, too."""

    def read(node: yaml.Node, problems: Problems) -> dict[PlacedText, T]:
        pairs = yaml_places.pairs_of(node, problems)
        keys: list[tuple[NodeReader[Any], yaml.Node]] = [(key.read, each) for each, _ in node.value]
        values = [(value.read, each) for each in pairs.values()]
        return dict(zip(pairs, yaml_places.read_all(iter(keys + values), problems)[len(keys) :]))

    names = {name: key.schema[name] for name in ("pattern", "enum") if name in key.schema}
    return Shape(read, {"type": "object", "propertyNames": names, "additionalProperties": value.schema})


def record(make: Callable[..., T], keys: Keys) -> Shape[T]:
    """Make a shape of a mapping with fixed keys, given to `make` by their names."""
    needed = {name: key.shape.read for name, key in keys.items() if key.needed}
    may = {name: key.shape.read for name, key in keys.items() if not key.needed}
    helps = {name: key.help for name, key in keys.items()}
    return Shape(yaml_places.record(make, needed, may, helps), object_schema(keys))


def object_schema(keys: Keys) -> Schema:
    """Return the schema of a mapping with fixed keys."""
    schema: Schema = {
        "type": "object",
        "properties": {name: key.schema for name, key in keys.items()},
        "additionalProperties": False,
    }
    needed = [name for name, key in keys.items() if key.needed]
    return schema | {"required": needed} if needed else schema


def taken(text: PlacedText, problems: Problems, convert: Callable[[str], T]) -> T:
    """Convert a text that knows its place; the LocalError of one that cannot be converted is noted there."""
    try:
        return convert(str(text))
    except LocalError as error:
        problems.append(problem_at(text, error))
        raise ReadError from None


def problem_at(text: PlacedText, what: object) -> Problem:
    """Return a problem of a text that knows its place."""
    return Problem(text.place, str(what))
