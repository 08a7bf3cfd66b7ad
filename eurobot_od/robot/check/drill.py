"""The drill: what a core does when it is checked alone, with a tester in the place of the drive and the navigation.

It is a fixed programme, and goes on whatever the others answer, as far as the protocol lets it: each step of a check
gets something to look at.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress

from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.robot.messages import GotoXY
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.values import Barriers, Obstacle, Passage, TeamColour, barrier_number

BEFORE = 10.0
"""Seconds from the start configuration to the first goto: time to look at the position polling."""

UNDER_WAY = 1.0
"""Seconds that a goto lasts before something comes in between."""

ENEMY_DIAMETER = 30
"""cm."""

UNDISTURBED = (
    GotoXY(1300, 1750, 90, 100, Barriers.of({barrier_number("fire 2"): Passage.FORCED})),
    GotoXY(700, 1150, 225, 60),
    GotoXY(1500, 900, 0, 80),
)
"""Gotos that the drive may bring to their end."""

STOPPED: tuple[tuple[GotoXY, Callable[[Core], object]], ...] = (
    (GotoXY(1500, 1300, 90, 90), lambda core: core.emergency_stop(Obstacle.OBJECT)),
    (GotoXY(1250, 400, 180, 70), lambda core: core.emergency_stop(Obstacle.ENEMY)),
    (GotoXY(2000, 400, 0, 70), lambda core: core.stop()),
    (GotoXY(420, 1650, 180, 100), lambda core: core.emergency_shutdown()),
)
"""Gotos that are stopped under way, and how."""


async def drill(core: Core) -> None:
    """Do the startup (document 5.1), then all gotos one after the other, and one too many after the shutdown.

    Ends early if a node does not answer during the startup: that blocks it.
    """
    with suppress(NoAnswer):
        await core.check_nodes()
        await core.configure_start(TeamColour.RED, enemies=1, confederates=1, enemy_1_diameter=ENEMY_DIAMETER)
        await asyncio.sleep(BEFORE)
        await _drive(core)


async def _drive(core: Core) -> None:
    for goto in UNDISTURBED:
        await _attempt(core, goto)
    for goto, stop in STOPPED:
        stopped = asyncio.ensure_future(_attempt(core, goto))
        await asyncio.sleep(UNDER_WAY)
        stop(core)
        await stopped
    await _attempt(core, UNDISTURBED[0])


async def _attempt(core: Core, goto: GotoXY) -> None:
    """Send a goto and wait for its end, also for one that is nobody's fault or not allowed."""
    with suppress(NoAnswer, StateError):
        await core.goto(*goto)
