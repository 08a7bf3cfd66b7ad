"""The text of regular frames by tables made of the kinds; of a candump log straight from its characters.

Rule of this file: nothing is decided here. The tables hold what `Text` writes of each value; for whatever is not in
them (another length, a value out of range, an unknown position, no message of ours) the caller goes the long way.
"""

from __future__ import annotations

from binascii import unhexlify
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from eurobot_od import codec
from eurobot_od.codec import Column
from eurobot_od.kinds import Kind, Limits
from eurobot_od.logs.filters import Wanted
from eurobot_od.logs.lines import IRREGULAR
from eurobot_od.logs.meaning import Decoder, field_text
from eurobot_od.logs.output import Output, Shown, Text, showing
from eurobot_od.logs.raw import REMEMBERED, Raw, Understand
from eurobot_od.protocol import TABLE_BITS, Binding, Protocol
from eurobot_od.values import OutOfRange

IDENTIFIER = 4
"""Length of an identifier of a base frame in candump's log, with its `#`."""


def ways(
    decoder: Decoder, wanted: Wanted | None, output: Output
) -> tuple[Understand[Shown], Callable[[bytes], Shown] | None]:
    """Return what a log reader is to make of a frame and, if there is a shorter way, of a candump line's frame."""
    show = showing(decoder, wanted, output)
    if wanted is not None or not isinstance(output, Text):
        return show, None
    rows = QuickRows(decoder.protocol, output)
    return rows.over(show), rows.line


class QuickRows:
    """Rows of regular frames by tables; `line` and `over` are the two ways in."""

    def __init__(self, protocol: Protocol, output: Text) -> None:
        self._rows: dict[object, Callable[[bytes], str]] = {
            each.cob_id: _row(each, output) for each in protocol.bindings
        }
        self._rows_by_text = {f"{each.cob_id:03X}#".encode(): self._rows[each.cob_id] for each in protocol.bindings}

    def line(self, rest: bytes) -> Shown:
        """Return what is shown of `008#D27423592C0D9702`; raises one of IRREGULAR for what is not in the tables."""
        return self._rows_by_text[rest[:IDENTIFIER]](unhexlify(rest[IDENTIFIER:])), ()

    def over(self, show: Understand[Shown]) -> Understand[Shown]:
        """Return `show` with the tables asked first."""
        rows = self._rows

        def quick(raw: Raw) -> Shown:
            try:
                return rows[raw[0]](raw[1]), ()  # type: ignore[arg-type]  # Foreign is in no table
            except IRREGULAR:
                return show(raw)

        return quick


def _row(binding: Binding, output: Text) -> Callable[[bytes], str]:
    """Return the function from a message's data to its row."""
    if not binding.layout.fields:
        return {b"": output.plain_row(binding.name, "")}.__getitem__
    head = output.plain_row(binding.name, " ").removesuffix(" ")
    columns = [_column(binding, field) for field in binding.kinds if field in binding.limits]
    read = codec.reader(binding.layout, columns, tuple, _irregular, binding.unknown)
    return lambda data: head + ", ".join(read(data))


def _irregular(_: bytes) -> Any:
    raise LookupError


def _column(binding: Binding, field: str) -> Column:
    kind, limits, width = binding.kinds[field], binding.limits[field], binding.layout.widths[field]
    if width > TABLE_BITS:
        return Column(field, lru_cache(REMEMBERED)(lambda raw: _regular(field, kind, limits, raw)), {})
    return Column(field, _table(field, kind, limits, width), {})


@lru_cache
def _table(field: str, kind: Kind, limits: Limits, width: int) -> tuple[str | None, ...]:
    """Return the text of every raw value, None for those out of range."""
    return tuple(_text(field, kind, limits, raw) for raw in range(1 << width))


def _text(field: str, kind: Kind, limits: Limits, raw: int) -> str | None:
    meaning = kind.read(raw, limits)
    return None if isinstance(meaning, OutOfRange) else field_text(field, kind, meaning)


def _regular(field: str, kind: Kind, limits: Limits, raw: int) -> str:
    text = _text(field, kind, limits, raw)
    if text is None:
        raise LookupError(raw)
    return text
