"""What the command `node` does with a node of the robot: the options, its instruments, and what its core leads."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eurobot_od import plugin
from eurobot_od.cli import ExitStatus
from eurobot_od.cli import options as shared
from eurobot_od.errors import LocalError
from eurobot_od.robot.commands.common import COLOURS, status_of
from eurobot_od.robot.commands.world import world_address
from eurobot_od.robot.model.values import TeamColour

if TYPE_CHECKING:
    from eurobot_od.bus.live import Live
    from eurobot_od.device.node import Node
    from eurobot_od.od.dictionary import Dictionary
    from eurobot_od.robot.match.referee import Strategy
    from eurobot_od.robot.model.options import MatchOptions
    from eurobot_od.robot.nodes import Core
    from eurobot_od.robot.world.remote import RemoteVehicle

ONLY = {"team": "core", "drill": "core", "strategy": "core", "beacons": "navigation"}
"""Options that make sense for one node only."""

APART = (("world", "beacons"), ("strategy", "team"), ("strategy", "drill"))
"""Options that do not go together."""

SHIPPED = "shipped"
"""What stands for the strategy that comes with the program, in place of a file."""

PATIENCE = 5.0
"""Seconds that a node waits for the world when it starts."""


def add_arguments(group: argparse._ActionsContainer) -> None:
    """Describe the options."""
    group.add_argument("--team", choices=COLOURS, help="core only: check the nodes and configure the start")
    group.add_argument("--drill", action="store_true", help="core only: do what the core does when it is checked")
    group.add_argument("--beacons", action="store_true", help="navigation only: simulated beacons for a red robot")
    group.add_argument(
        "--world", type=world_address, metavar="[TOKEN@]HOST:PORT", help="wheels, beacons, sensor in `world`"
    )
    group.add_argument(
        "--strategy",
        metavar="FILE",
        help=f"core in a world: play a match by a strategy file, or `{SHIPPED}`, then end; --duration: the match's",
    )


def check_arguments(arguments: argparse.Namespace, role: str) -> None:
    """Raise LocalError for options that do not fit a node, or each other."""
    spoken = f"the {role}" if role else "devices that do not belong to the robot"
    for option, only in ONLY.items():
        if getattr(arguments, option) and role != only:
            raise LocalError(f"--{option} is for the {only}, not for {spoken}")
    if arguments.world and not role:
        raise LocalError(f"--world is for the robot's nodes, not for {spoken}")
    for one, other in APART:
        if getattr(arguments, one) and getattr(arguments, other):
            raise LocalError(f"--{one} and --{other} do not go together")
    if arguments.strategy and not arguments.world:
        raise LocalError("--strategy goes with --world only: a match is played in a world")


def values(kind: type[Node], dictionary: Dictionary, arguments: argparse.Namespace) -> Mapping[str, Any]:
    """Return the facts that a node goes by in place of the file's, if the options give any; raises LocalError."""
    from eurobot_od.robot.model.options import facts_for, facts_given
    from eurobot_od.robot.nodes.node import RobotNode

    if not arguments.set:
        return {}
    if not issubclass(kind, RobotNode):
        raise LocalError(f"--set is for nodes that go by facts of the robot, not for a {kind.__name__}")
    changes = facts_given(shared.assignments("--set", "FACT=VALUE", arguments.set))
    return {"facts": facts_for(dictionary.file, changes)}


class NodeScene:
    """A node with its instruments, in a world of another process if the options name one.

    Raises WorldError, LocalError, OSError.
    """

    def __init__(self, node: Node, arguments: argparse.Namespace) -> None:
        self._node, self._arguments = node, arguments
        self._strategy = _strategy(arguments.strategy) if arguments.strategy else None
        self._world = enter(node, arguments) if arguments.world else None

    def play(self, live: Live) -> ExitStatus | None:
        """Do what a core does by the options; None if the node is to go on. Raises BusError, NoAnswer."""
        from eurobot_od.robot.nodes import Core

        duration = self._arguments.duration
        end = inf if duration is None else live.clock() + duration
        if self._arguments.beacons:
            from eurobot_od.robot.model.options import MatchOptions
            from eurobot_od.robot.world.instruments import assemble

            assemble([self._node], MatchOptions(), live.clock)  # our robot stands, the others are on their rounds
        if not isinstance(self._node, Core):
            return None
        if self._strategy and self._world:
            return _play(live, self._node, *self._world, self._strategy, self._arguments)
        _lead(self._node, self._arguments, lambda: max(end - live.clock(), 0.0))
        return None


set_up = NodeScene


def _strategy(name: str) -> Strategy:
    from eurobot_od.robot.match import referee, strategy

    return strategy.play if name == SHIPPED else referee.load_strategy(Path(name))


def enter(node: Node, arguments: argparse.Namespace) -> tuple[RemoteVehicle, MatchOptions]:
    """Equip a node with instruments in the world that the options name."""
    from eurobot_od.robot.world.instruments import equip
    from eurobot_od.robot.world.remote import RemoteVehicle

    vehicle = RemoteVehicle(arguments.world, report=partial(print, flush=True))
    # Nodes and world are started together, and the world need not be up first.
    options = vehicle.hello(PATIENCE)
    equip([node], vehicle, options.errors, str(options.seed))
    return vehicle, replace(options, duration=arguments.duration)


def _play(
    live: Live,
    core: Core,
    vehicle: RemoteVehicle,
    options: MatchOptions,
    strategy: Strategy,
    arguments: argparse.Namespace,
) -> ExitStatus:
    """Play the match; status 1 if the strategy raised."""
    from eurobot_od.bus.live import FrameReader
    from eurobot_od.pdo.protocol import Protocol
    from eurobot_od.robot.match.stage import Led
    from eurobot_od.robot.match.summary import FrameCounter

    robot = plugin.find(arguments.robot)
    counter = FrameCounter(Protocol.of_devices(robot.dialects.load_all(arguments.dialect), robot.catalogue()))
    # A second participant of the bus, as the core's own driver does not hear what it sends itself.
    watch = FrameReader(
        shared.open_bus(arguments), lambda _, frame: counter.count(frame), live.clock, opener=shared.opener(arguments)
    )
    with watch:
        summary = Led(live, core, vehicle, partial(print, flush=True)).play(options, strategy, counter)
    print(f"\n{summary}", flush=True)
    return status_of(summary)


def _lead(core: Core, arguments: argparse.Namespace, left: Callable[[], float]) -> None:
    """Do the core's part of the startup (document 5.1) and its drill, if asked to; raises NoAnswer.

    The drill ends after the seconds that are `left`, and its goto with it.
    """
    if arguments.team:
        for name, seconds in core.check_nodes().result().items():
            print(f"{name} answered after {seconds * 1000:.1f} ms", flush=True)
        seconds = core.configure_start(TeamColour[arguments.team.upper()]).result()
        print(f"start configuration confirmed after {seconds * 1000:.1f} ms", flush=True)
    if arguments.drill:
        import asyncio

        from eurobot_od.robot.check.drill import drill

        with suppress(TimeoutError):
            # Cancelled and not left alone: the goto under way has to end as well, with the robot standing.
            asyncio.run(asyncio.wait_for(drill(core), left()))
