"""A protocol's messages as other tools need them: plain values, the position of each field's bits, valid names.

Only this file reads the protocol; the writers of the formats use what it returns. Whatever a file contains, its names
and texts become printable ASCII in one line here, and never an empty name.
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
    """The kind of number in a field's bits: two's complement if SIGNED, IEEE 754 if REAL."""

    UNSIGNED = "unsigned"
    SIGNED = "signed"
    REAL = "real"


class DescribedField(NamedTuple):
    """A field: `width` in bits, `limits` as its numeral counts, what is `allowed`, and its `named` raw values.

    `unit` is what one raw step is, `scale` how the raw value becomes a physical one.
    `objects` are the mapped objects that make it up, by address and their own names. `places` are the frame bits (8
    times the byte plus the bit in it) of its bits 0, 1, 2, ... `default` is the raw value that a shorter frame means,
    None if every frame has the field. `unknown` is the raw value that means "unknown", together with those of the
    message's other fields that have one; None if there is none.
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
    """A message: who sends it to whom, what it is for (`text`), and its fields in wire order.

    A frame has `shortest` or `length` bytes, and no number in between.
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
        """Sender and receiver in words."""
        return f"{', '.join(self.senders) or 'nobody'} to {', '.join(self.receivers) or 'nobody'}"


def described(protocol: Protocol) -> list[DescribedMessage]:
    """Return all messages, most urgent first; raises LocalError if there is none."""
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
        # Python gives a named tuple without a docstring of its own `Name(x, y)`.
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


# Names and texts of files, made fit for other languages


LONGEST_IDENTIFIER = 31
"""Significant characters of an identifier in every C compiler (C99, 5.2.4.1)."""

LONGEST_TEXT = 400
"""Characters of a text that goes into a comment or a label."""

UNNAMED = "unnamed"

NOT_PRINTABLE = re.compile(r"[^\x20-\x7E]+")
NOT_AN_IDENTIFIER = re.compile(r"[^A-Za-z0-9]+")


def printable(text: str, longest: int = LONGEST_TEXT) -> str:
    """Return a text as printable ASCII in one line, cut at `longest` characters; anything else becomes a dot."""
    # Cut before it is split: a text in a file may be of any length.
    shown = NOT_PRINTABLE.sub(".", " ".join(text[: 2 * longest].split()))
    return shown if len(shown) <= longest else f"{shown[: longest - 3]}..."


def printable_name(name: str) -> str:
    """Return a name as printable ASCII that is not empty."""
    return printable(name) or UNNAMED


class Identifiers:
    """Hands out identifiers, each only once in any case of letters; never one of the `reserved` words (lower case)."""

    def __init__(self, reserved: str = "", longest: int = LONGEST_IDENTIFIER) -> None:
        self._taken, self._longest = set(reserved.split()), longest

    def new(self, name: str) -> str:
        """Return the identifier for a name: `Status (raw)` is `Status_raw`, a second one `Status_raw_2`."""
        base = NOT_AN_IDENTIFIER.sub("_", name).strip("_")[: self._longest] or UNNAMED
        base = f"n{base}"[: self._longest] if base[0].isdigit() else base
        ends = (f"_{number}" if number > 1 else "" for number in count(1))
        candidates = (base[: self._longest - len(end)] + end for end in ends)
        found = next(each for each in candidates if each.lower() not in self._taken)
        self._taken.add(found.lower())
        return found


# What messages draw in a log for Foxglove


class Drawing(NamedTuple):
    """How a message is drawn: the name of a well-known schema, its properties, and the function that draws it.

    `of` gets the message and the time in the form of MCAP's schemas.
    """

    schema: str
    properties: Mapping[str, Any]
    of: Callable[[Message, dict[str, int]], dict[str, Any] | None]


Drawings = Mapping[str, Drawing]
"""What messages draw, by their names."""
