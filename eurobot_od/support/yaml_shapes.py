"""Shapes: readers of YAML values that report what is wrong, made from type annotations.

`shape_of` takes an annotation. A named tuple, a dataclass or a function stands for a mapping whose keys are its
parameters; keys with a default may be omitted. `Annotated` adds a range or the form of a list (see `declared`), another
shape, or a function that converts the value. A function rejects a value by LocalError, which is reported with the
value's place.

YAML 1.1's own conversions are not used: they read `010` as 8, `12:30` as 750 and `off` as False, and accept a repeated
key.
"""

from __future__ import annotations

import re
from collections import abc
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import partial
from inspect import signature
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Generic, Literal, TypeAlias, TypeVar, Union, get_args, get_origin, get_type_hints

import yaml

from eurobot_od.errors import LocalError, UnknownName, look_up
from eurobot_od.support import texts
from eurobot_od.support import yaml_places as nodes
from eurobot_od.support.declared import ByName, Listed, OneOrMore, Within
from eurobot_od.support.yaml_places import (
    NodeReader,
    Place,
    PlacedInteger,
    PlacedNumber,
    PlacedReal,
    PlacedText,
    Problem,
    Problems,
)

T = TypeVar("T")
S = TypeVar("S")
WHOLE = r"0|[1-9][0-9]{0,99}|0x[0-9A-Fa-f]{1,99}"
DECIMAL = r"-?(0|[1-9][0-9]{0,8})(\.[0-9]{1,9})?"


@dataclass(frozen=True, eq=False)
class Shape(Generic[T]):
    """Reader of one kind of value; `whole` is set if it accepts whole numbers only."""

    read: NodeReader[T]
    whole: bool = False


def read_yaml(source: str, shape: Shape[T], file: str | Path) -> T:
    """Read a text of one YAML document; raises YamlError with all its problems. `file` is its name in errors."""
    with nodes.telling(file) as problems:
        return shape.read(nodes.compose(source, problems), problems)


# Single values


def _unquoted(pattern: str, what: str, make: Callable[[str, Place], T]) -> NodeReader[T]:
    """Return the reader of a number that is written without quotes."""

    def read(node: yaml.Node, problems: Problems) -> T:
        if not isinstance(node, yaml.ScalarNode) or node.style or not re.fullmatch(pattern, node.value):
            nodes.refuse(node, problems, f"expected {what}, found {nodes.shown(node)}")
        return make(node.value, nodes.place_of(node.start_mark))

    return read


def _text(node: yaml.Node, problems: Problems) -> PlacedText:
    if not isinstance(node, yaml.ScalarNode) or node.tag != nodes.STRING:
        hint = ", which needs quotes to be one" if isinstance(node, yaml.ScalarNode) else ""
        nodes.refuse(node, problems, f"expected a text, found {nodes.shown(node)}{hint}")
    return PlacedText(node.value, nodes.place_of(node.start_mark))


def _scalar(node: yaml.Node, problems: Problems) -> PlacedText:
    if not isinstance(node, yaml.ScalarNode):
        hint = "; a text in { } needs quotes: '{t}'" if isinstance(node, yaml.MappingNode) and node.flow_style else ""
        nodes.refuse(node, problems, f"expected a single value, found {nodes.shown(node)}{hint}")
    return PlacedText(node.value, nodes.place_of(node.start_mark))


A_WHOLE_NUMBER = "a whole number, decimal or 0x hexadecimal"

NUMBER = Shape(_unquoted(WHOLE, A_WHOLE_NUMBER, lambda text, place: PlacedNumber(int(text, 0), place)), whole=True)
"""A whole number, decimal without leading zeros or 0x hexadecimal, and not in quotes."""

REAL = Shape(_unquoted(DECIMAL, "a decimal number", lambda text, _: float(text)))
"""A decimal number, which may be negative and have a fraction."""

TEXT = Shape(_text)
"""A text; one that YAML would convert (`off`, `12:30`, `1.0`) has to be in quotes."""

INTEGER = Shape(
    _unquoted(f"{WHOLE}|-[1-9][0-9]{{0,99}}", A_WHOLE_NUMBER, lambda text, place: PlacedInteger(int(text, 0), place))
)
"""A whole number, which may be negative."""

SCALAR = Shape(_scalar)
"""A single value as text, whatever its type in YAML."""


def converted(shape: Shape[T], convert: Callable[[T], S]) -> Shape[S]:
    """Make a shape whose values are converted by `convert`, which rejects a value by LocalError."""

    def read(node: yaml.Node, problems: Problems) -> S:
        value = shape.read(node, problems)
        with nodes.refusing(node, problems):
            return convert(value)

    return Shape(read, shape.whole)


def _printable(text: PlacedText) -> PlacedText:
    if not (text.isascii() and text.isprintable()):
        raise LocalError(f"expected printable ASCII characters, found {str(text)!r}")
    return text


ASCII = converted(TEXT, _printable)
"""A text of printable ASCII characters."""

_FRACTION = Shape(_unquoted(DECIMAL, "a number", lambda text, place: PlacedReal(text, place)))


def _number(node: yaml.Node, problems: Problems) -> PlacedInteger | PlacedReal:
    return (_FRACTION if node.tag == nodes.DECIMAL else INTEGER).read(node, problems)


ANY_NUMBER: Shape[PlacedInteger | PlacedReal] = Shape(_number)
"""An integer, or a decimal number with a fraction."""

NUMBER_OR_ASCII: Shape[PlacedInteger | PlacedReal | PlacedText] = Shape(
    lambda node, problems: (ASCII if node.tag == nodes.STRING else ANY_NUMBER).read(node, problems)
)
"""A number, or else a text of ASCII."""


def matching(pattern: str, what: str) -> Shape[PlacedText]:
    """Make a shape of a text that matches a whole regular expression; `what` describes it in errors."""

    def matched(text: PlacedText) -> PlacedText:
        if not re.fullmatch(pattern, text):
            raise LocalError(f"expected {what}, found {str(text)!r}")
        return text

    return converted(ASCII, matched)


def named(table: Mapping[str, T], kind: str) -> Shape[T]:
    """Make a shape of a name in `table`, read as the value in the table."""
    return converted(SCALAR, lambda text: look_up(kind, text, table))


def within(shape: Shape[T], allowed: Within, name: str) -> Shape[T]:
    """Make a shape of a number in a range; `name` is its name in errors."""
    words = f"whole numbers {allowed}" if shape.whole else str(allowed)

    def read(node: yaml.Node, problems: Problems) -> T:
        try:
            value: Any = shape.read(node, [])
        except nodes.ReadError:
            value = None
        if value is None or not allowed.low <= value <= allowed.high:
            unit = ", with its unit, such as 20 ms" if value is None and shape is DURATION else ""
            nodes.refuse(node, problems, f"{name} = {nodes.shown(node)} is not allowed; allowed: {words}{unit}")
        return value  # type: ignore[no-any-return]

    return Shape(read)


def longer_than_0(seconds: float) -> float:
    """Return a time; raises LocalError for 0."""
    if not seconds:
        raise LocalError("this time has to be longer than 0")
    return seconds


DURATION = converted(SCALAR, texts.seconds)
"""A duration with its unit, in s."""


# Lists and mappings


def listing(item: Shape[T]) -> Shape[tuple[T, ...]]:
    """Make a shape of a list."""

    def read(node: yaml.Node, problems: Problems) -> tuple[T, ...]:
        return tuple(nodes.read_all(((item.read, each) for each in _items(node, problems)), problems))

    return Shape(read)


def listed(make: Callable[..., T], items: Sequence[Shape[Any]]) -> Shape[T]:
    """Make a shape of a list with one shape for each item; `make` is called with the items."""

    def read(node: yaml.Node, problems: Problems) -> T:
        found = _items(node, problems)
        if len(found) != len(items):
            nodes.refuse(node, problems, f"expected a list of {len(items)}, found {len(found)}")
        return make(*nodes.read_all(((item.read, each) for item, each in zip(items, found)), problems))

    return Shape(read)


def _items(node: yaml.Node, problems: Problems) -> list[yaml.Node]:
    if not isinstance(node, yaml.SequenceNode):
        nodes.refuse(node, problems, f"expected a list, found {nodes.shown(node)}")
    items: list[yaml.Node] = node.value
    return items


def one_or_more(item: Shape[T]) -> Shape[tuple[T, ...]]:
    """Make a shape of one item, or of a list of them."""
    several = listing(item)

    def read(node: yaml.Node, problems: Problems) -> tuple[T, ...]:
        return several.read(node, problems) if isinstance(node, yaml.SequenceNode) else (item.read(node, problems),)

    return Shape(read)


def filled(entries: T) -> T:
    """Return a list or mapping; raises LocalError if it is empty."""
    if not entries:
        raise LocalError("expected at least one entry")
    return entries


def pairs_of(node: yaml.Node, problems: Problems) -> dict[PlacedText, yaml.Node]:
    """Return a mapping's keys with their value nodes; a repeated key is a problem."""
    return _pairs(node, problems, ASCII)


def _pairs(node: yaml.Node, problems: Problems, key: Shape[T]) -> dict[T, yaml.Node]:
    if not isinstance(node, yaml.MappingNode):
        nodes.refuse(node, problems, f"expected a mapping, `key: value`, found {nodes.shown(node)}")
    pairs: dict[T, yaml.Node] = {}
    keys = nodes.read_all(((key.read, each) for each, _ in node.value), problems)
    for name, (key_node, value_node) in zip(keys, node.value):
        if name in pairs:  # PyYAML would silently take the second
            problems.append(Problem(nodes.place_of(key_node.start_mark), f"key {nodes.shown(key_node)} is given twice"))
        pairs.setdefault(name, value_node)
    return pairs


def mapping(value: Shape[T], key: Shape[S]) -> Shape[dict[S, T]]:
    """Make a shape of a mapping from shapes of its keys and values; it keeps the file's order."""

    def read(node: yaml.Node, problems: Problems) -> dict[S, T]:
        pairs = _pairs(node, problems, key)
        return dict(zip(pairs, nodes.read_all(((value.read, each) for each in pairs.values()), problems)))

    return Shape(read)


@dataclass(frozen=True)
class Key:
    """One key of a mapping: its shape, a hint for the error about a missing one, and whether it is required."""

    shape: Shape[Any]
    help: str = ""
    needed: bool = False


Keys: TypeAlias = Mapping[str, Key]


def record(make: Callable[..., T], keys: Keys) -> Shape[T]:
    """Make a shape of a mapping with fixed keys; `make` is called with the values by name. Other keys are refused."""

    def read(node: yaml.Node, problems: Problems) -> T:
        if not isinstance(node, yaml.MappingNode):
            nodes.refuse(node, problems, f"expected a mapping (keys: {', '.join(keys)}), found {nodes.shown(node)}")
        pairs = _pairs(node, problems, SCALAR)
        wrong = [Problem(each.place, str(UnknownName("key", str(each), keys))) for each in pairs if each not in keys]
        wrong += [
            Problem(nodes.place_of(node.start_mark), f"key '{name}' is missing" + (f": {key.help}" if key.help else ""))
            for name, key in keys.items()
            if key.needed and name not in pairs
        ]
        problems += wrong
        known = {str(name): each for name, each in pairs.items() if name in keys}
        values = nodes.read_all(((keys[name].shape.read, each) for name, each in known.items()), problems)
        if wrong:  # only now, so that problems of the other values are reported, too
            raise nodes.ReadError
        with nodes.refusing(node, problems):
            return make(**dict(zip(known, values)))

    return Shape(read)


# From declarations

Plain: TypeAlias = Mapping[Any, Shape[Any]]
"""Shapes of single values by type."""

PLAIN: Plain = {
    int: converted(NUMBER, int),
    float: REAL,
    str: converted(TEXT, str),
    bool: named({"true": True, "false": False}, "answer"),
    PlacedNumber: NUMBER,
    PlacedInteger: INTEGER,
    PlacedText: ASCII,
}


def shape_of(kind: Any, plain: Plain = PLAIN, name: str = "value") -> Shape[Any]:
    """Return the shape that an annotation, a class or a function declares; `name` is the value's name in errors."""
    if kind in plain:
        return plain[kind]
    if isinstance(kind, type) and issubclass(kind, Enum):
        return named({each.value: each for each in kind}, name)
    form = FORMS.get(get_origin(kind))
    of = partial(shape_of, plain=plain)
    return form(of, name, *get_args(kind)) if form else record(kind, _keys(of, kind))


Of: TypeAlias = Callable[..., Shape[Any]]
"""`shape_of` with the `plain` shapes already given."""


def _keys(of: Of, kind: Any) -> dict[str, Key]:
    """Return the keys for the parameters of a class or function."""
    hints = get_type_hints(kind, include_extras=True)
    parameters = signature(kind).parameters.items()
    return {name: Key(of(hints[name], name=name), needed=each.default is each.empty) for name, each in parameters}


def _optional(of: Of, name: str, *kinds: Any) -> Shape[Any]:
    (kind,) = set(kinds) - {NoneType}  # None is written by omitting the key
    return of(kind, name=name)


def _mapping(of: Of, name: str, key: Any, value: Any) -> Shape[Any]:
    if get_origin(key) is Literal:  # every one is required
        return record(dict, {each: Key(of(value, name=each), needed=True) for each in get_args(key)})
    return mapping(of(value, name=name), of(key))


def _sequence(of: Of, name: str, item: Any, *others: Any) -> Shape[Any]:
    if others in ((), (...,)):
        return listing(of(item, name=name))
    return listed(lambda *values: values, [of(each, name=name) for each in (item, *others)])


def _annotated(of: Of, name: str, kind: Any, *said: Any) -> Shape[Any]:
    """Apply the metadata of `Annotated` one after the other."""
    shape: Shape[Any] | None = None
    for each in said:
        if isinstance(each, Shape):
            shape = each
        elif type(each) in SAID:
            shape = SAID[type(each)](of, each, kind)
        else:
            shape = shape or of(kind, name=name)
            shape = within(shape, each, name) if isinstance(each, Within) else converted(shape, each)
    return shape or of(kind, name=name)


FORMS: Mapping[Any, Callable[..., Shape[Any]]] = {
    Annotated: _annotated,
    **dict.fromkeys((Union, UnionType), _optional),
    **dict.fromkeys((dict, abc.Mapping), _mapping),
    **dict.fromkeys((tuple, abc.Sequence), _sequence),
}
"""Functions that make the shape of a generic annotation, by its origin."""


def _by_fields(of: Of, said: Listed, kind: Any) -> Shape[Any]:
    hints = get_type_hints(kind)
    ranges = zip(kind._fields, said.ranges, strict=True)
    return listed(kind, [within(of(hints[name]), allowed, name) for name, allowed in ranges])


def _by_name(of: Of, _: ByName, kind: Any) -> Shape[Any]:
    item = get_args(kind)[0]
    keys = _keys(of, item)
    del keys["name"]
    # Both keep their places; a file whose texts need no quotes needs none for its names (`off`, 5).
    names = SCALAR if of(str) is SCALAR else TEXT
    entries: Shape[dict[PlacedText, Any]] = mapping(record(dict, keys), names)
    return converted(entries, lambda found: tuple(item(name=name, **values) for name, values in found.items()))


SAID: Mapping[type, Callable[..., Shape[Any]]] = {
    Listed: _by_fields,
    ByName: _by_name,
    OneOrMore: lambda of, _, kind: one_or_more(of(get_args(kind)[0])),
}
"""Functions that make a shape from metadata in `Annotated`, by the metadata's type."""
