"""Plays the same seeds with the shipped strategy, with a fixed order of tasks, and with tasks drawn by lot.

The points say whether the strategy's choosing is worth anything: with any other order of the same tasks there would be
fewer of them.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import random
import statistics
import sys
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from itertools import cycle
from typing import NamedTuple

from eurobot_od.errors import RemoteError, StateError
from eurobot_od.robot.match import strategy
from eurobot_od.robot.match.referee import Strategy
from eurobot_od.robot.match.stage import EdsFiles, play_simulated
from eurobot_od.robot.match.touches import touches_of
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.model.tasks import Task
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.world.world import OURS


class Played(NamedTuple):
    """What a match came to."""

    points: int
    tasks: int
    touches: int
    """Touches of pools, border and robots by our fault."""


async def attempt(core: Core, task: Task) -> None:
    """Drive to a task and do it, whoever is in the way; wait for a moment if that fails."""
    try:
        report = await core.goto(task.x, task.y, task.angle, strategy.SPEED, strategy.flags(core.facts))
        if report.outcome is Outcome.ARRIVED:
            await core.act(task.name)
            return
    except (RemoteError, StateError):
        pass  # the next task may do better
    await asyncio.sleep(strategy.PAUSE)


async def in_order(core: Core) -> None:
    """Do one task after the other, in the order of the table, again and again."""
    assert core.configuration is not None
    for task in cycle(core.facts.tasks(core.configuration.team_colour).values()):
        await attempt(core, task)


async def by_lot(core: Core) -> None:
    """Do any task, again and again."""
    assert core.configuration is not None
    chance, table = random.Random(1), list(core.facts.tasks(core.configuration.team_colour).values())
    while True:
        await attempt(core, chance.choice(table))


STRATEGIES: dict[str, Strategy] = {"shipped": strategy.play, "in order": in_order, "by lot": by_lot}


@cache
def files() -> EdsFiles:
    """Return the EDS files, read once in each process."""
    return EdsFiles.read(MatchOptions())


def play(name: str, seed: int) -> Played:
    """Play a match, in any process."""
    kinds: list[str] = []
    options = MatchOptions(seed=seed)
    summary, world = play_simulated(
        options, lambda event: kinds.append(event.kind.value), lambda *_: None, files(), STRATEGIES[name]
    )
    wrong = sum(touch.is_wrong for touch in touches_of(OURS, world.touches))
    return Played(summary.points[OURS], kinds.count("task"), wrong)


def row(name: str, played: Sequence[Played]) -> str:
    """Write the figures of a strategy."""
    points = [each.points for each in played]
    low, middle, high = statistics.quantiles(points, n=4)
    figures = (statistics.mean(points), min(points), low, middle, high, max(points))
    done, touches = statistics.mean(each.tasks for each in played), sum(each.touches for each in played)
    return f"{name:<10}" + "".join(f"{each:8.1f}" for each in figures) + f"{done:8.1f}{touches:10}"


def main(arguments: Iterable[str] | None = None) -> int:
    """Print a row for each strategy."""
    parser = argparse.ArgumentParser(description="Compare strategies over the same seeds.")
    parser.add_argument("--seeds", type=int, default=300, metavar="N", help="how many (default: %(default)s)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), metavar="N", help="processes")
    options = parser.parse_args(None if arguments is None else list(arguments))
    print(f"{'':<10}{'mean':>8}{'least':>8}{'25 %':>8}{'median':>8}{'75 %':>8}{'most':>8}{'tasks':>8}{'our fault':>10}")
    with ProcessPoolExecutor(options.jobs) as pool:
        for name in STRATEGIES:
            print(row(name, list(pool.map(partial(play, name), range(1, options.seeds + 1), chunksize=5))), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
