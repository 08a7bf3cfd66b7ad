"""A simulated robot's wheels: they do not quite do what they are told, nor quite report what they did."""

from __future__ import annotations

import math
import random

from eurobot_od.robot.model.options import Errors
from eurobot_od.robot.nodes.motion import Odometry, WheelCommand
from eurobot_od.robot.world.vehicle import Vehicle

BLOCKED = 0.5
"""Below this share of the way that they should have made, wheels are blocked: their encoders slip on."""


class SimulatedWheels:
    """The chassis of a drive (see `nodes.motion.Chassis`), on a vehicle in the world.

    They roll a little more or less than they count: by a share that stays the same for a match, and by chance. What
    blocks the robot stalls them, and they count what it still moved, and a share of what it did not.
    """

    def __init__(self, vehicle: Vehicle, errors: Errors, chance: random.Random) -> None:
        self._vehicle, self._errors, self._chance = vehicle, errors, chance
        # Drawn once, as tyres and track do not change in a match; the drive's filter learns the first of the two.
        self._scale, self._bias = chance.gauss(1, errors.wheel_scale), chance.gauss(1, errors.wheel_turn)

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        """Obey `command` for `dt` seconds and report what the wheels counted."""
        told = Odometry(command.speed * dt, command.turn * dt)
        wanted = self._rolled(told)
        moved = self._vehicle.move(wanted, dt)
        # No world: wheels that do not turn, so that the drive gives up its goto as blocked.
        if moved is None:
            return Odometry(0.0, 0.0)
        if not wanted.distance or abs(moved) >= BLOCKED * abs(wanted.distance):
            return told
        share = moved / wanted.distance
        return Odometry(told.distance * (share + self._errors.wheel_slip * (1 - share)), told.turn)

    def _rolled(self, told: Odometry) -> Odometry:
        """Return how the wheels really roll when they are given a step."""
        metres, quarters = abs(told.distance) / 1000, abs(told.turn) / 90
        distance, turn = told.distance * self._scale, told.turn * self._bias
        if metres:
            distance += self._chance.gauss(0, self._errors.wheel_noise * math.sqrt(metres))
        # Random errors grow with the root of the way: they are the sum of many small ones.
        if metres or quarters:
            turn += self._chance.gauss(0, self._errors.heading_noise * math.sqrt(metres + quarters))
        return Odometry(distance, turn)
