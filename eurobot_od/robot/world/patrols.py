"""The other robots on the field: two enemies and a confederate, each on its rounds."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from eurobot_od.robot.field import WIDTH, Point, Pose
from eurobot_od.robot.values import Source, TeamColour

ROUNDS: dict[Source, Sequence[Point]] = {
    Source.ENEMY_1: (Point(2800, 1700), Point(1900, 1650), Point(1500, 1100), Point(2400, 1200)),
    Source.ENEMY_2: (Point(2750, 300), Point(1700, 250), Point(1600, 700), Point(2500, 650)),
    Source.CONFEDERATE: (Point(250, 300), Point(650, 250), Point(250, 600)),
}
"""Where the others drive when our team is red; yellow is the mirror image."""

STRAY = 80
"""How far a patrol's way points differ from one seed to another, mm."""


class Patrol(NamedTuple):
    """Another robot on its rounds: way points, and its speed in mm/s."""

    points: tuple[Point, ...]
    speed: float

    def at(self, now: float) -> Pose:
        """Return where it is at a time, heading where it drives; it goes round and round."""
        legs = list(pairwise((*self.points, self.points[0])))
        left = now * self.speed % sum(math.dist(*leg) for leg in legs)
        while left > math.dist(*legs[0]):
            left -= math.dist(*legs.pop(0))
        start, end = legs[0]
        return Pose(*start, Pose(*start, 0).bearing(end)).moved(left, 0)

    @classmethod
    def of(cls, who: Source, team: TeamColour, chance: random.Random) -> Patrol:
        """Make the rounds of a robot in a match of ours as `team`; chance moves the way points a little."""
        points = [Point(x + chance.uniform(-STRAY, STRAY), y + chance.uniform(-STRAY, STRAY)) for x, y in ROUNDS[who]]
        mirrored = points if team is TeamColour.RED else [Point(WIDTH - x, y) for x, y in points]
        return cls(tuple(mirrored), chance.uniform(150, 350))
