"""A protocol's messages for other tools: plain values, positions of bits, valid identifiers.

Only this module reads the protocol; the writers of the formats use its results. All names and texts become printable
ASCII in one line here, and names are never empty.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from enum import Enum
from itertools import count
from pathlib import Path
from typing import Any, NamedTuple

from eurobot_od.errors import LocalError
from eurobot_od.od.units import UnitScale
from eurobot_od.od.values import Limits, label
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.codec import Run, merged
from eurobot_od.pdo.kinds import Message, Real
from eurobot_od.pdo.protocol import Protocol


class Numeral(Enum):
    """Kind of number of a field's bits: two's complement if SIGNED, IEEE 754 if REAL."""

    UNSIGNED = "unsigned"
    SIGNED = "signed"
    REAL = "real"


class DescribedField(NamedTuple):
    """A field: `width` in bits, `limits` of raw values, `allowed` values as text, and `named` raw values.

    `unit` is one raw step, `scale` converts raw to physical values. `objects` are the mapped objects, as address and
    name. `places` are the frame bits (8 times the byte, plus the bit in it) of its bits 0, 1, 2, ... `default` is the
    raw value for a shorter frame, None if every frame has the field. `unknown` is the raw value for "unknown", valid
    together with those of the message's other fields; None if there is none.
    """

    name: str
    width: int
    numeral: Numeral
    limits: Limits
    unit: str
    scale: UnitScale
    allowed: str
    named: Mapping[int, str]
    places: Sequence[int]
    default: int | None = None
    unknown: int | None = None
    objects: Sequence[str] = ()

    @property
    def chunks(self) -> tuple[Run, ...]:
        """The field's bits byte by byte, from its lowest bit."""
        return merged(self.places, most=8)


class DescribedMessage(NamedTuple):
    """A message: senders and receivers, purpose (`text`), and fields in wire order.

    A frame has either `shortest` or `length` bytes.
    """

    name: str
    cob_id: int
    length: int
    shortest: int
    senders: Sequence[str]
    receivers: Sequence[str]
    text: str
    fields: Sequence[DescribedField]
    file: Path
    mapping_index: int

    @property
    def path(self) -> str:
        """Senders and receivers as text."""
        return f"{', '.join(self.senders) or 'nobody'} to {', '.join(self.receivers) or 'nobody'}"


def described(protocol: Protocol) -> list[DescribedMessage]:
    """Return all messages, highest priority first; raises LocalError if there is none."""
    if not protocol.bindings:
        raise LocalError("no messages: none of the loaded files has a valid PDO")
    return [_described(each) for each in protocol.bindings]


def _described(binding: Binding) -> DescribedMessage:
    text = " ".join((inspect.getdoc(binding.type) or "").split())
    return DescribedMessage(
        name=binding.name,
        cob_id=binding.cob_id,
        length=binding.layout.length,
        shortest=binding.lengths[0],
        senders=binding.senders,
        receivers=binding.receivers,
        # `Name(x, y)` is Python's default docstring of a named tuple.
        text="" if text.startswith(f"{binding.type.__name__}(") else text,
        fields=list(_fields(binding)),
        file=binding.file,
        mapping_index=binding.pdo.mapping_index,
    )


NUMERALS = {True: Numeral.SIGNED, False: Numeral.UNSIGNED}


def _fields(binding: Binding) -> Iterator[DescribedField]:
    objects: dict[str | None, list[str]] = {}
    for slot, mapped in zip(binding.layout.slots, binding.pdo.mapping):
        objects.setdefault(slot.field, []).append(label(mapped.address, mapped.variable.qualname))
    for name in binding.layout.fields:
        kind, limits = binding.kinds[name], binding.limits[name]
        yield DescribedField(
            name=name,
            width=binding.layout.widths[name],
            numeral=Numeral.REAL if isinstance(kind, Real) else NUMERALS[name in binding.layout.signed],
            limits=kind.measured(limits),
            unit=kind.raw_unit,
            scale=kind.scale,
            allowed=kind.allowed(limits),
            named=dict(sorted(kind.named_values().items())),
            places=binding.layout.places(name),
            default=binding.raw(name, binding.defaults[name]) if name in binding.optional else None,
            unknown=kind.unknown_as_a_whole,
            objects=objects[name],
        )


# Identifiers and texts for other languages


LONGEST_IDENTIFIER = 31
"""Longest identifier in characters, significant in every C compiler (C99, 5.2.4.1)."""

LONGEST_TEXT = 400
"""Longest text of a comment or a label, in characters."""

UNNAMED = "unnamed"

NOT_PRINTABLE = re.compile(r"[^\x20-\x7E]+")
NOT_AN_IDENTIFIER = re.compile(r"[^A-Za-z0-9]+")


def printable(text: str, longest: int = LONGEST_TEXT) -> str:
    """Return a text as printable ASCII in one line, cut at `longest` characters; anything else becomes a dot."""
    # Cut before splitting, because a text in a file may have any length.
    shown = NOT_PRINTABLE.sub(".", " ".join(text[: 2 * longest].split()))
    return shown if len(shown) <= longest else f"{shown[: longest - 3]}..."


def printable_name(name: str) -> str:
    """Return a name as printable ASCII, never empty."""
    return printable(name) or UNNAMED


class Identifiers:
    """Makes identifiers that are unique in any letter case and not `reserved` words (in lower case)."""

    def __init__(self, reserved: str = "", longest: int = LONGEST_IDENTIFIER) -> None:
        self._taken = set(reserved.split())
        self._longest = longest

    def new(self, name: str) -> str:
        """Return the identifier for a name: `Status_raw` for `Status (raw)`, `Status_raw_2` for a second one."""
        base = NOT_AN_IDENTIFIER.sub("_", name).strip("_")[: self._longest] or UNNAMED
        base = f"n{base}"[: self._longest] if base[0].isdigit() else base
        ends = (f"_{number}" if number > 1 else "" for number in count(1))
        candidates = (base[: self._longest - len(end)] + end for end in ends)
        found = next(each for each in candidates if each.lower() not in self._taken)
        self._taken.add(found.lower())
        return found


# Drawings of messages in a log for Foxglove


class Drawing(NamedTuple):
    """The drawing of a message: name of a well-known schema, its properties, and the function that makes it.

    `of` is called with the message and the time in the form of MCAP's schemas.
    """

    schema: str
    properties: Mapping[str, Any]
    of: Callable[[Message, dict[str, int]], dict[str, Any] | None]


Drawings = Mapping[str, Drawing]
"""Drawings by message name."""
