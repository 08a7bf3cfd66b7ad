"""The world around the robot: where it truly is, what its wheels and beacons say, and who else is on the field.

Rule of this file: the truth stays here. The nodes see it through wheels that slip, beacons that are off by some
millimetres, and a distance sensor. All chance comes from one seed, but from a stream of its own for each thing: with
one stream for all, one more question to the beacons would change everything that comes after it.
"""

from __future__ import annotations

import random
from collections.abc import Callable

from eurobot_od.robot.field import HEIGHT, START_POSES, WIDTH, Point, Pose, turn
from eurobot_od.robot.nodes.motion import Command, Odometry
from eurobot_od.robot.nodes.navigation import Fix
from eurobot_od.robot.options import MatchOptions
from eurobot_od.robot.values import Obstacle, Source
from eurobot_od.robot.world.patrols import Patrol

SLIP = 0.01
"""Share by which the wheels' distance scale is off, standard deviation."""

DRIFT = 0.004
"""Share by which the wheels' turning is off, standard deviation."""

PLACEMENT = 3.0
PLACEMENT_ANGLE = 0.5
"""How far from its start place a team puts the robot, standard deviations: mm and degrees."""

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


class World:
    """A match's world: `robot` is the true pose of our robot, `others` are enemies and confederate.

    It is the drive's chassis (`advance`) and the navigation's beacons (`locate`). `deviations` gives the standard
    deviations of the beacons, mm and degrees.
    """

    def __init__(
        self, options: MatchOptions, deviations: Callable[[], tuple[float, float]], clock: Callable[[], float]
    ) -> None:
        self._seed = options.seed
        self._deviations, self._clock = deviations, clock
        place = self._stream("placement")
        spreads = (PLACEMENT, PLACEMENT, PLACEMENT_ANGLE)
        self.robot = Pose(*(exact + place.gauss(0, by) for exact, by in zip(START_POSES[options.team], spreads)))
        wheels = self._stream("wheels")
        self._scale, self._bias = wheels.gauss(1, SLIP), wheels.gauss(1, DRIFT)
        self._noise = {source: self._stream(source.name) for source in Source}
        who = [Source.ENEMY_1, Source.ENEMY_2][: options.enemies] + [Source.CONFEDERATE] * options.confederates
        self.others = {each: Patrol.of(each, options.team, self._stream(f"patrol {each.name}")) for each in who}
        self.speed = 0.0
        self.path: list[tuple[float, Pose]] = [(0.0, self.robot)]
        self._dropped_at: float | None = None
        self.thing: Point | None = None

    def _stream(self, name: str) -> random.Random:
        return random.Random(f"{self._seed} {name}")

    # The drive's wheels

    def advance(self, command: Command, dt: float) -> Odometry:
        """Move the robot as its wheels really do, and report what they measured."""
        true = Odometry(command.speed * dt * self._scale, command.turn * dt * self._bias)
        x, y, angle = self.robot.moved(*true)
        self.robot = Pose(min(max(x, 0), WIDTH), min(max(y, 0), HEIGHT), angle)  # the borders hold it
        self.speed = command.speed
        self.path.append((self._clock(), self.robot))
        return Odometry(command.speed * dt, command.turn * dt)

    # The navigation's beacons

    def locate(self, whom: Source, now: float) -> Fix | None:
        """Measure a robot's place; only our own heading can be measured."""
        if whom is Source.INTERNAL:
            pose = self.robot
        elif whom in self.others:
            pose = self.others[whom].at(now)
        else:
            return None
        noise, (place, angle) = self._noise[whom], self._deviations()
        x, y = pose.x + noise.gauss(0, place), pose.y + noise.gauss(0, place)
        return Fix(x, y, pose.angle + noise.gauss(0, angle) if whom is Source.INTERNAL else None)

    # The core's distance sensor

    def obstacle(self, now: float) -> Obstacle | None:
        """Return what the distance sensor sees in the way of the driving robot."""
        if self._dropped_at is not None and now - self._dropped_at > REMOVED_AFTER:
            self.thing = None
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
        if self._dropped_at is None and self.speed >= DROP_SPEED:
            self._dropped_at = now
            self.thing = self.robot.moved(DROP_AHEAD, 0).point
