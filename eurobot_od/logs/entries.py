"""What a log holds: entries with a classic base data frame, or with something else.

Nothing in a log is dropped; an entry that is not such a frame gets a name, its Damage.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from enum import Enum
from struct import error as StructError  # noqa: N812 (a class with a small name)
from typing import BinaryIO, NamedTuple, TypeAlias, TypeVar

from eurobot_od.frame import HIGHEST_IDENTIFIER, MOST_BYTES, Frame

REMEMBERED = 256
"""Distinct frames, or values of a field, whose meaning is cached."""


LARGEST = 1 << 20
"""Most bytes of a line, or of a record, that a log may have by default; 20 times the usual."""

LATEST = 1e11
"""A time in s that no log has; it also sorts out `nan` and `inf`."""


class Damage(Enum):
    """Defects of a log entry, worst first; the value is the word in reports."""

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
    """An entry that is not a classic base data frame: the reason, and its text, shortened."""

    damage: Damage
    text: str


Raw: TypeAlias = Frame | Foreign

LogEntry: TypeAlias = tuple[int, float, str, Raw]
"""One entry of a log: its line (or its number, if there are no lines), time in s, channel, and what stands there."""

Entries: TypeAlias = Iterator[LogEntry]
Read: TypeAlias = Callable[[BinaryIO, int], Entries]
"""A reader of a format: an open file, and the most bytes of a line or record, in; entries out."""

BAD = (ValueError, LookupError, TypeError, ArithmeticError, StructError)
"""What a reader raises for an entry that it cannot read."""

Item = TypeVar("Item")


def read_each(items: Iterable[Item], entry: Callable[[Item], tuple[float, str, Raw]]) -> Entries:
    """Read items of a log; `entry` gives time in s, channel and what stands there, or raises one of BAD.

    A bad one is Foreign, with the time of the entry before, and costs no other.
    """
    time = 0.0
    for number, item in enumerate(items, 1):
        try:
            time, channel, raw = entry(item)
        except BAD as error:
            yield number, time, "", Foreign(Damage.UNREADABLE, shortened(str(error)))
        else:
            yield number, time, channel, raw


def seconds(text: bytes | float) -> float:
    """Read a time in s; raises ValueError or TypeError."""
    time = float(text)
    # In this form, as every comparison with `nan` is false.
    if not 0 <= time < LATEST:
        raise ValueError(text)
    return time


def frame(cob_id: int, data: bytes) -> Frame:
    """Return a classic base data frame; raises ValueError for an identifier or length that it cannot have."""
    if not 0 <= cob_id <= HIGHEST_IDENTIFIER or len(data) > MOST_BYTES:
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
