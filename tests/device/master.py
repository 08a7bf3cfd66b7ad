"""Stock canopen as the master of one device, wired to it directly: no bus, no thread, no waiting.

Rule of this file: what canopen sends goes into the device at once, and what the device answers into canopen.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import canopen
import pytest
from canopen import SdoAbortedError

from eurobot_od.device.device import Device, Reaction
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.storage import Store
from eurobot_od.frame import Frame
from eurobot_od.od.values import NMT_COB_ID, Address, Value
from eurobot_od.robot import dialects
from eurobot_od.robot.messages import CATALOGUE
from eurobot_od.sdo.wire import AbortCode


class Memory:
    """A store for as long as the test runs."""

    def __init__(self) -> None:
        self._values: dict[Address, Value] = {}

    def load(self) -> dict[Address, Value]:
        return dict(self._values)

    def save(self, values: Mapping[Address, Value], node_id: int) -> None:
        self._values = dict(values)


class Wire(canopen.Network):
    """A network whose only other end is `device`; `now` is the time in seconds, `heard` are the device's frames."""

    def __init__(self, device: Device) -> None:
        super().__init__()
        self.device, self.now = device, 0.0
        self.heard: list[Frame] = []
        self.sdo: Any = self.add_node(device.node_id)
        self._take(Reaction(device.start(self.now)))

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        self.send(Frame(can_id, bytes(data)))

    def send(self, frame: Frame) -> Reaction:
        """Give the device a frame."""
        return self._take(self.device.receive(frame, self.now))

    def wait(self, seconds: float) -> Reaction:
        """Let the time pass."""
        self.now += seconds
        return self._take(self.device.tick(self.now))

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
        """Give a PDO an identifier and a mapping by CiA 301's procedure (7.5.2.36)."""
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


def wired(node: str = "drive", dialect: str = "canopen", store: Store | None = None) -> Wire:
    """Return a master and a device that has just booted."""
    return Wire(Device(dialects.load(node, dialect), store, CATALOGUE))
