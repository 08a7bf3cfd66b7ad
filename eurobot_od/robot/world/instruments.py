"""The instruments of a simulated robot, which measure the world with their errors: wheels, beacons, distance sensor.

A `Vehicle` tells only the truth. The instruments add the errors themselves, so that these are the same whether the
world is in this process or in another one.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Iterable, Sequence
from typing import Protocol

from eurobot_od.robot.model.options import Errors, MatchOptions
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.robot_file import Field
from eurobot_od.robot.model.values import Obstacle, Source
from eurobot_od.robot.nodes import Core, Drive, Navigation, Node
from eurobot_od.robot.nodes.motion import Odometry, WheelCommand
from eurobot_od.robot.nodes.navigation import Fix
from eurobot_od.robot.nodes.node import Actuators, Detection
from eurobot_od.robot.world import World


class Vehicle(Actuators, Protocol):
    """One robot in the world; its actuators are those of the world."""

    def move(self, wanted: Odometry, dt: float) -> float | None:
        """Drive along an arc for `dt` seconds, as far as nothing is in the way; return the distance, mm.

        None if nothing moves, because the world cannot be reached.
        """

    def pose(self, whom: Source, age: float = 0.0) -> Pose | None:
        """Return where a robot was `age` seconds ago; None for one that is not there. INTERNAL is this robot."""

    def ahead(self, distance: float, angle: float) -> Detection | None:
        """Return the nearest thing or robot ahead, within `distance` mm and `angle` degrees to either side."""


# Wheels


BLOCKED = 0.5
"""Wheels are blocked if they make less than this share of their distance: the encoders then slip on."""


class SimulatedWheels:
    """The chassis of a drive (see `nodes.motion.Chassis`), on a vehicle in the world.

    The wheels roll a little more or less than they count: by a share that stays the same for a match, and at random. If
    something blocks the robot they stall, and count what it still moved, and a share of what it did not.
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
        # Without a world the wheels do not turn, so that the drive gives up its goto as blocked.
        if moved is None:
            return Odometry(0.0, 0.0)
        if not wanted.distance or abs(moved) >= BLOCKED * abs(wanted.distance):
            return told
        share = moved / wanted.distance
        return Odometry(told.distance * (share + self._errors.wheel_slip * (1 - share)), told.turn)

    def _rolled(self, told: Odometry) -> Odometry:
        """Return how the wheels really roll when they are commanded a step."""
        metres, quarters = abs(told.distance) / 1000, abs(told.turn) / 90
        distance, turn = told.distance * self._scale, told.turn * self._bias
        if metres:
            distance += self._chance.gauss(0, self._errors.wheel_noise * math.sqrt(metres))
        # Random errors grow with the root of the distance: they are the sum of many small ones.
        if metres or quarters:
            turn += self._chance.gauss(0, self._errors.heading_noise * math.sqrt(metres + quarters))
        return Odometry(distance, turn)


# Beacons


class SimulatedBeacons:
    """The beacons of a navigation (see `nodes.navigation.Beacons`), which see the robots of the world.

    They are noisy, late, sometimes blind and sometimes wrong. All chance comes from one seed, with a stream for each
    robot that is asked for: with one stream for all, one more question would change all later answers. `deviations`
    gives their standard deviations, mm and degrees. Only our own heading can be measured.
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


# Distance sensor


class Sensor:
    """The distance sensor of a core (see `nodes.equipment.DistanceSensor`), on a vehicle in the world.

    It has a range, is slightly off, misses things, and sees things that are not there. It sees robots and what has
    fallen over; barriers, trees and the border are too low for it.
    """

    def __init__(self, vehicle: Vehicle, errors: Errors, chance: random.Random) -> None:
        self._vehicle, self._errors, self._chance = vehicle, errors, chance

    def look(self, _now: float) -> Detection | None:
        """Measure what is ahead; None if nothing is seen."""
        errors, chance = self._errors, self._chance
        seen = self._vehicle.ahead(errors.sensor_range, errors.sensor_angle)
        # Even if something is there: the false echo hides it.
        if chance.random() < errors.sensor_false:
            return Detection(Obstacle.OBJECT, chance.uniform(0, errors.sensor_range), 0.0)
        if seen is None or chance.random() < errors.sensor_missed:
            return None
        return seen._replace(distance=max(seen.distance + chance.gauss(0, errors.sensor_noise), 0.0))


# All of them


def assemble(nodes: Sequence[Node], options: MatchOptions, clock: Callable[[], float]) -> World:
    """Make the world of a match around some of our robot's nodes, with the facts that they have, and return it."""
    facts = (each.facts for each in nodes if isinstance(each, Core | Drive | Navigation))
    world = World(options, clock, facts=next(facts, None))
    equip(nodes, world.vehicle(), options.errors, str(options.seed))
    return world


def equip(nodes: Iterable[Node], vehicle: Vehicle, errors: Errors, seed: str) -> None:
    """Give some of a robot's nodes their instruments on its vehicle; `seed` is that of the errors."""
    for node in nodes:
        # A random stream for each instrument: one more look by the sensor must not change how the wheels roll.
        if isinstance(node, Drive):
            node.chassis = SimulatedWheels(vehicle, errors, random.Random(f"{seed} wheels"))
        if isinstance(node, Navigation):
            node.beacons = SimulatedBeacons(vehicle, node.facts.field, errors, node.deviations, seed)
        if isinstance(node, Core):
            node.sensor, node.actuators = Sensor(vehicle, errors, random.Random(f"{seed} sensor")), vehicle
