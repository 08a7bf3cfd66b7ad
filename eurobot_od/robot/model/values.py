"""The values in messages: colours, obstacles, sources, barriers, faults; and outcomes of a goto.

All are immutable. Their numbers are codes of the protocol table, under the same names.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import Enum, IntEnum
from typing import NamedTuple

from eurobot_od.errors import LocalError

OURS = "ours"
"""Name of our robot among those on the field."""


class TeamColour(Enum):
    """Team colour (document Table 3)."""

    YELLOW = "yellow"
    RED = "red"

    @property
    def other(self) -> TeamColour:
        """The opponents' colour."""
        return TeamColour.YELLOW if self is TeamColour.RED else TeamColour.RED


class Obstacle(Enum):
    """The reason of an Emergency Stop (document Table 1, Extended Stop)."""

    OBJECT = "object"
    ENEMY = "enemy"


class Source(Enum):
    """The source of a position (document Table 2; the codes of the 2014 robot, others are reserved)."""

    INTERNAL = "internal"
    CONFEDERATE = "confederate"
    ENEMY_1 = "enemy 1"
    ENEMY_2 = "enemy 2"


class Direction(Enum):
    """How to drive to the place of a goto: forward or backward (2014 robot; forward where it is not mapped)."""

    FORWARD = "forward"
    BACKWARD = "backward"


class Route(Enum):
    """Whether the drive plans a route around barriers (2014 robot; planned where it is not mapped, as in 2.1)."""

    DIRECT = "direct"
    PLANNED = "planned"


class GotoFault(Enum):
    """Why a goto has no remaining time (2014 robot)."""

    BLOCKED = "blocked"
    NOT_POSSIBLE = "not possible"


class Outcome(Enum):
    """How a goto ended; LOST: the drive no longer carries it out, or has arrived somewhere else."""

    ARRIVED = "arrived"
    NOT_POSSIBLE = "not possible"
    BLOCKED = "blocked"
    STOPPED = "stopped"
    REPLACED = "replaced"
    LOST = "lost"
    TIMED_OUT = "timed out"


FAULT_OUTCOME = {GotoFault.NOT_POSSIBLE: Outcome.NOT_POSSIBLE, GotoFault.BLOCKED: Outcome.BLOCKED}
"""The outcome of a goto with a fault instead of its remaining time."""


class Caption(NamedTuple):
    """A text of a robot's strategy, with its time in s."""

    time: float
    robot: str
    words: str


class Score(NamedTuple):
    """Points from a task: the time in s, the robot, the task, the points."""

    time: float
    robot: str
    task: str
    points: int


class RobotError(IntEnum):
    """Emergency error codes of the robot's own nodes (CiA 301, Table 26: 0xFF00 and up are the device's)."""

    EMERGENCY_SHUTDOWN = 0xFF01
    DRIVE_BLOCKED = 0xFF02
    CONFIGURATION_REFUSED = 0xFF03
    WRONG_SOURCE = 0xFF04
    NOT_STANDING = 0xFF05
    PLACE_UNSURE = 0xFF06


class Passage(IntEnum):
    """How to treat a barrier (document Table 1); in a frame, 3 means forced as well."""

    FREE = 0
    NORMAL = 1
    FORCED = 2


PASSAGE_OF_FLAGS = (Passage.FREE, Passage.NORMAL, Passage.FORCED, Passage.FORCED)
"""Meaning of a barrier's two flags; `10` and `11` are both forced (document Table 1)."""


FLAGGED = 8
"""Number of barriers with flags in a goto."""


class Barriers(int):
    """The barrier flags of a goto: two bits each for barriers 1 to 8 (document Table 1, Figure 2).

    They are an integer of 16 bits, so that a received `11` does not change; `passage` returns the meaning. Numbers and
    names of barriers are facts of the field (see `robot_file.Facts`).
    """

    @classmethod
    def of(cls, passages: Mapping[int, Passage]) -> Barriers:
        """Return the flags for barrier numbers 1 to 8 and their passages; raises LocalError for another number."""
        if not isinstance(passages, Mapping):
            raise LocalError(f"{passages!r} is not a mapping; write Barriers.of({{1: Passage.NORMAL}})")
        if wrong := [number for number in passages if number not in range(1, FLAGGED + 1)]:
            raise LocalError(f"barrier {wrong[0]!r} is unknown; known: 1 to {FLAGGED}")
        return cls(sum(passage << 2 * (number - 1) for number, passage in passages.items()))

    def passage(self, number: int) -> Passage:
        """Return how to treat barrier `number` (1 to 8)."""
        return PASSAGE_OF_FLAGS[self >> 2 * (number - 1) & 3]

    def set_barriers(self) -> Iterator[tuple[int, Passage]]:
        """Yield number and passage of every barrier that is not free."""
        for number in range(1, FLAGGED + 1):
            if passage := self.passage(number):
                yield number, passage

    def __str__(self) -> str:
        return ", ".join(f"{number}:{passage.name.lower()}" for number, passage in self.set_barriers()) or "none"

    def __repr__(self) -> str:
        return f"Barriers(0x{int(self):04X})"
