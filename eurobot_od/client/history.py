"""What a node remembers of its errors: error register 0x1001 and pre-defined error field 0x1003.

Rule of this file: codes of our nodes have their own names, all others the class that CiA 301 gives them.
"""

from __future__ import annotations

from typing import NamedTuple

from eurobot_od.client.master import RemoteNode
from eurobot_od.device.emergency import ErrorCode
from eurobot_od.od.values import Address

REGISTER: Address = (0x1001, 0)
FIELD = 0x1003

REGISTER_BITS = (
    "generic error", "current", "voltage", "temperature",
    "communication", "device profile", "reserved bit 6", "manufacturer specific",
)  # fmt: skip
"""Names of the bits of the error register, bit 0 first (CiA 301, 7.5.2.2)."""

CLASSES = {
    0x00: "no error", 0x10: "generic error", 0x20: "current", 0x21: "current, device input side",
    0x22: "current inside the device", 0x23: "current, device output side", 0x30: "voltage", 0x31: "mains voltage",
    0x32: "voltage inside the device", 0x33: "output voltage", 0x40: "temperature", 0x41: "ambient temperature",
    0x42: "device temperature", 0x50: "device hardware", 0x60: "device software", 0x61: "internal software",
    0x62: "user software", 0x63: "data set", 0x70: "additional modules", 0x80: "monitoring", 0x81: "communication",
    0x82: "protocol error", 0x90: "external error", 0xF0: "additional functions", 0xFF: "device specific",
}  # fmt: skip
"""Classes of emergency error codes by their upper byte (CiA 301, Table 26)."""


class Entry(NamedTuple):
    """One remembered error: its emergency error `code` and the manufacturer's `info`, 16 bits each."""

    code: int
    info: int

    @property
    def text(self) -> str:
        """The error for a person."""
        if self.code in set(ErrorCode):
            return ErrorCode(self.code).name.lower().replace("_", " ")
        return CLASSES.get(self.code >> 8, CLASSES.get(self.code >> 8 & 0xF0, "reserved"))


class History(NamedTuple):
    """The error register, and the remembered errors, newest first."""

    register: int
    entries: list[Entry]

    @property
    def register_bits(self) -> list[str]:
        """Names of the bits that are set in the register."""
        return [name for bit, name in enumerate(REGISTER_BITS) if self.register >> bit & 1]


def history(node: RemoteNode) -> History:
    """Read the errors of a node. Raises NodeRefused, NoAnswer, BusError."""
    register = node.upload(REGISTER, "Error register")[0]
    count = node.upload((FIELD, 0), "Number of errors")[0]
    return History(register, [_entry(node.upload((FIELD, sub))) for sub in range(1, count + 1)])


def clear(node: RemoteNode) -> None:
    """Empty the history; raises as `history` does."""
    node.download((FIELD, 0), b"\0", "Number of errors")


def _entry(data: bytes) -> Entry:
    return Entry(int.from_bytes(data[:2], "little"), int.from_bytes(data[2:4], "little"))
