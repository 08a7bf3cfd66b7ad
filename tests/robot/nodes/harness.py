"""The three nodes, or stand-ins for some of them, on a simulated bus, and what went over it.

Rule of this file: nothing here behaves like a node; what a stand-in sends is what the test tells it to.
"""

from __future__ import annotations

import itertools
from collections.abc import Coroutine
from typing import Any, NamedTuple, TypeVar

from eurobot_od.bus.simulated import loop
from eurobot_od.bus.simulated.network import ON_TIME, Simulation
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.station import Station
from eurobot_od.errors import RemoteError
from eurobot_od.frame import Frame
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.pdo.kinds import Message, MessageT
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

Result = TypeVar("Result")

PROTOCOL = EurobotProtocol.load()
DICTIONARIES = {each.name: each for each in dialects.load_all()}
RED = StartConfigurationSet(TeamColour.RED, 2, 1, 30, 20)
"""A start configuration in which everyone is there."""
TUNING = Drive(DICTIONARIES["drive"]).estimate.tuning._replace(latency=0.0)
"""The tuning of the Kalman filter by the settings' defaults, but for positions of this moment."""


def as_if_started(core: Core) -> None:
    """Have a core send gotos as if its nodes had been checked and configured: for a test in which nobody answers."""
    core.readiness.checked |= {"drive", "navigation"}
    core.readiness.configured = True


def put(node: Node, setting: str, value: int) -> None:
    """Give a setting a value."""
    node.device.objects.put(node.device.dictionary.address(setting), value)


class Peer(Node):
    """Stands in for a node: it answers nothing, and says what it is told, whatever that is."""

    def say(self, *what: Message | Frame) -> None:
        """Send messages and frames at once, so that the most urgent one leaves first."""
        for each in what:
            self.put(each if isinstance(each, Frame) else PROTOCOL.encode(each))


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


class Sent(NamedTuple):
    """A message on the bus and when it was through, s."""

    time: float
    message: Message


class Bench:
    """The three nodes on a simulated bus, running; those named in `peers` are stand-ins.

    `log` is every message on the bus, `others` every other frame.
    """

    def __init__(self, *peers: str) -> None:
        self.network = Simulation()
        self.network.observers.append(self._observe)
        self.log: list[Sent] = []
        self.others: list[tuple[float, Frame]] = []
        self.nodes: dict[str, Node] = {}
        self.stations: dict[str, Station] = {}
        for name, role in ROLES.items():
            self.attach(name, (Peer if name in peers else role)(DICTIONARIES[name]))
        self.run(0.01)

    def _observe(self, time: float, frame: Frame) -> None:
        try:
            self.log.append(Sent(time, PROTOCOL.decode(*frame)))
        except RemoteError:
            self.others.append((time, frame))

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

    def peer(self, name: str) -> Peer:
        """Return a stand-in."""
        peer = self.nodes[name]
        assert isinstance(peer, Peer)
        return peer

    @property
    def now(self) -> float:
        return self.network.now

    def pose(self) -> Pose:
        """Where the drive believes the robot is."""
        assert self.drive.estimate.pose is not None
        return self.drive.estimate.pose

    # What happens

    def run(self, seconds: float) -> None:
        """Let the time pass."""
        self.network.run(self.network.now + seconds)

    def say(self, peer: str, *what: Message | Frame, within: float = 0.01) -> None:
        """Have a stand-in send messages and frames, each when the one before got through, then let time pass."""
        for each in what:
            self.peer(peer).say(each)
            self.run(0.001)
        self.run(within)

    def command(self, peer: str, command: NmtCommand, node_id: int = 0) -> None:
        """Have a stand-in send an NMT command."""
        self.say(peer, Frame(NMT_COB_ID, bytes([command, node_id])))

    def play(self, coroutine: Coroutine[Any, Any, Result]) -> Result:
        """Run a coroutine to its end in simulated time."""
        return loop.run(self.network, coroutine)

    def configure(self) -> None:
        """Have the core configure the start for a red team with everyone there; stand-ins confirm it."""
        self.core.configure_start(*RED)
        self.run(0.005)
        for name, node in self.nodes.items():
            if isinstance(node, Peer):
                self.say(name, StartConfigurationConfirm())
        self.check()
        self.run(0.005)

    def replace(self, name: str, node: Node) -> None:
        """Put another node in the place of one, switched on now; a drive that boots anew, for example."""
        self.network.detach(self.stations[name])
        self.attach(name, node)

    def attach(self, name: str, node: Node) -> None:
        """Switch on a node that takes the place of one that is gone."""
        self.nodes[name] = node
        if isinstance(node, Drive):  # nobody sees the robot, unless a test gives the navigation beacons
            put(node, "Estimate.Largest deviation", 0xFFFF)
        self.stations[name] = self.network.attach(node, start=self.now)

    def lose(self, *message_types: type[Message], count: int | None = None) -> None:
        """Have the next `count` frames of these messages reach nobody, None: all from now on; nothing else is lost."""
        cob_ids = {PROTOCOL.cob_id(each) for each in message_types}
        left = itertools.count() if count is None else iter(range(count))

        def disturb(_: float, frame: Frame) -> tuple[float, ...]:
            return () if frame.cob_id in cob_ids and next(left, None) is not None else ON_TIME

        self.network.disturb = disturb

    def check(self) -> None:
        """Have stand-ins answer the node checks."""
        for name, answer in (("drive", CheckDriveResponse()), ("navigation", CheckNaviResponse())):
            if isinstance(self.nodes[name], Peer):
                self.say(name, answer)

    def arrive(self, place: GotoXY) -> None:
        """Have a stand-in drive say that it has arrived, at a place."""
        self.say("drive", GotoStateResponse(0), KalmanPositionResponse(*place[:3], Source.INTERNAL))

    # What was sent

    def emergencies(self, name: str) -> list[int]:
        """Return the error codes that a node has reported by EMCY so far."""
        cob_id = 0x080 + self.nodes[name].device.node_id
        return [int.from_bytes(frame.data[:2], "little") for _, frame in self.others if frame.cob_id == cob_id]

    def messages(self) -> list[Message]:
        """Return all messages so far in the order they were on the bus."""
        return [sent.message for sent in self.log]

    def sent(self, message_type: type[MessageT]) -> list[MessageT]:
        """Return the messages of a type so far."""
        return [message for _, message in self.log if isinstance(message, message_type)]

    def times(self, *message_types: type[Message]) -> list[float]:
        """Return when messages of these types were on the bus, s."""
        return [time for time, message in self.log if isinstance(message, message_types)]
