"""Devices as a simulated check needs them: the robot's nodes in their world, the core with something to do; others."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from functools import partial

from eurobot_od.check.results import SuiteResult
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.simulated import NodeUnderTest, run_simulated
from eurobot_od.check.suite import Suite
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.robot.assembly import assemble
from eurobot_od.robot.check.drill import drill
from eurobot_od.robot.faults import faulty_kinds
from eurobot_od.robot.nodes import KINDS, Core, Node, role_of
from eurobot_od.robot.options import NOISE_ONLY, MatchOptions

ON_A_BENCH = MatchOptions(errors=NOISE_ONLY, falling=False, solid=False)
"""Where nodes are checked: suites send the robot from place to place as if nothing stood there."""


def nodes_under_test(
    dictionaries: Mapping[str, Dictionary],
    seed: int,
    clock: Callable[[], float],
    kinds: Mapping[str, type[Node]] = KINDS,
) -> list[NodeUnderTest]:
    """Make the nodes that have these dictionaries; `kinds` are their classes by role, with or without faults."""
    nodes = [kinds[role_of(dictionary)](dictionary) for dictionary in dictionaries.values()]
    # A core that is checked drives nothing, and would only be stopped by the robots that come along.
    in_the_world = [node for node in nodes if not isinstance(node, Core)]
    assemble(in_the_world, replace(ON_A_BENCH, seed=seed), clock)
    return [NodeUnderTest(node, partial(drill, node) if isinstance(node, Core) else None) for node in nodes]


def simulate(suite: Suite, options: RunOptions, faults: Iterable[str] = (), seed: int = 1) -> SuiteResult:
    """Run a suite against simulated nodes, those that can have some faults having them; raises UnknownName."""
    return run_simulated(suite, options, partial(nodes_under_test, kinds=faulty_kinds(faults)), seed)
