"""The emergency messages that a master hears from a node, and the errors that the node remembers (CiA 301, 7.2.7)."""

from __future__ import annotations

from typing import NamedTuple

from eurobot_od.client import history
from eurobot_od.client.history import History
from eurobot_od.client.master import RemoteNode
from eurobot_od.client.streams import AsyncStream, BlockingStream, Stream
from eurobot_od.device.emergency import ErrorCode, error_words

EMCY_BYTES = 8


class Emergency(NamedTuple):
    """An emergency message: when it came in seconds, from which node, error code, error register, 5 bytes of the maker.

    Code 0 says that an error has gone.
    """

    time: float
    node_id: int
    code: int
    register: int
    data: bytes

    @property
    def text(self) -> str:
        """The code in words: CiA 301's class of it."""
        return error_words(self.code, {})

    def __str__(self) -> str:
        data = self.data.hex(" ").upper()
        return f"node {self.node_id}: 0x{self.code:04X} {self.text} (error register 0x{self.register:02X}, data {data})"


class HeardEmergencies(Stream[Emergency]):
    """What both kinds of emergency streams have in common."""

    def __init__(self, node: RemoteNode) -> None:
        super().__init__(node.master, "emergency message", node.node_id)
        self._node = node
        self.active: dict[int, Emergency] = {}

    def push(self, item: Emergency) -> None:
        if item.code == ErrorCode.NO_ERROR:
            self.active.clear()
        else:
            self.active[item.code] = item
        super().push(item)

    def hear(self, data: bytes, now: float) -> None:
        """Take in a frame of the node's EMCY; one of another length is none."""
        if len(data) == EMCY_BYTES:
            self.push(Emergency(now, self.node_id, int.from_bytes(data[:2], "little"), data[2], data[3:]))


class EmergencyStream(HeardEmergencies, BlockingStream[Emergency]):
    """A node's emergency messages as they come; `active` has those since the last `no error`, by code."""

    def history(self) -> History:
        """Read the errors that the node remembers (0x1001, 0x1003); raises NodeRefused, NoAnswer, BusError."""
        return history.history(self._node)

    def clear(self) -> None:
        """Have the node forget its errors; raises as `history`."""
        history.clear(self._node)


class AsyncEmergencyStream(HeardEmergencies, AsyncStream[Emergency]):
    """A node's emergency messages as they come; `active` has those since the last `no error`, by code."""

    async def history(self) -> History:
        """Read the errors that the node remembers (0x1001, 0x1003); raises NodeRefused, NoAnswer, BusError."""
        return await history.history.steps(self._node)

    async def clear(self) -> None:
        """Have the node forget its errors; raises as `history`."""
        await history.clear.steps(self._node)
