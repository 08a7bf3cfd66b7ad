"""Shipped suites put back what they change: the bus after a suite is the bus before it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import pytest

from eurobot_od.check.format import SuiteReader
from eurobot_od.check.on_bus import NodeUnderTest, run_simulated
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.suite import Suite
from eurobot_od.device.nmt import NmtState
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.plugin import Plugins
from eurobot_od.robot.check import drill
from eurobot_od.robot.nodes import Core, Drive, Node
from eurobot_od.robot.plugin import ROBOT


def suites() -> Iterator[Suite]:
    yield from SuiteReader(Plugins(ROBOT).networks()).read_files(Plugins(ROBOT).shipped_suites().values())


class Left(NamedTuple):
    """What a suite leaves of a node: its NMT state, what is configured, which errors it has, what it does."""

    state: NmtState
    configuration: Mapping[Any, Any]
    errors: Mapping[Any, int]
    moving: bool
    safe: bool


def left(node: Node) -> Left:
    device = node.device
    return Left(
        device.state,
        device.objects.configuration(),
        dict(device.emergencies.errors),
        isinstance(node, Drive) and node.moving,
        isinstance(node, Drive) and node.safe,
    )


@pytest.mark.long
@pytest.mark.parametrize("suite", [*suites()])
def test_a_suite_puts_back_what_it_changes(suite: Suite) -> None:
    nodes: list[Node] = []
    before: dict[str, Left] = {}

    def all_nodes(_: Mapping[str, Dictionary], seed: int, clock: Callable[[], float]) -> Sequence[NodeUnderTest]:
        """Make the others, too, which a suite may touch; but a core stops a robot that others than it have sent."""
        made = [each.node for each in Plugins(ROBOT).under_test(suite.dictionaries, seed, clock)]
        nodes[:] = [node for node in made if "core" in suite.nodes or not isinstance(node, Core)]
        before.update({node.name: left(node)._replace(state=NmtState.OPERATIONAL) for node in nodes})
        tested = (partial(drill, node) if isinstance(node, Core) and "core" in suite.nodes else None for node in nodes)
        return [NodeUnderTest(node, program) for node, program in zip(nodes, tested)]

    run_simulated(suite, RunOptions(keep_going=True), all_nodes)
    after = {node.name: left(node) for node in nodes}
    if "core" in suite.nodes:  # its drill goes on, whatever the suite puts back
        assert {name: each[:2] for name, each in after.items()} == {name: each[:2] for name, each in before.items()}
    else:
        assert after == before
