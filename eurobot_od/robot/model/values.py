"""The values in messages: colours, obstacles, sources, barriers, faults; and how a goto ends.

All are immutable, with the names that people use. Their numbers are codes of the protocol table, by the same names.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import Enum, IntEnum
from typing import NamedTuple

OURS = "ours"
"""Our robot, among those on a field."""


class TeamColour(Enum):
    """Team colour (document Table 3)."""

    YELLOW = "yellow"
    RED = "red"

    @property
    def other(self) -> TeamColour:
        """The opponents' colour."""
        return TeamColour.YELLOW if self is TeamColour.RED else TeamColour.RED


class Obstacle(Enum):
    """What an Emergency Stop was sent for (document Table 1, Extended Stop)."""

    OBJECT = "object"
    ENEMY = "enemy"


class Source(Enum):
    """Where a position comes from (document Table 2; the 2014 robot has these, the others are reserved)."""

    INTERNAL = "internal"
    CONFEDERATE = "confederate"
    ENEMY_1 = "enemy 1"
    ENEMY_2 = "enemy 2"


class Direction(Enum):
    """How to drive to the place of a goto: nose or tail first (2014 robot; forward where it is not mapped)."""

    FORWARD = "forward"
    BACKWARD = "backward"


class Route(Enum):
    """Whether the drive plans a route round barriers (2014 robot; planned where it is not mapped, as in 2.1)."""

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
"""How a goto ended that has a fault in place of its remaining time."""


class Caption(NamedTuple):
    """What a robot's strategy said, and when, in s."""

    time: float
    robot: str
    words: str


class Score(NamedTuple):
    """Points made with a task: when, in s, by whom, which task, how many."""

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
    """How a barrier is to be treated (document Table 1); on the wire 3 means forced as well."""

    FREE = 0
    NORMAL = 1
    FORCED = 2


PASSAGE_OF_FLAGS = (Passage.FREE, Passage.NORMAL, Passage.FORCED, Passage.FORCED)
"""What a barrier's two flags mean; `10` and `11` are both forced (document Table 1)."""


FLAGGED = 8
"""The number of barriers that have flags in a goto."""


class Barriers(int):
    """The barrier flags of a goto: two bits each for barriers 1 to 8 (document Table 1, Figure 2).

    It is an integer of 16 bits, so that a received `11` stays what it was; `passage` gives the meaning. Which barrier
    has which number, and what it is called, is a fact of the field (see `robot_file.Facts`).
    """

    @classmethod
    def of(cls, passages: Mapping[int, Passage]) -> Barriers:
        """Build the flags from barrier numbers 1..8 and their passages."""
        return cls(sum(passage << 2 * (number - 1) for number, passage in passages.items()))

    def passage(self, number: int) -> Passage:
        """Return how barrier `number` (1..8) is to be treated."""
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
