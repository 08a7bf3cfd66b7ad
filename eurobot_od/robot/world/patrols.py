"""The other robots when nobody plays them: two enemies and a confederate, each on its rounds.

A patrol goes along its way points and back again. It stops for a robot ahead, waits for it to go, and then turns round,
as it does for anything that holds it up. A careless one does not look out, and stops only when it has driven into
somebody.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

from eurobot_od.robot.model.facts import Facts
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.values import Source, TeamColour

STRAY = 60
"""How far a patrol's way points may move with the seed, mm."""

SPEEDS = (150.0, 350.0)
"""Speeds of the slowest and the fastest patrol, mm/s."""

CARELESS = 0.25
"""Share of the enemies that do not look out."""

LOOK_OUT, BUMPED = 120.0, 1.0
"""How near a careful robot and a careless one let another robot come that is in their way, mm from edge to edge."""

WAIT = 1.5
"""Seconds that a patrol waits for something in its way."""


class Patrol:
    """A robot on its rounds; `pose` is where it wants to be, and where it looks."""

    def __init__(self, points: Sequence[Point], speed: float, careless: bool = False) -> None:
        self._points, self.speed, self.careless = tuple(points), speed, careless
        self._leg, self._step = 1, 1
        self._waited = 0.0
        self.pose = Pose(*self._points[0], Pose(*self._points[0], 0).bearing(self._points[1]))

    @property
    def look_out(self) -> float:
        """How near it lets a robot come that is in its way, mm from edge to edge."""
        return BUMPED if self.careless else LOOK_OUT

    def held_up(self, here: Point, dt: float) -> Pose:
        """Wait `here` for what is in the way, and turn round if that takes too long; return the pose it wants."""
        self._waited += dt
        if self._waited >= WAIT:
            # It turns round rather than wait on: two that wait for each other would stand there until the end.
            self._waited, self._step = 0.0, -self._step
            self._aim_at_next()
            self.pose = Pose(*here, Pose(*here, 0).bearing(self._points[self._leg]))
        return self.pose

    def advance(self, here: Point, dt: float) -> Pose:
        """Return where it wants to be `dt` seconds after it was `here`; call `gone_on` if it got there."""
        target, way = self._points[self._leg], self.speed * dt
        if math.dist(here, target) <= way:
            self._aim_at_next()
            target = self._points[self._leg]
        self.pose = Pose(*here, Pose(*here, 0).bearing(target)).moved(way, 0)
        return self.pose

    def gone_on(self) -> None:
        """Note that nothing is in the way any more."""
        self._waited = 0.0

    def _aim_at_next(self) -> None:
        self._leg = (self._leg + self._step) % len(self._points)

    @classmethod
    def of(cls, who: Source, facts: Facts, team: TeamColour, chance: random.Random) -> Patrol:
        """Make the rounds of a robot in our match as `team`; chance moves the way points a little."""
        rounds = facts.others[who].rounds
        points = [Point(x + chance.uniform(-STRAY, STRAY), y + chance.uniform(-STRAY, STRAY)) for x, y in rounds]
        seen = [facts.field.seen_by(team, point) for point in points]
        # Drawn even for the confederate, who is never careless, so that the order of the random numbers stays the same.
        speed, careless = chance.uniform(*SPEEDS), chance.random() < CARELESS
        return cls(seen, speed, careless and who is not Source.CONFEDERATE)
