"""YAML is read as it is written, with the place of everything, and a file's problems are all told."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest
import yaml

from eurobot_od.support.yaml_places import (
    PARSERS,
    Place,
    PlacedNumber,
    PlacedText,
    Problems,
    ReadError,
    any_text,
    compose,
    compose_all,
    listing,
    mapping,
    matching,
    number,
    read_yaml,
    record,
    refuse_aliases,
    scalar,
    text,
)
from tests.rows import rows


class Pair(NamedTuple):
    one: int
    two: str = ""


A_OR_B = matching("a|b", "a or b")
PAIR = record(Pair, {"one": number}, {"two": any_text})

VALID = [
    (number, "12", 12),
    (number, "0xFF", 255),
    (text, "'12'", "12"),
    (any_text, "Zürich", "Zürich"),
    (scalar, "010", "010"),  # as written
    (scalar, "off", "off"),
    (A_OR_B, "b", "b"),
    (listing(number), "[1, 2]", (1, 2)),
    (listing(number, 2), "[1, 2]", (1, 2)),
    (mapping(number), "{a: 1, b: 2}", {"a": 1, "b": 2}),
    (PAIR, "{one: 1}", Pair(1)),
    (PAIR, "{two: x, one: 1}", Pair(1, "x")),
]

INVALID = [
    (number, "010", "1:1: expected a whole number, decimal or 0x hexadecimal, found '010'"),
    (number, "'1'", "1:1: expected a whole number, decimal or 0x hexadecimal, found '1'"),
    (text, "Zürich", "1:1: expected printable ASCII characters, found 'Zürich'"),
    (any_text, "off", "1:1: expected a text, found 'off', which needs quotes to be one"),
    (scalar, "[]", "1:1: expected a single value, found a list"),
    (A_OR_B, "c", "1:1: expected a or b, found 'c'"),
    (listing(number, 2), "[1]", "1:1: expected a list of 2, found 1"),
    (mapping(number), "a: 1\nb: x\n", "2:4: expected a whole number, decimal or 0x hexadecimal, found 'x'"),
    (mapping(number), "a: 1\na: 2\n", "2:1: key 'a' is given twice"),
    (PAIR, "{two: x}", "1:1: key 'one' is missing"),
    (PAIR, "{one: 1, three: 3}", "1:10: unknown key 'three'; known: one, two"),
]


def shown(problems: Problems) -> list[str]:
    return [f"{line}:{column}: {what}" for (line, column), what in problems]


@rows("reader, source, value", VALID)
def test_reads(reader: object, source: str, value: object) -> None:
    assert read_yaml(source, reader, []) == value  # type: ignore[arg-type]


@rows("reader, source, what", INVALID)
def test_tells_place_and_reason(reader: object, source: str, what: str) -> None:
    problems: Problems = []
    with pytest.raises(ReadError):
        read_yaml(source, reader, problems)  # type: ignore[arg-type]
    assert shown(problems) == [what]


def test_tells_all_problems() -> None:
    problems: Problems = []
    with pytest.raises(ReadError):
        read_yaml("[x, 1, y]", listing(number), problems)
    assert [place for place, _ in problems] == [Place(1, 2), Place(1, 8)]


def test_values_know_their_place() -> None:
    value = read_yaml("- 1\n- 22\n", listing(number), [])[1]
    assert value.place == Place(2, 3)


@pytest.mark.parametrize(
    ("source", "what"),
    [
        ("", "1:1: the file is empty"),
        ("a: [", "1:5: a value is missing"),
        ("a:\n\t- 1", "2:1: a tab; YAML is indented by spaces"),
        ("ab\x07", "1:3: special characters are not allowed"),
        ("a: 1\n---\nb: 2", "2:1: a second document, where one is all there can be"),
        ("[" * 5000, "1:1: the file is nested too deeply"),
    ],
)
def test_tells_what_is_no_yaml(source: str, what: str) -> None:
    problems: Problems = []
    with pytest.raises(ReadError):
        compose(source, problems)
    assert shown(problems) == [what]


def test_composes_several_documents() -> None:
    nodes = compose_all("a\n---\nb\n", [])
    assert [node.value for node in nodes] == ["a", "b"]
    with pytest.raises(ReadError):
        compose_all("", [])


@pytest.mark.parametrize("source", ["[&a 1, *a]", "{x: &a {}, y: [*a]}", "&a [*a]"])
def test_refuses_aliases(source: str) -> None:
    problems: Problems = []
    with pytest.raises(ReadError):
        refuse_aliases(compose(source, []), problems)
    assert [what for _, what in problems] == ["an alias refers to this; write it out"]


def test_takes_what_only_looks_the_same() -> None:
    problems: Problems = []
    refuse_aliases(compose("[1, 1, {a: 1}]", problems), problems)
    assert problems == []


@pytest.mark.parametrize("value", [PlacedText("x", Place(2, 3)), PlacedNumber(7, Place(4, 5))])
def test_a_copy_has_the_place_as_well(value: PlacedText | PlacedNumber) -> None:
    copy = pickle.loads(pickle.dumps(value))
    assert (copy, type(copy), copy.place) == (value, type(value), value.place)


# libyaml's parser and Python's


OURS = sorted(Path(__file__).parents[2].glob("eds/*.yaml"))
LOOK_ALIKE = [
    "a: 'b'\nc: \"d\"\n",
    "a: 01\nb: off\nc: 12:30\n",
    "a: |\n  x\n  y\n",
    "\ufeffä: ü\n",
    "? [a]\n: {b: ~, c}",
]


def parts(node: yaml.Node) -> Iterator[tuple[object, ...]]:
    """Give all that a reader looks at, of a node and of those in it."""
    place = node.start_mark.line, node.start_mark.column
    if isinstance(node, yaml.ScalarNode):
        yield node.tag, node.value, bool(node.style), place
        return
    yield node.tag, len(node.value), place
    for part in node.value:
        for each in part if isinstance(part, tuple) else (part,):
            yield from parts(each)


@rows("source", [*(file.read_text() for file in OURS), *LOOK_ALIKE])
def test_all_parsers_read_the_same(source: str) -> None:
    read = [[list(parts(node)) for node in yaml.compose_all(source, parser)] for parser in PARSERS]
    assert read[0]
    assert all(each == read[0] for each in read)


@pytest.mark.parametrize("sign", ["[", "- ", "{a: "])
def test_deep_nesting_is_a_problem_and_no_crash(sign: str) -> None:
    problems: Problems = []
    with pytest.raises(ReadError):
        compose(sign * 100_000, problems)
    assert shown(problems) == ["1:1: the file is nested too deeply"]
