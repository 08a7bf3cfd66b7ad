"""Benches in which the robot drives, and what becomes of the bus and of its nodes."""

from __future__ import annotations

from concurrent.futures import Future
from itertools import pairwise
from typing import Any, ClassVar

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.frame import Frame
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model.messages import (
    EmergencyShutdown,
    EmergencyStop,
    GotoXY,
    StopDrive,
)
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import (
    RobotError,
    Source,
)
from eurobot_od.robot.nodes import Drive, Navigation
from eurobot_od.robot.nodes.core.flows import GotoReport
from eurobot_od.robot.nodes.motion import Odometry, WheelCommand
from eurobot_od.robot.nodes.navigation import Fix
from eurobot_od.robot.nodes.node import Handlers
from tests.robot.nodes.harness import DICTIONARIES, RED, Bench, as_if_started

GOTO = GotoXY(1500, 1000, 90, 80)
ON_THE_WIRE = 0.0005
"""Longer than a frame and its answer take on an idle bus, s."""


def gaps(times: list[float]) -> list[float]:
    """Return the times between one and the next."""
    return [later - earlier for earlier, later in pairwise(times)]


def goto(bench: Bench) -> Future[GotoReport]:
    """Begin a goto of the core."""
    as_if_started(bench.core)
    call = bench.core.goto(*GOTO)
    bench.run(0.002)
    return call


FAR = GotoXY(2700, 1700, 0, 50)
"""A goto that takes more than 6 s from the red start place."""

NEAR = GotoXY(400, 1700, 0, 100)
"""A goto that takes less than 2 s from the red start place."""

BRAKED = 1.0
"""Within this many seconds the robot stands, whatever one frame was lost."""

NOT_STANDING, HEARTBEAT_LOST = RobotError.NOT_STANDING, 0x8130

CORE_ID, DRIVE_ID, NAVIGATION_ID = 1, 2, 3


def ready(*peers: str) -> Bench:
    """Return all three nodes, configured; the peers are stand-ins."""
    bench = Bench(*peers)
    bench.configure()
    return bench


def drive_off(bench: Bench, goto: GotoXY = FAR, seconds: float = 2.0) -> Future[GotoReport]:
    """Begin with a goto, and have the robot drive for some time."""
    call = bench.core.goto(*goto)
    bench.run(seconds)
    assert bench.drive.moving
    assert not call.done()
    return call


def nmt(bench: Bench, command: NmtCommand, node_id: int) -> None:
    """Send an NMT command to one node, as a master that is not a node of this bus."""
    for station in bench.stations.values():
        station.controller.receive(Frame(NMT_COB_ID, bytes([command, node_id])), bench.now)


def commands(bench: Bench, since: float = 0.0) -> list[Message]:
    """Return the gotos and stops on the bus since a time."""
    kinds = (GotoXY, StopDrive, EmergencyStop, EmergencyShutdown)
    return [message for time, message in bench.log if time >= since and isinstance(message, kinds)]


class Runaway(Drive):
    """A drive that brakes for nothing until it is `tamed`."""

    tamed = False

    def _stop(self, stop: Any) -> None:
        if self.tamed:
            super()._stop(stop)

    HANDLERS: ClassVar[Handlers] = {
        **Drive.HANDLERS,
        StopDrive: _stop,
        EmergencyStop: _stop,
        EmergencyShutdown: lambda self, shutdown: self._shut_down(shutdown) if self.tamed else None,
    }


def configured(bench: Bench, _: Future[GotoReport]) -> None:
    bench.core.configure_start(*RED)


def reboot(bench: Bench, name: str) -> None:
    """Switch a node off and on: the wheels stay where they are, and what it knew is gone."""
    node: Drive | Navigation
    if name == "drive":
        node = Drive(DICTIONARIES[name], bench.drive.chassis)
    else:
        node = Navigation(DICTIONARIES[name], bench.navigation.beacons)
    bench.replace(name, node)


class TrueRobot:
    """Wheels that know where the robot really is, and beacons that see it there if they are `clear`."""

    def __init__(self, pose: Pose) -> None:
        self.pose = pose
        self.clear = True

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        self.pose = self.pose.moved(command.speed * dt, command.turn * dt)
        return Odometry(command.speed * dt, command.turn * dt)

    def locate(self, whom: Source, _now: float) -> Fix | None:
        return Fix(*self.pose) if whom is Source.INTERNAL and self.clear else None


def true_robot(bench: Bench) -> TrueRobot:
    """Put the robot of a bench at the place where the drive believes it is."""
    robot = TrueRobot(bench.pose())
    bench.drive.chassis = bench.navigation.beacons = robot
    return robot


def match_under_way() -> Bench:
    """All three nodes in a match, each heard once, the robot seen by the beacons."""
    bench = Bench()
    bench.run(1.5)
    bench.configure()
    true_robot(bench)
    bench.core.start_match(60.0)
    bench.run(0.1)
    return bench
