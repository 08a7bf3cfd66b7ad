"""YAML is parsed to nodes with their places, and a file's problems are all told."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from eurobot_od.errors import YamlError
from eurobot_od.support.yaml_places import (
    PARSERS,
    Place,
    PlacedNumber,
    PlacedText,
    Problem,
    Problems,
    ReadError,
    compose,
    compose_all,
    refuse_aliases,
    telling,
)
from tests.marks import marked


def shown(problems: Problems) -> list[str]:
    return [f"{line}:{column}: {what}" for (line, column), what in problems]


def test_one_error_lists_each_problem_of_a_file_once_in_order() -> None:
    found = [Problem(Place(3, 1), "b\nc"), Problem(Place(2, 5), "a"), Problem(Place(2, 5), "a")]
    with pytest.raises(YamlError) as error, telling("a.yaml") as problems:
        problems += found
    assert str(error.value) == "a.yaml:2:5: a\na.yaml:3:1: b\\nc"


@pytest.mark.parametrize(
    ("source", "what"),
    [
        ("", "1:1: the file is empty"),
        ("a: [", "1:5: a value is missing"),
        ("a:\n\t- 1", "2:1: a tab; YAML is indented by spaces"),
        ("ab\x07", "1:3: special characters are not allowed"),
        ("a: 1\n---\nb: 2", "2:1: a second document, where one is all there can be"),
        ("[" * 5000, "1:1: the file is nested too deeply"),
        ('a: [b, "\\ud800"]', "1:8: not YAML: half a surrogate pair is not a character"),
        ('a: "\\U00110000"', "1:7: not YAML: an escape above \\U0010FFFF is not a character"),
        ('a: "\\UFFFFFFFF"', "1:7: not YAML: an escape above \\U0010FFFF is not a character"),
        ('"\\udcff": 1', "1:1: not YAML: half a surrogate pair is not a character"),
    ],
)
def test_invalid_yaml_is_a_problem_with_its_place(source: str, what: str) -> None:
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


def test_equal_values_without_aliases_are_accepted() -> None:
    problems: Problems = []
    refuse_aliases(compose("[1, 1, {a: 1}]", problems), problems)
    assert problems == []


@pytest.mark.parametrize("value", [PlacedText("x", Place(2, 3)), PlacedNumber(7, Place(4, 5))])
def test_copies_and_pickles_keep_the_place(value: PlacedText | PlacedNumber) -> None:
    copy = pickle.loads(pickle.dumps(value))
    assert (copy, type(copy), copy.place) == (value, type(value), value.place)


# libyaml's parser and Python's


OURS = [
    *sorted(Path(__file__).parents[2].glob("docs/**/*.yaml")),
    *sorted(Path(__file__).parents[1].glob("kit/**/*.yaml")),
]
LOOK_ALIKE = [
    "a: 'b'\nc: \"d\"\n",
    "a: 01\nb: off\nc: 12:30\n",
    "a: |\n  x\n  y\n",
    "\ufeffä: ü\n",
    "? [a]\n: {b: ~, c}",
]


def parts(node: yaml.Node) -> Iterator[tuple[object, ...]]:
    """Yield all that a reader looks at, of a node and of those in it."""
    place = node.start_mark.line, node.start_mark.column
    if isinstance(node, yaml.ScalarNode):
        yield node.tag, node.value, bool(node.style), place
        return
    yield node.tag, len(node.value), place
    for part in node.value:
        children = part if isinstance(part, tuple) else (part,)
        for each in children:
            yield from parts(each)


@pytest.mark.parametrize("source", [*(file.read_text() for file in OURS), *LOOK_ALIKE])
def test_all_parsers_read_the_same(source: str) -> None:
    read = [[list(parts(node)) for node in yaml.compose_all(source, parser)] for parser in PARSERS]
    assert read[0]
    assert all(each == read[0] for each in read)


@pytest.mark.parametrize("sign", ["[", "- ", "{a: "])
def test_deep_nesting_is_a_problem(sign: str) -> None:
    problems: Problems = []
    with pytest.raises(ReadError):
        compose(sign * 100_000, problems)
    assert shown(problems) == ["1:1: the file is nested too deeply"]


QUOTES = "a text with > or | at its start needs quotes: '> 0'"
INDENTED = "this line is not indented like those it belongs to"
COLON = "a ': ' in a text needs quotes; or this line is indented wrongly"

# Each row: a text with ^ before the place of the complaint, and its words.
TEXTS = {
    "one space more": ("a: 1\n b^: 2\n", COLON),
    "a list that moves": ("a:\n  - x\n ^- y\n", INDENTED),
    "a key behind a list": ("- a\n^b: 1\n", INDENTED),
    "one space less": ("steps:\n- send: x\n  expect: y\n ^wait: 1\n", INDENTED),
    "an item inside an item": ("- a: 1\n  ^- b: 2\n", INDENTED),
    "a colon in a text": ("name: drive^: stops\n", COLON),
    "no space behind the colon": ("key:value\nb^: 1\n", COLON),
    "a list without its end": ("a: [1\nb^: 2\n", "a list in [ ] lacks a comma, or its ]"),
    "a list without commas": ("a: ['x' ^'y']\n", "a list in [ ] lacks a comma, or its ]"),
    "a mapping without its end": (
        "a: {x: 1\nb^: 2\n",
        "a mapping in { } lacks a comma, or its }; behind ' #' all is a comment",
    ),
    "greater": ("a: > ^0\n", QUOTES),
    "greater or equal": ("a: >^= 3\n", QUOTES),
    "greater in a mapping": ("a: {t: ^> 0}\n", QUOTES),
    "a tab": ("a:\n^\t- b\n", "a tab; YAML is indented by spaces"),
    "an at": ("a: ^@x\n", "a text with '@' at its start needs quotes"),
    "a percent sign": ("a: ^%x\n", "a text with '%' at its start needs quotes"),
    "a star": ("a: ^*x\n", "* begins a reference, and there is none to 'x'; a text needs quotes"),
    "an ampersand": ("a: &^\n", "a text with & or * at its start needs quotes"),
    "a quote left open": ("a: 'x\n^", "a quote that begins a text is never closed"),
    "an escape": ('a: "\\^d"\n', "\\d means nothing in double quotes; take single ones"),
    "words behind quotes": ("a: 'b' ^c\n", "something behind a text in quotes; put all of it in quotes"),
    "a list on the key's line": ("a: ^- b\n", "a list begins on a line of its own"),
    "a last line without a colon": ("a: 1\nb^", "a line without ': '; a key has a colon and a space behind it"),
    "a bracket too many": ("a: ^]\n", "a value is missing"),
    "two documents in one": (
        "{a: 1}\n^b: 2\n",
        "this does not belong to what is before it: one document is one mapping",
    ),
}


@pytest.mark.parametrize(("text", "words"), TEXTS.values())
def test_yaml_errors_are_explained(text: str, words: str) -> None:
    source, place = marked(text)
    problems: Problems = []
    with pytest.raises(ReadError):
        compose(source, problems)
    ((line, column), what) = problems[0]
    assert (f"{line}:{column}", what) == (place, words)
