"""What a log holds: entries with a classic base data frame, or with something else.

Rule of this file: nothing that stands in a log is dropped; what is not such a frame gets a name, its Damage.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import Enum
from typing import BinaryIO, NamedTuple, TypeAlias

from eurobot_od.frame import Frame

MAX_COB_ID = 0x7FF
MAX_LENGTH = 8
"""Highest identifier and longest data of a classic base frame (ISO 11898-1)."""

REMEMBERED = 256
"""For how many distinct frames, or values of a field, their meaning is kept."""


class Damage(Enum):
    """What can be wrong with an entry of a log, worst first; the value is how it is reported."""

    UNREADABLE = "unreadable"
    CUT_OFF = "cut off"
    ERROR_FRAME = "error frame"
    REMOTE = "remote frame"
    FD = "FD frame"
    EXTENDED = "extended frame"
    UNKNOWN_IDENTIFIER = "unknown identifier"
    WRONG_LENGTH = "wrong length"
    OUT_OF_RANGE = "out of range"


class Foreign(NamedTuple):
    """An entry that is not a classic base data frame: why not, and what stands there, shortened."""

    damage: Damage
    text: str


Raw: TypeAlias = Frame | Foreign

LogEntry: TypeAlias = tuple[int, float, str, Raw]
"""One entry of a log: its line (or its number, if there are no lines), time in s, channel, and what stands there."""

Entries: TypeAlias = Iterator[LogEntry]
Read: TypeAlias = Callable[[BinaryIO], Entries]
"""A reader of a format: an open file in, entries out."""


def frame(cob_id: int, data: bytes) -> Frame:
    """Return a classic base data frame; raises ValueError for an identifier or length that it cannot have."""
    if cob_id > MAX_COB_ID or len(data) > MAX_LENGTH:
        raise ValueError(cob_id)
    return tuple.__new__(Frame, (cob_id, data))


def frame_or_foreign(damage: Damage | None, cob_id: int, data: bytes) -> Raw:
    """Return a frame, or with damage what stands there instead; raises ValueError as `frame`."""
    return Foreign(damage, shortened(f"{cob_id:03X}#{data.hex().upper()}")) if damage else frame(cob_id, data)


def shortened(text: str | bytes, length: int = 60) -> str:
    """Return text for a report: one line of printable characters, at most `length` long."""
    plain = text.decode("ascii", "backslashreplace") if isinstance(text, bytes) else text
    shown = "".join(each if each.isprintable() else " " for each in plain.strip())
    return shown if len(shown) <= length else shown[: length - 3] + "..."
