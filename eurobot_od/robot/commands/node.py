"""The command `node` for a node of the robot: its options, its instruments, and the core's part in a match."""

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
"""Options for the core only."""

SHIPPED = "shipped"
"""Name of the shipped strategy, instead of a file."""

PATIENCE = 5.0
"""Maximum time that a node waits for the world at its start, in s."""


@dataclass(frozen=True, kw_only=True)
class NodeOptions:
    """What a node of the robot does, and its instruments.

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
        """Check that the options fit the node, and each other; raises LocalError."""
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
            raise LocalError(
                "--strategy goes with --world only; with a real drive and navigation a program plays it: "
                "docs/real-robot.md"
            )

    def _has(self, option: str) -> bool:
        """Return whether an option is given."""
        return getattr(self, option) is not None and getattr(self, option) is not False

    def values(self, kind: type[Node], dictionary: Dictionary, facts: Sequence[tuple[str, str]]) -> Mapping[str, Any]:
        """Return the facts for a node that replace the file's, and the stored values for a drill.

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
        """Connect the node to its instruments; raises WorldError, LocalError, OSError.

        The scene raises BusError, NoAnswer.
        """
        played = load_strategy(self.strategy) if self.strategy else None
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


def load_strategy(name: str) -> Strategy:
    """Return the strategy of a file, or the shipped one; raises as `referee.load_strategy`."""
    from eurobot_od.robot.match import referee, strategy  # here, as a node without a match does not need it

    return strategy.play if name == SHIPPED else referee.load_strategy(Path(name))


def enter(node: Node, world: WorldAddress, duration: float | None) -> tuple[RemoteVehicle, MatchOptions]:
    """Connect a node to its instruments in a world."""
    from eurobot_od.robot.world.server import RemoteVehicle
    from eurobot_od.robot.world.world import equip

    vehicle = RemoteVehicle(world, report=partial(print, flush=True))
    # The world may be started after the node.
    options = vehicle.hello(PATIENCE)
    equip([node], vehicle, options.errors, str(options.seed))
    return vehicle, replace(options, duration=duration)


def _play(
    live: Live, core: Core, vehicle: RemoteVehicle, options: MatchOptions, strategy: Strategy, run: NodeRun
) -> ExitStatus:
    """Play the match; return 1 if the strategy raised."""
    from eurobot_od.bus.live import FrameReader
    from eurobot_od.pdo.protocol import Protocol
    from eurobot_od.robot.match.stage import play_led
    from eurobot_od.robot.match.summary import FrameCounter

    counter = FrameCounter(Protocol.of_devices(run.robot.dialects.load_all(run.dialect), run.robot.catalogue()))
    # A second participant on the bus, as the core's driver does not receive what it sends.
    watch = FrameReader(run.open_bus(), lambda _, frame: counter.count(frame), live.clock, opener=run.open_bus)
    with watch:
        summary = play_led(live, core, vehicle, options, strategy, counter, partial(print, flush=True))
    print(f"\n{summary}", flush=True)
    return status_of(summary)


def _lead(core: Core, options: NodeOptions, left: Callable[[], float]) -> None:
    """Do the core's part of the startup (document 5.1) and its drill, as the options say; raises NoAnswer, StateError.

    If the drive is in a match, that match goes on, as this core has been restarted.

    The drill, with its goto, ends after the time that is `left`, in s.
    """
    memory = None
    with suppress(NoAnswer):  # the drive may not be there yet
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
            # Cancelled, so that the current goto ends, too, and the robot stands.
            asyncio.run(asyncio.wait_for(drill(core), left()))
