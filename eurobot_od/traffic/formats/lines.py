"""Logs of lines: candump, Vector's ASC, PEAK's TRC, BUSMASTER, SavvyCAN's GVRET, IXXAT, Kvaser, python-can's CSV.

A format turns a line into an entry or says why it cannot. A line that cannot be read is an entry like any other, and
does not spoil its neighbours.
"""

from __future__ import annotations

import re
from binascii import a2b_base64, a2b_hex
from codecs import BOM_UTF8
from collections.abc import Iterator
from contextlib import suppress
from copy import copy
from datetime import UTC, datetime, timedelta
from functools import cache
from typing import TYPE_CHECKING, BinaryIO, NamedTuple, cast

from eurobot_od.frame import HIGHEST_IDENTIFIER, MOST_BYTES, Frame
from eurobot_od.traffic import entries
from eurobot_od.traffic.entries import Batch, Damage, Entries, Foreign, Raw, Stamps

if TYPE_CHECKING:
    from io import BufferedReader


class LineFormat:
    """A format of lines; `entry` and `comment` raise one of `entries.BAD` for unreadable lines.

    A format with a header keeps what it says; an instance is used for one log.
    """

    def comment(self, line: bytes) -> bool:
        """Return whether a line without an entry belongs to the format, and process a header."""
        return line.strip()[:1] in (b"", b"#")

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        """Return time in s, channel and content of a line."""
        raise NotImplementedError

    def parts(self, piece: bytes) -> Iterator[Batch | bytes]:
        """Yield lines in order: batches of those that can be read together, counted from 1, and the others."""
        yield piece


PIECE = 1 << 16
"""Maximum number of bytes read at once, some thousand lines."""


class LogPlace(NamedTuple):
    """The start of a line from which a log can be read on.

    `offset` counts bytes and `line` the lines before it; `time` is that of the entry before it, in s; `form` is the
    format with what it has read of a header by then.
    """

    offset: int
    line: int
    time: float
    form: LineFormat

    @classmethod
    def first(cls, form: LineFormat) -> LogPlace:
        """Return the start of a log."""
        return cls(0, 0, 0.0, form)


def read_lines(file: BinaryIO, form: LineFormat, largest: int) -> Iterator[Batch]:
    """Read a log of lines in batches as they arrive; unreadable lines are Foreign, with the time before them.

    Of a line longer than `largest` bytes the start is kept and the rest skipped.
    """
    return (batch for _, batch in placed_lines(file, LogPlace.first(form), largest))


def placed_lines(file: BinaryIO, start: LogPlace, largest: int) -> Iterator[tuple[LogPlace, Batch]]:
    """Read as `read_lines` from the place where the file stands; yield each batch with its place."""
    before, time, form = start.line, start.time, copy(start.form)
    for offset, piece in _pieces(file, largest, start.offset):
        place, batches = LogPlace(offset, before, time, copy(form)), list[Batch]()
        for part in form.parts(piece):
            if isinstance(part, Batch):
                made = part._replace(lines=range(before + 1, before + 1 + len(part.heads)))
                before += len(part.heads)
            else:
                made = Batch.of(_entries(part, form, before, time))
                before += part.count(b"\n")
            if made.heads:
                batches.append(made)
                time = made.times[-1]
        if batches:
            yield place, Batch.joined(batches)


def _pieces(file: BinaryIO, largest: int, start: int) -> Iterator[tuple[int, bytes]]:
    """Yield complete lines as they arrive, then the unterminated rest, each with its offset."""
    source, left = cast("BufferedReader", file), b""
    read = begun = start
    while block := source.read1(PIECE):
        read += len(block)
        block = block.removeprefix(BOM_UTF8) if read == len(block) else block
        if b"\n" not in block and block.count(b"\r") > 1:  # line ends of an old Mac
            block = block.replace(b"\r", b"\n")
        lines, end, rest = block.rpartition(b"\n")
        if end:
            yield begun, _shortened(left + lines + end, largest)
            left, begun = rest, read - len(rest)
        elif len(left) <= largest:
            left += rest
    if left:
        yield begun, left[:largest]


def _shortened(lines: bytes, largest: int) -> bytes:
    """Cut lines that are too long."""
    if len(lines) <= largest:
        return lines
    return b"".join(each[:largest] + b"\n" for each in lines[:-1].split(b"\n"))


def _entries(piece: bytes, form: LineFormat, before: int, time: float) -> Entries:
    """Read lines one by one; `before` is the number of lines before them, `time` the last time."""
    lines = piece.split(b"\n")
    ends = [b"\n"] * (len(lines) - 1) + [b""]
    for number, (line, end) in enumerate(zip(lines, ends), before + 1):
        try:
            time, channel, raw = form.entry(line)
        except entries.BAD:
            # Only now, as nearly every line is an entry.
            with suppress(*entries.BAD):
                if form.comment(line):
                    continue
            # Only the last line may have no line end, if the log was cut off.
            yield number, time, "", Foreign(Damage.UNREADABLE if end else Damage.CUT_OFF, entries.shortened(line))
        else:
            yield number, time, channel, raw


def matched(found: re.Match[bytes] | None) -> re.Match[bytes]:
    """Return a match; raises ValueError without one."""
    if found is None:
        raise ValueError("a line of another form")
    return found


# candump, `(1396.123456) can0 008#D27423592C01C3A5`, strictly as can-utils and python-can write it


OPENING, CLOSING = b"()"
"""Brackets around a time."""

CANDUMP_EXTENDED = 8

CANDUMP_DIRECTIONS = (b"R", b"T")
"""Received or sent; any other word belongs to another entry after a lost line end."""

COB_ID = re.compile(rb"([0-7][0-9A-F]{2})#", re.IGNORECASE)

CANDUMP_OTHER = re.compile(
    rb"(?P<identifier>[0-7][0-9A-F]{2}|[01][0-9A-F]{7})#(?:R(?P<length>[0-9A-F]?)|(?P<data>(?:[0-9A-F]{2}){0,8}))(?:_[9A-F])?",
    re.IGNORECASE,
)
"""Remote frames, frames with 29-bit identifiers (eight digits), or with a DLC above 8 (option -8)."""

CANDUMP_FOREIGN = (
    (Damage.ERROR_FRAME, rb"[2367ABEF][0-9A-F]{7}#([0-9A-F]{2})*"),
    (Damage.FD, rb"([0-9A-F]{3}|[0-9A-F]{8})##[0-9A-F]([0-9A-F]{2}){0,64}"),
)
"""Patterns of other entries, in order; an error frame has bit 29 of its identifier set."""


USUAL = re.compile(
    rb"(?:\((?!0[0-9])[0-7]?[0-9]{1,9}+\.[0-9]{6}\) [!-\"$-'*-~]++ [0-7][0-9A-Fa-f]{2}#[0-9A-Fa-f]{0,16}+\n)*+"
)
"""Lines with classic base data frames, and times of six decimals that a float keeps exactly."""

BLANKS = bytes.maketrans(b"#\n", b"  ")
BRACKETS = b"()"
"""Separators of the columns of usual lines, and brackets to drop."""

ENDS = {b" R\n": False, b" T\n": False, b"\r\n": True}
"""Alternative line ends, and whether a line with nothing else is empty."""


class CandumpFormat(LineFormat):
    """Reads one log of candump."""

    def parts(self, piece: bytes) -> Iterator[Batch | bytes]:
        plain, place = piece, 0
        for end, may_be_alone in ENDS.items():
            if end in plain and (may_be_alone or not (plain.startswith(end) or b"\n" + end in plain)):
                plain = plain.replace(end, b"\n")
        while place < len(plain):
            end_of_usual = USUAL.match(plain, place).end()  # type: ignore[union-attr]  # it matches nothing, too
            if end_of_usual > place:
                yield _usual(plain[place:end_of_usual])
            place = plain.find(b"\n", end_of_usual) + 1 or len(plain)
            if place > end_of_usual:
                yield plain[end_of_usual:place]

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        words = line.split()
        if len(words) > 3 and words.pop() not in CANDUMP_DIRECTIONS:
            raise ValueError(line)
        stamp, channel, rest = words
        time = float(stamp[1:-1])
        if not 0 <= time < entries.LATEST or stamp[0] != OPENING or stamp[-1] != CLOSING:
            raise ValueError(line)
        try:
            cob_id = _cob_id(rest[:4])
            data = a2b_hex(rest[4:])
        except ValueError:
            return time, channel.decode(), _other_candump(rest)
        if len(data) > MOST_BYTES:
            raise ValueError(line)
        # Without the named tuple's own constructor, which is Python code: a log may have millions of lines.
        return time, channel.decode(), tuple.__new__(Frame, (cob_id, data))


def _usual(lines: bytes) -> Batch | bytes:
    """Return the columns of usual lines; the lines themselves if some have half a byte."""
    words = lines.translate(BLANKS, BRACKETS).decode().split(" ")
    stamps = words[0:-1:4]  # the last word is empty
    identifiers = list(map(IDENTIFIERS.__getitem__, words[2::4]))
    try:
        data = list(map(a2b_hex, words[3::4]))
    except ValueError:
        return lines
    return Batch(range(1, len(stamps) + 1), Stamps(stamps), words[1::4], identifiers, data, stamps)


class _Identifiers(dict[str, int]):
    """Cache of identifiers by their text."""

    def __missing__(self, text: str) -> int:
        self[text] = number = int(text, 16)
        return number


IDENTIFIERS = _Identifiers()


def _other_candump(rest: bytes) -> Raw:
    """Read an entry other than a classic base data frame; raises ValueError."""
    if found := CANDUMP_OTHER.fullmatch(rest):
        remote = None if found["length"] is None else int(found["length"] or b"0", 16)
        data = a2b_hex(found["data"] or b"")
        return entries.frame(int(found["identifier"], 16), data, len(found["identifier"]) == CANDUMP_EXTENDED, remote)
    for damage, pattern in CANDUMP_FOREIGN:
        if re.fullmatch(pattern, rest, re.IGNORECASE):
            return Foreign(damage, rest.decode())
    raise ValueError(rest)


@cache  # the pattern rejects `0_8` and `+08`, which int() accepts
def _cob_id(text: bytes) -> int:
    return int(matched(COB_ID.fullmatch(text))[1], 16)


# candump on a terminal, ` (1396.123456)  can0  008   [8]  D2 74 23 59 2C 01 C3 A5`, with any of its options for times


CONSOLE = re.compile(
    rb"\s*(?:[<>]\s+)?(?:\((?P<time>[-:. \d]+)\)\s+)?(?P<channel>\S+)\s+(?:[RT]X [-B] [-E]\s+)?"
    rb"(?P<identifier>[0-9A-F]{8}|[0-9A-F]{3})\s+(?:\[(?P<length>\d{1,2})\]|\{(?P<dlc>[0-9A-F])\})"
    rb"(?:\s+(?P<remote>remote request)|(?P<data>(?:\s+[0-9A-F]{2}\b)*))",
    re.IGNORECASE,
)
"""A line; a length of two digits marks a CAN FD frame."""

ERROR_FLAG = 1 << 29
FD_DIGITS = 2


class ConsoleFormat(LineFormat):
    """Reads candump's output on a terminal; without times all entries are at 0."""

    def comment(self, line: bytes) -> bool:
        return super().comment(line) or line[:1] == b"\t"  # candump -e explains an error frame in a line of its own

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        found = matched(CONSOLE.match(line))
        time = _console_time(found["time"].decode()) if found["time"] else 0.0
        identifier, extended = int(found["identifier"], 16), len(found["identifier"]) == CANDUMP_EXTENDED
        length = int(found["length"] or found["dlc"], 10 if found["length"] else 16)
        data = bytes.fromhex((found["data"] or b"").decode())[: length if found["length"] else MOST_BYTES]
        if not found["remote"] and len(data) != min(length, 64 if found["length"] else MOST_BYTES):
            raise ValueError(line)
        is_error = extended and identifier & ERROR_FLAG
        is_fd = len(found["length"] or b"") == FD_DIGITS
        length = length if found["remote"] else len(data)
        raw = entries.recorded(identifier, data, length, extended, found["remote"], is_error, is_fd)
        return time, found["channel"].decode(), raw


def _console_time(text: str) -> float:
    """Return a time in s, or that of a date in local time."""
    return datetime.fromisoformat(text).timestamp() if "-" in text else entries.seconds(float(text))


# ASC, `   2.501010 1  222  Rx   d 8 0C 00 00 00 00 00 00 00`; what is not a frame (statistics, chip state) is a comment


BASE = re.compile(rb"base\s+(hex|dec)", re.IGNORECASE)
NUMBER = {b"hex": 16, b"dec": 10}
ASC_HEADER = re.compile(rb"(//|date\s|base\s|(no\s+)?internal\s|begin\s|end\s|previous\s)|$", re.IGNORECASE)
ASC_EVENT = re.compile(
    rb"\d+\.\d+\s+((?:CANFD\s+)?(?!CANFD|\d)\S+|\d+\s+(Statistic|Status|J1939|TxTrc|Trigger))", re.IGNORECASE
)
"""A line with a time that is no frame, with a word in place of the channel or after it."""

ASC_DIRECTIONS = (b"Rx", b"Tx", b"TxRq")
ASC_ERROR_FRAME = b"errorframe"
ASC_FD = b"CANFD"
ASC_EXTENDED = (b"x", b"X")
ASC_DATA = b"d"
ASC_KINDS = (b"d", b"r", b"R")


ASC_BITS = (b"0", b"1")
ASC_FD_FLAG = 0x1000
ASC_REMOTE_FLAG = 0x10
"""Of CAN FD hardware: texts of a bit, and flags of a frame."""


class AscFormat(LineFormat):
    """Reads one ASC log; numbers are hexadecimal unless its header says `base dec`."""

    def __init__(self) -> None:
        self._base = NUMBER[b"hex"]
        self._is_relative, self._before = False, 0.0

    def comment(self, line: bytes) -> bool:
        text = line.strip()
        if base := BASE.match(text):
            self._base = NUMBER[base[1].lower()]
            self._is_relative = text.lower().endswith(b"relative")
        is_event = ASC_EVENT.match(text)
        if is_event:
            self._time(text.split(None, 1)[0])
        return bool(ASC_HEADER.match(text) or is_event)

    def _time(self, stamp: bytes) -> float:
        """Return a time in s since the log's start; a relative one counts from the previous entry."""
        time = entries.seconds(stamp)
        if self._is_relative:
            self._before = time = self._before + time
        return time

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        stamp, channel, *words = line.split()
        is_of_fd_hardware = channel.upper() == ASC_FD  # the word stands before the channel
        if is_of_fd_hardware:
            channel, *words = words
        if ASC_ERROR_FRAME in line.lower():
            made: Raw = Foreign(Damage.ERROR_FRAME, entries.shortened(line.split(None, 2)[2]))
        else:
            made = self._of_fd_hardware(*words) if is_of_fd_hardware else self._classic(*words)
        return self._time(stamp), _asc_channel(channel), made

    def _classic(self, identifier: bytes, direction: bytes, kind: bytes, *rest: bytes) -> Raw:
        extended = identifier[-1:] in ASC_EXTENDED
        number = int(identifier.rstrip(b"xX"), self._base)
        if direction not in ASC_DIRECTIONS or kind not in ASC_KINDS:
            raise ValueError(kind)
        if kind == ASC_DATA:
            return entries.frame(number, self._data(*rest), extended)
        # CANalyzer omits the length; a longer word there is something else.
        return entries.frame(number, b"", extended, int(rest[0], self._base) if rest and len(rest[0]) < 3 else 0)

    def _of_fd_hardware(self, direction: bytes, identifier: bytes, *rest: bytes) -> Raw:
        """Read a line of CAN FD hardware, whose flags tell whether the frame is classic.

        After a message's name, if there is one: bit rate switch, error state, DLC, length, data, duration, bits, flags.
        """
        if direction not in ASC_DIRECTIONS:
            raise ValueError(direction)
        extended = identifier[-1:] in ASC_EXTENDED
        number = int(identifier.rstrip(b"xX"), self._base)
        _, _, dlc, count, *words = rest if rest[0] in ASC_BITS else rest[1:]
        data = bytes([int(octet, 16) for octet in words[: int(count)]])
        flags = int(words[int(count) + 2], 16)
        is_remote = flags & ASC_REMOTE_FLAG  # some lines have no flags
        length = int(dlc, 16) if is_remote else len(data)
        return entries.recorded(number, data, length, extended, is_remote, is_fd=flags & ASC_FD_FLAG)

    def _data(self, length: bytes, *octets: bytes) -> bytes:
        count = min(int(length, self._base), MOST_BYTES)  # a DLC of 9 to 15 means 8 bytes, too (ISO 11898-1)
        octets = octets[:count]
        is_usual = self._base == NUMBER[b"hex"] and set(map(len, octets)) <= {2}  # nearly all: read at once
        data = a2b_hex(b"".join(octets)) if is_usual else bytes([int(octet, self._base) for octet in octets])
        if len(data) != count:
            raise ValueError(octets)
        return data


@cache
def _asc_channel(channel: bytes) -> str:
    """Return a channel numbered from 0, as in python-can."""
    return str(int(channel) - 1)


# TRC 1.0 to 2.1, `  7)  103.250 DT 008 Rx 8 D2 74 23 59 2C 01 C3 A5`; a version is the order of its columns


TRC_COLUMNS = {"1.0": "N,O,I,L,D", "1.1": "N,O,T,I,L,D", "1.2": "N,O,B,T,I,L,D", "1.3": "N,O,B,T,I,R,L,D"}
"""Columns of versions without a list of columns; letters as in version 2: number, offset, type, identifier, ..."""

TRC_2 = {"2.0": "N,O,T,I,d,L,D", "2.1": "N,O,T,B,I,d,R,L,D"}
"""Columns of versions with such a list, for logs without their head."""

TRC_LINES = (
    (rb"\d+\)\s+[\d.,]+\s+[0-9A-F]{4,8}\s", "1.0"),
    (rb"\d+\)\s+[\d.,]+\s+(?:Rx|Tx|Warng|Error)\s", "1.1"),
    (rb"\d+\)\s+[\d.,]+\s+\d\s+(?:Rx|Tx|Warng|Error)\s+[0-9A-F]+\s+\d", "1.2"),
    (rb"\d+\)\s+[\d.,]+\s+\d\s+(?:Rx|Tx|Warng|Error)\s+[0-9A-F]+\s+-", "1.3"),
    (rb"\d+\s+[\d.,]+\s+[A-Z]{2}\s+[0-9A-F]{4,8}\s+(?:Rx|Tx)\s", "2.0"),
    (rb"\d+\s+[\d.,]+\s+[A-Z]{2}\s+\d\s+[0-9A-F]{4,8}\s+(?:Rx|Tx)\s", "2.1"),
)
"""Patterns of the beginning of a line, by version."""

TRC_FRAMES: dict[str, Damage | None] = {
    **dict.fromkeys(("DT", "Rx", "Tx")),
    **dict.fromkeys(("FD", "FB", "FE", "BI"), Damage.FD),
    **dict.fromkeys(("ER", "Error"), Damage.ERROR_FRAME),
    "RR": None,
}
TRC_EVENTS = ("ST", "EC", "EV", "Warng", "FFFFFFFF")
"""Entry types that are no frames; in version 1.0, an identifier."""

TRC_REMOTE, TRC_REMOTE_DATA = "RR", "RTR"
"""Marks of a remote frame: its type, or in other versions the text in place of its data."""

MOST_DLC = 15

TRC_EXTENDED = 5
"""Minimum number of digits of a 29-bit identifier."""

TRC_EPOCH = datetime(1899, 12, 30, tzinfo=UTC)
"""Day 0 of $STARTTIME."""


class TrcFormat(LineFormat):
    """Reads one TRC log."""

    def __init__(self) -> None:
        self._start, self._has_columns = 0.0, False
        self._set_columns(TRC_COLUMNS["1.0"])

    def _set_columns(self, columns: str) -> None:
        """Set the place of each column after number and offset; the data is last."""
        letters = columns.strip().split(",")[2:]
        # `l` is the number of bytes, `L` the DLC; a version has one of them.
        self._identifier = letters.index("I")
        self._length = letters.index("l" if "l" in letters else "L")
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
            self._has_columns = True
        elif key == ";$FILEVERSION":
            self._set_columns(TRC_COLUMNS.get(value, TRC_COLUMNS["1.0"]))
            self._has_columns = True
        return True

    def _guess_columns(self, line: bytes) -> None:
        """Set the columns by the beginning of a line, as the log has no head."""
        self._has_columns = True
        version = next((each for start, each in TRC_LINES if re.match(start, line.strip(), re.IGNORECASE)), "1.0")
        self._set_columns((TRC_COLUMNS | TRC_2)[version])

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        if not self._has_columns and line.strip()[:1].isdigit():
            self._guess_columns(line)
        _, offset, rest = line.split(None, 2)
        time = float(offset.replace(b",", b".")) / 1000 + self._start  # PCAN-View writes numbers as its user does
        if line[:1] == b";" or not abs(time) < entries.LATEST:
            raise ValueError(line)
        words = rest.decode("ascii").split(None, self._data)  # the data, which is last, stays in one piece
        channel = "1" if self._bus is None else words[self._bus]  # versions without that column record one bus
        identifier = words[self._identifier]
        data = " ".join(words[self._data :]).rstrip()
        kind = None if self._type is None else words[self._type]
        damage = None if kind is None else TRC_FRAMES[kind]
        extended = len(identifier) >= TRC_EXTENDED
        if damage is Damage.FD:
            return time, channel, entries.foreign(damage, int(identifier, 16), bytes.fromhex(data), extended)
        if damage is not None:
            return time, channel, Foreign(damage, entries.shortened(rest))
        is_remote = kind == TRC_REMOTE or data == TRC_REMOTE_DATA
        length = int(words[self._length])
        octets = b"" if is_remote else bytes.fromhex(data)
        if length > MOST_DLC or not (is_remote or length == len(octets)):
            raise ValueError(rest)
        octets = octets[:MOST_BYTES]  # a DLC of 9 to 15 means 8 bytes, whatever is written behind them
        return time, channel, entries.frame(int(identifier, 16), octets, extended, length if is_remote else None)


# BUSMASTER, `00:12:16:6390 Rx 1 0x701 s 1 05`; times are in 100 us, and the header says from when they count


BUSMASTER_START = re.compile(r"\*{3}START DATE AND TIME ([\d:]+) ([\d:]+)\*{3}")
BUSMASTER_KINDS = {b"s": (False, False), b"x": (True, False), b"sr": (False, True), b"xr": (True, True)}
"""Whether a frame has a 29-bit identifier, and whether it is remote, by its kind."""


class BusmasterFormat(LineFormat):
    """Reads a BUSMASTER log; times of day belong to the day of its start, in UTC."""

    def __init__(self) -> None:
        self._base = NUMBER[b"hex"]
        self._mode = b"SYSTEM"
        self._before = 0.0
        self._began = self._midnight = 0.0

    def comment(self, line: bytes) -> bool:
        text = line.strip()
        if found := BUSMASTER_START.match(text.decode("latin-1")):
            day, month, year = map(int, found[1].split(":"))
            hour, minute, second, millisecond = map(int, found[2].split(":"))
            begun = datetime(year, month, day, hour, minute, second, millisecond * 1000, UTC)
            self._began = begun.timestamp()
            self._midnight = begun.replace(hour=0, minute=0, second=0, microsecond=0).timestamp()
        elif text in (b"***DEC***", b"***HEX***"):
            self._base = NUMBER[text.strip(b"*").lower()]
        elif text.endswith(b" MODE***"):
            self._mode = text.strip(b"*").split()[0]
        return not text or text.startswith(b"***")

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        stamp, direction, channel, identifier, kind, length, *octets = line.split()
        extended, is_remote = BUSMASTER_KINDS[kind]
        hours, minutes, seconds_, parts = map(int, stamp.split(b":"))
        time = hours * 3600 + minutes * 60 + seconds_ + parts / 10_000
        number = int(identifier.removeprefix(b"0x"), self._base)
        data = bytes([int(octet, self._base) for octet in octets])
        if direction not in ASC_DIRECTIONS:
            raise ValueError(line)
        raw = entries.recorded(number, data, int(length), extended, is_remote)
        if self._mode == b"RELATIVE":
            self._before = time = self._before + time
        since = self._midnight if self._mode == b"SYSTEM" else self._began
        return since + time, channel.decode(), raw


# GVRET, `166064000,0000021A,false,Rx,0,8,FE,36,12,FE,69,05,07,AD,`, as SavvyCAN writes it; times are in us


GVRET_HEADER = b"Time Stamp,"
GVRET_TRUE = (b"true", b"1")


class GvretFormat(LineFormat):
    """Reads one log of SavvyCAN; an old one has no column for the direction."""

    def __init__(self) -> None:
        self._has_direction = True

    def comment(self, line: bytes) -> bool:
        if line.startswith(GVRET_HEADER):
            self._has_direction = b",Dir," in line
            return True
        return super().comment(line)

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        stamp, identifier, extended, *rest = line.strip().rstrip(b",").split(b",")
        channel, length, *octets = rest[1:] if self._has_direction else rest
        # An old log has eight octets in each line.
        data = bytes([int(octet, 16) for octet in octets[: int(length)]])
        number = int(identifier, 16)
        raw = entries.recorded(number, data, int(length), extended.lower() in GVRET_TRUE)
        return entries.seconds(int(stamp) / 1e6), channel.decode(), raw


# IXXAT's traces, `"00:02:20.66";"703";"Std";"";"7F "`, as MiniMon and canAnalyser Mini write them, columns as headed


class IxxatFormat(LineFormat):
    """Reads a trace of IXXAT's MiniMon (times since its start) or canAnalyser Mini (times of day)."""

    def __init__(self) -> None:
        self._columns = [b"time", b"identifier", b"format", b"flags", b"data"]

    def comment(self, line: bytes) -> bool:
        if line.startswith(b'"') and b"Data" in line:
            # `"ID (hex)"`, `"Identifier (hex)"`, `"Time (abs)"`
            self._columns = [each.split()[0].lower() for each in _ixxat_words(line)]
            return True
        return not line.startswith(b'"')

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        said = dict(zip(self._columns, _ixxat_words(line)))
        hours, minutes, second = said[b"time"].replace(b",", b".").split(b":")
        time = int(hours) * 3600 + int(minutes) * 60 + entries.seconds(second)
        number = int(said.get(b"identifier") or said[b"id"], 16)
        text = said[b"data"]
        extended = number > HIGHEST_IDENTIFIER or IXXAT_KINDS[said.get(b"format", b"std").strip().lower()]
        channel = said.get(b"bus", b"").decode().rpartition(" ")[2]
        if b"rtr" in said.get(b"flags", b"").lower():  # and as its data `Remote request  DLC = 1`
            return time, channel, entries.frame(number, b"", extended, int(text.rpartition(b"=")[2]))
        data = bytes.fromhex(text.decode())
        return time, channel, entries.recorded(number, data, int(said.get(b"dlc", len(data))), extended)


IXXAT_KINDS = {b"std": False, b"ext": True}


def _ixxat_words(line: bytes) -> list[bytes]:
    return re.split(rb'"[;,]"', line.strip()[1:-1])


# Kvaser's CanKing, ` 0    0000070A         1  00                154.266550 R`; times are since its start


KVASER = re.compile(
    rb"\s*(?P<channel>\d+)\s+(?P<identifier>[0-9A-F]{1,8})\s+(?:(?P<extended>X)\s+)?"
    rb"(?:(?P<error>ErrorFrame)|(?P<length>\d+)(?P<data>(?:\s+[0-9A-F]{2}\b)*))\s+(?P<time>\d+\.\d+)\s+[RT]\s*",
    re.IGNORECASE,
)
"""A line; lines of remote frames and CAN FD are not publicly documented."""


class KvaserFormat(LineFormat):
    """Reads a CanKing log; a line that does not begin with a channel is a heading or a note."""

    def comment(self, line: bytes) -> bool:
        return not line.strip()[:1].isdigit()

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        found = matched(KVASER.fullmatch(line))
        time = entries.seconds(found["time"])
        channel = found["channel"].decode()
        if found["error"]:
            return time, channel, Foreign(Damage.ERROR_FRAME, entries.shortened(line))
        data = bytes.fromhex(found["data"].decode())
        number = int(found["identifier"], 16)
        length = int(found["length"])
        return time, channel, entries.recorded(number, data, length, found["extended"])


# CSV, `1396.123456,0x8,0,0,0,8,0nQjWSwBw6U=`, as python-can writes it: identifier, flags, length, data in base 64


class CsvFormat(LineFormat):
    """Reads one log of python-can's CSV."""

    def comment(self, line: bytes) -> bool:
        return super().comment(line) or line.startswith(b"timestamp,")

    def entry(self, line: bytes) -> tuple[float, str, Raw]:
        stamp, identifier, extended, remote, error, length, data = line.strip().split(b",")
        octets = a2b_base64(data)
        flags = (each == b"1" for each in (extended, remote, error))
        return entries.seconds(stamp), "", entries.recorded(int(identifier, 16), octets, int(length), *flags)
