"""The values of messages: numbers of the document's tables, barrier flags, names of barriers."""

from __future__ import annotations

from enum import IntEnum

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
from tests.rows import rows

NUMBERS: list[tuple[type[IntEnum], dict[str, int]]] = [
    (TeamColour, {"YELLOW": 0, "RED": 1}),  # Table 3
    (Obstacle, {"OBJECT": 0, "ENEMY": 1}),  # Table 1, Extended Stop
    (Source, {"INTERNAL": 0, "CONFEDERATE": 1, "ENEMY_1": 2, "ENEMY_2": 3}),  # Table 2 and the 2014 robot
    (Direction, {"FORWARD": 0, "BACKWARD": 1}),  # 2014 robot
    (Route, {"DIRECT": 0, "PLANNED": 1}),
    (GotoFault, {"BLOCKED": 0xFFFFFE, "NOT_POSSIBLE": 0xFFFFFF}),
    (Passage, {"FREE": 0, "NORMAL": 1, "FORCED": 2}),  # Table 1, barrier flags
]


@rows("enum, numbers", NUMBERS)
def test_enums_have_the_numbers_of_the_wire(enum: type[IntEnum], numbers: dict[str, int]) -> None:
    assert {member.name: member.value for member in enum} == numbers


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


@rows("flags, passages", FLAGS)
def test_barrier_flags_are_read(flags: int, passages: dict[int, Passage]) -> None:
    barriers = Barriers(flags)
    assert dict(barriers.set_barriers()) == passages
    assert {n: barriers.passage(n) for n in range(1, 9)} == {n: passages.get(n, Passage.FREE) for n in range(1, 9)}


@rows("passages", [passages for _, passages in FLAGS])
def test_barrier_flags_are_built(passages: dict[int, Passage]) -> None:
    assert dict(Barriers.of(passages).set_barriers()) == passages


def test_barriers_are_written_by_their_numbers() -> None:
    barriers = Barriers.of({2: Passage.FORCED, 7: Passage.NORMAL, 1: Passage.FREE})
    assert str(barriers) == "2:forced, 7:normal"
    assert repr(barriers) == "Barriers(0x1008)"
    assert str(Barriers(0)) == "none"
