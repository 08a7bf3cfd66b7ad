"""Kinds of fields: raw value to meaning and back, and how a person writes and reads it."""

from __future__ import annotations

import re
from enum import IntEnum
from typing import Any

import pytest

from eurobot_od.od.values import REAL32, Limits
from eurobot_od.pdo.kinds import Choice, Kind, OutOfRange, Quantity, Real


class Colour(IntEnum):
    YELLOW, RED = range(2)


class Source(IntEnum):
    INTERNAL, CONFEDERATE, ENEMY_1, ENEMY_2 = range(4)


X = Limits(0, 3000)
ANY = Limits(0, 0xFFFFFF)

PERCENT, SPARE, MILLIMETRES = Kind("%"), Kind(), Kind("mm")
COLOUR, SOURCE = Choice(Colour), Choice(Source)


class Reading(IntEnum):
    """What a sensor sends instead of a distance."""

    NOTHING = 0x7FF
    TOO_NEAR = -1


class Sight(IntEnum):
    """What another sensor sends instead."""

    NOTHING = 0x7FF


DISTANCE = Quantity("mm", within=(0, 1500), codes=Reading)
TENTHS, DOUBLES = Quantity("mm", step=0.1, within=(-20, 150), codes=Sight), Quantity(step=2)
FORCE = Real(REAL32, "N")
SIGNED = Limits(-200, 0x7FF)

Row = tuple[Kind, Limits, int, Any]

BOTH_WAYS: list[Row] = [
    (PERCENT, Limits(0, 100), 0, 0),
    (PERCENT, Limits(0, 100), 100, 100),
    (PERCENT, Limits(5, 10), 5, 5),
    (DISTANCE, SIGNED, 1500, 1500),
    (DISTANCE, SIGNED, 0x7FF, Reading.NOTHING),
    (DISTANCE, SIGNED, -1, Reading.TOO_NEAR),
    (TENTHS, SIGNED, 3, 0.3),  # not 0.30000000000000004, which is 3 * 0.1
    (TENTHS, SIGNED, -200, -20.0),
    (TENTHS, SIGNED, 0x7FF, Sight.NOTHING),
    (DOUBLES, Limits(-5, 5), -5, -10.0),
    (FORCE, ANY, 0x3F000000, 0.5),
    (COLOUR, Limits(0, 1), 1, Colour.RED),
    (SOURCE, Limits(0, 3), 2, Source.ENEMY_1),
]

OUT_OF_RANGE: list[tuple[Kind, Limits, int]] = [
    (PERCENT, Limits(0, 100), 101),
    (PERCENT, Limits(5, 10), 4),
    (DISTANCE, SIGNED, 1800),  # between the range and the code
    (DISTANCE, SIGNED, -2),
    (TENTHS, SIGNED, 1501),
    (DOUBLES, Limits(-5, 5), 6),
    (COLOUR, Limits(0, 1), 2),
    (SOURCE, Limits(0, 3), 4),  # reserved
]

WRITTEN: list[Row] = [
    (PERCENT, X, 7, 7.0),  # a whole number all the same
    (COLOUR, X, 1, 1),
    (TENTHS, SIGNED, 123, 12.34),  # the nearest step
    (TENTHS, SIGNED, 1500, 150),
]

NOT_WRITTEN: list[tuple[Kind, Limits, Any]] = [
    (PERCENT, Limits(0, 100), 101),
    (PERCENT, Limits(0, 100), -1),
    (PERCENT, Limits(0, 100), 1.5),
    (PERCENT, Limits(0, 100), "7"),
    (PERCENT, Limits(0, 100), None),
    (PERCENT, Limits(0, 100), float("nan")),
    (PERCENT, Limits(0, 100), float("inf")),
    (MILLIMETRES, X, OutOfRange(7)),  # what was flagged once does not go on
    (DISTANCE, SIGNED, 1800),
    (DISTANCE, SIGNED, 0x7FF),  # a code is sent by its name
    (DISTANCE, SIGNED, Colour.RED),  # of another enum
    (DISTANCE, SIGNED, 0.5),
    (TENTHS, SIGNED, 150.1),
    (TENTHS, SIGNED, "1.5"),
    (TENTHS, SIGNED, float("nan")),
    (TENTHS, SIGNED, float("inf")),
    (TENTHS, SIGNED, OutOfRange(7)),
    (FORCE, ANY, "1"),
    (FORCE, ANY, 1e39),
    (COLOUR, Limits(0, 1), 2),
    (COLOUR, Limits(0, 1), "red"),
    (SOURCE, Limits(0, 3), OutOfRange(4)),
]

PARSED: list[tuple[Kind, str, Any]] = [
    (PERCENT, "75", 75),
    (PERCENT, "0x4B", 75),
    (DISTANCE, "too near", Reading.TOO_NEAR),
    (DISTANCE, "0x10", 16),
    (TENTHS, "-1.5", -1.5),
    (TENTHS, "nothing", Sight.NOTHING),
    (COLOUR, "red", Colour.RED),
    (COLOUR, "0", Colour.YELLOW),
    (SOURCE, "enemy 1", Source.ENEMY_1),
]

NOT_PARSED: list[tuple[Kind, str]] = [
    (PERCENT, "fast"),
    (PERCENT, "unknown"),
    (PERCENT, "1.5"),
    (PERCENT, " "),
    (DISTANCE, "1.5"),
    (TENTHS, "far"),
    (COLOUR, "green"),
    (COLOUR, "2"),
]

SHOWN: list[tuple[Kind, Any, str]] = [
    (PERCENT, 75, "75 %"),
    (SPARE, 2, "2"),
    (MILLIMETRES, OutOfRange(4000), "4000 mm (out of range)"),
    (TENTHS, 0.1 + 0.2, "0.3 mm"),
    (DISTANCE, Reading.TOO_NEAR, "too near"),
    (TENTHS, OutOfRange(1800), "1800 x 0.1 mm (out of range)"),
    (DOUBLES, 4.0, "4"),
    (FORCE, 0.5, "0.5 N"),
    (SOURCE, Source.ENEMY_2, "enemy 2"),
    (SOURCE, OutOfRange(9), "9 (out of range)"),
]

ALLOWED = [
    (PERCENT, Limits(0, 100), "0..100 %"),
    (SPARE, Limits(0, 2), "0..2"),
    (DISTANCE, SIGNED, "0..1500 mm, nothing (2047), too near (-1)"),
    (TENTHS, SIGNED, "-20..150 mm in steps of 0.1, nothing (2047)"),
    (Kind(codes=Sight), Limits(0, 0x7FF), "0..2046, nothing (2047)"),  # which the limits include
    (DOUBLES, Limits(-5, 5), "-10..10 in steps of 2"),
    (COLOUR, Limits(0, 1), "yellow (0), red (1)"),
]


@pytest.mark.parametrize(("kind", "limits", "raw", "meaning"), BOTH_WAYS)
def test_reading_inverts_writing(kind: Kind, limits: Limits, raw: int, meaning: Any) -> None:
    assert kind.read(raw, limits) == meaning
    assert type(kind.read(raw, limits)) is type(meaning)
    assert kind.write(meaning, limits) == raw


@pytest.mark.parametrize(("kind", "limits", "raw"), OUT_OF_RANGE)
def test_a_raw_value_out_of_range_is_marked(kind: Kind, limits: Limits, raw: int) -> None:
    assert kind.read(raw, limits) == raw
    assert isinstance(kind.read(raw, limits), OutOfRange)


@pytest.mark.parametrize(("kind", "limits", "raw", "value"), WRITTEN)
def test_equivalent_values_have_the_same_raw_value(kind: Kind, limits: Limits, raw: int, value: Any) -> None:
    assert kind.write(value, limits) == raw


@pytest.mark.parametrize(("kind", "limits", "value"), NOT_WRITTEN)
def test_invalid_values_are_not_written(kind: Kind, limits: Limits, value: Any) -> None:
    with pytest.raises(ValueError, match=re.escape(str(value))):
        kind.write(value, limits)


@pytest.mark.parametrize(("kind", "text", "value"), PARSED)
def test_texts_are_parsed(kind: Kind, text: str, value: Any) -> None:
    assert kind.parse(text) == value
    assert type(kind.parse(text)) is type(value)


@pytest.mark.parametrize(("kind", "text"), NOT_PARSED)
def test_invalid_texts_are_not_parsed(kind: Kind, text: str) -> None:
    with pytest.raises(ValueError, match=re.escape(text)):
        kind.parse(text)


@pytest.mark.parametrize(("kind", "value", "text"), SHOWN)
def test_values_are_formatted(kind: Kind, value: Any, text: str) -> None:
    assert kind.text(value) == text


@pytest.mark.parametrize(("kind", "limits", "text"), ALLOWED)
def test_allowed_values_are_described(kind: Kind, limits: Limits, text: str) -> None:
    assert kind.allowed(limits) == text


@pytest.mark.parametrize(("kind", "meaning"), [(kind, value) for kind, *_, value in BOTH_WAYS])
def test_parsing_inverts_formatting(kind: Kind, meaning: Any) -> None:
    assert kind.parse(kind.text(meaning).removesuffix(f" {kind.unit}")) == meaning


@pytest.mark.parametrize(
    ("within", "step", "codes"),
    [
        (None, 1, Reading),  # which of the values are plain?
        ((-1, 1500), 1, Reading),  # -1 would be both
        ((0, 3000), 1, Reading),
        ((0, 1500), 0, None),
    ],
)
def test_an_ambiguous_quantity_is_refused(within: Any, step: float, codes: Any) -> None:
    with pytest.raises(ValueError, match=r"codes need a range|a step of"):
        Quantity("mm", step, within, codes)
