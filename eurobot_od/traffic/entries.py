"""What a log holds: entries with a classic frame, or with something else.

Nothing in a log is dropped; an entry that is not such a frame gets a name, its Damage. A frame with a 29-bit identifier
has EXTENDED in its COB-ID.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from enum import Enum
from struct import error as StructError  # noqa: N812 (a class with a small name)
from typing import BinaryIO, NamedTuple, TypeAlias, TypeVar

from eurobot_od.frame import EXTENDED, HIGHEST_EXTENDED, HIGHEST_IDENTIFIER, MOST_BYTES, Frame, RemoteFrame

MASTER = "master"
"""What the master of a network is called if it is not one of its devices and has no other name."""

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
    FD = "FD frame"
    UNKNOWN_IDENTIFIER = "unknown identifier"
    SWITCHED_OFF = "switched off"
    INCOMPLETE = "incomplete transfer"
    WRONG_LENGTH = "wrong length"
    OUT_OF_RANGE = "out of range"


class Foreign(NamedTuple):
    """An entry that is not a classic frame: the reason, and its text, shortened."""

    damage: Damage
    text: str

    @property
    def is_read(self) -> bool:
        """Whether it is something that a bus can carry, and not text that nobody understands."""
        return self.damage not in (Damage.UNREADABLE, Damage.CUT_OFF)


LONGEST_FOREIGN = 140
"""Characters of a frame of CAN FD, with its 64 bytes."""

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


def frame(identifier: int, data: bytes, extended: object = False, remote_length: int | None = None) -> Frame:
    """Return a classic frame, a remote one of `remote_length`, if that is not None; both flags as a log has them.

    Raises ValueError for an identifier or length that it cannot have.
    """
    highest, bit = (HIGHEST_EXTENDED, EXTENDED) if extended else (HIGHEST_IDENTIFIER, 0)
    if not 0 <= identifier <= highest or len(data) > MOST_BYTES:
        raise ValueError(identifier)
    if remote_length is not None:  # a DLC of 9 to 15 means 8 bytes, too (ISO 11898-1)
        return RemoteFrame(bit | identifier, bytes(min(remote_length, MOST_BYTES)))
    return tuple.__new__(Frame, (bit | identifier, data))


def foreign(damage: Damage, identifier: int, data: bytes) -> Foreign:
    """Return what is not a classic frame, but has an identifier and data."""
    return Foreign(damage, shortened(f"{identifier:03X}#{data.hex().upper()}", LONGEST_FOREIGN))


def shortened(text: str | bytes, length: int = 60) -> str:
    """Return text for a report: one line of printable characters, at most `length` long."""
    plain = text.decode("ascii", "backslashreplace") if isinstance(text, bytes) else text
    shown = "".join(each if each.isprintable() else " " for each in plain.strip())
    return shown if len(shown) <= length else shown[: length - 3] + "..."
