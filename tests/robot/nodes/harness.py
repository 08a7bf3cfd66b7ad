"""The three nodes, or stand-ins for some of them, on a simulated bus."""

from __future__ import annotations

from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import (
    CheckDriveResponse,
    CheckNaviResponse,
    GotoStateResponse,
    GotoXY,
    KalmanPositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
)
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import Source, TeamColour
from eurobot_od.robot.nodes import ROLES, Core, Drive, Navigation, Node
from eurobot_od.robot.nodes.motion import Odometry, WheelCommand
from eurobot_od.robot.nodes.navigation import Fix
from eurobot_od.robot.protocol import EurobotProtocol
from tests.kit import bench
from tests.kit.bench import put

PROTOCOL = EurobotProtocol.load()
DICTIONARIES = {each.name: each for each in dialects.load_all()}
RED = StartConfigurationSet(TeamColour.RED, 2, 1, 30, 20)
"""A start configuration in which everyone is there."""
TUNING = Drive(DICTIONARIES["drive"]).estimate.tuning._replace(latency=0.0)
"""The tuning of the Kalman filter by the settings' defaults, but for positions of this moment."""


def as_if_started(core: Core) -> None:
    """Return a core that sends gotos as if its nodes had been checked and configured, for tests without answers."""
    core.readiness.checked |= {"drive", "navigation"}
    core.readiness.configured = True


class Peer(bench.Peer):
    """Stands in for a node of the robot."""

    protocol = PROTOCOL


class Wheels:
    """Ideal wheels that remember every command."""

    def __init__(self) -> None:
        self.commands: list[WheelCommand] = []

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        self.commands.append(command)
        return Odometry(command.speed * dt, command.turn * dt)


class Seen:
    """Beacons that see everyone at one place; who is not in `fixes` is not seen."""

    def __init__(self, **fixes: Fix) -> None:
        self.fixes = {Source[name.upper()]: fix for name, fix in fixes.items()}

    def locate(self, whom: Source, _now: float) -> Fix | None:
        return self.fixes.get(whom)


class Bench(bench.Bench):
    """The three nodes on a simulated bus, running; those named in `peers` are stand-ins."""

    def __init__(self, *peers: str) -> None:
        nodes = {name: (Peer if name in peers else role)(DICTIONARIES[name]) for name, role in ROLES.items()}
        super().__init__(PROTOCOL, nodes)

    # The nodes

    @property
    def core(self) -> Core:
        core = self.nodes["core"]
        assert isinstance(core, Core)
        return core

    @property
    def drive(self) -> Drive:
        drive = self.nodes["drive"]
        assert isinstance(drive, Drive)
        return drive

    @property
    def navigation(self) -> Navigation:
        navigation = self.nodes["navigation"]
        assert isinstance(navigation, Navigation)
        return navigation

    def pose(self) -> Pose:
        """Where the drive believes the robot is."""
        assert self.drive.estimate.pose is not None
        return self.drive.estimate.pose

    def configure(self) -> None:
        """Configure the start of a red team with all robots; stand-ins confirm it."""
        self.core.configure_start(*RED)
        self.run(0.005)
        for name, node in self.nodes.items():
            if isinstance(node, Peer):
                self.say(name, StartConfigurationConfirm())
        self.check()
        self.run(0.005)

    def attach(self, name: str, node: Node) -> None:
        if isinstance(node, Drive):  # nobody sees the robot, unless a test gives the navigation beacons
            put(node, "Estimate.Largest deviation", 0xFFFF)
        super().attach(name, node)

    def check(self) -> None:
        """Answer the node checks from stand-ins."""
        for name, answer in (("drive", CheckDriveResponse()), ("navigation", CheckNaviResponse())):
            if isinstance(self.nodes[name], Peer):
                self.say(name, answer)

    def arrive(self, place: GotoXY) -> None:
        """Report from a stand-in drive that it has arrived at a place."""
        self.say("drive", GotoStateResponse(0), KalmanPositionResponse(*place[:3], Source.INTERNAL))
