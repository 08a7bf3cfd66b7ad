"""The robot's check suites in simulation: the world of its nodes, and a drill for the core.

The drill is what a core does when it is checked alone, while the tester plays drive and navigation. It is a fixed
programme that goes on whatever the others answer, as far as the protocol allows, so that each step of a check has
something to look at.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

from eurobot_od.device.objects import MemoryStore
from eurobot_od.device.timers import Call
from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.plugin import Program
from eurobot_od.robot.model.messages import GotoXY
from eurobot_od.robot.model.options import NOISE_ONLY, MatchOptions
from eurobot_od.robot.model.values import Barriers, Obstacle, Passage, TeamColour
from eurobot_od.robot.nodes import Core, Drive, Navigation, Node
from eurobot_od.robot.nodes.core.flows import NotStanding, Standstill
from eurobot_od.robot.world.world import assemble

BEFORE = 10.0
"""Time from the start configuration to the first goto, in s; meanwhile the position polling is checked."""

UNDER_WAY = 1.0
"""Time of a goto before it is stopped, in s."""

MATCH = 1.0
"""Duration of a match, in s."""

BETWEEN = 1.5
"""Time from a stop to the next goto, in s; meanwhile no frame may be sent."""

ENEMY_DIAMETER = 30
"""Diameter of enemy 1 in the start configuration, in cm."""

UNDISTURBED = (
    GotoXY(1300, 1750, 90, 100, Barriers.of({2: Passage.FORCED})),
    GotoXY(700, 1150, 225, 60),
    GotoXY(1500, 900, 0, 80),
)
"""Gotos that the drive may complete."""

STOPPED: tuple[tuple[GotoXY, Callable[[Core], Call[Standstill]]], ...] = (
    (GotoXY(1500, 1300, 90, 90), lambda core: core.emergency_stop(Obstacle.OBJECT)),
    (GotoXY(1250, 400, 180, 70), lambda core: core.emergency_stop(Obstacle.ENEMY)),
    (GotoXY(2000, 400, 0, 70), lambda core: core.stop()),
)
AFTER_THE_MATCH: tuple[tuple[GotoXY, Callable[[Core], Call[Standstill]]], ...] = (
    (GotoXY(600, 600, 0, 50), lambda core: core.stop()),
    (GotoXY(420, 1650, 180, 100), lambda core: core.emergency_shutdown()),
)
"""Gotos that are stopped under way, and how."""


async def drill(core: Core) -> None:
    """Do the startup (document 5.1), then all gotos one after the other, and one too many after the shutdown.

    Ends early if a node does not answer during the startup. After a stop it waits until the robot stands.
    """
    with suppress(NoAnswer):
        await core.check_nodes()
        await core.configure_start(TeamColour.RED, enemies=1, confederates=1, enemy_1_diameter=ENEMY_DIAMETER)
        await asyncio.sleep(BEFORE)
        for goto in UNDISTURBED:
            await _attempt(core, goto)
        await _stop_on_the_way(core, STOPPED)
        # The match ends during a goto, and the next goto comes too late. The following match has no end.
        core.start_match(MATCH)
        await _attempt(core, GotoXY(900, 600, 0, 60))
        await _attempt(core, GotoXY(1500, 900, 0, 80))
        await asyncio.sleep(BETWEEN)
        core.start_match()
        await _stop_on_the_way(core, AFTER_THE_MATCH)
        await _attempt(core, UNDISTURBED[0])  # after the shutdown, so it must not be sent


async def _stop_on_the_way(core: Core, ways: Sequence[tuple[GotoXY, Callable[[Core], Call[Standstill]]]]) -> None:
    for goto, stop in ways:
        stopped = asyncio.ensure_future(_attempt(core, goto))
        await asyncio.sleep(UNDER_WAY)
        with suppress(NotStanding, StateError):
            await stop(core)
        await stopped
        await asyncio.sleep(BETWEEN)


async def _attempt(core: Core, goto: GotoXY) -> None:
    """Send a goto and wait for its end, even if it fails or is not allowed."""
    with suppress(NoAnswer, StateError):
        await core.goto(*goto)


# The surroundings of nodes that are checked

BELIEVED = "Node check.Nodes without SDO"
"""Setting by which a core accepts nodes that answer no SDO, such as the tester."""


def stored(dictionary: Dictionary) -> MemoryStore | None:
    """Return the stored values of a node that is checked; None if there are none."""
    if dictionary.name != "core":
        return None
    return MemoryStore({dictionary.address(BELIEVED): 1})


ON_A_BENCH = MatchOptions(errors=NOISE_ONLY, falling=False, solid=False)
"""Options of a check: the robot drives everywhere as if there were no obstacles."""


def partners(nodes: Sequence[Node], seed: int, clock: Callable[[], float]) -> Mapping[str, Program]:
    """Put nodes that are checked into their world, and return the core's program."""
    # A core alone needs no world, and would only be stopped by the other robots.
    moving = [node for node in nodes if isinstance(node, Drive | Navigation)]
    if moving:
        assemble(moving, replace(ON_A_BENCH, seed=seed), clock)
    return {node.name: partial(drill, node) for node in nodes if isinstance(node, Core)}
