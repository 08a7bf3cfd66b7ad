"""Nodes, or stand-ins for some of them, on a simulated bus, and what went over it; by default the three of the lift.

Rule of this file: nothing here behaves like a node; what a stand-in sends is what the test tells it to.
"""

from __future__ import annotations

import itertools
from collections.abc import Coroutine, Mapping
from typing import Any, NamedTuple, TypeVar

from eurobot_od.bus.simulated import loop
from eurobot_od.bus.simulated.network import ON_TIME, Simulation
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.node import Node
from eurobot_od.device.station import Station
from eurobot_od.errors import RemoteError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.pdo.kinds import Message, MessageT
from eurobot_od.pdo.protocol import Protocol
from tests.kit import lift

Result = TypeVar("Result")


def put(node: Node, setting: str, value: int) -> None:
    """Set a setting."""
    node.device.objects.put(node.device.dictionary.address(setting), value)


class Peer(Node):
    """Stands in for a node: it answers nothing, and says what it is told, whatever that is, in the `protocol`."""

    protocol: Protocol = lift.protocol()

    def say(self, *what: Message | Frame) -> None:
        """Send messages and frames at once, so that the most urgent one leaves first."""
        for each in what:
            self.put(each if isinstance(each, Frame) else self.protocol.encode(each))


class Sent(NamedTuple):
    """A message on the bus and when it was through, s."""

    time: float
    message: Message


class Bench:
    """Nodes on a simulated bus, running.

    `log` is every message on the bus, `others` every other frame.
    """

    def __init__(self, protocol: Protocol, nodes: Mapping[str, Node]) -> None:
        self.protocol, self.network = protocol, Simulation()
        self.network.observers.append(self._observe)
        self.log: list[Sent] = []
        self.others: list[tuple[float, Frame]] = []
        self.nodes: dict[str, Node] = {}
        self.stations: dict[str, Station] = {}
        for name, each in nodes.items():
            self.attach(name, each)
        self.run(0.01)

    def _observe(self, time: float, frame: Frame) -> None:
        try:
            self.log.append(Sent(time, self.protocol.decode(*frame)))
        except RemoteError:
            self.others.append((time, frame))

    def peer(self, name: str) -> Peer:
        """Return a stand-in."""
        peer = self.nodes[name]
        assert isinstance(peer, Peer)
        return peer

    @property
    def now(self) -> float:
        """The time, in s."""
        return self.network.now

    # What happens

    def run(self, seconds: float) -> None:
        """Advance the simulated time."""
        self.network.run(self.network.now + seconds)

    def say(self, peer: str, *what: Message | Frame, within: float = 0.01) -> None:
        """Send messages and frames from a stand-in, each when the one before got through, then advance the time."""
        for each in what:
            self.peer(peer).say(each)
            self.run(0.001)
        self.run(within)

    def command(self, peer: str, command: NmtCommand, node_id: int = 0) -> None:
        """Send an NMT command from a stand-in."""
        self.say(peer, Frame(NMT_COB_ID, bytes([command, node_id])))

    def play(self, coroutine: Coroutine[Any, Any, Result]) -> Result:
        """Run a coroutine to its end in simulated time."""
        return loop.run(self.network, coroutine)

    def replace(self, name: str, node: Node) -> None:
        """Put another node in the place of one, switched on now; one that boots anew, for example."""
        self.network.detach(self.stations[name])
        self.attach(name, node)

    def attach(self, name: str, node: Node) -> None:
        """Switch on a node that takes the place of one that is gone."""
        self.nodes[name] = node
        self.stations[name] = self.network.attach(node, start=self.now)

    def lose(self, *message_types: type[Message], count: int | None = None) -> None:
        """Lose the next `count` frames of these messages, None: all from now on; nothing else is lost."""
        cob_ids = {self.protocol.cob_id(each) for each in message_types}
        left = itertools.count() if count is None else iter(range(count))

        def disturb(_: float, frame: Frame) -> tuple[float, ...]:
            return () if frame.cob_id in cob_ids and next(left, None) is not None else ON_TIME

        self.network.disturb = disturb

    def download(self, peer: str, name: str, index: int, subindex: int, value: int, size: int = 4) -> None:
        """Write a number to a node from a stand-in: an expedited download (CiA 301, 7.2.4.3.3)."""
        node_id = self.nodes[name].device.node_id
        address = index.to_bytes(2, "little") + bytes([subindex])
        request = bytes([0x23 | 4 - size << 2]) + address + value.to_bytes(4, "little")
        before = len(self.others)
        self.say(peer, Frame(0x600 + node_id, request))
        answers = [frame.data for _, frame in self.others[before:] if frame.cob_id == 0x580 + node_id]
        assert answers == [b"\x60" + address + bytes(4)]

    # What was sent

    def frames(self, cob_id: int) -> list[bytes]:
        """Return the data of all frames so far that are no message and have this COB-ID."""
        return [frame.data for _, frame in self.others if frame.cob_id == cob_id]

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


class Lift(Bench):
    """The lift on a simulated bus; those named in `peers` are stand-ins."""

    def __init__(self, *peers: str) -> None:
        files: dict[str, Dictionary] = {name: lift.dictionary(name) for name in lift.ROLES}
        nodes = {name: (Peer if name in peers else role)(files[name]) for name, role in lift.ROLES.items()}
        super().__init__(lift.protocol(), nodes)

    @property
    def panel(self) -> lift.Panel:
        """The panel."""
        panel = self.nodes["panel"]
        assert isinstance(panel, lift.Panel)
        return panel

    @property
    def cabin(self) -> lift.Cabin:
        """The cabin."""
        cabin = self.nodes["cabin"]
        assert isinstance(cabin, lift.Cabin)
        return cabin

    @property
    def door(self) -> lift.Door:
        """The door."""
        door = self.nodes["door"]
        assert isinstance(door, lift.Door)
        return door
