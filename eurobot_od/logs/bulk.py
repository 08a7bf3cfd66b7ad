"""A candump log to text, some thousand lines at once, by what the interpreter does to whole lists and texts.

Rule of this file: nothing is guessed. A piece of a log is taken at once only if each of its lines is exactly `(time)
channel identifier#data`; otherwise it is halved, and few lines go the long way, as does each frame whose row is not in
the tables. Both ways give the same text.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import lru_cache
from io import BytesIO
from typing import NamedTuple, NoReturn, Protocol

from eurobot_od.logs.candump import Candump, parse
from eurobot_od.logs.lines import read_lines
from eurobot_od.logs.output import GAP, TIME_WIDTH, Show, Shown, Text, written
from eurobot_od.logs.raw import REMEMBERED, Entries
from eurobot_od.logs.rows import HASH, Rows, complete, from_tables
from eurobot_od.logs.statistics import Tally

PIECE = 1 << 14
"""Bytes taken at once: some four hundred lines. Twice as many are hardly faster, and take memory."""

FEW = 32
"""Lines that are not halved any more."""

LINE_ENDS = ("\r\n", " R\n", " T\n")
"""What may stand for a plain line end: python-can writes the direction behind the frame."""

OTHER_SPACE = "\t\v\f\r\x1c\x1d\x1e\x1f"
"""What `str.split` takes for space beside the space and the line end."""

AROUND_DIGITS = len("(.123456)")
"""Length of a time without the digits before its point."""

MOST_DIGITS, HIGHEST_FIRST = 10, "7"
"""With so many digits before the point, the first at most this one, a float is exact to six behind it."""


class Blocks(Protocol):
    """An open file that gives what is there without waiting for more."""

    def read1(self, size: int, /) -> bytes:
        """Read at most `size` bytes, none at the end."""


class Columns(NamedTuple):
    """The lines of a piece in columns: times in their brackets, channels, identifiers, and data behind a `#`."""

    times: Sequence[str]
    channels: Sequence[str]
    identifiers: Sequence[str]
    frames: Sequence[str]


COLUMNS = len(Columns._fields)


class Bulk:
    """Turns one log into text and counts what is wrong in it."""

    def __init__(self, rows: Mapping[int, Rows], show: Show, output: Text, log: str, tally: Tally) -> None:
        self._tables = {f"{cob_id:03X}": each.of_hex for cob_id, each in rows.items()}
        self._show, self._output, self._log, self._tally = show, output, log, tally
        self._form = Candump()
        self._long: Callable[[str], Shown] = lru_cache(REMEMBERED)(lambda rest: show(parse(rest.encode())))
        self._lines, self._time = 0, 0.0  # how many lines there were so far, and the time of the last one

    def texts(self, file: Blocks) -> Iterator[str]:
        """Yield the text of a log, piece by piece."""
        for piece in _pieces(file):
            yield from self._texts(piece)

    def _texts(self, piece: bytes) -> Iterator[str]:
        text = self._at_once(piece)
        if text is not None:
            yield text
        elif piece.count(b"\n") <= FEW:
            yield "".join(self._one_by_one(piece))
        else:
            for half in _halves(piece):
                yield from self._texts(half)

    def _one_by_one(self, piece: bytes) -> Iterator[str]:
        entries = read_lines(BytesIO(piece), self._form, self._lines, self._time)
        yield from written(self._noted(entries), self._show, self._log, self._output, self._tally)
        self._lines += piece.count(b"\n")

    def _noted(self, entries: Entries) -> Entries:
        for entry in entries:
            self._time = entry[1]
            yield entry

    def _at_once(self, piece: bytes) -> str | None:
        """Return the text of a regular piece, None for another."""
        try:
            columns = _columns(piece.decode("ascii"))
            rows = from_tables(self._tables, columns.identifiers, columns.frames)
            findings = complete(rows, lambda place: self._long(columns.identifiers[place] + columns.frames[place]))
        except ValueError:
            return None
        for place, wrong in findings:
            self._tally.add(self._log, self._lines + place + 1, wrong)
        self._lines += len(rows)
        self._time = float(columns.times[-1][1:-1])
        return self._joined(columns, rows)

    def _joined(self, columns: Columns, rows: Sequence[str]) -> str:
        """Return the lines, as `Text.line` writes each of them."""
        gaps = {channel: f"{GAP}{channel}{GAP}" for channel in set(columns.channels)}
        start = self._output.start(self._log) + " " * (TIME_WIDTH + len("()") - len(columns.times[0]))
        parts = [f"\n{start}"] * (4 * len(rows))
        parts[0::4] = "".join(columns.times)[1:-1].split(")(")
        parts[1::4] = map(gaps.__getitem__, columns.channels)
        parts[2::4] = rows
        parts[-1] = "\n"
        return start + "".join(parts)


# Pieces of a log


def _pieces(file: Blocks) -> Iterator[bytes]:
    """Yield a log in pieces that end with a line, as soon as their lines are there; the last one as it ends."""
    begun: list[bytes] = []
    while block := file.read1(PIECE):
        lines, end, rest = block.rpartition(b"\n")
        if end:
            yield b"".join((*begun, lines, end))
            begun.clear()
        begun.append(rest)
    if any(begun):
        yield b"".join(begun)


def _halves(piece: bytes) -> tuple[bytes, bytes]:
    """Return a piece of several lines in two; one very long line is a part of its own."""
    middle = piece.find(b"\n", len(piece) // 2, -1) + 1 or piece.rfind(b"\n", 0, -1) + 1
    return piece[:middle], piece[middle:]


# Regular lines


def _columns(text: str) -> Columns:
    """Return the columns of regular lines; raises ValueError if there are others."""
    return _split(text) or _split(_with_plain_ends(text)) or _refuse()


def _with_plain_ends(text: str) -> str:
    for end in LINE_ENDS:
        text = text.replace(end, "\n")
    return text


def _refuse() -> NoReturn:
    raise ValueError("not a regular piece of a log")


def _split(text: str) -> Columns | None:
    """Return the columns of regular lines, None if there are others.

    Each line begins with a bracket, and if it is in a word of the first column and nowhere else, each line has as many
    words as there are columns. Between them is one space if there is as little space as can be.
    """
    lines = text.count("\n")
    spread = text.replace(HASH, f" {HASH}")
    words = spread.split()
    columns = Columns(*(words[column::COLUMNS] for column in range(COLUMNS)))
    times, *others = map("".join, columns)
    regular = (
        text.startswith("(")
        and text.endswith("\n")
        and text.count("\n(") == lines - 1
        and len(words) == COLUMNS * lines
        and len(spread) == len(times) + sum(map(len, others)) + COLUMNS * lines
        and not any("(" in other for other in others)
        and not any(space in text for space in OTHER_SPACE)
        and _are_times(times, lines)
    )
    return columns if regular else None


def _are_times(text: str, count: int) -> bool:
    """Tell whether these are so many times of one length in brackets, each as a float is written with six decimals."""
    size, odd = divmod(len(text), count)
    digits, first = size - AROUND_DIGITS, text[1::size]
    only_digits = text.replace(")(", "").replace(".", "")[1:-1]
    return (
        not odd
        and 1 <= digits <= MOST_DIGITS
        and text[::size] == "(" * count
        and text[digits + 1 :: size] == "." * count
        and text[size - 1 :: size] == ")" * count
        and len(only_digits) == count * (size - len("(.)"))
        and only_digits.isdigit()
        and (digits == 1 or "0" not in first)
        and (digits < MOST_DIGITS or max(first) <= HIGHEST_FIRST)
    )
