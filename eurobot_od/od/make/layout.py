"""Where the bits of an object lie in its PDO: whole fields, or slices of them, in CiA 301's order.

CiA 301 fills a frame from the least significant bit of its first byte on, and cannot say anything else (7.5.2.36). A
device with another bit order is described in these words all the same: its fields are cut into slices, each a run of
bits that are neighbours both in the value and in the frame, and the slices are mapped in the order that gives the
device's bytes. What loads such an EDS joins the slices again by their names, `X position (11:4)`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import accumulate, groupby
from typing import NamedTuple

from eurobot_od.od import pdos
from eurobot_od.od.make.table import DialectRow, Record, Table, TableField
from eurobot_od.od.values import MappingEntry
from eurobot_od.support.yaml_places import Place, PlacedText

PADDING = PlacedText(pdos.PADDING, Place(0, 0))
BYTE = 8
FIRST_SLICES = 0x3000
"""The object of the first cut object's slices; the next ones follow."""


class Slice(NamedTuple):
    """The bits `high` down to `low` of a field of the object; bit 0 is the value's least significant one."""

    field: PlacedText
    high: int
    low: int

    @property
    def bits(self) -> int:
        """How many bits the slice has."""
        return self.high - self.low + 1

    @property
    def name(self) -> str:
        """The slice's ParameterName, `X position (11:4)`; padding has no value whose bits could be named."""
        return PADDING if self.field == PADDING else f"{self.field} ({self.high}:{self.low})"


def whole_fields(fields: dict[PlacedText, TableField]) -> tuple[Slice, ...]:
    """Lay out the fields as CiA 301 does, each one whole, the least significant bit first (7.5.2.36)."""
    return tuple(Slice(name, each.bits - 1, 0) for name, each in fields.items())


def most_significant_first(fields: dict[PlacedText, TableField]) -> tuple[Slice, ...]:
    """Lay out the fields from the first byte's most significant bit on; left-over bits of the last byte are padding."""
    bits = [(name, bit) for name, each in fields.items() for bit in reversed(range(each.bits))]
    bits += [(PADDING, bit) for bit in reversed(range(-len(bits) % BYTE))]
    frame = [bit for start in range(0, len(bits), BYTE) for bit in reversed(bits[start : start + BYTE])]
    return tuple(runs(frame))


def runs(frame: Iterable[tuple[PlacedText, int]]) -> Iterator[Slice]:
    """Join neighbouring bits of a field, given in CiA 301's order, into the longest slices.

    Within a slice, value and frame advance together: a bit and its place in the frame keep their distance.
    """
    for (name, _), run in groupby(enumerate(frame), key=lambda each: (each[1][0], each[1][1] - each[0])):
        bits = [bit for _, (_, bit) in run]
        yield Slice(name, bits[-1], bits[0])


@dataclass(frozen=True)
class ObjectLayout:
    """An object in a dialect: index and fields, its `parts` in PDO order, and the index of those that are slices."""

    index: int
    fields: dict[PlacedText, TableField]
    parts: tuple[Slice, ...]
    slices_index: int

    @property
    def cut(self) -> tuple[Slice, ...]:
        """The parts that are not a whole field: sub-indices 1, 2, ... of the slices' object."""
        return tuple(each for each in self.parts if not self.is_whole(each))

    @property
    def targets(self) -> tuple[int, ...]:
        """The mapping entries of a PDO: index, sub-index and bits of every part (CiA 301, 7.5.2.36)."""
        return tuple(self.target(each) for each in self.parts)

    @property
    def begins(self) -> dict[PlacedText, int]:
        """The bit, 0 to 7, of its first byte in a frame at which each field begins that is mapped whole."""
        offsets = accumulate((each.bits for each in self.parts), initial=0)
        return {part.field: at % BYTE for part, at in zip(self.parts, offsets) if self.is_whole(part)}

    def is_whole(self, part: Slice) -> bool:
        """Tell whether a part is a whole field."""
        return part.field in self.fields and part.bits == self.fields[part.field].bits

    def target(self, part: Slice) -> int:
        """Return the mapping entry of a part."""
        if self.is_whole(part):
            index, position = self.index, list(self.fields).index(part.field)
        else:
            index, position = self.slices_index, self.cut.index(part)
        return MappingEntry(index, position + 1, part.bits).number


def layouts(table: Table, dialect: DialectRow) -> dict[PlacedText, ObjectLayout]:
    """Lay out every object of the table in `dialect`."""
    return {name: layout(dialect, name, each) for name, each in table.objects_in(dialect).items()}


def layout(dialect: DialectRow, name: PlacedText, record: Record) -> ObjectLayout:
    """Lay out the object `name` with the fields that it has in `dialect`."""
    fields = in_pdo_order(record.fields, dialect.reserved_before(name))
    if name not in dialect.most_significant_first:
        return ObjectLayout(record.index, record.fields, whole_fields(fields), 0)
    slices_index = FIRST_SLICES + dialect.most_significant_first.index(name)
    return ObjectLayout(record.index, record.fields, most_significant_first(fields), slices_index)


def in_pdo_order(
    fields: dict[PlacedText, TableField], reserved: dict[PlacedText, PlacedText]
) -> dict[PlacedText, TableField]:
    """Return the fields with the reserved bits, which are the last sub-indices, before those they belong before."""
    named = (name for name in fields if name not in reserved.values())
    order = (each for name in named for each in (reserved.get(name), name) if each is not None)
    return {name: fields[name] for name in order}
