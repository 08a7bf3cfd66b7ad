"""Homing methods as tables of what is sought, one after the other, and in which direction (CiA 402-2, clause 11).

Rule of this file: a method is data. The axis moves in the direction of each step until what it says is there.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum, IntEnum
from typing import NamedTuple

POSITIVE, NEGATIVE = 1, -1


class Switch(IntEnum):
    """The switches, by their bits in 0x60FD."""

    NEGATIVE_LIMIT = 1 << 0
    POSITIVE_LIMIT = 1 << 1
    HOME = 1 << 2


LIMITS: Mapping[int, Switch] = {NEGATIVE: Switch.NEGATIVE_LIMIT, POSITIVE: Switch.POSITIVE_LIMIT}
"""The limit switch at the end of each direction."""


class Speed(Enum):
    """Which of the two homing speeds: the sub-index of 0x6099."""

    SWITCH = 1
    ZERO = 2


class Seek(NamedTuple):
    """Move in a `direction` until a switch is `active` or not; without a switch, until the index pulse.

    `turns` tells that the axis turns round at a limit switch, as the home switch may be behind it.
    """

    direction: int
    switch: Switch | None
    active: bool = True
    speed: Speed = Speed.ZERO
    turns: bool = False


class Method(NamedTuple):
    """A homing method in words, and its steps; none of them: the axis is at home where it is."""

    words: str
    steps: tuple[Seek, ...] = ()


class HomeEdge(NamedTuple):
    """Which edge of the home switch is home.

    The axis looks for the switch in the direction `initial`, leaves it to the side `edge`, and is at home there, or
    `inside`, when it has come back.
    """

    initial: int
    edge: int
    inside: bool

    @property
    def steps(self) -> tuple[Seek, ...]:
        """What is sought."""
        found = Seek(self.initial, Switch.HOME, True, Speed.SWITCH, turns=True)
        # A fast axis has gone through the switch before it stands; any other one is still inside.
        back = Seek(-self.initial, Switch.HOME, True, turns=True)
        left = Seek(self.edge, Switch.HOME, False)
        return (found, back, left, Seek(-self.edge, Switch.HOME)) if self.inside else (found, back, left)

    @property
    def words(self) -> str:
        """For a person."""
        side = "positive" if self.edge == POSITIVE else "negative"
        return f"{side} edge of the home switch, {'inside' if self.inside else 'outside'}"


EDGES: Mapping[int, HomeEdge] = {
    # 19 to 22 know on which side of the switch they start; 23 to 26 begin in positive and 27 to 30 in negative
    # direction, and turn round at a limit switch.
    19: HomeEdge(POSITIVE, NEGATIVE, False),
    20: HomeEdge(POSITIVE, NEGATIVE, True),
    21: HomeEdge(NEGATIVE, POSITIVE, False),
    22: HomeEdge(NEGATIVE, POSITIVE, True),
    23: HomeEdge(POSITIVE, NEGATIVE, False),
    24: HomeEdge(POSITIVE, NEGATIVE, True),
    25: HomeEdge(POSITIVE, POSITIVE, True),
    26: HomeEdge(POSITIVE, POSITIVE, False),
    27: HomeEdge(NEGATIVE, POSITIVE, False),
    28: HomeEdge(NEGATIVE, POSITIVE, True),
    29: HomeEdge(NEGATIVE, NEGATIVE, True),
    30: HomeEdge(NEGATIVE, NEGATIVE, False),
}
"""The methods that look for the home switch."""


def _limit(direction: int) -> Method:
    switch = LIMITS[direction]
    side = "positive" if direction == POSITIVE else "negative"
    steps = Seek(direction, switch, True, Speed.SWITCH), Seek(-direction, switch, False)
    return Method(f"{side} limit switch", steps)


_WITHOUT_INDEX: Mapping[int, Method] = {
    17: _limit(NEGATIVE),
    18: _limit(POSITIVE),
    **{number: Method(edge.words, edge.steps) for number, edge in EDGES.items()},
}


INDEX_OFFSET = 16
"""Methods 1 to 14 are 17 to 30 with the index pulse after them."""

METHODS: Mapping[int, Method] = {
    # The axis goes on to the next index pulse in the direction in which it came to the switch's edge.
    **{
        number - INDEX_OFFSET: Method(f"{words}, and index pulse", (*steps, Seek(steps[-1].direction, None)))
        for number, (words, steps) in _WITHOUT_INDEX.items()
    },
    **_WITHOUT_INDEX,
    # 15, 16, 31 and 32 are reserved.
    33: Method("next index pulse in negative direction", (Seek(NEGATIVE, None),)),
    34: Method("next index pulse in positive direction", (Seek(POSITIVE, None),)),
    35: Method("present position, obsolete number"),
    37: Method("present position"),
}
"""Every method that CiA 402 defines, by its number in 0x6098."""

METHOD_WORDS: Mapping[int, str] = {0: "no homing", **{number: method.words for number, method in METHODS.items()}}
