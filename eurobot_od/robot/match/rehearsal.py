"""A team's program in simulated time, without a referee or a start-up of ours, with the log and picture of a match."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Coroutine
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

from eurobot_od.bus.live.event_loop import apart
from eurobot_od.bus.live.watchdog import Watchdog, passing
from eurobot_od.bus.simulated import loop
from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.device.flow import Result
from eurobot_od.errors import ProgramFailed
from eurobot_od.frame import Frame
from eurobot_od.robot.match.stage import POWER_UP, EdsFiles, cast_for, switch_on
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.world import World
from eurobot_od.traffic.recorder import recording

DEFAULTS = MatchOptions(falling=False)


def rehearse(
    strategy: Callable[[Core], Coroutine[Any, Any, Result]],
    options: MatchOptions = DEFAULTS,
    *,
    log: str | Path | None = None,
    picture: str | Path | None = None,
) -> Result:
    """Run a team's strategy in simulated time against simulated nodes, and return its result.

    It also works in a notebook. The strategy starts when the nodes have booted. `log` is a file for all frames, in the
    format of its suffix; `picture` is one for the drawing: .svg, .html or .png. Both are written even if the strategy
    raises. Raises what the strategy raises, ProgramFailed if it hangs, FileError, OSError, LocalError for a suffix or
    an option.
    """
    return apart(lambda: _rehearse(strategy, options, log, picture))


async def rehearse_async(
    strategy: Callable[[Core], Coroutine[Any, Any, Result]],
    options: MatchOptions = DEFAULTS,
    **files: str | Path | None,
) -> Result:
    """Do what `rehearse` does, for a program with an event loop of its own, which keeps running meanwhile."""
    return await asyncio.to_thread(lambda: rehearse(strategy, options, **files))


def _rehearse(
    strategy: Callable[[Core], Coroutine[Any, Any, Result]],
    options: MatchOptions,
    log: str | Path | None,
    picture: str | Path | None,
) -> Result:
    network = Simulation()
    world = World(options, lambda: network.now)
    core, nodes = cast_for(options, EdsFiles.read(options), world)
    switch_on(nodes, network, options.seed)
    with ExitStack() as stack:
        if picture is not None:
            from eurobot_od.robot.match.drawing import draw
            from eurobot_od.robot.scene.files import form

            form(Path(picture))  # raises for a suffix before anything is played
            frames: list[tuple[float, Frame]] = []
            network.observers.append(lambda time, frame: frames.append((time, frame)))
            stack.callback(draw, Path(picture), frames, options, world)
        network.observers.append(
            stack.enter_context(recording(None if log is None else Path(log), tell=partial(print, file=sys.stderr)))
        )
        # Otherwise a program's first call would meet nodes that have not booted, and wait for a whole check attempt.
        network.run(POWER_UP)
        with Watchdog(passing(lambda: network.now), partial(print, file=sys.stderr)) as watchdog:
            try:
                result = loop.run(network, strategy(core))
            except BaseException:
                # As on the robot: however a program ends, the drive is stopped, and gets the time it needs.
                if core.leave() is not None:
                    network.run(network.now + core.standstill_wait)
                raise
        if watchdog.hang:  # in a task that nobody has awaited
            raise ProgramFailed(watchdog.hang)
        return result
