"""Nodes as a simulated check needs them: the robot's in their world, a core with something to do, others as they are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from eurobot_od.check.simulated import NodeUnderTest
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.robot.assembly import assemble
from eurobot_od.robot.check.drill import drill
from eurobot_od.robot.messages import CATALOGUE
from eurobot_od.robot.nodes import ROLES, Core, Node
from eurobot_od.robot.options import MatchOptions


def nodes_under_test(
    dictionaries: Mapping[str, Dictionary],
    seed: int,
    clock: Callable[[], float],
    roles: Mapping[str, type[Node]] = ROLES,
    other: type[Node] = SimulatedDevice,
) -> list[NodeUnderTest]:
    """Make the nodes that have these dictionaries.

    `roles` are the classes of the robot's nodes, with or without faults; `other` is that of any other device, which
    runs from its file.
    """
    nodes = [_role(dictionary, roles, other)(dictionary) for dictionary in dictionaries.values()]
    assemble(nodes, MatchOptions(seed=seed), clock)
    return [NodeUnderTest(node, partial(drill, node) if isinstance(node, Core) else None) for node in nodes]


def _role(dictionary: Dictionary, roles: Mapping[str, type[Node]], other: type[Node]) -> type[Node]:
    """Return the class of a node: a device that only has the name of one of the robot's is none of them."""
    pdos = dictionary.read_pdos(dictionary.default, lambda _: None)
    speaks_it = any(CATALOGUE.find(each.name) for each in pdos)
    return roles.get(dictionary.name, other) if speaks_it else other
