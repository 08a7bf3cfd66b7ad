"""Emergency messages that a master hears, and the errors that a node remembers (CiA 301, 7.2.7, 0x1001 and 0x1003).

Error codes of our own nodes have their own words, all others those of their class in CiA 301.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from eurobot_od.client.master import Procedure, RemoteNode
from eurobot_od.client.streams import AsyncStream, BlockingStream, Stream
from eurobot_od.device.emergency import REGISTER_BITS, ErrorCode, error_words
from eurobot_od.od.standard import ERROR_FIELD, ERROR_REGISTER

# The errors that a node remembers


class RememberedError(NamedTuple):
    """One remembered error: its emergency error `code` and the manufacturer's `info`, 16 bits each."""

    code: int
    info: int


class History(NamedTuple):
    """The error register, and the remembered errors, newest first."""

    register: int
    entries: list[RememberedError]

    @property
    def register_bits(self) -> list[str]:
        """Names of the bits that are set in the register."""
        return [name for bit, name in enumerate(REGISTER_BITS) if self.register >> bit & 1]


@Procedure
async def read_history(node: RemoteNode) -> History:
    """Read the errors of a node. Raises NodeRefused, NoAnswer, BusError."""
    register = (await node.upload.steps(ERROR_REGISTER, "Error register"))[0]
    count = (await node.upload.steps((ERROR_FIELD, 0), "Number of errors"))[0]
    fields = [await node.upload.steps((ERROR_FIELD, sub)) for sub in range(1, count + 1)]
    return History(register, [RememberedError(*struct.unpack_from("<HH", each)) for each in fields])


@Procedure
async def clear_history(node: RemoteNode) -> None:
    """Clear the history; raises as `read_history`."""
    await node.download.steps((ERROR_FIELD, 0), b"\0", "Number of errors")


# Emergency messages


EMCY_BYTES = 8


class Emergency(NamedTuple):
    """An emergency message: its time in seconds, the node, error code, error register and the maker's 5 bytes.

    Code 0 means that an error has gone.
    """

    time: float
    node_id: int
    code: int
    register: int
    data: bytes

    @property
    def text(self) -> str:
        """The words of the code's class in CiA 301."""
        return error_words(self.code, {})

    def __str__(self) -> str:
        data = self.data.hex(" ").upper()
        return f"node {self.node_id}: 0x{self.code:04X} {self.text} (error register 0x{self.register:02X}, data {data})"


class HeardEmergencies(Stream[Emergency]):
    """The common part of both kinds of emergency streams."""

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
        """Take in a frame of the node's EMCY; one of another length is ignored."""
        if len(data) == EMCY_BYTES:
            self.push(Emergency(now, self.node_id, int.from_bytes(data[:2], "little"), data[2], data[3:]))


class EmergencyStream(HeardEmergencies, BlockingStream[Emergency]):
    """A node's emergency messages as they come; `active` has those since the last `no error`, by code."""

    def history(self) -> History:
        """Read the errors that the node remembers (0x1001, 0x1003); raises NodeRefused, NoAnswer, BusError."""
        return read_history(self._node)

    def clear(self) -> None:
        """Have the node forget its errors; raises as `history`."""
        clear_history(self._node)


class AsyncEmergencyStream(HeardEmergencies, AsyncStream[Emergency]):
    """A node's emergency messages as they come; `active` has those since the last `no error`, by code."""

    async def history(self) -> History:
        """Read the errors that the node remembers (0x1001, 0x1003); raises NodeRefused, NoAnswer, BusError."""
        return await read_history.steps(self._node)

    async def clear(self) -> None:
        """Have the node forget its errors; raises as `history`."""
        await clear_history.steps(self._node)
