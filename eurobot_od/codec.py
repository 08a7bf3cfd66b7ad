"""PDO mapping to pack and unpack functions, for any mapping of 1 to 64 bits at any offset.

Rule of this file: bits only. A layout is worked out once from the mapping (CiA 301, 7.4.8.2: the first mapped object
has the least significant bits, bytes follow in little-endian order) and written out as one short Python function a
message, which shifts and masks a single integer. What a raw value means is not known here; it comes in as a table or
a function for each field.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Literal, NamedTuple

from eurobot_od.frame import Frame

MAX_BITS = 64
"""A PDO carries at most 64 bits (CiA 301, 7.4.8.2)."""

SLICE = re.compile(r"(?P<name>.+) \[(?P<high>\d+):(?P<low>\d+)\]$")
"""ParameterName of a part of a value: `X position [11:4]` is its bits 11 down to 4."""


class LayoutError(ValueError):
    """Mapping entries that make no layout: a gap, an overlap, a wrong length, or over 64 bits."""


class Slot(NamedTuple):
    """One mapping entry: `bits` bits of `field` (None: padding), the lowest being the value's bit `shift`."""

    field: str | None
    shift: int
    bits: int


def slot(name: str, bits: int, to_field: Callable[[str], str]) -> Slot:
    """Return the slot of a mapping entry from its ParameterName and mapped length.

    Raises LayoutError if a slice's name and its mapped length contradict each other.
    """
    match = SLICE.match(name)
    if match is None:
        return Slot(to_field(name), 0, bits)
    high, low = int(match["high"]), int(match["low"])
    if high - low + 1 != bits:
        raise LayoutError(f"{name} is mapped with {bits} bits")
    return Slot(to_field(match["name"]), low, bits)


class Run(NamedTuple):
    """Bits side by side in value and word alike: value bit `shift` is word bit `offset`, for `bits` bits."""

    shift: int
    offset: int
    bits: int

    @property
    def mask(self) -> int:
        return (1 << self.bits) - 1

    def place(self, value: int) -> int:
        """Return this run's part of a value, at its place in the word."""
        return (value >> self.shift & self.mask) << self.offset

    def extract(self) -> str:
        """Write the expression that brings the run from `word` to its place in the value."""
        masked = f"word >> {self.offset} & {self.mask:#x}" if self.offset else f"word & {self.mask:#x}"
        return f"({masked}) << {self.shift}" if self.shift else masked

    def insert(self, name: str) -> str:
        """Write the expression that brings the run from the value in variable `name` to its place in the word."""
        shifted = f"{name} >> {self.shift}" if self.shift else name
        return f"({shifted} & {self.mask:#x}) << {self.offset}"


ByteOrder = Literal["little", "big"]


class Layout:
    """Where each field's bits lie in a PDO: `fields` in wire order, `widths` in bits, `length` in bytes.

    The frame is read as one integer, in the byte order that leaves the fewest runs: a value whose slices are stored
    most significant first is in one piece again when the frame is read as big-endian.
    Raises LayoutError for over 64 bits, and for parts of a field that overlap or leave a gap.
    """

    def __init__(self, slots: Iterable[Slot]) -> None:
        self.slots = tuple(slots)
        self.bits = sum(slot.bits for slot in self.slots)
        if self.bits > MAX_BITS:
            raise LayoutError(f"{self.bits} bits are mapped, a PDO has at most {MAX_BITS}")
        self.length = (self.bits + 7) // 8
        self._places = {field: _whole(field, places) for field, places in self._collect().items()}
        self.fields = tuple(self._places)
        self.widths = {field: len(places) for field, places in self._places.items()}
        little, big = self._runs("little"), self._runs("big")
        self.byte_order: ByteOrder = "big" if _count(big) < _count(little) else "little"
        self.runs = big if self.byte_order == "big" else little

    def _collect(self) -> dict[str, list[tuple[int, int]]]:
        """Return for each field its pairs of value bit and frame bit."""
        found: dict[str, list[tuple[int, int]]] = {}
        offset = 0
        for field, shift, bits in self.slots:
            if field is not None:
                found.setdefault(field, []).extend((shift + bit, offset + bit) for bit in range(bits))
            offset += bits
        return found

    def _runs(self, order: ByteOrder) -> dict[str, tuple[Run, ...]]:
        flip = 8 * (self.length - 1) if order == "big" else 0
        return {
            field: _merge([abs(flip - place // 8 * 8) + place % 8 for place in places])
            for field, places in self._places.items()
        }

    def places(self, field: str) -> list[int]:
        """Return the frame bits (8 times the byte plus the bit in it) of a field's bits 0, 1, 2, ..."""
        return list(self._places[field])

    def shortest(self, needed: Iterable[str]) -> int:
        """Return the number of bytes that hold all `needed` fields: a frame without the others may end there."""
        return max((max(self._places[field]) // 8 + 1 for field in needed), default=0)

    def place(self, field: str, raw: int) -> int:
        """Return a raw value's bits at their places in the word."""
        word = 0
        for run in self.runs[field]:
            word |= run.place(raw)
        return word

    def extract(self, field: str) -> str:
        """Write the expression that takes a field's raw value out of `word`."""
        return " | ".join(f"({run.extract()})" for run in self.runs[field])

    def insert(self, field: str, name: str) -> str:
        """Write the expression that puts the raw value in variable `name` into the word."""
        return " | ".join(run.insert(name) for run in self.runs[field])


def _count(runs: Mapping[str, Sequence[Run]]) -> int:
    return sum(map(len, runs.values()))


def _whole(field: str, pairs: list[tuple[int, int]]) -> list[int]:
    """Return the frame bits of a value's bits 0, 1, 2, ...; each must be there exactly once."""
    value_bits = [value_bit for value_bit, _ in pairs]
    for bit in range(max(value_bits)):
        if bit not in value_bits:
            raise LayoutError(f"{field}: bit {bit} is mapped nowhere")
    if len(set(value_bits)) != len(pairs):
        raise LayoutError(f"{field}: bits are mapped twice")
    return [place for _, place in sorted(pairs)]


def _merge(places: list[int]) -> tuple[Run, ...]:
    """Return the runs of a value whose bits 0, 1, 2, ... are the word's bits `places`."""
    runs: list[Run] = []
    for bit, place in enumerate(places):
        if runs and place == runs[-1].offset + runs[-1].bits:
            runs[-1] = runs[-1]._replace(bits=runs[-1].bits + 1)
        else:
            runs.append(Run(bit, place, 1))
    return tuple(runs)


# Raw integers


def unpacker(layout: Layout) -> Callable[[bytes], tuple[int, ...]]:
    """Generate `unpack(data) -> (raw, ...)`, in the order of `layout.fields`, for data of the layout's length."""
    source = f"""
def unpack(data):
    word = from_bytes(data, {layout.byte_order!r})
    return ({"".join(f"{layout.extract(field)}, " for field in layout.fields)})
"""
    return generate("unpack", source, {"from_bytes": int.from_bytes})


# Meanings


class Column(NamedTuple):
    """How one field of a message is read and written.

    `read` turns the raw value into its meaning: a tuple with an entry for every raw value, or a function where that
    would be too long; None for a field that is not mapped and always has its `default`. `write` turns the meaning into
    the word's bits by a mapping, or into the raw value by a function; `most` is the highest raw value then.
    """

    field: str
    read: Sequence[Any] | Callable[[int], Any] | None
    write: Mapping[Any, int] | Callable[[Any], int]
    default: Any = None
    most: int = 0


class Unknown(NamedTuple):
    """Bits of the word that mean "unknown" together, though each of `fields` may have a value that looks so."""

    mask: int
    code: int
    fields: tuple[str, ...]


def reader(
    layout: Layout,
    columns: Sequence[Column],
    message: type,
    irregular: Callable[[bytes], Any],
    unknown: Unknown | None,
) -> Callable[[bytes], Any]:
    """Generate `read(data) -> message`; `irregular` gets data of another length than the layout's."""
    names: dict[str, Any] = {
        "from_bytes": int.from_bytes,
        "new": tuple.__new__,
        "message": message,
        "irregular": irregular,
    }
    names.update({f"_{column.field}": column.default if column.read is None else column.read for column in columns})
    fields = "".join(f"{_reading(layout, column)}, " for column in columns)
    nothing = "".join("None, " if _in(unknown, column) else f"{_reading(layout, column)}, " for column in columns)
    source = f"""
def read(data):
    if len(data) != {layout.length}:
        return irregular(data)
    word = from_bytes(data, {layout.byte_order!r})
    {_if_unknown(unknown, f"new(message, ({nothing}))")}
    return new(message, ({fields}))
"""
    return generate("read", source, names)


def _reading(layout: Layout, column: Column) -> str:
    name = f"_{column.field}"
    if column.read is None:
        return name
    raw = layout.extract(column.field)
    return f"{name}({raw})" if callable(column.read) else f"{name}[{raw}]"


def _in(unknown: Unknown | None, column: Column) -> bool:
    return unknown is not None and column.field in unknown.fields


def writer(
    layout: Layout,
    columns: Sequence[Column],
    cob_id: int,
    careful: Callable[[Any], Frame],
    unknown: Unknown | None,
) -> Callable[[Any], Frame]:
    """Generate `write(message) -> Frame`; `careful` gets each message that the tables do not hold."""
    if not columns:
        frame = Frame(cob_id, bytes(layout.length))
        return lambda _: frame
    names: dict[str, Any] = {"new": tuple.__new__, "Frame": Frame, "careful": careful}
    names.update({f"_{column.field}": column.write for column in columns})
    called = [column for column in columns if callable(column.write)]
    odd = " or ".join(f"not 0 <= {column.field} <= {column.most}" for column in called)
    source = f"""
def write(message):
    try:
        {", ".join(column.field for column in columns)}, = message
        {"; ".join(f"{column.field} = _{column.field}({column.field})" for column in called)}
        word = {" | ".join(_writing(layout, column) for column in columns)}
    except (KeyError, TypeError, ValueError):
        return careful(message)
    {f"if {odd}: return careful(message)" if odd else ""}
    {_if_unknown(unknown, "careful(message)")}
    return new(Frame, ({cob_id}, word.to_bytes({layout.length}, {layout.byte_order!r})))
"""
    return generate("write", source, names)


def _writing(layout: Layout, column: Column) -> str:
    if callable(column.write):
        return layout.insert(column.field, column.field)
    return f"_{column.field}[{column.field}]"


def _if_unknown(unknown: Unknown | None, result: str) -> str:
    return f"if word & {unknown.mask:#x} == {unknown.code:#x}: return {result}" if unknown else ""


def generate(name: str, source: str, names: dict[str, Any]) -> Callable[[Any], Any]:
    """Compile one generated function; field names are identifiers, and numbers the only other thing put in."""
    exec(compile(source, f"<generated {name}>", "exec"), names)
    function: Callable[[Any], Any] = names[name]
    return function
