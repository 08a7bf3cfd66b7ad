"""What the instruments of one robot can ask of the world, and do in it.

Rule of this file: the truth and nothing else. Wheels, beacons and distance sensor make their errors themselves, so that
they are the same whether the world is in this process or in another one.
"""

from __future__ import annotations

from typing import Protocol

from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.nodes.equipment import Actuators, Detection
from eurobot_od.robot.nodes.motion import Odometry


class Vehicle(Actuators, Protocol):
    """One robot in the world; its actuators are as the world has them."""

    def move(self, wanted: Odometry, dt: float) -> float | None:
        """Drive an arc for `dt` seconds as far as nothing is in the way; return how far it came, mm.

        None if nothing moves, as the world cannot be reached.
        """

    def pose(self, whom: Source, age: float = 0.0) -> Pose | None:
        """Return where a robot was `age` seconds ago; None for one that is not there. INTERNAL is this robot."""

    def ahead(self, distance: float, angle: float) -> Detection | None:
        """Return the nearest thing or robot ahead, within `distance` mm and `angle` degrees to either side."""
