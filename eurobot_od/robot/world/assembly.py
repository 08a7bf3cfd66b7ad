"""Puts nodes into a simulated world: it gives them their wheels, beacons, distance sensor and actuators."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable

from eurobot_od.robot.model.options import Errors, MatchOptions
from eurobot_od.robot.nodes import Core, Drive, Navigation, Node
from eurobot_od.robot.world import World
from eurobot_od.robot.world.beacons import SimulatedBeacons
from eurobot_od.robot.world.sensor import Sensor
from eurobot_od.robot.world.vehicle import Vehicle
from eurobot_od.robot.world.wheels import SimulatedWheels


def assemble(nodes: Iterable[Node], options: MatchOptions, clock: Callable[[], float]) -> World:
    """Make the world of a match around some of our robot's nodes, and return it."""
    world = World(options, clock)
    equip(nodes, world.vehicle(), options.errors, str(options.seed))
    return world


def equip(nodes: Iterable[Node], vehicle: Vehicle, errors: Errors, seed: str) -> None:
    """Give some of a robot's nodes the instruments that they have on its vehicle; `seed` is that of their errors."""
    for node in nodes:
        # A random stream for each instrument: one more look of the sensor must not change how the wheels roll.
        if isinstance(node, Drive):
            node.chassis = SimulatedWheels(vehicle, errors, random.Random(f"{seed} wheels"))
        if isinstance(node, Navigation):
            node.beacons = SimulatedBeacons(vehicle, node.facts.field, errors, node.deviations, seed)
        if isinstance(node, Core):
            node.sensor, node.actuators = Sensor(vehicle, errors, random.Random(f"{seed} sensor")), vehicle
