"""A world whose clock the test sets, and in which it drives the robots by hand."""

from __future__ import annotations

from typing import Any

from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.values import OURS
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.world import World

STEP = 0.01
"""Duration of a step, in s."""


class Place:
    """A world with nobody in it but our robot, unless told otherwise."""

    def __init__(self, seed: int = 1, rival: bool = False, **who: Any) -> None:
        self.now = 0.0
        self.options = MatchOptions(seed=seed, **({"enemies": 0, "confederates": 0, "falling": False} | who))
        self.world = World(self.options, lambda: self.now, rival=rival)
        self.vehicle = self.world.vehicle()

    def put(self, x: float, y: float, angle: float, name: str = OURS) -> None:
        """Put a robot somewhere."""
        self.world.robots[name].place(Pose(x, y, angle))

    def drive(self, speed: float, seconds: float, turn: float = 0.0, name: str = OURS) -> float:
        """Drive at mm/s and deg/s; return how far the robot came."""
        came = 0.0
        for _ in range(round(seconds / STEP)):
            self.now += STEP
            came += self.world.move(name, Odometry(speed * STEP, turn * STEP), STEP)
        return came

    def clear(self) -> None:
        """Take away everything that stands on the field."""
        self.world.things.clear()
        self.world.robots[OURS].place(self.world.robot)

    @property
    def here(self) -> Point:
        """Where our robot truly is."""
        return self.world.robot.point

    def touched(self) -> list[tuple[str, str]]:
        """Return who touched what, in the order of time."""
        return [(touch.robot, touch.thing) for touch in self.world.touches]
