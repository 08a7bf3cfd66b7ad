"""A CAN frame, the one value that crosses the boundary between nodes and buses.

Rule of this file: classic CAN data frames with 11-bit identifiers only; whatever else a bus carries is
counted where it arrives and goes no further.
"""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

Data: TypeAlias = bytes | bytearray
"""Data of a frame where it is only read: python-can's messages have a bytearray."""


class Frame(NamedTuple):
    """A data frame: `cob_id` 0..0x7FF and 0 to 8 bytes of `data`."""

    cob_id: int
    data: bytes = b""

    def __str__(self) -> str:
        """Write it as candump does: `008#D27423592C0D9702`."""
        return f"{self.cob_id:03X}#{self.data.hex().upper()}"
