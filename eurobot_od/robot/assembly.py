"""Puts nodes into a simulated world: it gives the drive its wheels and the navigation its beacons."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from eurobot_od.robot.nodes import Drive, Navigation, Node
from eurobot_od.robot.options import MatchOptions
from eurobot_od.robot.world import World


def assemble(nodes: Iterable[Node], options: MatchOptions, clock: Callable[[], float]) -> World:
    """Make the world of a match around some of the robot's nodes, and return it."""
    cast = tuple(nodes)
    noise = next((node.deviations for node in cast if isinstance(node, Navigation)), lambda: (0.0, 0.0))
    world = World(options, noise, clock)
    for node in cast:
        if isinstance(node, Drive):
            node.chassis = world
        if isinstance(node, Navigation):
            node.beacons = world
    return world
