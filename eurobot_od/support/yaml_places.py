"""YAML as nodes with their places in the file, and a file's problems, each with its place.

A file is only parsed into nodes here; `yaml_shapes` reads the values. All problems of a file are collected, so that one
run shows them all.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import chain
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
"""The tags that YAML gives to texts and to decimal numbers."""


class Place(NamedTuple):
    """A place in a file: `line` and `column`, both from 1."""

    line: int
    column: int


START = Place(1, 1)


class PlaceElsewhere(Place):
    """A place in another `file`, from which the file that is read inherits."""

    file: str


class Problem(NamedTuple):
    """What is wrong at a place, without the file's name."""

    place: Place
    what: str


class ReadError(Exception):
    """A node could not be read; the collected problems say why."""


class WithPlace:
    """A value with its `place` in the file; copying and pickling first create it without one."""

    def __new__(cls, value: Any, place: Place = START) -> Self:
        self = super().__new__(cls, value)  # type: ignore[call-arg]  # the other base is a text or a number
        self.place = place
        return self

    place: Place


class PlacedText(WithPlace, str):
    """A text and its `place`."""


class PlacedNumber(WithPlace, int):
    """A non-negative whole number and its `place`."""


class PlacedInteger(PlacedNumber):
    """A whole number, possibly negative, and its `place`."""


class PlacedReal(WithPlace, float):
    """A decimal number with a fraction, and its `place`."""


Problems = list[Problem]
NodeReader = Callable[[yaml.Node, Problems], T]


class PlacedError(LocalError):
    """A mistake at the place of a `text`, if that has one; otherwise at the node that is being read."""

    def __init__(self, text: str, what: str) -> None:
        super().__init__(what)
        self.place: Place | None = getattr(text, "place", None)


def place_of(mark: yaml.Mark) -> Place:
    """Convert YAML's mark, which counts from 0, to line and column from 1."""
    if not isinstance(mark, MarkElsewhere):
        return Place(mark.line + 1, mark.column + 1)
    place = PlaceElsewhere(mark.line + 1, mark.column + 1)
    place.file = str(mark.name)
    return place


class MarkElsewhere(yaml.Mark):
    """The mark of a node from another file, its `name`."""


def elsewhere(node: yaml.Node, file: str) -> yaml.Node:
    """Mark a node, and all nodes in it, as coming from another file, and return it."""
    if not isinstance(node.start_mark, MarkElsewhere):  # an alias was visited before, and may refer to itself
        mark = node.start_mark
        node.start_mark = MarkElsewhere(file, mark.index, mark.line, mark.column, None, 0)
        for child in children(node):
            elsewhere(child, file)
    return node


def children(node: yaml.Node) -> Iterator[yaml.Node]:
    """Yield the items of a list, or the keys and values of a mapping; nothing for a single value."""
    if isinstance(node, yaml.MappingNode):
        yield from chain.from_iterable(node.value)
    elif isinstance(node, yaml.SequenceNode):
        yield from node.value


def merged(base: yaml.Node, own: yaml.Node) -> yaml.Node:
    """Merge two mappings: own entries replace those of the base, and an empty own entry removes the base's.

    Entries that are mappings in both are merged likewise; anything else is replaced as a whole.
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
    """Describe a node in an error: its text, `nothing`, `a list` or `a mapping`."""
    kinds: dict[type[yaml.Node], str] = {yaml.SequenceNode: "a list", yaml.MappingNode: "a mapping"}
    empty = node.value == "" and isinstance(node, yaml.ScalarNode) and not node.style
    return "nothing" if empty else kinds.get(type(node)) or repr(node.value)


def refuse(node: yaml.Node, problems: Problems, what: str) -> NoReturn:
    """Add a problem at a node, then raise ReadError to leave its reader."""
    problems.append(Problem(place_of(node.start_mark), what))
    raise ReadError


@contextmanager
def refusing(node: yaml.Node, problems: Problems) -> Iterator[None]:
    """Convert a LocalError inside the `with` block into a problem at the node, and leave its reader."""
    try:
        yield
    except PlacedError as error:
        problems.append(Problem(error.place or place_of(node.start_mark), str(error)))
        raise ReadError from None
    except LocalError as error:
        refuse(node, problems, str(error))


def taken(text: PlacedText, problems: Problems, convert: Callable[[str], T]) -> T:
    """Convert a text; a LocalError becomes a problem at the text's place."""
    try:
        return convert(str(text))
    except LocalError as error:
        problems.append(Problem(text.place, str(error)))
        raise ReadError from None


@contextmanager
def telling(file: str | Path) -> Iterator[Problems]:
    """Collect the problems of a file; at the end raises YamlError if there is any."""
    problems: Problems = []
    with suppress(ReadError):
        yield problems
    if problems:
        raise YamlError(file, placed_lines(file, problems))


def placed_lines(file: str | Path, problems: Iterable[Problem]) -> list[str]:
    """Return one line `file:line:column: what` for each distinct problem, in the file's order."""
    # A node that is read several times has its problem several times.
    return [
        one_line(f"{getattr(place, 'file', file)}:{place.line}:{place.column}: {what}")
        for place, what in sorted(set(problems))
    ]


def read_all(parts: Iterator[tuple[NodeReader[T], yaml.Node]], problems: Problems) -> list[T]:
    """Read every part, also after a faulty one, to find all problems; raises ReadError at the end if there was one."""
    # Counted, because a reader may add a problem and still return a value, such as for a repeated key.
    before = len(problems)
    values = []
    for reader, node in parts:
        try:
            values.append(reader(node, problems))
        except ReadError:
            continue
    if len(problems) > before:
        raise ReadError
    return values


def compose(source: str, problems: Problems) -> yaml.Node:
    """Parse the only document of `source` into nodes; invalid YAML is a problem."""
    return _parsed(yaml.compose, source, problems)


def compose_all(source: str, problems: Problems) -> list[yaml.Node]:
    """Parse all documents of `source`; invalid YAML is a problem."""
    return _parsed(lambda *arguments: list(yaml.compose_all(*arguments)), source, problems)


class PurePython(yaml.SafeLoader):
    """A slow parser which, like libyaml, refuses escapes that are not characters."""

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
    """Return the result of the first parser that accepts the source, or raise the last parser's error."""
    for parser in PARSERS[:-1]:
        with suppress(yaml.YAMLError):
            return parse(source, parser)
    return parse(source, PARSERS[-1])


MOST_VALUES, BEFORE_VALUES = 500_000, "\n,[{-?"
"""Largest number of values that is parsed, estimated by counting the characters that precede a value."""


def _parsed(parse: Callable[[str, type], T | None], source: str, problems: Problems) -> T:
    """Call the parser; its errors, an empty source and one with too many values become problems."""
    if sum(map(source.count, BEFORE_VALUES)) > MOST_VALUES:
        problems.append(Problem(START, f"more than {MOST_VALUES} values, which are the most that are read"))
        raise ReadError
    try:
        parsed = _nodes(parse, source)
    except yaml.reader.ReaderError as error:
        lines = source[: error.position].split("\n")  # only this error has a position instead of a mark
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
    """Refuse a node that is used again by an alias: it would be read twice, with only one place for problems."""
    seen: set[int] = set()
    waiting = [root]
    while waiting:
        node = waiting.pop()
        if id(node) in seen:
            refuse(node, problems, "an alias refers to this; write it out")
        seen.add(id(node))
        waiting += children(node)


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
    (r"flow mapping\|.*", "a mapping in {{ }} lacks a comma, or its }}; behind ' #' all is a comment"),
    (r"block mapping\|.*'<scalar>'", "something behind a text in quotes; put all of it in quotes"),
    (r"block (mapping|collection)\|.*<block end>.*", "this line is not indented like those it belongs to"),
    (r".*node content.*", "a value is missing"),
    (r".*found another document", "a second document, where one is all there can be"),
)
"""Patterns of PyYAML's errors as `context|problem`, without `while ...ing a`, and what each means to the user."""

CONTEXT = re.compile(r"while (parsing|scanning) an? ")


def in_words(error: yaml.MarkedYAMLError) -> str:
    """Return what is wrong, in the user's terms."""
    # Either part of the parser's text may be what distinguishes two mistakes.
    complaint = f"{CONTEXT.sub('', error.context or '', count=1)}|{error.problem}"
    for pattern, words in MISTAKES:
        match = re.fullmatch(pattern, complaint, re.DOTALL)
        if match:
            return words.format(**match.groupdict())
    return "not YAML: " + re.sub(r"[<>]", "", str(error.problem))
