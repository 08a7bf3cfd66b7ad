"""A CAN frame, the one value that crosses the boundary between nodes and buses.

Rule of this file: classic CAN frames with 11-bit identifiers only, and remote frames only to be sent; whatever else a
bus carries is counted where it arrives and goes no further.
"""

from __future__ import annotations

import re
from typing import NamedTuple, TypeAlias

from eurobot_od.errors import LocalError

Data: TypeAlias = bytes | bytearray
"""Data of a frame where it is only read: python-can's messages have a bytearray."""


MOST_BYTES = 8
HIGHEST_IDENTIFIER = 0x7FF

TEXT = re.compile(r"(?P<identifier>[0-7][0-9a-f]{2})#(?P<data>(?:[0-9a-f]{2}\.?)*)", re.IGNORECASE)


class Frame(NamedTuple):
    """A data frame: `cob_id` 0..0x7FF and 0 to 8 bytes of `data`."""

    cob_id: int
    data: bytes = b""

    @property
    def is_remote(self) -> bool:
        """Whether it carries no data, and asks for some."""
        return False

    @classmethod
    def parse(cls, text: str) -> Frame:
        """Read a frame as candump and cansend write it: `185#0102`, dots between bytes allowed; raises LocalError."""
        match = TEXT.fullmatch(text)
        data = match["data"].replace(".", "") if match else ""  # candump's dots are for the eye
        if match is None or len(data) > 2 * MOST_BYTES:
            raise LocalError(
                f"{text!r} is not a frame: write an 11-bit identifier, # and up to {MOST_BYTES} bytes: 185#0102"
            )
        return cls(int(match["identifier"], 16), bytes.fromhex(data))

    def __str__(self) -> str:
        """Write it as candump does: `008#D27423592C01C3A5`."""
        return f"{self.cob_id:03X}#{self.data.hex().upper()}"


class RemoteFrame(Frame):
    """A remote frame, which asks for the frame of its `cob_id`; of `data` only the length is sent: the answer's.

    As a tuple it is equal to a data frame of zeros: `is_remote` tells them apart.
    """

    __slots__ = ()

    @property
    def is_remote(self) -> bool:
        """Always."""
        return True

    def __str__(self) -> str:
        """Write it as candump does: `705#R1`."""
        return f"{self.cob_id:03X}#R{len(self.data) or ''}"
