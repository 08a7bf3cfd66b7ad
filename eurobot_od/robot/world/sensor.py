"""A simulated robot's distance sensor: it sees so far, is a little off, misses things and sees what is not there."""

from __future__ import annotations

import random

from eurobot_od.robot.model.options import Errors
from eurobot_od.robot.model.values import Obstacle
from eurobot_od.robot.nodes.equipment import Detection
from eurobot_od.robot.world.vehicle import Vehicle


class Sensor:
    """The distance sensor of a core (see `nodes.equipment.DistanceSensor`), on a vehicle in the world.

    It sees robots and what has fallen over; barriers, trees and the border are lower than it looks.
    """

    def __init__(self, vehicle: Vehicle, errors: Errors, chance: random.Random) -> None:
        self._vehicle, self._errors, self._chance = vehicle, errors, chance

    def look(self, _now: float) -> Detection | None:
        """Measure what is ahead; None if nothing is seen."""
        errors, chance = self._errors, self._chance
        seen = self._vehicle.ahead(errors.sensor_range, errors.sensor_angle)
        # Also when something is there: the false echo hides it.
        if chance.random() < errors.sensor_false:
            return Detection(Obstacle.OBJECT, chance.uniform(0, errors.sensor_range), 0.0)
        if seen is None or chance.random() < errors.sensor_missed:
            return None
        return seen._replace(distance=max(seen.distance + chance.gauss(0, errors.sensor_noise), 0.0))
