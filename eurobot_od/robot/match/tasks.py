"""What the robot has to do in a match: places to drive to, and which barriers to mind on the way."""

from __future__ import annotations

from typing import NamedTuple

from eurobot_od.robot.field import WIDTH, normalise
from eurobot_od.robot.values import BARRIER_NAMES, Barriers, Passage, TeamColour, barrier_number


class Task(NamedTuple):
    """A place to drive to, as the red team sees it: mm, degrees, percent, and how to treat the barriers."""

    name: str
    x: int
    y: int
    angle: int
    speed: int
    barriers: dict[str, Passage]

    def seen_by(self, team: TeamColour) -> Task:
        """Return the task for a team; yellow plays the mirror image."""
        if team is TeamColour.RED:
            return self
        barriers = {MIRRORED[name]: passage for name, passage in self.barriers.items()}
        return self._replace(x=int(WIDTH) - self.x, angle=int(normalise(180 - self.angle)), barriers=barriers)

    def flags(self) -> Barriers:
        """Return the barriers as Goto XY has them."""
        return Barriers.of({barrier_number(name): passage for name, passage in self.barriers.items()})

    def __str__(self) -> str:
        return f"{self.name} ({self.x}, {self.y}) {self.angle} deg, {self.speed} %"


MIRRORED = dict(zip(BARRIER_NAMES, ("fire 2", "fire 1", "fire 4", "fire 3", "fire 6", "fire 5", "pool 2", "pool 1")))
"""The barrier on the other half of the field."""

POOLS = {"pool 1": Passage.FORCED, "pool 2": Passage.FORCED}
FIRES = {name: Passage.NORMAL for name in BARRIER_NAMES if name.startswith("fire")}

TASKS = (
    Task("tree", 1300, 1750, 90, 80, {}),
    Task("fire 1", 700, 1150, 225, 60, POOLS),
    Task("fresco", 1500, 1300, 90, 90, POOLS | FIRES),
    Task("fire 5", 1250, 400, 180, 70, POOLS | FIRES),
    Task("basket", 420, 1650, 180, 100, POOLS | FIRES),
    Task("centre", 1500, 900, 0, 80, POOLS),
)
"""What is to be done, again and again."""
