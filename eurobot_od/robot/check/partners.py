"""What the robot's nodes need when they are checked in simulation: their world, and for the core something to do."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from eurobot_od.plugin import Program
from eurobot_od.robot.check.drill import drill
from eurobot_od.robot.model.options import NOISE_ONLY, MatchOptions
from eurobot_od.robot.nodes import Core, Drive, Navigation, Node
from eurobot_od.robot.world.instruments import assemble

ON_A_BENCH = MatchOptions(errors=NOISE_ONLY, falling=False, solid=False)
"""Where nodes are checked: suites send the robot from place to place as if nothing stood there."""


def partners(nodes: Sequence[Node], seed: int, clock: Callable[[], float]) -> Mapping[str, Program]:
    """Put nodes that are checked into their world, and return what the core does there."""
    # A core that is checked drives nothing, and would only be stopped by the robots that come along.
    moving = [node for node in nodes if isinstance(node, Drive | Navigation)]
    if moving:
        assemble(moving, replace(ON_A_BENCH, seed=seed), clock)
    return {node.name: partial(drill, node) for node in nodes if isinstance(node, Core)}
