"""What a log holds: entries with a classic frame, or with something else; and many of them at once, by columns.

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
    UNKNOWN_MAPPING = "unknown mapping"
    INCOMPLETE = "incomplete transfer"
    WRONG_LENGTH = "wrong length"
    OUT_OF_RANGE = "out of range"
    OTHERS = "other identifiers"
    """No defect: a frame of an identifier beyond those that are told apart."""


class Foreign(NamedTuple):
    """An entry that is not a classic frame: the reason, and its text, shortened."""

    damage: Damage
    text: str

    @property
    def frame(self) -> tuple[int, bytes] | None:
        """COB-ID and data of a frame of CAN FD, None for anything else."""
        found = FOREIGN_FRAME.fullmatch(self.text) if self.damage is Damage.FD else None
        if found is None:
            return None
        extended = EXTENDED * (len(found["identifier"]) == EXTENDED_DIGITS)
        return int(found["identifier"], 16) | extended, bytes.fromhex(found["data"])

    @property
    def has_bit_rate_switch(self) -> bool | None:
        """Whether the data of a frame of CAN FD came at a higher bit rate; None if the log does not say it."""
        found = FOREIGN_FRAME.fullmatch(self.text) if self.damage is Damage.FD else None
        return bool(int(found["flags"], 16) & BIT_RATE_SWITCH) if found and found["flags"] else None

    @property
    def is_read(self) -> bool:
        """Whether it is something that a bus can carry, and not text that nobody understands."""
        return self.damage not in (Damage.UNREADABLE, Damage.CUT_OFF)


LONGEST_FOREIGN = 140
"""Characters of a frame of CAN FD, with its 64 bytes."""

BIT_RATE_SWITCH = 1
"""Bit of the flags of a frame of CAN FD (CANFD_BRS, linux/can.h)."""

EXTENDED_DIGITS = 8
"""Digits of a 29-bit identifier, as candump writes it; an 11-bit one has three."""

FOREIGN_FRAME = re.compile(
    r"(?P<identifier>[0-9A-F]{3}|[0-9A-F]{8})#(?:#(?P<flags>[0-9A-F]))?(?P<data>(?:[0-9A-F]{2})*)", re.I
)
"""How the text of a frame of CAN FD is written; candump has its flags after a second mark."""

Raw: TypeAlias = Frame | Foreign

Timed: TypeAlias = tuple[float, Raw]
"""A time in s, and what came then."""

LogEntry: TypeAlias = tuple[int, float, str, Raw]
"""One entry of a log: its line (or its number, if there are no lines), time in s, channel, and what stands there."""

Entries: TypeAlias = Iterator[LogEntry]


class Stamps(Sequence[float]):
    """Stamps in s as they are in a log, read only when they are asked for."""

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
    """Consecutive entries of a log by columns: lines, times in s, channels, and what stands there.

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
        """Return some entries as a batch."""
        lines, times, channels, raws = tuple(zip(*entries)) or ((), (), (), ())
        heads = [raw[0] if raw.__class__ is Frame else raw for raw in raws]
        return cls(lines, times, channels, heads, [raw[1] if raw.__class__ is Frame else b"" for raw in raws])

    @classmethod
    def joined(cls, parts: Sequence[Batch]) -> Batch:
        """Return batches that follow each other as one."""
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
        """Return what stands at a place in the batch."""
        return _raw(self.heads[place], self.data[place])

    def grouped(self, places: Sequence[int]) -> dict[int | Raw, list[int]]:
        """Return some places, in their order, by their heads."""
        groups, heads = defaultdict[int | Raw, list[int]](list), self.heads
        for place in places:
            groups[heads[place]].append(place)
        return groups

    def entries(self) -> Entries:
        """Give the entries one by one."""
        return zip(self.lines, self.times, self.channels, map(_raw, self.heads, self.data))

    @property
    def is_of_one_channel(self) -> bool:
        """Whether all entries have one channel."""
        return self.channels.count(self.channels[0]) == len(self.channels)

    @property
    def is_read(self) -> bool:
        """Whether some of it is what a bus can carry, and not text that nobody understands."""
        return any(not isinstance(head, Foreign) or head.is_read for head in self.heads)


def _raw(head: int | Raw, data: bytes) -> Raw:
    """Return what a batch has as a head and data."""
    # Without the named tuple's own constructor, which is Python code: a log may have millions of entries.
    return tuple.__new__(Frame, (head, data)) if isinstance(head, int) else head


def _stamped(batch: Batch) -> Batch:
    return batch if batch.stamps is not None else batch._replace(stamps=[f"{time:.6f}" for time in batch.times])


def gathered(entries: Entries, most: int) -> Iterator[Batch]:
    """Yield entries in batches of at most so many, and those before an error before that is raised."""
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
"""What a reader raises for an entry that it cannot read."""

Item = TypeVar("Item")


Reason: TypeAlias = Callable[[Exception], Foreign | None]
"""Says of an error why a log cannot be read any further; None for any other error."""


def read_each(items: Iterable[Item], entry: Callable[[Item], tuple[float, str, Raw]], reason: Reason) -> Entries:
    """Read items of a log; `entry` gives time in s, channel and what stands there, or raises one of BAD.

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
        if why is None and isinstance(error, UNREADABLE):  # of a library, which does not say what it raises
            why = Foreign(Damage.UNREADABLE, shortened(why_unreadable(error)))
        if why is None:
            raise
        yield number + 1, time, "", why


def ends_within(what: str, *more: type[Exception]) -> Reason:
    """Return the reasons of a file of records: it ends within one, which `more` errors show, too, or is not one."""

    def reason(error: Exception) -> Foreign | None:
        if isinstance(error, (EOFError, StructError, *more)):
            return Foreign(Damage.CUT_OFF, f"the file ends in the middle of {what}")
        return Foreign(Damage.UNREADABLE, str(error)) if isinstance(error, ValueError) else None

    return reason


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


def recorded(
    identifier: int,
    data: bytes,
    length: int,
    extended: Any,
    remote: Any = False,
    error: Any = False,
    is_fd: Any = False,
) -> Raw:
    """Return what a program has recorded; raises ValueError for a length that its data does not have."""
    if error:
        return foreign(Damage.ERROR_FRAME, identifier, data, extended)
    if is_fd or len(data) > MOST_BYTES:  # not every table says that a frame is one of CAN FD; its length does
        return foreign(Damage.FD, identifier, data, extended)
    if length != len(data) and not remote:
        raise ValueError(f"{identifier:03X}#{data.hex().upper()} with length {length}")
    return frame(identifier, data, extended, length if remote else None)


def foreign(damage: Damage, identifier: int, data: bytes, extended: object = False) -> Foreign:
    """Return what is not a classic frame, but has an identifier and data."""
    digits = EXTENDED_DIGITS if extended else 3
    return Foreign(damage, shortened(f"{identifier:0{digits}X}#{data.hex().upper()}", LONGEST_FOREIGN))


def shortened(text: str | bytes, length: int = 60) -> str:
    """Return text for a report: one line of printable characters, at most `length` long."""
    plain = text.decode("ascii", "backslashreplace") if isinstance(text, bytes) else text
    shown = "".join(each if each.isprintable() else " " for each in plain.strip())
    return shown if len(shown) <= length else shown[: length - 3] + "..."
