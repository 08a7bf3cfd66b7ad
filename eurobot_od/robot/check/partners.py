"""The robot's nodes as a simulated check needs them: in their world, and a core that has something to do."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

from eurobot_od.check.simulated import NodeUnderTest
from eurobot_od.errors import UnknownName
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.robot.assembly import assemble
from eurobot_od.robot.check.drill import drill
from eurobot_od.robot.nodes import ROLES, Core, Node
from eurobot_od.robot.options import MatchOptions


def nodes_under_test(
    dictionaries: Mapping[str, Dictionary],
    seed: int,
    clock: Callable[[], float],
    roles: Mapping[str, type[Node]] = ROLES,
) -> list[NodeUnderTest]:
    """Make the nodes of the robot that have these dictionaries; `roles` are their classes, with or without faults.

    Raises UnknownName for a name that no node of the robot has.
    """
    for name in dictionaries:
        if name not in roles:
            raise UnknownName("simulated node", name, roles)
    nodes = [roles[name](dictionary) for name, dictionary in dictionaries.items()]
    assemble(nodes, MatchOptions(seed=seed), clock)
    return [NodeUnderTest(node, partial(drill, node) if isinstance(node, Core) else None) for node in nodes]
