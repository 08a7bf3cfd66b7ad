"""Stock canopen as the master of one device, wired to it directly: no bus, no thread, no waiting.

Rule of this file: what canopen sends goes into the device at once, and what the device answers into canopen.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import canopen
import pytest
from canopen import SdoAbortedError

from eurobot_od.device.bound import NO_APPLICATION, Application
from eurobot_od.device.device import Device
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.node import Node
from eurobot_od.device.objects import Store
from eurobot_od.device.reaction import Reaction
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import NMT_COB_ID, SYNC_COB_ID, Address, Value
from eurobot_od.sdo.wire import AbortCode
from tests.kit import lift
from tests.kit.lift import CATALOGUE


class Memory:
    """A store for as long as the test runs."""

    def __init__(self) -> None:
        self._values: dict[Address, Value] = {}

    def load(self) -> dict[Address, Value]:
        return dict(self._values)

    def save(self, values: Mapping[Address, Value], node_id: int, kbit: int | None = None) -> None:
        self._values = dict(values)


class Wire(canopen.Network):
    """A network whose only other end is `device`; `now` is the time in seconds, `heard` are the device's frames."""

    def __init__(self, device: Device) -> None:
        super().__init__()
        self.device, self.now = device, 0.0
        self.heard: list[Frame] = []
        self.sdo: Any = self.add_node(device.node_id)
        self._take(self._start())

    def _start(self) -> Reaction:
        return Reaction(self.device.start(self.now))

    def _receive(self, frame: Frame) -> Reaction:
        return self.device.receive(frame, self.now)

    def _tick(self) -> Reaction:
        return self.device.tick(self.now)

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self.send(Frame(can_id, bytes(data)))

    def send(self, frame: Frame) -> Reaction:
        """Send the device a frame."""
        return self._take(self._receive(frame))

    def wait(self, seconds: float) -> Reaction:
        """Advance the time."""
        self.now += seconds
        return self._take(self._tick())

    def command(self, command: NmtCommand, node_id: int = 0) -> Reaction:
        """Send an NMT command, to all nodes unless one is named."""
        return self.send(Frame(NMT_COB_ID, bytes([command, node_id])))

    def _take(self, reaction: Reaction) -> Reaction:
        self.heard += reaction.frames
        for frame in reaction.frames:
            self.notify(frame.cob_id, bytearray(frame.data), self.now)
        return reaction

    def sent(self) -> list[Frame]:
        """Return and forget what the device has sent."""
        heard, self.heard = self.heard, []
        return heard

    # Objects

    def read(self, index: int, subindex: int = 0) -> int:
        """Read a number over SDO."""
        return int.from_bytes(self.sdo.sdo.upload(index, subindex), "little")

    def write(self, index: int, subindex: int, value: int, size: int = 4) -> None:
        """Write a number of `size` bytes over SDO."""
        self.sdo.sdo.download(index, subindex, value.to_bytes(size, "little"))

    def map_pdo(self, index: int, cob_id: int, *entries: int) -> None:
        """Set identifier and mapping of a PDO by CiA 301's procedure (7.5.2.36)."""
        mapping = index + 0x200
        self.write(index, 1, 1 << 31 | self.read(index, 1))
        self.write(mapping, 0, 0, size=1)
        for subindex, entry in enumerate(entries, 1):
            self.write(mapping, subindex, entry)
        self.write(mapping, 0, len(entries), size=1)
        self.write(index, 1, 1 << 31 | cob_id)
        self.write(index, 1, cob_id)

    def refused(self, address: Address, value: int, size: int) -> AbortCode:
        """Write a number that has to be refused; return why it was."""
        with pytest.raises(SdoAbortedError) as refusal:
            self.write(*address, value, size)
        return AbortCode(refusal.value.code)


class NodeWire(Wire):
    """The same with a whole `node` in the place of the device."""

    def __init__(self, node: Node) -> None:
        self.node = node
        super().__init__(node.device)

    def _start(self) -> Reaction:
        return Reaction(self.node.start(self.now))

    def _receive(self, frame: Frame) -> Reaction:
        return Reaction(self.node.receive(frame, self.now))

    def _tick(self) -> Reaction:
        return Reaction(self.node.tick(self.now))

    def run(self, seconds: float) -> None:
        """Advance the time, and call the node whenever it is due."""
        end = self.now + seconds
        while (wakeup := self.node.next_wakeup) <= end:
            self.now = wakeup
            self._take(self._tick())
        self.now = end


def wired(
    node: str = "cabin",
    dialect: str = lift.DIALECT,
    store: Store | None = None,
    application: Application = NO_APPLICATION,
) -> Wire:
    """Return a master and a device that has just booted."""
    return Wire(Device(lift.dictionary(node, dialect), store, CATALOGUE, application))


def with_sync(plain: Dictionary, cob_id: int = SYNC_COB_ID) -> Dictionary:
    """Return a dictionary with an object 0x1005."""
    entries = ("ParameterName=COB-ID SYNC", "DataType=0x0007", "AccessType=rw", f"DefaultValue={cob_id}")
    text = "\n".join((plain.content.decode(), "[1005]", *entries, ""))
    return Dictionary.read(text.encode(), plain.file, plain.node_id)
