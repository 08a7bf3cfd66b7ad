"""A team's program in simulated time: no referee, no start-up but its own, with the log and the picture of a match."""

from __future__ import annotations

import sys
from collections.abc import Callable, Coroutine
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

from eurobot_od.device.flow import Result
from eurobot_od.frame import Frame
from eurobot_od.logs.recorder import recording
from eurobot_od.robot.match.stage import POWER_UP, EdsFiles, cast_for, switch_on
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.options import MatchOptions
from eurobot_od.robot.world import World
from eurobot_od.simulation import loop
from eurobot_od.simulation.network import Network

DEFAULTS = MatchOptions(falling=False)


def rehearse(
    strategy: Callable[[Core], Coroutine[Any, Any, Result]],
    options: MatchOptions = DEFAULTS,
    *,
    log: str | Path | None = None,
    picture: str | Path | None = None,
) -> Result:
    """Run a team's strategy in simulated time against simulated nodes, and return its result.

    The strategy starts when the nodes have booted. `log` is a file for all frames, in the format of its suffix,
    `picture` one for the drawing: .svg, .html or .png; both are written also when the strategy raises. Raises what the
    strategy raises, DictionaryError, OSError, LocalError for a suffix or an option.
    """
    network = Network()
    world = World(options, lambda: network.now)
    nodes = cast_for(options, EdsFiles.read(options.dialect), world)
    switch_on(nodes, network, options.seed)
    with ExitStack() as stack:
        if picture is not None:
            from eurobot_od.robot.match.drawing import draw
            from eurobot_od.robot.picture.files import form

            form(Path(picture))  # complains of a suffix before anything is played
            frames: list[tuple[float, Frame]] = []
            network.observers.append(lambda time, frame: frames.append((time, frame)))
            stack.callback(draw, Path(picture), frames, options, world)
        network.observers.append(
            stack.enter_context(recording(None if log is None else Path(log), tell=partial(print, file=sys.stderr)))
        )
        network.run(POWER_UP)
        return loop.run(network, strategy(nodes[0]))
