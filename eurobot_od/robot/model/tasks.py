"""What there is to do in a match, and what it brings."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from eurobot_od.robot.model.places import Pose


class Worth(Enum):
    """What a task brings."""

    POINTS = "points"
    FRUIT = "fruit"
    """Pieces of fruit, to be carried to the basket."""
    HARVEST = "harvest"
    """A point for each piece of fruit that the robot has with it."""


class Task(NamedTuple):
    """Something to do at a place: mm, and the degrees that the robot looks to.

    It takes `seconds`. Each of `tries` succeeds with the probability `chance`, and then brings `points`. A task that is
    `shared` can be done once by whoever comes first, others once by each robot.
    """

    name: str
    x: int
    y: int
    angle: int
    seconds: float
    tries: int
    points: int
    chance: float
    worth: Worth = Worth.POINTS
    shared: bool = False

    @property
    def pose(self) -> Pose:
        """Where to do it."""
        return Pose(self.x, self.y, self.angle)

    @property
    def expected(self) -> float:
        """How much it brings on average: points, or fruit."""
        return self.tries * self.chance * self.points
