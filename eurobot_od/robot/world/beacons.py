"""A simulated robot's beacons: noisy, late, sometimes blind, sometimes wrong.

All chance comes from one seed, but from a stream of its own for each robot that is asked for: with one stream for all,
one more question would change every answer that comes after it.
"""

from __future__ import annotations

import random
from collections.abc import Callable

from eurobot_od.robot.model.facts import Field
from eurobot_od.robot.model.options import Errors
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.nodes.navigation import Fix
from eurobot_od.robot.world.vehicle import Vehicle


class SimulatedBeacons:
    """The beacons of a navigation (see `nodes.navigation.Beacons`), which see the robots of the world.

    `deviations` gives their standard deviations, mm and degrees. Only our own heading can be measured.
    """

    def __init__(
        self, vehicle: Vehicle, field: Field, errors: Errors, deviations: Callable[[], tuple[float, float]], seed: str
    ) -> None:
        self._vehicle, self._field, self._errors, self._deviations = vehicle, field, errors, deviations
        self._chance = {source: random.Random(f"{seed} {source.name}") for source in Source}

    def locate(self, whom: Source, _now: float) -> Fix | None:
        """Measure a robot's place; None if it is not seen."""
        errors, chance = self._errors, self._chance[whom]
        seen = whom
        if chance.random() < errors.beacon_swaps:  # another robot is taken for this one
            others = [each for each in Source if each is not whom and self._vehicle.pose(each) is not None]
            seen = chance.choice(others) if others else whom
        pose = self._vehicle.pose(seen, errors.beacon_latency)
        if pose is None or chance.random() < errors.beacon_dropouts:
            return None
        if chance.random() < errors.beacon_outliers:
            field = self._field
            pose = Pose(chance.uniform(0, field.width), chance.uniform(0, field.height), chance.uniform(0, 360))
        place, angle = self._deviations()
        x, y = pose.x + chance.gauss(0, place), pose.y + chance.gauss(0, place)
        return Fix(x, y, pose.angle + chance.gauss(0, angle) if whom is Source.INTERNAL else None)
