"""A CAN frame, the one value that crosses the boundary between nodes and buses.

It is a frame of classic CAN. Nodes and masters do not use 29-bit identifiers, and only send remote frames; whatever
else a bus carries is counted where it arrives, and goes no further. What only listens, such as the decoder, gets all of
these.
"""

from __future__ import annotations

import re
from typing import NamedTuple, TypeAlias

from eurobot_od.errors import LocalError

Data: TypeAlias = bytes | bytearray
"""Data of a frame where it is only read: python-can's messages have a bytearray."""


MOST_BYTES = 8
HIGHEST_IDENTIFIER = 0x7FF

EXTENDED = 1 << 29
"""Bit of a COB-ID that stands for a 29-bit identifier (CiA 301, Tables 67 and 71); no 11-bit one is equal to it."""

HIGHEST_EXTENDED = EXTENDED - 1
"""The highest 29-bit identifier."""

TEXT = re.compile(r"(?P<identifier>[0-7][0-9a-f]{2})#(?P<data>(?:[0-9a-f]{2}\.?)*)", re.IGNORECASE)


class Frame(NamedTuple):
    """A data frame: `cob_id` 0..0x7FF, or EXTENDED and a 29-bit identifier, and 0 to 8 bytes of `data`."""

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
        return f"{identifier_text(self.cob_id)}#{self.data.hex().upper()}"


def identifier_text(cob_id: int) -> str:
    """Write an identifier as candump does: three digits, or eight for one of 29 bits."""
    return f"{cob_id & HIGHEST_EXTENDED:08X}" if cob_id & EXTENDED else f"{cob_id:03X}"


class RemoteFrame(Frame):
    """A remote frame, which asks for the frame of its `cob_id`; of `data` only the length is sent: the answer's.

    It is never equal to a data frame, so that a cache keeps both.
    """

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        """Return whether the other is a remote frame, too, and the same one."""
        return isinstance(other, RemoteFrame) and super().__eq__(other)

    def __ne__(self, other: object) -> bool:
        """Return whether it is not equal; a tuple has a method of its own for that."""
        return not self == other

    def __hash__(self) -> int:
        """Differ from the data frame of the same identifier."""
        return hash((RemoteFrame, self.cob_id, len(self.data)))

    @property
    def is_remote(self) -> bool:
        """Always."""
        return True

    def __str__(self) -> str:
        """Write it as candump does: `705#R1`."""
        return f"{identifier_text(self.cob_id)}#R{len(self.data) or ''}"
