"""The game of Eurobot 2014, "Prehistobot": what can be done where, for how many points.

Places and points follow the public rules of 2014 and the document's Figure 2, simplified:

- a fire is turned over where it stands, by whoever comes first; none is carried to a hearth, and the pools, which are
  the mobile torches, are only in the way;
- a mammoth is shot at from one place, six spears one after the other; catching it with the net, after the match, is
  left out;
- trees stand outside of the border, in nobody's way; of a tree's fruit three are good and can be reached, and are worth
  something in the team's basket only;
- mammoth, frescos and basket are at the back of our half, where no other team's are.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

from eurobot_od.robot.field import WIDTH, Point, Pose, normalise
from eurobot_od.robot.values import TeamColour

TREES = (Point(0, 700), Point(700, 0), Point(2300, 0), Point(3000, 700))
TREE_RADIUS = 75.0
"""Where the trees' trunks stand at the border, and how thick they are, mm."""


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

    def seen_by(self, team: TeamColour) -> Task:
        """Return the task for a team; yellow plays the mirror image."""
        if team is TeamColour.RED:
            return self
        name = MIRRORED.get(self.name, self.name)
        return self._replace(name=name, x=int(WIDTH) - self.x, angle=int(normalise(180 - self.angle)))


def _fire(name: str, x: int, y: int, angle: int) -> Task:
    return Task(name, x, y, angle, seconds=1.0, tries=1, points=1, chance=0.9, shared=True)


def _tree(name: str, x: int, y: int, angle: int) -> Task:
    return Task(name, x, y, angle, 3.0, tries=3, points=1, chance=0.8, worth=Worth.FRUIT, shared=True)


RED_TASKS = (
    _fire("fire 1", 900, 1670, 270),
    _fire("fire 3", 400, 1170, 270),
    _fire("fire 5", 630, 400, 0),
    _fire("fire 2", 2100, 1670, 270),
    _fire("fire 4", 2600, 1170, 270),
    _fire("fire 6", 2370, 400, 180),
    _fire("torch 1", 200, 1200, 180),
    _fire("torch 2", 1300, 200, 270),
    _fire("torch 3", 1700, 200, 270),
    _fire("torch 4", 2800, 1200, 0),
    _tree("tree 1", 240, 640, 166),
    _tree("tree 2", 650, 230, 282),
    _tree("tree 3", 2350, 230, 258),
    _tree("tree 4", 2760, 640, 14),
    Task("mammoth", 600, 1700, 90, seconds=4.0, tries=6, points=2, chance=0.6),
    Task("frescos", 1400, 1800, 90, seconds=2.0, tries=2, points=3, chance=0.9),
    Task("basket", 1150, 1800, 90, seconds=1.5, tries=1, points=1, chance=1.0, worth=Worth.HARVEST),
)
"""What a red robot can do."""

MIRRORED = {
    **{f"fire {one}": f"fire {other}" for one, other in zip((1, 2, 3, 4, 5, 6), (2, 1, 4, 3, 6, 5))},
    **{f"{what} {one}": f"{what} {5 - one}" for what in ("torch", "tree") for one in (1, 2, 3, 4)},
}
"""What is on the other half of the field."""


def tasks(team: TeamColour) -> dict[str, Task]:
    """Return what a team's robot can do, by name."""
    return {task.name: task for task in (each.seen_by(team) for each in RED_TASKS)}
