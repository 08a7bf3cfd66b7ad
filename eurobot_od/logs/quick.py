"""The text of regular frames straight from a candump log's characters, by tables made of the kinds.

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
from eurobot_od.logs.meaning import field_text
from eurobot_od.logs.output import Shown, Text
from eurobot_od.logs.raw import REMEMBERED
from eurobot_od.protocol import TABLE_BITS, Binding, Protocol
from eurobot_od.values import OutOfRange

IDENTIFIER = 4
"""Length of an identifier of a base frame in candump's log, with its `#`."""


def quick_rows(protocol: Protocol, output: Text) -> Callable[[bytes], Shown]:
    """Return the function from `008#D27423592C0D9702` to what is shown of it; it raises one of lines.IRREGULAR."""
    rows = {f"{each.cob_id:03X}#".encode(): _row(each, output) for each in protocol.bindings}

    def quick(rest: bytes) -> Shown:
        return rows[rest[:IDENTIFIER]](rest[IDENTIFIER:]), ()

    return quick


def _row(binding: Binding, output: Text) -> Callable[[bytes], str]:
    """Return the function from a message's data in hexadecimal digits to its row."""
    if not binding.layout.fields:
        return {b"": output.plain_row(binding.name, "")}.__getitem__
    head = output.plain_row(binding.name, " ").removesuffix(" ")
    columns = [_column(binding, field) for field in binding.kinds if field in binding.limits]
    read = codec.reader(binding.layout, columns, tuple, _irregular, binding.unknown)
    return lambda digits: head + ", ".join(read(unhexlify(digits)))


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
