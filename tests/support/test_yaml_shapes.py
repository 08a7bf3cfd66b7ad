"""Declared types are read from YAML as it is written; what does not fit is told with its place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import Enum
from typing import Annotated, Any, Literal, NamedTuple

import pytest

from eurobot_od.errors import LocalError, YamlError
from eurobot_od.support.declared import ByName, Listed, OneOrMore, Within
from eurobot_od.support.yaml_places import Place, PlacedNumber, PlacedText
from eurobot_od.support.yaml_shapes import (
    DURATION,
    PLAIN,
    SCALAR,
    filled,
    longer_than_0,
    matching,
    read_yaml,
    shape_of,
)


class Colour(Enum):
    RED = "red"
    YELLOW = "yellow"


class Spot(NamedTuple):
    x: float
    y: float


class Thing(NamedTuple):
    name: str
    number: Annotated[int, Within(1, 8)]
    colour: Colour = Colour.RED
    is_pushed: bool = False


def total(one: int, two: Annotated[float, Within(-1, 1, "mm")] | None = None) -> float:
    """Stand for a mapping that is made by a function."""
    if one == 13:
        raise LocalError("13 is unlucky")
    return one + (two or 0)


SPOT = Annotated[Spot, Listed(Within(0, 9, "mm"), Within(0, 9, "mm"))]
THINGS = Annotated[Sequence[Thing], ByName()]

# What is declared, a text of YAML, and the value.
VALID: list[tuple[Any, str, object]] = [
    (int, "12", 12),
    (int, "0xFF", 255),
    (float, "-1.5", -1.5),
    (str, "'12'", "12"),
    (str, "Zürich", "Zürich"),
    (bool, "true", True),
    (Colour, "yellow", Colour.YELLOW),
    (Annotated[str, SCALAR], "010", "010"),  # as written
    (Annotated[str, SCALAR], "off", "off"),
    (Annotated[str, matching("a|b", "a or b")], "b", "b"),
    (Annotated[float, DURATION, longer_than_0], "20 ms", 0.02),
    (tuple[int, ...], "[1, 2]", (1, 2)),
    (tuple[int, str], "[1, a]", (1, "a")),
    (Sequence[int], "[]", ()),
    (Annotated[Sequence[int], OneOrMore()], "1", (1,)),
    (Annotated[Sequence[int], OneOrMore()], "[1, 2]", (1, 2)),
    (dict[str, int], "{a: 1, b: 2}", {"a": 1, "b": 2}),
    (Mapping[Literal["left", "right"], int], "{right: 2, left: 1}", {"left": 1, "right": 2}),
    (SPOT, "[1, 2.5]", Spot(1, 2.5)),
    (Thing, "{name: a, number: 2, is_pushed: true}", Thing("a", 2, is_pushed=True)),
    (THINGS, "{a: {number: 2}, b: {number: 1, colour: yellow}}", (Thing("a", 2), Thing("b", 1, Colour.YELLOW))),
    (total, "{one: 1}", 1),
    (total, "{two: -0.5, one: 1}", 0.5),
]

WHOLE = "expected a whole number, decimal or 0x hexadecimal, found"
INVALID: list[tuple[Any, str, str]] = [
    (int, "010", f"1:1: {WHOLE} '010'"),
    (int, "'1'", f"1:1: {WHOLE} '1'"),
    (float, "1e3", "1:1: expected a decimal number, found '1e3'"),
    (str, "off", "1:1: expected a text, found 'off', which needs quotes to be one"),
    (PlacedText, "Zürich", "1:1: expected printable ASCII characters, found 'Zürich'"),
    (bool, "yes", "1:1: unknown answer 'yes'; known: true, false"),
    (Thing, "{name: a, number: 1, colour: yelow}", "1:30: unknown colour 'yelow'; did you mean yellow?"),
    (Annotated[str, SCALAR], "[]", "1:1: expected a single value, found a list"),
    (Annotated[str, matching("a|b", "a or b")], "c", "1:1: expected a or b, found 'c'"),
    (Annotated[float, DURATION, longer_than_0], "0 s", "1:1: this time has to be longer than 0"),
    (tuple[int, int], "[1]", "1:1: expected a list of 2, found 1"),
    (tuple[int, int], "{a: 1}", "1:1: expected a list, found a mapping"),
    (Annotated[tuple[int, ...], filled], "[]", "1:1: expected at least one entry"),
    (dict[str, int], "a: 1\nb: x\n", f"2:4: {WHOLE} 'x'"),
    (dict[str, int], "a: 1\na: 2\n", "2:1: key 'a' is given twice"),
    (dict[str, int], "[a]", "1:1: expected a mapping, `key: value`, found a list"),
    (Mapping[Literal["left", "right"], int], "{left: 1}", "1:1: key 'right' is missing"),
    (SPOT, "[1, 10]", "1:5: y = '10' is not allowed; allowed: 0..9 mm"),
    (Thing, "{name: a, number: 1.0}", "1:19: number = '1.0' is not allowed; allowed: whole numbers 1..8"),
    (Thing, "{number: 1}", "1:1: key 'name' is missing"),
    (Thing, "{name: a, number: 1, color: red}", "1:22: unknown key 'color'; did you mean colour?"),
    (THINGS, "{a: {name: b, number: 2}}", "1:6: unknown key 'name'; known: number, colour, is_pushed"),
    (total, "{one: 1, two: [1]}", "1:15: two = a list is not allowed; allowed: -1..1 mm"),
    (total, "{one: 13}", "1:1: 13 is unlucky"),
]


@pytest.mark.parametrize(("kind", "source", "value"), VALID)
def test_values_are_read_by_their_annotation(kind: Any, source: str, value: object) -> None:
    assert read_yaml(source, shape_of(kind), "a.yaml") == value


@pytest.mark.parametrize(("kind", "source", "what"), INVALID)
def test_a_wrong_value_is_reported_with_its_place(kind: Any, source: str, what: str) -> None:
    with pytest.raises(YamlError) as error:
        read_yaml(source, shape_of(kind), "a.yaml")
    assert str(error.value) == f"a.yaml:{what}"


def test_a_file_may_replace_the_shapes_of_single_values() -> None:
    assert read_yaml("[010, off]", shape_of(tuple[str, str], {**PLAIN, str: SCALAR}), "a.yaml") == ("010", "off")


def test_all_problems_of_a_value_are_reported() -> None:
    with pytest.raises(YamlError) as error:
        read_yaml("{name: off, number: 9, colr: 1}", shape_of(Thing), "a.yaml")
    assert [line.split(" ")[0] for line in str(error.value).splitlines()] == [f"a.yaml:1:{at}:" for at in (8, 21, 24)]


@pytest.mark.parametrize("kind", [PlacedNumber, PlacedText])
def test_values_have_their_place(kind: Any) -> None:
    source = "- 1\n- 22\n" if kind is PlacedNumber else "- a\n- b\n"
    assert read_yaml(source, shape_of(tuple[kind, ...]), "a.yaml")[1].place == Place(2, 3)
