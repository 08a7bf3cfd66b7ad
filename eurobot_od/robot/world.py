"""The world around the robot: where it truly is, what its wheels and beacons say, and who else is on the field.

Rule of this file: the truth stays here. The nodes see it through wheels that slip, beacons that are off by some
millimetres, and a distance sensor; all chance comes from one seed, a stream for each thing, so that how often one is
asked does not change what another says.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

from eurobot_od.robot.field import HEIGHT, START_POSES, WIDTH, Point, Pose, turn
from eurobot_od.robot.nodes.motion import Command, Odometry
from eurobot_od.robot.nodes.navigation import Fix
from eurobot_od.robot.values import Obstacle, Source, TeamColour

SLIP = 0.01
"""Share by which the wheels' distance scale is off, standard deviation."""

DRIFT = 0.004
"""Share by which the wheels' turning is off, standard deviation."""

PLACEMENT = 3.0
"""How far from its start place a team puts the robot, mm standard deviation."""

SIGHT = 400.0
"""How far ahead, mm, the distance sensor sees something that is in the way."""

SIGHT_ANGLE = 25.0
"""How far to either side, degrees."""

DROP_AHEAD = 380.0
"""How far ahead of a driving robot a thing falls over, mm."""

DROP_SPEED = 200.0
"""The robot is fast enough for a thing to fall over in front of it from this speed on, mm/s."""

REMOVED_AFTER = 1.0
"""Seconds after which a thing in the way is pushed aside."""


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


class World:
    """A match's world: `robot` is the true pose of our robot, `others` are enemies and confederate.

    It is the drive's chassis (`advance`) and the navigation's beacons (`locate`). `deviations` gives the standard
    deviations of the beacons, mm and degrees.
    """

    def __init__(
        self,
        seed: int,
        team: TeamColour,
        enemies: int,
        confederates: int,
        deviations: Callable[[], tuple[float, float]],
        clock: Callable[[], float],
    ) -> None:
        self._seed = seed
        self._deviations, self._clock = deviations, clock
        place = self._stream("placement")
        start = START_POSES[team]
        self.robot = Pose(
            start.x + place.gauss(0, PLACEMENT), start.y + place.gauss(0, PLACEMENT), start.angle + place.gauss(0, 0.5)
        )
        wheels = self._stream("wheels")
        self._scale, self._bias = wheels.gauss(1, SLIP), wheels.gauss(1, DRIFT)
        self._noise = {source: self._stream(source.name) for source in Source}
        self.others = self._place_others(team, enemies, confederates)
        self.speed = 0.0
        self.path: list[tuple[float, Pose]] = [(0.0, self.robot)]
        self._drops = True
        self._dropped_at: float | None = None
        self.thing: Point | None = None

    def _stream(self, name: str) -> random.Random:
        return random.Random(f"{self._seed} {name}")

    def _place_others(self, team: TeamColour, enemies: int, confederates: int) -> dict[Source, Patrol]:
        sources = [Source.ENEMY_1, Source.ENEMY_2][:enemies] + [Source.CONFEDERATE] * confederates
        return {source: _patrol(self._stream(f"patrol {source.name}"), team, source) for source in sources}

    # The drive's wheels

    def advance(self, command: Command, dt: float) -> Odometry:
        """Move the robot as its wheels really do, and report what they measured."""
        true = Odometry(command.speed * dt * self._scale, command.turn * dt * self._bias)
        self.robot = _inside(self.robot.moved(*true))
        self.speed = command.speed
        self.path.append((self._clock(), self.robot))
        return Odometry(command.speed * dt, command.turn * dt)

    # The navigation's beacons

    def locate(self, whom: Source, now: float) -> Fix | None:
        """Measure a robot's place; only our own heading can be measured."""
        pose = self.robot if whom is Source.INTERNAL else self._other(whom, now)
        if pose is None:
            return None
        noise, (place, angle) = self._noise[whom], self._deviations()
        x, y = pose.x + noise.gauss(0, place), pose.y + noise.gauss(0, place)
        return Fix(x, y, pose.angle + noise.gauss(0, angle) if whom is Source.INTERNAL else None)

    def _other(self, whom: Source, now: float) -> Pose | None:
        patrol = self.others.get(whom)
        return patrol.at(now) if patrol else None

    # The core's distance sensor

    def obstacle(self, now: float) -> Obstacle | None:
        """Return what the distance sensor sees in the way of the driving robot."""
        self._clear_thing(now)
        if self.speed <= 0:
            return None
        if any(self._in_sight(patrol.at(now).point) for patrol in self.others.values()):
            return Obstacle.ENEMY
        return Obstacle.OBJECT if self.thing is not None and self._in_sight(self.thing) else None

    def _in_sight(self, point: Point) -> bool:
        ahead = abs(turn(self.robot.angle, self.robot.bearing(point)))
        return self.robot.distance(point) < SIGHT and ahead < SIGHT_ANGLE

    def drop_thing(self, now: float) -> None:
        """Let a thing fall over in front of the robot, once, as soon as it drives fast enough."""
        if self._drops and self.speed >= DROP_SPEED:
            self._drops, self._dropped_at = False, now
            self.thing = self.robot.moved(DROP_AHEAD, 0).point

    def _clear_thing(self, now: float) -> None:
        if self._dropped_at is not None and now - self._dropped_at > REMOVED_AFTER:
            self.thing = None


def _inside(pose: Pose) -> Pose:
    """Keep the robot between the field's borders."""
    return Pose(min(max(pose.x, 0), WIDTH), min(max(pose.y, 0), HEIGHT), pose.angle)


ROUNDS: dict[Source, Sequence[Point]] = {
    Source.ENEMY_1: (Point(2800, 1700), Point(1900, 1650), Point(1500, 1100), Point(2400, 1200)),
    Source.ENEMY_2: (Point(2750, 300), Point(1700, 250), Point(1600, 700), Point(2500, 650)),
    Source.CONFEDERATE: (Point(250, 300), Point(650, 250), Point(250, 600)),
}
"""Where the others drive when our team is red; yellow is the mirror image."""

STRAY = 80
"""How far a patrol's way points differ from one seed to another, mm."""


def _patrol(chance: random.Random, team: TeamColour, who: Source) -> Patrol:
    points = [
        Point(point.x + chance.uniform(-STRAY, STRAY), point.y + chance.uniform(-STRAY, STRAY)) for point in ROUNDS[who]
    ]
    mirrored = points if team is TeamColour.RED else [Point(WIDTH - point.x, point.y) for point in points]
    return Patrol(tuple(mirrored), chance.uniform(150, 350))
