"""YAML as nodes with their places in the file, and the problems that a file has, each with its place.

A file is parsed only as far as nodes, which `yaml_shapes` reads. All problems of a file are collected, so one run shows
them all.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, Self, TypeVar

import yaml
from yaml.composer import Composer, ComposerError
from yaml.scanner import ScannerError

from eurobot_od.errors import LocalError, YamlError
from eurobot_od.support.files import UNREADABLE, why_unreadable
from eurobot_od.support.texts import encodable, one_line

T = TypeVar("T")
STRING, DECIMAL = "tag:yaml.org,2002:str", "tag:yaml.org,2002:float"
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


class WithPlace:
    """A value that remembers its `place`; a copy, or another process, first makes it without one."""

    def __new__(cls, value: Any, place: Place = START) -> Self:
        self = super().__new__(cls, value)  # type: ignore[call-arg]  # of the text or number that it is, too
        self.place = place
        return self

    place: Place


class PlacedText(WithPlace, str):
    """A text and its `place`."""


class PlacedNumber(WithPlace, int):
    """A whole number, zero or more, and its `place`."""


class PlacedInteger(PlacedNumber):
    """A whole number, which may be negative, and its `place`."""


class PlacedReal(WithPlace, float):
    """A decimal number with a fraction, and its `place`."""


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


@contextmanager
def refusing(node: yaml.Node, problems: Problems) -> Iterator[None]:
    """Have a LocalError noted as the problem of a node, whose reader is left then."""
    try:
        yield
    except LocalError as error:
        refuse(node, problems, str(error))


def taken(text: PlacedText, problems: Problems, convert: Callable[[str], T]) -> T:
    """Convert a text that knows its place; the LocalError of one that cannot be converted is noted there."""
    try:
        return convert(str(text))
    except LocalError as error:
        problems.append(Problem(text.place, str(error)))
        raise ReadError from None


@contextmanager
def telling(file: str | Path) -> Iterator[Problems]:
    """Collect what is wrong with a file; raises YamlError with all of it in the end, if there is anything."""
    problems: Problems = []
    with suppress(ReadError):
        yield problems
    if problems:
        raise YamlError(file, placed_lines(file, problems))


def placed_lines(file: str | Path, problems: Iterable[Problem]) -> list[str]:
    """Return a line `file:line:column: what` for each problem, once, in the file's order."""
    # An object that several nodes share brings its problem several times.
    return [
        one_line(f"{getattr(place, 'file', file)}:{place.line}:{place.column}: {what}")
        for place, what in sorted(set(problems))
    ]


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


def compose(source: str, problems: Problems) -> yaml.Node:
    """Parse the one document of `source` into nodes; text that is not YAML is one problem."""
    return _parsed(yaml.compose, source, problems)


def compose_all(source: str, problems: Problems) -> list[yaml.Node]:
    """Parse all documents of `source`; text that is not YAML is one problem."""
    return _parsed(lambda *arguments: list(yaml.compose_all(*arguments)), source, problems)


class PurePython(yaml.SafeLoader):
    """Parses slowly, and like libyaml refuses escapes that are no characters, which no file can hold."""

    def scan_flow_scalar_non_spaces(self, double: bool, start_mark: yaml.Mark) -> list[str]:
        """Return the characters up to the next blank; raises ScannerError."""
        try:
            chunks: list[str] = super().scan_flow_scalar_non_spaces(double, start_mark)
        except (ValueError, OverflowError) as error:  # of `chr`
            what = "an escape above \\U0010FFFF is not a character"
            raise ScannerError(None, None, what, self.get_mark()) from error
        return chunks

    def compose_scalar_node(self, anchor: Any) -> yaml.ScalarNode:
        """Return a scalar's node; raises ComposerError."""
        node: yaml.ScalarNode = super().compose_scalar_node(anchor)
        if node.value != encodable(node.value):
            raise ComposerError(None, None, "half a surrogate pair is not a character", node.start_mark)
        return node


if yaml.__with_libyaml__:

    class LibYaml(Composer, yaml.CSafeLoader):
        """Parses by libyaml, eight times as fast; composes in Python, as libyaml's composer crashes on deep nesting."""

        def __init__(self, source: str) -> None:
            yaml.CSafeLoader.__init__(self, source)
            Composer.__init__(self)

    PARSERS: tuple[type, ...] = (LibYaml, PurePython)
else:
    PARSERS = (PurePython,)


def _nodes(parse: Callable[[str, type], T | None], source: str) -> T | None:
    """Return what the first parser makes of it that takes it; else raise the last one's error, whose words we know."""
    for parser in PARSERS[:-1]:
        with suppress(yaml.YAMLError):
            return parse(source, parser)
    return parse(source, PARSERS[-1])


MOST_VALUES, BEFORE_VALUES = 500_000, "\n,[{-?"
"""Most values of a text that is parsed, counted by the characters of which one stands before each of them."""


def _parsed(parse: Callable[[str, type], T | None], source: str, problems: Problems) -> T:
    """Call the parser; what it raises, and a text without a document, or with too much, become a problem."""
    if sum(map(source.count, BEFORE_VALUES)) > MOST_VALUES:
        problems.append(Problem(START, f"more than {MOST_VALUES} values, which are the most that are read"))
        raise ReadError
    try:
        parsed = _nodes(parse, source)
    except yaml.reader.ReaderError as error:
        lines = source[: error.position].split("\n")  # this error alone has a position instead of a mark
        problem = Problem(Place(len(lines), len(lines[-1]) + 1), error.reason)
    except yaml.MarkedYAMLError as error:
        problem = Problem(place_of(error.problem_mark) if error.problem_mark else START, in_words(error))
    except UNREADABLE as error:
        problem = Problem(START, why_unreadable(error))
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


MISTAKES = (
    (r"block scalar\|.*", "a text with > or | at its start needs quotes: '> 0'"),
    (r".*character '[>|]' that cannot start.*", "a text with > or | at its start needs quotes: '> 0'"),
    (r".*character '\\t' that cannot start.*", "a tab; YAML is indented by spaces"),
    (r".*character (?P<sign>'.') that cannot start.*", "a text with {sign} at its start needs quotes"),
    (r".*undefined alias (?P<name>'.*')", "* begins a reference, and there is none to {name}; a text needs quotes"),
    (r"(anchor|alias)\|.*", "a text with & or * at its start needs quotes"),
    (r"directive\|.*|.*'<document start>'.*", "this does not belong to what is before it: one document is one mapping"),
    (r".*mapping values are not allowed.*", "a ': ' in a text needs quotes; or this line is indented wrongly"),
    (r".*sequence entries are not allowed.*", "a list begins on a line of its own"),
    (r".*quoted scalar\|found unexpected end.*", "a quote that begins a text is never closed"),
    (r".*unknown escape character '(?P<sign>.+)'", r"\{sign} means nothing in double quotes; take single ones"),
    (r".*could not find expected ':'", "a line without ': '; a key has a colon and a space behind it"),
    (r"flow sequence\|.*", "a list in [ ] lacks a comma, or its ]"),
    (r"flow mapping\|.*", "a mapping in {{ }} lacks a comma, or its }}"),
    (r"block mapping\|.*'<scalar>'", "something behind a text in quotes; put all of it in quotes"),
    (r"block (mapping|collection)\|.*<block end>.*", "this line is not indented like those it belongs to"),
    (r".*node content.*", "a value is missing"),
    (r".*found another document", "a second document, where one is all there can be"),
)
"""A complaint as `context|problem`, context without `while ...ing a`, and what it means."""

CONTEXT = re.compile(r"while (parsing|scanning) an? ")


def in_words(error: yaml.MarkedYAMLError) -> str:
    """Say what is wrong, for a person."""
    # The parser's words are in two parts, of which either may be what tells one mistake from another.
    complaint = f"{CONTEXT.sub('', error.context or '', count=1)}|{error.problem}"
    for pattern, words in MISTAKES:
        match = re.fullmatch(pattern, complaint, re.DOTALL)
        if match:
            return words.format(**match.groupdict())
    return "not YAML: " + re.sub(r"[<>]", "", str(error.problem))
