"""Logs that consist of lines: candump's, Vector's ASC, PEAK's TRC.

A format turns a line into an entry or says why it cannot. A line that cannot be read is an entry like any other, and
does not spoil its neighbours.
"""

from __future__ import annotations

import re
from binascii import a2b_hex
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from functools import cache, partial
from typing import BinaryIO

from eurobot_od.frame import MOST_BYTES, Frame
from eurobot_od.traffic.entries import BAD, LATEST, Damage, Entries, Foreign, Raw, frame, seconds, shortened


class LineFormat:
    """A format of lines; `entry` and `comment` raise one of BAD for what they cannot read.

    A format with a header keeps what it says; an instance is used for one log.
    """

    def comment(self, line: bytes) -> bool:
        """Return whether a line that is not an entry belongs to the format all the same; read a header from it."""
        return not line.strip()

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        """Return time in s, channel, and what stands there."""
        raise NotImplementedError


def read_lines(file: BinaryIO, form: LineFormat, largest: int) -> Entries:
    """Read a log of lines; what cannot be read is Foreign, with the time of the entry before.

    Of a line longer than `largest` bytes the start is kept and the rest skipped.
    """
    entry, time, read = form.entry, 0.0, partial(file.readline, largest)
    for number, line in enumerate(iter(read, b""), 1):
        try:
            time, channel, raw = entry(line)
        except BAD:
            # Asked only now: nearly every line is an entry.
            with suppress(*BAD):
                if form.comment(line):
                    continue
            rest = line
            while len(rest) == largest and not rest.endswith(b"\n"):  # too long: on to its end
                rest = file.readline(largest)
            # Only the last line may have no line end: then the log was cut off there.
            damage = Damage.UNREADABLE if rest.endswith(b"\n") else Damage.CUT_OFF
            yield number, time, "", Foreign(damage, shortened(line))
        else:
            yield number, time, channel, raw


# candump, `(1396.123456) can0 008#D27423592C01C3A5`, as can-utils and python-can write it, and nothing more lenient


OPENING, CLOSING = b"()"
"""The brackets around a time."""

CANDUMP_EXTENDED = 8

CANDUMP_DIRECTIONS = (b"R", b"T")
"""Received or sent. Any other word belongs to a next entry: the line end between them is lost."""

COB_ID = re.compile(rb"([0-7][0-9A-F]{2})#", re.IGNORECASE)

CANDUMP_OTHER = re.compile(
    rb"(?P<identifier>[0-7][0-9A-F]{2}|[01][0-9A-F]{7})#(?:R(?P<length>[0-9A-F]?)|(?P<data>(?:[0-9A-F]{2}){0,8}))",
    re.IGNORECASE,
)
"""Frames that are remote, or have 29-bit identifiers, which are written with eight digits."""

CANDUMP_FOREIGN = (
    (Damage.ERROR_FRAME, rb"[2367ABEF][0-9A-F]{7}#([0-9A-F]{2})*"),
    (Damage.FD, rb"([0-9A-F]{3}|[0-9A-F]{8})##[0-9A-F]([0-9A-F]{2}){0,64}"),
)
"""What is not a classic frame, the first that fits; an error frame has bit 29 of its identifier set."""


class CandumpFormat(LineFormat):
    """Reads one log of candump."""

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        words = line.split()
        if len(words) > 3 and words.pop() not in CANDUMP_DIRECTIONS:
            raise ValueError(line)
        stamp, channel, rest = words
        time = float(stamp[1:-1])
        if not 0 <= time < LATEST or stamp[0] != OPENING or stamp[-1] != CLOSING:
            raise ValueError(line)
        try:
            cob_id, data = _cob_id(rest[:4]), a2b_hex(rest[4:])
        except ValueError:
            return time, channel.decode(), _other_candump(rest)
        if len(data) > MOST_BYTES:
            raise ValueError(line)
        # Without the named tuple's own constructor, which is Python code: a log may have millions of lines.
        return time, channel.decode(), tuple.__new__(Frame, (cob_id, data))


def _other_candump(rest: bytes) -> Raw:
    """Read what is not a classic base data frame; raises ValueError."""
    if found := CANDUMP_OTHER.fullmatch(rest):
        remote = None if found["length"] is None else int(found["length"] or b"0", 16)
        data = a2b_hex(found["data"] or b"")
        return frame(int(found["identifier"], 16), data, len(found["identifier"]) == CANDUMP_EXTENDED, remote)
    for damage, pattern in CANDUMP_FOREIGN:
        if re.fullmatch(pattern, rest, re.IGNORECASE):
            return Foreign(damage, rest.decode())
    raise ValueError(rest)


@cache  # int() alone would also read `0_8` and `+08`; there are few identifiers, so that each is checked once
def _cob_id(text: bytes) -> int:
    found = COB_ID.fullmatch(text)
    if found is None:
        raise ValueError(text)
    return int(found[1], 16)


# ASC, `   2.501010 1  222  Rx   d 8 0C 00 00 00 00 00 00 00`; what is not a frame (statistics, chip state) is a comment


BASE = re.compile(rb"base\s+(hex|dec)", re.IGNORECASE)
NUMBER = {b"hex": 16, b"dec": 10}
ASC_HEADER = re.compile(rb"(//|date\s|base\s|(no\s+)?internal\s|begin\s|end\s|previous\s)|$", re.IGNORECASE)
ASC_EVENT = re.compile(rb"\d+\.\d+\s+((?!CANFD|\d)\S+|\d+\s+(Statistic|Status|J1939|TxTrc|Trigger))", re.IGNORECASE)
"""A line with a time that is not a frame: a word in place of the channel, or after it."""

ASC_DIRECTIONS = (b"Rx", b"Tx", b"TxRq")
ASC_ERROR_FRAME, ASC_FD, ASC_DATA, ASC_REMOTE, ASC_EXTENDED = b"errorframe", b"CANFD", b"d", (b"r", b"R"), (b"x", b"X")


class AscFormat(LineFormat):
    """Reads one ASC log; numbers are hexadecimal unless its header says `base dec`."""

    def __init__(self) -> None:
        self._base = NUMBER[b"hex"]

    def comment(self, line: bytes) -> bool:
        text = line.strip()
        if base := BASE.match(text):
            self._base = NUMBER[base[1].lower()]
        return bool(ASC_HEADER.match(text) or ASC_EVENT.match(text))

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        stamp, channel, *words = line.split()
        is_fd = channel.upper() == ASC_FD
        foreign = Damage.ERROR_FRAME if ASC_ERROR_FRAME in line.lower() else Damage.FD if is_fd else None
        if foreign:
            channel = words[0] if is_fd else channel  # the word stands before the channel
            return seconds(stamp), _asc_channel(channel), Foreign(foreign, shortened(line.split(None, 2)[2]))
        identifier, direction, kind, *rest = words
        extended, number = identifier[-1:] in ASC_EXTENDED, int(identifier.rstrip(b"xX"), self._base)
        if direction not in ASC_DIRECTIONS or kind not in (*ASC_REMOTE, ASC_DATA):
            raise ValueError(line)
        if kind in ASC_REMOTE:  # CANalyzer leaves the length out
            made = frame(number, b"", extended, int(rest[0], self._base) if rest else 0)
        else:
            made = frame(number, self._data(*rest), extended)
        return seconds(stamp), _asc_channel(channel), made

    def _data(self, length: bytes, *octets: bytes) -> bytes:
        count = min(int(length, self._base), MOST_BYTES)  # a DLC of 9 to 15 means 8 bytes, too (ISO 11898-1)
        data = bytes([int(octet, self._base) for octet in octets[:count]])
        if len(data) != count:
            raise ValueError(octets)
        return data


@cache
def _asc_channel(channel: bytes) -> str:
    """Return a channel as python-can counts them, from 0."""
    return str(int(channel) - 1)


# TRC 1.0 to 2.1, `  7)  103.250 DT 008 Rx 8 D2 74 23 59 2C 01 C3 A5`; a version is the order of its columns


TRC_COLUMNS = {"1.0": "N,O,I,L,D", "1.1": "N,O,T,I,L,D", "1.2": "N,O,B,T,I,L,D", "1.3": "N,O,B,T,I,R,L,D"}
"""Columns of the versions that do not list theirs; letters as in version 2: number, offset, type, identifier, ..."""

TRC_FRAMES: dict[str, Damage | None] = {
    **dict.fromkeys(("DT", "Rx", "Tx")),
    **dict.fromkeys(("FD", "FB", "FE", "BI"), Damage.FD),
    **dict.fromkeys(("ER", "Error"), Damage.ERROR_FRAME),
    "RR": None,
}
TRC_EVENTS = ("ST", "EC", "EV", "Warng")
"""Types of entries that are frames, and what kind of; and those that are not."""

TRC_REMOTE, TRC_REMOTE_DATA = "RR", "RTR"
"""A remote frame, by its type in some versions, and in others by what stands in place of its data."""

TRC_EXTENDED = 5
"""Identifiers with this many digits or more have 29 bits."""

TRC_EPOCH = datetime(1899, 12, 30, tzinfo=UTC)
"""What $STARTTIME counts days from."""


class TrcFormat(LineFormat):
    """Reads one TRC log."""

    def __init__(self) -> None:
        self._start = 0.0
        self._set_columns(TRC_COLUMNS["1.0"])

    def _set_columns(self, columns: str) -> None:
        """Note where each column is after the number and the offset; the data is the last one."""
        letters = columns.strip().split(",")[2:]
        # `l` is the number of bytes, `L` the DLC; a version has one of them.
        self._identifier, self._length = letters.index("I"), letters.index("l" if "l" in letters else "L")
        self._data = len(letters) - 1
        self._bus, self._type = (letters.index(each) if each in letters else None for each in "BT")

    def comment(self, line: bytes) -> bool:
        text = line.decode("latin-1").strip()
        if not text.startswith(";"):
            return not text or any(word in TRC_EVENTS for word in text.split()[2:4])
        key, _, value = text.partition("=")
        if key == ";$STARTTIME":
            self._start = (TRC_EPOCH + timedelta(days=float(value))).timestamp()
        elif key == ";$COLUMNS":
            self._set_columns(value)
        elif key == ";$FILEVERSION" and value in TRC_COLUMNS:
            self._set_columns(TRC_COLUMNS[value])
        return True

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        _, offset, rest = line.split(None, 2)
        time = float(offset) / 1000 + self._start
        if line[:1] == b";" or not abs(time) < LATEST:
            raise ValueError(line)
        words = rest.decode("ascii").split(None, self._data)  # the data, last and with blanks in it, in one piece
        channel = "1" if self._bus is None else words[self._bus]  # versions without that column record one bus
        identifier, data = words[self._identifier], " ".join(words[self._data :]).rstrip()
        kind = None if self._type is None else words[self._type]
        damage = None if kind is None else TRC_FRAMES[kind]
        if damage is not None:
            return time, channel, Foreign(damage, shortened(rest))
        is_remote, length = kind == TRC_REMOTE or data == TRC_REMOTE_DATA, int(words[self._length])
        octets = b"" if is_remote else bytes.fromhex(data)
        if not is_remote and length != len(octets):
            raise ValueError(rest)
        extended = len(identifier) >= TRC_EXTENDED
        return time, channel, frame(int(identifier, 16), octets, extended, length if is_remote else None)
