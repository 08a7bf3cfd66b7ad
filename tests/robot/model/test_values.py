"""The values of messages: numbers of the document's tables, barrier flags, names of barriers."""

from __future__ import annotations

from enum import Enum
from typing import Any

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.pdo.kinds import OutOfRange
from eurobot_od.robot.model.values import (
    Barriers,
    Direction,
    GotoFault,
    Obstacle,
    Passage,
    Route,
    Source,
    TeamColour,
)
from eurobot_od.robot.protocol import EurobotProtocol

NUMBERS: list[tuple[str, str, dict[Enum, int]]] = [
    ("Start Configuration Set", "team_colour", {TeamColour.YELLOW: 0, TeamColour.RED: 1}),  # Table 3
    ("Emergency Stop", "obstacle", {Obstacle.OBJECT: 0, Obstacle.ENEMY: 1}),  # Table 1, Extended Stop
    # Table 2 and the 2014 robot
    ("Navi Position Response", "source", {Source.INTERNAL: 0, Source.CONFEDERATE: 1, Source.ENEMY_1: 2}),
    ("Navi Position Response", "source", {Source.ENEMY_2: 3}),
    ("Goto XY", "direction", {Direction.FORWARD: 0, Direction.BACKWARD: 1}),  # 2014 robot
    ("Goto XY", "route", {Route.DIRECT: 0, Route.PLANNED: 1}),
    ("Goto State Response", "time", {GotoFault.BLOCKED: 0xFFFFFE, GotoFault.NOT_POSSIBLE: 0xFFFFFF}),
]


@pytest.mark.parametrize(("message", "field", "numbers"), NUMBERS)
def test_enums_have_the_numbers_of_the_wire(message: str, field: str, numbers: dict[Enum, int]) -> None:
    binding = EurobotProtocol.load("firmware2014").binding(message)
    assert {each: binding.raw(field, each) for each in numbers} == numbers


def test_passages_have_the_numbers_of_barrier_flags() -> None:
    assert [*Passage] == [0, 1, 2]  # Table 1


def test_out_of_range_keeps_the_raw_value_and_shows_its_flag() -> None:
    assert OutOfRange(4000) == 4000
    assert repr(OutOfRange(4000)) == "OutOfRange(4000)"


# Two bits a barrier, barrier n in bits 2n-2 and 2n-1 (document Table 1): 00 free, 01 normal, 10 and 11 forced.
FLAGS = [
    (0x0000, {}),
    (0x0001, {1: Passage.NORMAL}),
    (0x0002, {1: Passage.FORCED}),
    (0x0003, {1: Passage.FORCED}),
    (0x0004, {2: Passage.NORMAL}),
    (0x1000, {7: Passage.NORMAL}),
    (0x8000, {8: Passage.FORCED}),
    (0xC001, {1: Passage.NORMAL, 8: Passage.FORCED}),
    (0xFFFF, dict.fromkeys(range(1, 9), Passage.FORCED)),
]


@pytest.mark.parametrize(("flags", "passages"), FLAGS)
def test_barrier_flags_are_read(flags: int, passages: dict[int, Passage]) -> None:
    barriers = Barriers(flags)
    assert dict(barriers.set_barriers()) == passages
    assert {n: barriers.passage(n) for n in range(1, 9)} == {n: passages.get(n, Passage.FREE) for n in range(1, 9)}


@pytest.mark.parametrize("passages", [passages for _, passages in FLAGS])
def test_barrier_flags_are_built(passages: dict[int, Passage]) -> None:
    assert dict(Barriers.of(passages).set_barriers()) == passages


@pytest.mark.parametrize("number", [0, 9, "fire-1"])
def test_a_barrier_that_is_not_on_the_field_is_refused(number: Any) -> None:
    with pytest.raises(LocalError, match=f"^barrier {number!r} is unknown; known: 1 to 8$"):
        Barriers.of({number: Passage.NORMAL})


def test_barriers_are_given_by_number_and_passage() -> None:
    with pytest.raises(LocalError, match=r"^\[1, 7\] is not a mapping; write Barriers\.of\(\{1: Passage\.NORMAL\}\)$"):
        Barriers.of([1, 7])  # type: ignore[arg-type]


def test_barriers_are_written_by_their_numbers() -> None:
    barriers = Barriers.of({2: Passage.FORCED, 7: Passage.NORMAL, 1: Passage.FREE})
    assert str(barriers) == "2:forced, 7:normal"
    assert repr(barriers) == "Barriers(0x1008)"
    assert str(Barriers(0)) == "none"
