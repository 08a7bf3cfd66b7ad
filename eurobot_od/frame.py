"""A CAN frame, the value that nodes and buses exchange.

It is a frame of classic CAN. Nodes and masters use no 29-bit identifiers; other frames of a bus are counted on arrival
and dropped. The decoder and other listeners get all frames.
"""

from __future__ import annotations

import re
from typing import Any, NamedTuple, TypeAlias

from eurobot_od.errors import FieldError, LocalError

Data: TypeAlias = bytes | bytearray
"""Data of a frame that is only read; python-can's messages have a bytearray."""


MOST_BYTES = 8
HIGHEST_IDENTIFIER = 0x7FF

EXTENDED = 1 << 29
"""Bit of a COB-ID that marks a 29-bit identifier (CiA 301, Tables 67 and 71)."""

HIGHEST_EXTENDED = EXTENDED - 1
"""The highest 29-bit identifier."""

TEXT = re.compile(
    r"(?P<identifier>[0-7][0-9a-f]{2})#(?:R(?P<remote>[0-8]?)|(?P<data>(?:[0-9a-f]{2}\.?)*))", re.IGNORECASE
)


class Frame(NamedTuple):
    """A data frame: `cob_id` 0 to 0x7FF, or EXTENDED and a 29-bit identifier, and 0 to 8 bytes of `data`."""

    cob_id: int
    data: bytes = b""

    @property
    def is_remote(self) -> bool:
        """Whether the frame carries no data, but requests some."""
        return False

    @classmethod
    def checked(cls, cob_id: Any, data: Any) -> Frame:
        """Return a frame that a program gives; raises FieldError unless the bus can carry it."""
        if not isinstance(cob_id, int) or cob_id not in range(HIGHEST_IDENTIFIER + 1):
            raise FieldError("frame", "identifier", cob_id, f"0..0x{HIGHEST_IDENTIFIER:03X}")
        try:
            content = None if isinstance(data, (str, int)) else bytes(data)
        except (TypeError, ValueError):
            content = None
        if content is None or len(content) > MOST_BYTES:
            as_bytes = f", such as bytes.fromhex({data!r})" if isinstance(data, str) else ""
            raise FieldError(f"frame 0x{cob_id:03X}", "data", data, f"up to {MOST_BYTES} bytes{as_bytes}")
        return cls(cob_id, content)

    @classmethod
    def parse(cls, text: str) -> Frame:
        """Parse a frame as candump and cansend write it, with optional dots between bytes; raises LocalError.

        `185#0102` is a data frame, `705#R1` a remote frame.
        """
        match = TEXT.fullmatch(text)
        data = (match["data"] or "").replace(".", "") if match else ""  # candump may separate bytes by dots
        if match is None or len(data) > 2 * MOST_BYTES:
            raise LocalError(
                f"{text!r} is not a frame: write an 11-bit identifier, # and up to {MOST_BYTES} bytes: 185#0102, or R "
                "and a length for a remote frame: 705#R1"
            )
        cob_id, remote = int(match["identifier"], 16), match["remote"]
        return cls(cob_id, bytes.fromhex(data)) if remote is None else RemoteFrame(cob_id, bytes(int(remote or 0)))

    def __str__(self) -> str:
        """Return the frame as candump writes it: `008#D27423592C01C3A5`."""
        return f"{identifier_text(self.cob_id)}#{self.data.hex().upper()}"


def identifier_text(cob_id: int) -> str:
    """Return an identifier as candump writes it: three digits, or eight for one of 29 bits."""
    return f"{cob_id & HIGHEST_EXTENDED:08X}" if cob_id & EXTENDED else f"{cob_id:03X}"


class RemoteFrame(Frame):
    """A remote frame, which requests the frame with its `cob_id`; of `data` only the length is sent.

    It never equals a data frame, so that a cache keeps both.
    """

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        """Return whether the other is an equal remote frame."""
        return isinstance(other, RemoteFrame) and super().__eq__(other)

    def __ne__(self, other: object) -> bool:
        """Return whether the other is not equal; without this, the tuple's own method would be used."""
        return not self == other

    def __hash__(self) -> int:
        """Return another hash than that of the data frame."""
        return hash((RemoteFrame, self.cob_id, len(self.data)))

    @property
    def is_remote(self) -> bool:
        """True."""
        return True

    def __str__(self) -> str:
        """Return the frame as candump writes it: `705#R1`."""
        return f"{identifier_text(self.cob_id)}#R{len(self.data) or ''}"
