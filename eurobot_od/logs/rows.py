"""The rows of regular frames by tables made of the kinds, all frames of one message at once.

Rule of this file: nothing is decided here. The tables hold what `field_text` writes of each value; for whatever is not
in them (another length, a value unknown or out of range, no message of ours) the caller goes the long way.
"""

from __future__ import annotations

from binascii import unhexlify
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property, lru_cache
from struct import unpack
from typing import Any, NamedTuple, TypeAlias, TypeVar

from eurobot_od.logs.meaning import Finding, field_text
from eurobot_od.logs.output import Shown, Text
from eurobot_od.logs.raw import REMEMBERED
from eurobot_od.od.values import Limits
from eurobot_od.pdo import codec
from eurobot_od.pdo.kinds import Kind
from eurobot_od.pdo.protocol import TABLE_BITS, Binding, Protocol
from eurobot_od.robot.values import OutOfRange

MARK = "\0"
"""Stands in a row for a value that is in no table."""

HASH = "#"
"""What candump writes before the data."""

IRREGULAR = (LookupError, ValueError)
"""What is raised for frames that are not in the tables."""


class Integer(NamedTuple):
    """How `struct` names an integer of `size` bytes."""

    size: int
    code: str


INTEGERS = (Integer(1, "B"), Integer(2, "H"), Integer(4, "I"), Integer(8, "Q"))


class Piece(NamedTuple):
    """A field in the source of a row: its text with an expression in braces, and what the expression's name means."""

    text: str
    meaning: object


class Rows:
    """The rows of one message."""

    def __init__(self, binding: Binding, output: Text) -> None:
        self._binding, self._output, self._layout = binding, output, binding.layout
        self._big = self._layout.byte_order == "big"
        self._integer = next(each for each in INTEGERS if each.size >= self._layout.length)
        self._zeros = bytes(self._integer.size - self._layout.length)

    @cached_property
    def _texts(self) -> Callable[[Sequence[int]], list[str]]:
        """The function from frames, each as one integer, to rows."""
        if not self._layout.fields:
            row = self._output.plain_row(self._binding.name, "")
            return lambda words: [row] * len(words)
        pieces = {field: self._piece(field) for field in self._binding.kinds if field in self._binding.limits}
        row = self._output.plain_row(self._binding.name, ", ".join(piece.text for piece in pieces.values()))
        meanings: dict[str, Any] = {f"_{field}": piece.meaning for field, piece in pieces.items()}
        source = f"def texts(words):\n    return [f{row!r} for word in words]\n"
        return codec.generate("texts", source, meanings | {"mark": MARK})

    def _piece(self, field: str) -> Piece:
        kind, limits, width = self._binding.kinds[field], self._binding.limits[field], self._layout.widths[field]
        raw, numbers = self._layout.extract(field), kind.numbers(limits)
        if width <= TABLE_BITS and numbers:
            return Piece(_around(field, kind, f"_{field}[{raw}]"), _decimals(numbers, width))
        if width <= TABLE_BITS:
            return Piece(f"{{_{field}[{raw}]}}", _table(field, kind, limits, width))
        if numbers:
            return Piece(_around(field, kind, f"raw if (raw := {raw}) in _{field} else mark"), numbers)
        return Piece(f"{{_{field}({raw})}}", lru_cache(REMEMBERED)(lambda raw: _text(field, kind, limits, raw)))

    def of_hex(self, frames: Sequence[str]) -> list[str]:
        """Return the rows of frames given as `#D27423592C0D9702`, with a MARK where the tables have nothing.

        Raises ValueError if one of them is no data, or of another length.
        """
        text, size = "".join(frames), len(HASH) + 2 * self._layout.length
        if len(text) != size * len(frames) or text[::size] != HASH * len(frames):
            raise ValueError(frames)
        zeros = "00" * len(self._zeros)
        filled = text.replace(HASH, zeros)
        return self._of_words(unhexlify(filled if self._big else filled[len(zeros) :] + zeros))

    def of_data(self, frames: Sequence[bytes]) -> list[str]:
        """Return the rows of frames as `of_hex` does."""
        if set(map(len, frames)) != {self._layout.length}:
            raise ValueError(frames)
        filled = self._zeros.join(frames)
        return self._of_words(self._zeros + filled if self._big else filled + self._zeros)

    def _of_words(self, data: bytes) -> list[str]:
        """Return the rows of frames that are filled up to the size of an integer."""
        words = f"{'>' if self._big else '<'}{len(data) // self._integer.size}{self._integer.code}"
        return self._texts(unpack(words, data))


Key = TypeVar("Key")
Data = TypeVar("Data")


def from_tables(
    tables: Mapping[Key, Callable[[Sequence[Data]], list[str]]], identifiers: Sequence[Key], frames: Sequence[Data]
) -> list[str]:
    """Return the rows of frames, each message's at once; with a MARK where they are not in the tables."""
    rows = [MARK] * len(frames)
    for identifier, places in _places(identifiers).items():
        try:
            found = tables[identifier]([frames[place] for place in places])
        except IRREGULAR:
            continue
        for place, row in zip(places, found):
            rows[place] = row
    return rows


def _places(identifiers: Sequence[Key]) -> Mapping[Key, list[int]]:
    """Return where each identifier stands."""
    places: defaultdict[Key, list[int]] = defaultdict(list)
    for place, identifier in enumerate(identifiers):
        places[identifier].append(place)
    return places


Findings: TypeAlias = "list[tuple[int, tuple[Finding, ...]]]"
"""Places of rows, and what is wrong there."""


def complete(rows: list[str], show: Callable[[int], Shown]) -> Findings:
    """Put in the rows that are not in the tables; `show` is given their places."""
    if MARK not in "".join(rows):
        return []
    shown = {place: show(place) for place, row in enumerate(rows) if MARK in row}
    for place, (row, _) in shown.items():
        rows[place] = row or ""
    return [(place, findings) for place, (_, findings) in shown.items() if findings]


# Tables


def _around(field: str, kind: Kind, number: str) -> str:
    """Return what `field_text` writes of a number, with an expression for it."""
    return f"{{{number}}}".join(field_text(field, kind, 0).rsplit("0", 1))


@lru_cache
def _decimals(numbers: range, width: int) -> tuple[str, ...]:
    """Return the decimals of every raw value, a MARK for those that are none of the numbers."""
    return tuple(text if raw in numbers else MARK for raw, text in enumerate(_all_decimals()[: 1 << width]))


@cache
def _all_decimals() -> tuple[str, ...]:
    """Return the texts that all tables share."""
    return tuple(map(str, range(1 << TABLE_BITS)))


@lru_cache
def _table(field: str, kind: Kind, limits: Limits, width: int) -> tuple[str, ...]:
    """Return the text of every raw value."""
    return tuple(_text(field, kind, limits, raw) for raw in range(1 << width))


def _text(field: str, kind: Kind, limits: Limits, raw: int) -> str:
    meaning = kind.read(raw, limits)
    return MARK if meaning is None or isinstance(meaning, OutOfRange) else field_text(field, kind, meaning)


def rows_of(protocol: Protocol, output: Text) -> dict[int, Rows]:
    """Return the rows of all messages by COB-ID."""
    return {each.cob_id: Rows(each, output) for each in protocol.bindings}
