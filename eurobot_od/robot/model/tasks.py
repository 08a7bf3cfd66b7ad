"""What there is to do in a match, and what it brings."""

from __future__ import annotations

from enum import Enum
from typing import Annotated, NamedTuple

from eurobot_od.robot.model.places import Pose
from eurobot_od.support.declared import Listed, Within

SIDE, ANGLE = Within(0, 100_000, "mm"), Within(0, 359, "degrees")
"""Places on a side of the largest field, and headings."""


class Worth(Enum):
    """What a task brings."""

    POINTS = "points"
    FRUIT = "fruit"
    """Pieces of fruit, to be carried to the basket."""
    HARVEST = "harvest"
    """A point for each piece of fruit that the robot has with it."""


class Stand(NamedTuple):
    """Where a robot stands and looks for a task: mm and degrees, whole numbers as in a goto."""

    x: int
    y: int
    angle: int


class Task(NamedTuple):
    """Something to do at a place.

    It takes `seconds`. Each of `tries` succeeds with the probability `chance`, and then brings `points`. A task that is
    `shared` can be done once by whoever comes first, others once by each robot.
    """

    name: str
    at: Annotated[Stand, Listed(SIDE, SIDE, ANGLE)]
    seconds: Annotated[float, Within(0, 1000, "s")]
    tries: Annotated[int, Within(1, 1000)]
    points: Annotated[int, Within(0, 10_000)]
    chance: Annotated[float, Within(0, 1)]
    worth: Worth = Worth.POINTS
    shared: bool = False

    @property
    def pose(self) -> Pose:
        """Where to do it."""
        return Pose(*self.at)

    @property
    def expected(self) -> float:
        """How much it brings on average: points, or fruit."""
        return self.tries * self.chance * self.points
