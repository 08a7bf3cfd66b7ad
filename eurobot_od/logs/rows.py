"""The rows of regular frames by tables made of the kinds, one frame or many of one message at once.

Rule of this file: nothing is decided here. The tables hold what `field_text` writes of each value; for whatever is not
in them (another length, a value unknown or out of range, no message of ours) the caller goes the long way.
"""

from __future__ import annotations

from binascii import unhexlify
from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property, lru_cache
from struct import unpack
from typing import Any, NamedTuple

from eurobot_od import codec
from eurobot_od.kinds import Kind, Limits
from eurobot_od.logs.meaning import field_text
from eurobot_od.logs.output import Shown, Text
from eurobot_od.logs.raw import REMEMBERED, Raw, Understand
from eurobot_od.protocol import TABLE_BITS, Binding, Protocol
from eurobot_od.values import OutOfRange

MARK = "\0"
"""Stands in a row for a value that is in no table."""

HASH = "#"
"""What candump writes before the data."""

IRREGULAR = (LookupError, ValueError)
"""What is raised for frames that are not in the tables."""


class Integers(NamedTuple):
    """How `struct` names an integer of `size` bytes."""

    size: int
    code: str


INTEGERS = (Integers(1, "B"), Integers(2, "H"), Integers(4, "I"), Integers(8, "Q"))
ORDERS = {"little": "<", "big": ">"}


class Piece(NamedTuple):
    """A field in the source of a row: its text with an expression in braces, and what the expression's name means."""

    text: str
    meaning: object


class Rows:
    """The rows of one message."""

    def __init__(self, binding: Binding, output: Text) -> None:
        self._binding, self._output, self._layout = binding, output, binding.layout
        self._integers = next(each for each in INTEGERS if each.size >= max(self._layout.length, 1))
        self._zeros = "00" * (self._integers.size - self._layout.length)

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

    def of_frame(self, data: bytes) -> str:
        """Return the row of a frame; raises one of IRREGULAR."""
        if len(data) != self._layout.length:
            raise ValueError(data)
        (row,) = self._texts((int.from_bytes(data, self._layout.byte_order),))
        if MARK in row:
            raise LookupError(data)
        return row

    def of_frames(self, frames: Sequence[str]) -> list[str]:
        """Return the rows of frames given as `#D27423592C0D9702`, those of irregular values with a MARK.

        Raises ValueError if one of them is no data, or of another length.
        """
        words = f"{ORDERS[self._layout.byte_order]}{len(frames)}{self._integers.code}"
        return self._texts(unpack(words, self._octets(frames)))

    def _octets(self, frames: Sequence[str]) -> bytes:
        """Return the data of all frames, each filled up to the size of an integer."""
        text, size = "".join(frames), len(HASH) + 2 * self._layout.length
        if len(text) != size * len(frames) or text[::size] != HASH * len(frames):
            raise ValueError(frames)
        if self._layout.byte_order == "big":
            return unhexlify(text.replace(HASH, self._zeros))
        return unhexlify(text.replace(HASH, self._zeros)[len(self._zeros) :] + self._zeros)


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


def by_tables(rows: Mapping[int, Rows], show: Understand[Shown]) -> Understand[Shown]:
    """Return `show` with the tables asked first."""

    def shown(raw: Raw) -> Shown:
        try:
            return rows[raw[0]].of_frame(raw[1]), ()  # type: ignore[index,arg-type]  # Foreign is in no table
        except IRREGULAR:
            return show(raw)

    return shown
