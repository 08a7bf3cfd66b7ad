"""Entries of a log, with a classic frame or something else; and batches of them by columns.

Nothing in a log is dropped; an entry that is not such a frame gets a name, its Damage. A frame with a 29-bit identifier
has EXTENDED in its COB-ID.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from enum import Enum
from itertools import chain
from struct import error as StructError  # noqa: N812 (a class with a small name)
from typing import Any, NamedTuple, TypeAlias, TypeVar

from eurobot_od.frame import EXTENDED, HIGHEST_EXTENDED, HIGHEST_IDENTIFIER, MOST_BYTES, Frame, RemoteFrame
from eurobot_od.support.files import UNREADABLE, why_unreadable

MASTER = "master"
"""Default name of a master that is not one of the devices."""

REMEMBERED = 256
"""Number of distinct frames, or values of a field, whose meaning is cached."""


LARGEST = 1 << 20
"""Default maximum size of a line or record, in bytes; 20 times the usual."""

LATEST = 1e11
"""Upper limit of times, in s; it also rejects `nan` and `inf`."""


class Damage(Enum):
    """Defects of a log entry, worst first; the value is the word in reports."""

    UNREADABLE = "unreadable"
    CUT_OFF = "cut off"
    ERROR_FRAME = "error frame"
    FD = "FD frame"
    UNKNOWN_IDENTIFIER = "unknown identifier"
    SWITCHED_OFF = "switched off"
    UNKNOWN_MAPPING = "unknown mapping"
    INCOMPLETE = "incomplete transfer"
    WRONG_LENGTH = "wrong length"
    OUT_OF_RANGE = "out of range"
    OTHERS = "other identifiers"
    """No defect: a frame whose identifier is beyond the maximum number of distinct ones."""


class Foreign(NamedTuple):
    """An entry that is not a classic frame: its damage, and its text, shortened."""

    damage: Damage
    text: str

    @property
    def frame(self) -> tuple[int, bytes] | None:
        """COB-ID and data of a CAN FD frame, None for other entries."""
        found = FOREIGN_FRAME.fullmatch(self.text) if self.damage is Damage.FD else None
        if found is None:
            return None
        extended = EXTENDED * (len(found["identifier"]) == EXTENDED_DIGITS)
        return int(found["identifier"], 16) | extended, bytes.fromhex(found["data"])

    @property
    def has_bit_rate_switch(self) -> bool | None:
        """Whether a CAN FD frame's data had a higher bit rate; None if the log does not record it."""
        found = FOREIGN_FRAME.fullmatch(self.text) if self.damage is Damage.FD else None
        return bool(int(found["flags"], 16) & BIT_RATE_SWITCH) if found and found["flags"] else None

    @property
    def is_read(self) -> bool:
        """Whether a bus can carry it, so that it is not unreadable text."""
        return self.damage not in (Damage.UNREADABLE, Damage.CUT_OFF)


LONGEST_FOREIGN = 140
"""Maximum number of characters of a CAN FD frame with 64 bytes."""

BIT_RATE_SWITCH = 1
"""Bit of the flags of a frame of CAN FD (CANFD_BRS, linux/can.h)."""

EXTENDED_DIGITS = 8
"""Digits of a 29-bit identifier in candump; an 11-bit one has three."""

FOREIGN_FRAME = re.compile(
    r"(?P<identifier>[0-9A-F]{3}|[0-9A-F]{8})#(?:#(?P<flags>[0-9A-F]))?(?P<data>(?:[0-9A-F]{2})*)", re.I
)
"""Text of a CAN FD frame; candump writes the flags after a second `#`."""

Raw: TypeAlias = Frame | Foreign

Timed: TypeAlias = tuple[float, Raw]
"""Time in s and entry."""

LogEntry: TypeAlias = tuple[int, float, str, Raw]
"""An entry of a log: its line (or number, if there are no lines), time in s, channel, and content."""

Entries: TypeAlias = Iterator[LogEntry]


class Stamps(Sequence[float]):
    """Time stamps in s as texts of a log, converted on access."""

    def __init__(self, stamps: Sequence[str]) -> None:
        self._stamps = stamps

    def __len__(self) -> int:
        return len(self._stamps)

    def __iter__(self) -> Iterator[float]:
        return map(float, self._stamps)

    def __getitem__(self, place: Any) -> Any:
        found = self._stamps[place]
        return Stamps(found) if isinstance(place, slice) else float(found)


class Batch(NamedTuple):
    """Consecutive entries of a log by columns: lines, times in s, channels, and contents.

    A data frame has its COB-ID among the `heads`, and its `data`; for anything else the Raw itself is the head.
    `stamps` are the times as text with six decimals, None where the log does not have them so.
    """

    lines: Sequence[int]
    times: Sequence[float]
    channels: Sequence[str]
    heads: Sequence[int | Raw]
    data: Sequence[bytes]
    stamps: Sequence[str] | None = None

    @classmethod
    def of(cls, entries: Iterable[LogEntry]) -> Batch:
        """Return entries as a batch."""
        lines, times, channels, raws = tuple(zip(*entries)) or ((), (), (), ())
        heads = [raw[0] if raw.__class__ is Frame else raw for raw in raws]
        return cls(lines, times, channels, heads, [raw[1] if raw.__class__ is Frame else b"" for raw in raws])

    @classmethod
    def joined(cls, parts: Sequence[Batch]) -> Batch:
        """Return consecutive batches as one."""
        if len(parts) == 1:
            return parts[0]
        return cls(*(list(chain.from_iterable(each)) for each in zip(*map(_stamped, parts))))

    def part(self, first: int, end: int) -> Batch:
        """Return the entries from a place up to another one, which is no longer in it."""
        wanted = slice(first, end)
        lines, times, channels = self.lines[wanted], self.times[wanted], self.channels[wanted]
        stamps = self.stamps and self.stamps[wanted]
        return Batch(lines, times, channels, self.heads[wanted], self.data[wanted], stamps)

    def raw(self, place: int) -> Raw:
        """Return the entry at a place in the batch."""
        return _raw(self.heads[place], self.data[place])

    def grouped(self, places: Sequence[int]) -> dict[int | Raw, list[int]]:
        """Return places, in order, by their heads."""
        groups = defaultdict[int | Raw, list[int]](list)
        heads = self.heads
        for place in places:
            groups[heads[place]].append(place)
        return groups

    def entries(self) -> Entries:
        """Return the entries one by one."""
        return zip(self.lines, self.times, self.channels, map(_raw, self.heads, self.data))

    @property
    def is_of_one_channel(self) -> bool:
        """Whether all entries have one channel."""
        return self.channels.count(self.channels[0]) == len(self.channels)

    @property
    def is_read(self) -> bool:
        """Whether any entry is not unreadable text."""
        return any(not isinstance(head, Foreign) or head.is_read for head in self.heads)


def _raw(head: int | Raw, data: bytes) -> Raw:
    """Return an entry from its head and data."""
    # `tuple.__new__` is faster than the constructor of the named tuple, and logs have millions of entries.
    return tuple.__new__(Frame, (head, data)) if isinstance(head, int) else head


def _stamped(batch: Batch) -> Batch:
    return batch if batch.stamps is not None else batch._replace(stamps=[f"{time:.6f}" for time in batch.times])


def gathered(entries: Entries, most: int) -> Iterator[Batch]:
    """Yield entries in batches of at most `most`; entries before an error come before it is raised."""
    some: list[LogEntry] = []
    try:
        for entry in entries:
            some.append(entry)
            if len(some) >= most:
                yield Batch.of(some)
                some = []
    except Exception:
        if some:
            yield Batch.of(some)
        raise
    if some:
        yield Batch.of(some)


BAD = (ValueError, LookupError, TypeError, ArithmeticError, StructError)
"""Exceptions of a reader for an entry that it cannot read."""

Item = TypeVar("Item")


Reason: TypeAlias = Callable[[Exception], Foreign | None]
"""Returns an entry for an error that ends the reading of a log; None for other errors."""


def read_each(items: Iterable[Item], entry: Callable[[Item], tuple[float, str, Raw]], reason: Reason) -> Entries:
    """Read items of a log; `entry` returns time in s, channel and content, or raises one of BAD.

    A bad one is Foreign, with the time of the entry before, and costs no other. Where the items themselves end with an
    error that has a `reason`, the last entry is that.
    """
    number, time = 0, 0.0
    try:
        for number, item in enumerate(items, 1):
            try:
                time, channel, raw = entry(item)
            except BAD as error:
                yield number, time, "", Foreign(Damage.UNREADABLE, shortened(str(error)))
            else:
                yield number, time, channel, raw
    except Exception as error:
        why = reason(error)
        if why is None and isinstance(error, UNREADABLE):  # of a library that does not document its errors
            why = Foreign(Damage.UNREADABLE, shortened(why_unreadable(error)))
        if why is None:
            raise
        yield number + 1, time, "", why


def ends_within(what: str, *more: type[Exception]) -> Reason:
    """Return a `Reason` for files of records; `more` are further errors of a file that ends within one."""

    def reason(error: Exception) -> Foreign | None:
        if isinstance(error, (EOFError, StructError, *more)):
            return Foreign(Damage.CUT_OFF, f"the file ends in the middle of {what}")
        return Foreign(Damage.UNREADABLE, str(error)) if isinstance(error, ValueError) else None

    return reason


def seconds(text: bytes | float) -> float:
    """Parse a time in s; raises ValueError or TypeError."""
    time = float(text)
    # Negated, as every comparison with `nan` is false.
    if not 0 <= time < LATEST:
        raise ValueError(text)
    return time


def frame(identifier: int, data: bytes, extended: object = False, remote_length: int | None = None) -> Frame:
    """Return a classic frame, or a remote one if `remote_length` is not None.

    Raises ValueError for an identifier or length that it cannot have.
    """
    highest, bit = (HIGHEST_EXTENDED, EXTENDED) if extended else (HIGHEST_IDENTIFIER, 0)
    if not 0 <= identifier <= highest or len(data) > MOST_BYTES:
        raise ValueError(identifier)
    if remote_length is not None:  # a DLC of 9 to 15 means 8 bytes, too (ISO 11898-1)
        return RemoteFrame(bit | identifier, bytes(min(remote_length, MOST_BYTES)))
    return tuple.__new__(Frame, (bit | identifier, data))


def recorded(
    identifier: int,
    data: bytes,
    length: int,
    extended: Any,
    remote: Any = False,
    error: Any = False,
    is_fd: Any = False,
) -> Raw:
    """Return an entry from recorded values; raises ValueError for a length that does not match the data."""
    if error:
        return foreign(Damage.ERROR_FRAME, identifier, data, extended)
    if is_fd or len(data) > MOST_BYTES:  # not every table marks CAN FD frames, but their length does
        return foreign(Damage.FD, identifier, data, extended)
    if length != len(data) and not remote:
        raise ValueError(f"{identifier:03X}#{data.hex().upper()} with length {length}")
    return frame(identifier, data, extended, length if remote else None)


def foreign(damage: Damage, identifier: int, data: bytes, extended: object = False) -> Foreign:
    """Return an entry that is no classic frame but has an identifier and data."""
    digits = EXTENDED_DIGITS if extended else 3
    return Foreign(damage, shortened(f"{identifier:0{digits}X}#{data.hex().upper()}", LONGEST_FOREIGN))


def shortened(text: str | bytes, length: int = 60) -> str:
    """Return text for a report: one line of printable characters, at most `length` long."""
    plain = text.decode("ascii", "backslashreplace") if isinstance(text, bytes) else text
    shown = "".join(each if each.isprintable() else " " for each in plain.strip())
    return shown if len(shown) <= length else shown[: length - 3] + "..."
