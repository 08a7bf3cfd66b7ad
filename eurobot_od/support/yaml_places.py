"""Reads YAML into typed values that know their place in the file.

Nothing is converted by the rules of YAML 1.1 (`010` is 8, `12:30` is 750, `off` is False, the second of two equal keys
wins): a reader takes a composed node, and says with line and column what it cannot take. All problems of a file are
collected, so one run shows them all.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import Any, NamedTuple, NoReturn, TypeVar

import yaml
from yaml.composer import Composer

from eurobot_od.errors import UnknownName
from eurobot_od.support.yaml_mistakes import in_words

T = TypeVar("T")
NUMBER = re.compile(r"0|[1-9][0-9]{0,99}|0x[0-9A-Fa-f]{1,99}")
STRING = "tag:yaml.org,2002:str"
"""The tag of what YAML itself takes for a text."""


class Place(NamedTuple):
    """A place in a file: `line` and `column`, both from 1."""

    line: int
    column: int


START = Place(1, 1)


class PlaceElsewhere(Place):
    """A place in another `file` than the one that is read: one that it builds on."""

    file: str


class Problem(NamedTuple):
    """What is wrong at a place, in words without the file's name."""

    place: Place
    what: str


class ReadError(Exception):
    """A node that gave no value; the problems say why."""


class PlacedText(str):
    """A text and its `place`."""

    place: Place

    def __new__(cls, value: str, place: Place) -> PlacedText:
        """Make `value` remember `place`."""
        self = super().__new__(cls, value)
        self.place = place
        return self

    def __reduce__(self) -> tuple[type[PlacedText], tuple[str, Place]]:
        return PlacedText, (str(self), self.place)  # what a copy, or another process, makes it from


class PlacedNumber(int):
    """A whole number, zero or more, and its `place`."""

    place: Place

    def __new__(cls, value: int, place: Place) -> PlacedNumber:
        """Make `value` remember `place`."""
        self = super().__new__(cls, value)
        self.place = place
        return self

    def __reduce__(self) -> tuple[type[PlacedNumber], tuple[int, Place]]:
        return PlacedNumber, (int(self), self.place)  # what a copy, or another process, makes it from


Problems = list[Problem]
NodeReader = Callable[[yaml.Node, Problems], T]


def place_of(mark: yaml.Mark) -> Place:
    """Count line and column from 1, as editors do; YAML counts from 0."""
    if not isinstance(mark, MarkElsewhere):
        return Place(mark.line + 1, mark.column + 1)
    place = PlaceElsewhere(mark.line + 1, mark.column + 1)
    place.file = str(mark.name)
    return place


class MarkElsewhere(yaml.Mark):
    """The mark of a node that comes from another file, its `name`."""


def elsewhere(node: yaml.Node, file: str) -> yaml.Node:
    """Return a node, and all in it, as one that comes from another file."""
    if not isinstance(node.start_mark, MarkElsewhere):  # an alias is here already, and may refer to itself
        mark = node.start_mark
        node.start_mark = MarkElsewhere(file, mark.index, mark.line, mark.column, None, 0)
        for part in node.value if isinstance(node, yaml.CollectionNode) else ():
            for each in part if isinstance(part, tuple) else (part,):
                elsewhere(each, file)
    return node


def merged(base: yaml.Node, own: yaml.Node) -> yaml.Node:
    """Return a mapping with the entries of both; own ones count, and one that is empty takes away the base's.

    What is a mapping in both is merged likewise; anything else is replaced as a whole.
    """
    if not (isinstance(base, yaml.MappingNode) and isinstance(own, yaml.MappingNode)):
        return own
    mine = {key.value: value for key, value in own.value if isinstance(key, yaml.ScalarNode)}
    there = {key.value for key, _ in base.value}
    kept = [(key, merged(value, mine[key.value]) if key.value in mine else value) for key, value in base.value]
    new = [pair for pair in own.value if pair[0].value not in there]
    entries = [(key, value) for key, value in (*kept, *new) if shown(value) != "nothing"]
    return yaml.MappingNode(own.tag, entries, own.start_mark, own.end_mark, own.flow_style)


def shown(node: yaml.Node) -> str:
    """Say what a node is: its text, `nothing`, `a list` or `a mapping`."""
    kinds: dict[type[yaml.Node], str] = {yaml.SequenceNode: "a list", yaml.MappingNode: "a mapping"}
    empty = node.value == "" and isinstance(node, yaml.ScalarNode) and not node.style
    return "nothing" if empty else kinds.get(type(node)) or repr(node.value)


def refuse(node: yaml.Node, problems: Problems, what: str) -> NoReturn:
    """Note the problem of a node and leave its reader."""
    problems.append(Problem(place_of(node.start_mark), what))
    raise ReadError


def number(node: yaml.Node, problems: Problems) -> PlacedNumber:
    """Read a whole number, decimal without leading zeros or 0x hexadecimal, and not in quotes."""
    if not isinstance(node, yaml.ScalarNode) or node.style or not NUMBER.fullmatch(node.value):
        refuse(node, problems, f"expected a whole number, decimal or 0x hexadecimal, found {shown(node)}")
    return PlacedNumber(int(node.value, 0), place_of(node.start_mark))


def any_text(node: yaml.Node, problems: Problems) -> PlacedText:
    """Read a text; one that YAML takes for something else (`off`, `12:30`, `1.0`) has to be in quotes."""
    if not isinstance(node, yaml.ScalarNode) or node.tag != STRING:
        hint = ", which needs quotes to be one" if isinstance(node, yaml.ScalarNode) else ""
        refuse(node, problems, f"expected a text, found {shown(node)}{hint}")
    return PlacedText(node.value, place_of(node.start_mark))


def text(node: yaml.Node, problems: Problems) -> PlacedText:
    """Read a text of printable ASCII characters."""
    value = any_text(node, problems)
    if not (value.isascii() and value.isprintable()):
        refuse(node, problems, f"expected printable ASCII characters, found {shown(node)}")
    return value


def scalar(node: yaml.Node, problems: Problems) -> PlacedText:
    """Read a single value as it is written, whatever YAML takes it for."""
    if not isinstance(node, yaml.ScalarNode):
        braces = isinstance(node, yaml.MappingNode) and node.flow_style
        hint = "; a text in { } needs quotes: '{t}'" if braces else ""
        refuse(node, problems, f"expected a single value, found {shown(node)}{hint}")
    return PlacedText(node.value, place_of(node.start_mark))


def number_or_text(node: yaml.Node, problems: Problems) -> PlacedNumber | PlacedText:
    """Read a number, or else a text."""
    return text(node, problems) if node.tag == STRING else number(node, problems)


def matching(pattern: str, what: str) -> NodeReader[PlacedText]:
    """Make a reader of a text that matches all of a regular expression, called `what`."""

    def read(node: yaml.Node, problems: Problems) -> PlacedText:
        value = text(node, problems)
        if not re.fullmatch(pattern, value):
            refuse(node, problems, f"expected {what}, found {shown(node)}")
        return value

    return read


def listing(item: NodeReader[T], length: int | None = None) -> NodeReader[tuple[T, ...]]:
    """Make a reader of a list of items, of exactly `length` of them if given."""

    def read(node: yaml.Node, problems: Problems) -> tuple[T, ...]:
        if not isinstance(node, yaml.SequenceNode):
            refuse(node, problems, f"expected a list, found {shown(node)}")
        if length not in (None, len(node.value)):
            refuse(node, problems, f"expected a list of {length}, found {len(node.value)}")
        return tuple(read_all(((item, each) for each in node.value), problems))

    return read


def one_or_more(item: NodeReader[T]) -> NodeReader[tuple[T, ...]]:
    """Make a reader of one item, or of a list of them."""
    several = listing(item)

    def read(node: yaml.Node, problems: Problems) -> tuple[T, ...]:
        return several(node, problems) if isinstance(node, yaml.SequenceNode) else (item(node, problems),)

    return read


def mapping(value: NodeReader[T], key: NodeReader[PlacedText] = text) -> NodeReader[dict[PlacedText, T]]:
    """Make a reader of a mapping from texts to values, in the file's order, no key twice."""

    def read(node: yaml.Node, problems: Problems) -> dict[PlacedText, T]:
        pairs = pairs_of(node, problems, key)
        return dict(zip(pairs, read_all(((value, each) for each in pairs.values()), problems), strict=True))

    return read


def record(
    make: Callable[..., T],
    needed: Mapping[str, NodeReader[Any]],
    may: Mapping[str, NodeReader[Any]],
    helps: Mapping[str, str] = {},
) -> NodeReader[T]:
    """Make a reader of a mapping with fixed keys: all `needed` ones, the ones that `may` be there, and no others.

    `helps` say what keys are for, where one is missing.
    """
    readers = {**needed, **may}

    def read(node: yaml.Node, problems: Problems) -> T:
        pairs = pairs_of(node, problems)
        wrong = [Problem(key.place, str(UnknownName("key", str(key), readers))) for key in pairs if key not in readers]
        missing = (f"key '{key}' is missing" + (f": {helps[key]}" if key in helps else "") for key in needed)
        wrong += [Problem(place_of(node.start_mark), what) for key, what in zip(needed, missing) if key not in pairs]
        problems += wrong
        known = {key: each for key, each in pairs.items() if key in readers}
        values = read_all(((readers[key], each) for key, each in known.items()), problems)
        if wrong:  # only now: problems with the other keys are reported in the same run
            raise ReadError
        return make(**dict(zip(known, values, strict=True)))

    return read


def pairs_of(
    node: yaml.Node, problems: Problems, read_key: NodeReader[PlacedText] = text
) -> dict[PlacedText, yaml.Node]:
    """Return a mapping's keys with their values' nodes; a key that is given twice is a problem."""
    if not isinstance(node, yaml.MappingNode):
        refuse(node, problems, f"expected a mapping, `key: value`, found {shown(node)}")
    pairs: dict[PlacedText, yaml.Node] = {}
    for key_node, value_node in node.value:
        key = read_key(key_node, problems)
        if key in pairs:  # PyYAML would take the second without a word
            problems.append(Problem(key.place, f"key '{key}' is given twice"))
        pairs.setdefault(key, value_node)
    return pairs


def read_all(parts: Iterator[tuple[NodeReader[T], yaml.Node]], problems: Problems) -> list[T]:
    """Read every part, also after a faulty one, to find all problems; then give up if there was one."""
    # By their number, as a reader may note a problem and still give a value: a key that stands twice.
    before, values = len(problems), []
    for reader, node in parts:
        try:
            values.append(reader(node, problems))
        except ReadError:
            continue
    if len(problems) > before:
        raise ReadError
    return values


def read_yaml(source: str, reader: NodeReader[T], problems: Problems) -> T:
    """Read one YAML document; raise ReadError, with the problems noted, if there are any."""
    value = reader(compose(source, problems), problems)
    if problems:
        raise ReadError
    return value


def compose(source: str, problems: Problems) -> yaml.Node:
    """Parse the one document of `source` into nodes; text that is not YAML is one problem."""
    return _parsed(yaml.compose, source, problems)


def compose_all(source: str, problems: Problems) -> list[yaml.Node]:
    """Parse all documents of `source`; text that is not YAML is one problem."""
    return _parsed(lambda *arguments: list(yaml.compose_all(*arguments)), source, problems)


if yaml.__with_libyaml__:

    class LibYaml(Composer, yaml.CSafeLoader):
        """Parses by libyaml, eight times as fast; composes in Python, as libyaml's composer crashes on deep nesting."""

        def __init__(self, source: str) -> None:
            yaml.CSafeLoader.__init__(self, source)
            Composer.__init__(self)

    PARSERS: tuple[type, ...] = (LibYaml, yaml.SafeLoader)
else:
    PARSERS = (yaml.SafeLoader,)


def _nodes(parse: Callable[[str, type], T | None], source: str) -> T | None:
    """Return what the first parser makes of it that takes it; else raise the last one's error, whose words we know."""
    for parser in PARSERS[:-1]:
        with suppress(yaml.YAMLError):
            return parse(source, parser)
    return parse(source, PARSERS[-1])


def _parsed(parse: Callable[[str, type], T | None], source: str, problems: Problems) -> T:
    """Call the parser; what it raises, and a text without a document, become a problem."""
    try:
        parsed = _nodes(parse, source)
    except yaml.reader.ReaderError as error:
        lines = source[: error.position].split("\n")  # this error alone has a position instead of a mark
        problem = Problem(Place(len(lines), len(lines[-1]) + 1), error.reason)
    except yaml.MarkedYAMLError as error:
        problem = Problem(place_of(error.problem_mark) if error.problem_mark else START, in_words(error))
    except RecursionError:
        problem = Problem(START, "the file is nested too deeply")
    else:
        if parsed:
            return parsed
        problem = Problem(START, "the file is empty")
    problems.append(problem)
    raise ReadError


def refuse_aliases(root: yaml.Node, problems: Problems) -> None:
    """Note every part that an alias uses again: it would be read twice, and its problems have only one place."""
    seen: set[int] = set()
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if id(node) in seen:
            refuse(node, problems, "an alias refers to this; write it out")
        seen.add(id(node))
        if isinstance(node, yaml.CollectionNode):
            waiting += (part for each in node.value for part in (each if isinstance(each, tuple) else (each,)))
