"""A node in the world of another process: its options, its instruments there, and a match that its core leads."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from eurobot_od.cli import ExitStatus
from eurobot_od.cli import options as shared
from eurobot_od.errors import LocalError

if TYPE_CHECKING:
    from eurobot_od.live import Live
    from eurobot_od.robot.match.referee import Strategy
    from eurobot_od.robot.nodes import Core, Node
    from eurobot_od.robot.options import MatchOptions
    from eurobot_od.robot.world.remote import RemoteVehicle

APART = (("world", "beacons"), ("strategy", "team"), ("strategy", "drill"))
"""Options that do not go together."""

SHIPPED = "shipped"
"""What stands for the strategy that comes with the program, in place of a file."""

PATIENCE = 5.0
"""Seconds that a node waits for the world when it starts."""


def add_arguments(group: argparse._ActionsContainer) -> None:
    """Add --world and --strategy."""
    group.add_argument(
        "--world", type=shared.address, metavar="HOST:PORT", help="wheels, beacons, sensor in `eurobot-od world`"
    )
    group.add_argument(
        "--strategy",
        metavar="FILE",
        help=f"core in a world only: play a match by a file, or by `{SHIPPED}`, then end; --duration is the match's",
    )


def check_arguments(arguments: argparse.Namespace) -> None:
    """Raise LocalError for options that do not go together."""
    for one, other in APART:
        if getattr(arguments, one) and getattr(arguments, other):
            raise LocalError(f"--{one} and --{other} do not go together")
    if arguments.strategy and not arguments.world:
        raise LocalError("--strategy goes with --world only: a match is played in a world")


class Scene(NamedTuple):
    """A world in another process, which match that is, and by which strategy this process plays it, if it does."""

    vehicle: RemoteVehicle
    options: MatchOptions
    strategy: Strategy | None


def enter(node: Node, arguments: argparse.Namespace) -> Scene:
    """Equip a node with instruments in the world that the options name; raises WorldError, LocalError, OSError."""
    from eurobot_od.robot.assembly import equip
    from eurobot_od.robot.world.remote import RemoteVehicle

    strategy = _strategy(arguments.strategy) if arguments.strategy else None
    vehicle = RemoteVehicle(arguments.world, report=partial(print, flush=True))
    options = vehicle.hello(PATIENCE)
    equip([node], vehicle, options.errors, str(options.seed))
    return Scene(vehicle, replace(options, duration=arguments.duration), strategy)


def _strategy(name: str) -> Strategy:
    from eurobot_od.robot.match import strategies, strategy

    return strategy.play if name == SHIPPED else strategies.load(Path(name))


def play(live: Live, core: Core, scene: Scene, strategy: Strategy, arguments: argparse.Namespace) -> ExitStatus:
    """Play the match; status 1 if the strategy raised. Raises BusError, NoAnswer."""
    from eurobot_od.live import Watch
    from eurobot_od.robot.match.apart import Led
    from eurobot_od.robot.match.summary import FrameCounter
    from eurobot_od.robot.protocol import EurobotProtocol

    counter = FrameCounter(EurobotProtocol.load(arguments.dialect))
    with Watch(shared.open_bus(arguments), lambda _, frame: counter.count(frame), live.clock):
        summary = Led(live, core, scene.vehicle, partial(print, flush=True)).play(scene.options, strategy, counter)
    print(f"\n{summary}", flush=True)
    if summary.failure is None:
        return ExitStatus.FINE
    print(summary.failure, file=sys.stderr)
    return ExitStatus.FOUND
