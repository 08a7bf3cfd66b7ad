"""The robot's kinds of fields: angles, coordinates, a remaining time, barrier flags."""

from __future__ import annotations

import re
from typing import Any

import pytest

from eurobot_od.errors import UnknownName
from eurobot_od.od.meanings import ObjectMeaning
from eurobot_od.od.values import Limits
from eurobot_od.pdo.kinds import Kind, OutOfRange
from eurobot_od.robot.model.messages import TIMES, Angle, BarrierFlags, Coordinate, Heading
from eurobot_od.robot.model.values import Barriers, GotoFault, Passage

X = Limits(0, 3000)
ANY = Limits(0, 0xFFFFFF)

ANGLE, HEADING = Angle("deg"), Heading("deg").of(ObjectMeaning("deg", Limits(0, 359), {"unknown": 0x3FF}))
MILLIMETRES = Coordinate("mm").of(ObjectMeaning("mm", Limits(0, 3000), {"unknown": 0xFF}))
FAULTS = {"arrived": 0, "unknown": 0x0FFFFF, "blocked": 0xFFFFFE, "not possible": 0xFFFFFF}
TIME = Kind("ms", TIMES).of(ObjectMeaning("ms", Limits(0, 0x0FFFFE), FAULTS))
BARRIERS = BarrierFlags()

# A kind, its limits, a raw value, what it means, and how a person reads and writes it.
BOTH_WAYS: list[tuple[Kind, Limits, int, Any, str]] = [
    (ANGLE, ANY, 359, 359, "359 deg"),
    (HEADING, ANY, 0, 0, "0 deg"),
    (HEADING, ANY, 0x3FF, None, "unknown"),
    (MILLIMETRES, X, 0xFF, 255, "255 mm"),  # a real place: unknown only together with y and the angle
    (MILLIMETRES, X, 3000, 3000, "3000 mm"),
    (TIME, ANY, 0, 0, "0 ms"),
    (TIME, ANY, 0x0FFFFE, 0x0FFFFE, "1048574 ms"),
    (TIME, ANY, 0x0FFFFF, None, "unknown"),
    (TIME, ANY, 0xFFFFFE, GotoFault.BLOCKED, "blocked"),
    (TIME, ANY, 0xFFFFFF, GotoFault.NOT_POSSIBLE, "not possible"),
    (BARRIERS, Limits(0, 0xFFFF), 0x0002, Barriers.of({1: Passage.FORCED}), "fire 1:forced"),
    (BARRIERS, Limits(0, 0xFFFF), 0, Barriers(0), "none"),
]

OUT_OF_RANGE: list[tuple[Kind, Limits, int]] = [
    (ANGLE, ANY, 360),
    (ANGLE, ANY, 0x3FF),  # a goto has no unknown angle
    (HEADING, ANY, 0x3FE),
    (MILLIMETRES, X, 3001),
    (TIME, ANY, 0x100000),
    (TIME, ANY, 0xFFFFFD),
]

NOT_WRITTEN: list[tuple[Kind, Limits, Any]] = [
    (ANGLE, ANY, float("-inf")),
    (ANGLE, ANY, None),
    (HEADING, ANY, 0.5),
    (MILLIMETRES, X, None),  # not alone
    (TIME, ANY, 0x0FFFFF),  # the code of unknown, which is None
    (BARRIERS, Limits(0, 0xFFFF), 0x10000),
]

PARSED: list[tuple[Kind, str, Any]] = [
    (ANGLE, "-90", -90),
    (MILLIMETRES, "unknown", None),
    (BARRIERS, "0xA5C3", Barriers(0xA5C3)),
    (BARRIERS, "fire-1=forced", Barriers.of({1: Passage.FORCED})),
    (BARRIERS, "fire-1:forced,pool 2:normal", Barriers.of({1: Passage.FORCED, 8: Passage.NORMAL})),
    (BARRIERS, "fire-3", Barriers.of({3: Passage.NORMAL})),
]

NOT_PARSED: list[tuple[Kind, str]] = [
    (ANGLE, "unknown"),
    (HEADING, "north"),
    (TIME, "soon"),
    (BARRIERS, "0y"),
    (BARRIERS, "fire-1:closed"),
]

ALLOWED = [
    (ANGLE, ANY, "any whole angle in degrees"),
    (HEADING, ANY, "any whole angle in degrees, None for unknown (1023)"),
    (MILLIMETRES, X, "0..3000 mm, or x, y and angle None for unknown (255)"),
    (TIME, ANY, "0..1048574 ms, arrived (0), None for unknown (1048575), blocked (16777214), not possible (16777215)"),
    (
        BARRIERS,
        Limits(0, 65535),
        "0..65535, or fire-1, fire-2, fire-3, fire-4, fire-5, fire-6, pool-1, pool-2 with :free or normal or forced",
    ),
]


@pytest.mark.parametrize(("kind", "limits", "raw", "meaning", "text"), BOTH_WAYS)
def test_reads_what_it_writes(kind: Kind, limits: Limits, raw: int, meaning: Any, text: str) -> None:
    assert kind.read(raw, limits) == meaning
    assert type(kind.read(raw, limits)) is type(meaning)
    assert kind.write(meaning, limits) == raw
    assert kind.text(meaning) == text
    assert kind.parse(text.removesuffix(f" {kind.unit}").replace(" 1", "-1")) == meaning


@pytest.mark.parametrize(("kind", "limits", "raw"), OUT_OF_RANGE)
def test_reads_a_value_outside_its_range_raw_and_flagged(kind: Kind, limits: Limits, raw: int) -> None:
    assert isinstance(kind.read(raw, limits), OutOfRange)


@pytest.mark.parametrize(("angle", "raw"), [(360, 0), (-1, 359), (-450, 270)])
def test_any_angle_is_brought_to_the_circle(angle: int, raw: int) -> None:
    assert ANGLE.write(angle, ANY) == HEADING.write(angle, ANY) == raw


@pytest.mark.parametrize(("kind", "limits", "value"), NOT_WRITTEN)
def test_does_not_write(kind: Kind, limits: Limits, value: Any) -> None:
    with pytest.raises(ValueError, match=re.escape(str(value))):
        kind.write(value, limits)


@pytest.mark.parametrize(("kind", "text", "value"), PARSED)
def test_parses(kind: Kind, text: str, value: Any) -> None:
    assert kind.parse(text) == value


@pytest.mark.parametrize(("kind", "text"), NOT_PARSED)
def test_does_not_parse(kind: Kind, text: str) -> None:
    with pytest.raises(ValueError, match=re.escape(text)):
        kind.parse(text)


@pytest.mark.parametrize("text", ["wall:forced", "fire-9", "fire-1:forced,"])
def test_does_not_parse_an_unknown_barrier(text: str) -> None:
    with pytest.raises(UnknownName):
        BARRIERS.parse(text)


@pytest.mark.parametrize(("kind", "limits", "text"), ALLOWED)
def test_says_what_is_allowed(kind: Kind, limits: Limits, text: str) -> None:
    assert kind.allowed(limits) == text


def test_a_program_that_gives_barriers_by_name_is_told_how_to_give_them() -> None:
    wanted = BARRIERS.wanted(["fire 1"], Limits(0, 0xFFFF))
    assert wanted == "Barriers.of({1: Passage.NORMAL}), or 0..65535"
