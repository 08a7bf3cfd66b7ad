"""What the command `node` does with a node of the robot: the options, its instruments, and what its core leads."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from eurobot_od.cli import ExitStatus
from eurobot_od.cli.signature import Option
from eurobot_od.device.node import Node
from eurobot_od.errors import LocalError, NoAnswer
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.plugin import NodeRun, Scene
from eurobot_od.robot.commands import status_of
from eurobot_od.robot.model.options import MatchOptions, WorldAddress, facts_for, facts_given
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.nodes.node import RobotNode

if TYPE_CHECKING:
    from eurobot_od.bus.live import Live
    from eurobot_od.robot.match.referee import Strategy
    from eurobot_od.robot.world.server import RemoteVehicle

OF_THE_CORE = ("team", "drill", "strategy")
"""Options that make sense for the core only."""

SHIPPED = "shipped"
"""What stands for the strategy that comes with the program, in place of a file."""

PATIENCE = 5.0
"""Seconds that a node waits for the world when it starts."""


@dataclass(frozen=True, kw_only=True)
class NodeOptions:
    """What a node of the robot is to do, and what it has besides the bus.

    team: core only: check the nodes and configure the start
    drill: core only: do what the core does when it is checked
    world: wheels, beacons, sensor in `world`
    strategy: core in a world: play a match by a strategy file, or `shipped`, then end; --for: the match's
    """

    team: TeamColour | None = None
    drill: bool = False
    world: Annotated[WorldAddress | None, Option(metavar="[TOKEN@]HOST:PORT", read=WorldAddress.parse)] = None
    strategy: Annotated[str | None, Option(metavar="FILE", is_file=True)] = None

    def check(self, role: str) -> None:
        """Raise LocalError for options that do not fit a node, or each other."""
        spoken = f"the {role}" if role else "devices that do not belong to the robot"
        for option in OF_THE_CORE:
            if self._has(option) and role != "core":
                raise LocalError(f"--{option} is for the core, not for {spoken}")
        if self.world and not role:
            raise LocalError(f"--world is for the robot's nodes, not for {spoken}")
        for option in ("team", "drill"):
            if self.strategy and self._has(option):
                raise LocalError(f"--strategy and --{option} do not go together")
        if self.strategy and not self.world:
            raise LocalError("--strategy goes with --world only: a match is played in a world")

    def _has(self, option: str) -> bool:
        """Return whether an option is given; the colour yellow is 0."""
        return getattr(self, option) is not None and getattr(self, option) is not False

    def values(self, kind: type[Node], dictionary: Dictionary, facts: Sequence[tuple[str, str]]) -> Mapping[str, Any]:
        """Return the facts that a node goes by in place of the file's, and what is stored for a drill.

        Raises LocalError.
        """
        from eurobot_od.robot.check import stored

        given = {"store": stored(dictionary)} if self.drill else {}
        if not facts:
            return given
        if not issubclass(kind, RobotNode):
            raise LocalError(f"--set is for nodes that go by facts of the robot, not for a {kind.__name__}")
        return {"facts": facts_for(dictionary.file, facts_given(facts)), **given}

    def set_up(self, node: Node, run: NodeRun) -> Scene:
        """Give the node its instruments; raises WorldError, LocalError, OSError. On the bus: BusError, NoAnswer."""
        played = _strategy(self.strategy) if self.strategy else None
        world = enter(node, self.world, run.duration) if self.world else None

        def play(live: Live) -> ExitStatus | None:
            end = inf if run.duration is None else live.clock() + run.duration
            if not isinstance(node, Core):
                return None
            if played and world:
                return _play(live, node, *world, played, run)
            _lead(node, self, lambda: max(end - live.clock(), 0.0))
            return None

        return play


def _strategy(name: str) -> Strategy:
    from eurobot_od.robot.match import referee, strategy  # a node outside of a match starts without

    return strategy.play if name == SHIPPED else referee.load_strategy(Path(name))


def enter(node: Node, world: WorldAddress, duration: float | None) -> tuple[RemoteVehicle, MatchOptions]:
    """Equip a node with instruments in a world."""
    from eurobot_od.robot.world.server import RemoteVehicle
    from eurobot_od.robot.world.world import equip

    vehicle = RemoteVehicle(world, report=partial(print, flush=True))
    # Nodes and world are started together, and the world need not be up first.
    options = vehicle.hello(PATIENCE)
    equip([node], vehicle, options.errors, str(options.seed))
    return vehicle, replace(options, duration=duration)


def _play(
    live: Live, core: Core, vehicle: RemoteVehicle, options: MatchOptions, strategy: Strategy, run: NodeRun
) -> ExitStatus:
    """Play the match; status 1 if the strategy raised."""
    from eurobot_od.bus.live import FrameReader
    from eurobot_od.pdo.protocol import Protocol
    from eurobot_od.robot.match.stage import play_led
    from eurobot_od.robot.match.summary import FrameCounter

    counter = FrameCounter(Protocol.of_devices(run.robot.dialects.load_all(run.dialect), run.robot.catalogue()))
    # A second participant of the bus, as the core's own driver does not hear what it sends itself.
    watch = FrameReader(run.open_bus(), lambda _, frame: counter.count(frame), live.clock, opener=run.open_bus)
    with watch:
        summary = play_led(live, core, vehicle, options, strategy, counter, partial(print, flush=True))
    print(f"\n{summary}", flush=True)
    return status_of(summary)


def _lead(core: Core, options: NodeOptions, left: Callable[[], float]) -> None:
    """Do the core's part of the startup (document 5.1) and its drill, if asked to; raises NoAnswer, StateError.

    A match that the drive is in goes on: this core has begun again.

    The drill ends after the seconds that are `left`, and its goto with it.
    """
    memory = None
    with suppress(NoAnswer):  # a drive that is not there yet remembers nothing
        memory = core.recall().result()
    if memory is not None and memory.time_left:
        place = core.recover().result()
        print(
            f"a match is under way, {core.time_left:.1f} s are left; the robot is at ({place.x}, {place.y})", flush=True
        )
    elif options.team is not None:
        for name, seconds in core.check_nodes().result().items():
            print(f"{name} answered after {seconds * 1000:.1f} ms", flush=True)
        seconds = core.configure_start(options.team).result()
        print(f"start configuration confirmed after {seconds * 1000:.1f} ms", flush=True)
    if options.drill:
        from eurobot_od.robot.check import drill

        with suppress(TimeoutError):
            # Cancelled and not left alone: the goto under way has to end as well, with the robot standing.
            asyncio.run(asyncio.wait_for(drill(core), left()))
