"""What a robot touched in a match, and by whose fault."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from enum import Enum
from typing import NamedTuple

from eurobot_od.robot.world.contact import Touch


class Touched(Enum):
    """What kind of thing was touched."""

    POOL = "pool"
    FIRE = "fire"
    BORDER = "border"
    ROBOT = "robot"
    OTHER = "other thing"


KINDS = {each.value: each for each in Touched} | dict.fromkeys(("ours", "enemy", "confederate"), Touched.ROBOT)
"""The kinds of things by the first words of their names."""


def kind_of(thing: str) -> Touched:
    """Return the kind of a thing by its name: `fire 2`, `border`, `enemy 1`."""
    return KINDS.get(thing.partition(" ")[0], Touched.OTHER)


class RobotTouch(NamedTuple):
    """A touch as one of the two sees it: when, in s, what it touched, who drove into whom.

    `at_fault` tells whether the robot drove into the other body, `driven_into` whether that one drove into the robot;
    both may have, or neither, if one was pushed. `forced` tells whether the robot's goto had flagged it as forced.
    """

    time: float
    thing: str
    at_fault: bool
    driven_into: bool
    forced: bool = False

    @property
    def kind(self) -> Touched:
        """What kind of thing it is."""
        return kind_of(self.thing)

    @property
    def is_wrong(self) -> bool:
        """Tell whether the robot should have kept off: it had been told to, or the thing cannot have got in its way."""
        return self.forced or (self.at_fault and not self.driven_into and self.kind in AVOIDABLE)


AVOIDABLE = (Touched.POOL, Touched.BORDER, Touched.ROBOT)
"""What a robot can keep off; a fire is light, and often has to be passed closely."""


def touches_of(robot: str, touches: Iterable[Touch]) -> list[RobotTouch]:
    """Return the touches of a robot, in their order."""
    own = ((each, each.thing if each.robot == robot else each.robot) for each in touches if robot in each[1:3])
    return [RobotTouch(each.time, other, each.is_fault_of(robot), each.is_fault_of(other)) for each, other in own]


def counts(touches: Iterable[RobotTouch]) -> dict[str, int]:
    """Count touches by kind; a kind that was not touched is left out."""
    found = Counter(touch.kind for touch in touches)
    return {kind.value: found[kind] for kind in Touched if found[kind]}
