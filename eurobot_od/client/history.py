"""The errors that a node remembers: error register 0x1001 and pre-defined error field 0x1003.

Codes of our nodes have their own names, all others the class that CiA 301 gives them.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from eurobot_od.client.master import RemoteNode
from eurobot_od.client.procedure import Procedure
from eurobot_od.device.emergency import REGISTER_BITS
from eurobot_od.od.standard import ERROR_FIELD, ERROR_REGISTER


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
async def history(node: RemoteNode) -> History:
    """Read the errors of a node. Raises NodeRefused, NoAnswer, BusError."""
    register = (await node.upload.steps(ERROR_REGISTER, "Error register"))[0]
    count = (await node.upload.steps((ERROR_FIELD, 0), "Number of errors"))[0]
    fields = [await node.upload.steps((ERROR_FIELD, sub)) for sub in range(1, count + 1)]
    return History(register, [RememberedError(*struct.unpack_from("<HH", each)) for each in fields])


@Procedure
async def clear(node: RemoteNode) -> None:
    """Empty the history; raises as `history` does."""
    await node.download.steps((ERROR_FIELD, 0), b"\0", "Number of errors")
