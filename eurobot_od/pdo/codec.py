"""The layout of a message's bits, and the two functions generated from it: data to message, and message to frame.

A frame is read as one integer, the word; a field is then a shift and a mask. Interpreting the layout for each frame
would take several times as long, so the few lines for a message are generated as source once, and compiled.
Goto XY becomes, shortened to two fields:

    def read(data):
        if len(data) != 8: return irregular(data)
        word = from_bytes(data, 'little')
        return new(message, (r if 0 <= (r := word & 0xfff) < 3001 else read0(r), read4(word >> 42 & 0xffff)))

    def write(message):
        f0, f4 = message + ()
        try:
            word = ((f0 if 0 <= f0 < 3001 else write0(f0)) << 0) | ((f4 if 0 <= f4 < 65536 else write4(f4)) << 42)
            data = word.to_bytes(8, 'little')
        except unencodable: return careful(message)
        return new(Frame, (8, data))

The source contains only numbers and names made here, nothing from a file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cached_property, lru_cache
from typing import Any, Literal, NamedTuple

from eurobot_od.errors import FieldError
from eurobot_od.frame import Data, Frame
from eurobot_od.od.values import MAX_BITS, SLICE


class LayoutError(ValueError):
    """Mapping entries that do not make a layout: a gap, an overlap, a wrong length, or over 64 bits."""


class Slot(NamedTuple):
    """One mapping entry: `bits` bits of `field` (None: padding), of which the lowest is bit `shift` of the value.

    The highest bit of a `signed` field is its sign (two's complement, CiA 301, 7.1.4.4).
    """

    field: str | None
    shift: int
    bits: int
    signed: bool = False


def slot(name: str, bits: int, to_field: Callable[[str], str], signed: bool = False) -> Slot:
    """Return the slot of a mapping entry from its ParameterName and mapped length.

    Raises LayoutError if a slice's name and its mapped length contradict each other.
    """
    match = SLICE.match(name)
    if match is None:
        return Slot(to_field(name), 0, bits, signed)
    high, low = int(match["high"]), int(match["low"])
    # Either may be wrong, and a wrong guess would shift every later field.
    if high - low + 1 != bits:
        raise LayoutError(f"{name} is mapped with {bits} bits")
    return Slot(to_field(match["name"]), low, bits, signed)


class Run(NamedTuple):
    """Adjacent bits of a value that are adjacent in the word.

    They are `bits` bits from value bit `shift` and word bit `offset`.
    """

    shift: int
    offset: int
    bits: int

    @property
    def mask(self) -> int:
        """The run's bits, starting from bit 0."""
        return (1 << self.bits) - 1

    def place(self, value: int) -> int:
        """Return this run's bits of a value, at their place in the word."""
        return (value >> self.shift & self.mask) << self.offset


ByteOrder = Literal["little", "big"]


class Layout:
    """Places of the fields in a PDO: `fields` in wire order, `widths` in bits, `length` in bytes.

    `raws` are the raw values that fit each field's bits.

    The frame is read as one integer, in the byte order with the fewest runs: a value in slices with the most
    significant first is one run in big-endian order.

    Raises LayoutError for over 64 bits, and for slices that overlap or leave a gap.
    """

    def __init__(self, slots: Iterable[Slot]) -> None:
        self.slots = tuple(slots)
        self.bits = sum(slot.bits for slot in self.slots)
        if self.bits > MAX_BITS:
            raise LayoutError(f"{self.bits} bits are mapped, a PDO has at most {MAX_BITS}")
        self.length = (self.bits + 7) // 8
        # Single bits first, because slices may be in any order; they are joined into runs.
        self._places = {field: _whole(field, places) for field, places in self._collect().items()}
        self.fields = tuple(self._places)
        self.widths = {field: len(places) for field, places in self._places.items()}
        self.signed = frozenset(slot.field for slot in self.slots if slot.signed)
        # Two's complement: half of the values of a signed field are below 0 (CiA 301, 7.1.4.4).
        self.raws = {
            field: range(-(1 << width - 1), 1 << width - 1) if field in self.signed else range(1 << width)
            for field, width in self.widths.items()
        }

    @cached_property
    def runs_in(self) -> dict[ByteOrder, dict[str, tuple[Run, ...]]]:
        """Each field's runs in both byte orders, made on first use: few of a device's messages are ever used."""
        orders: tuple[ByteOrder, ...] = ("little", "big")  # CANopen's own order first: `min` returns it if equal
        return {order: self._runs_in(order) for order in orders}

    @cached_property
    def byte_order(self) -> ByteOrder:
        """The byte order with the fewest runs."""
        return min(self.runs_in, key=lambda order: sum(map(len, self.runs_in[order].values())))

    @cached_property
    def runs(self) -> dict[str, tuple[Run, ...]]:
        """Each field's runs in the chosen byte order."""
        return self.runs_in[self.byte_order]

    def _collect(self) -> dict[str, list[tuple[int, int]]]:
        """Return each field's pairs of value bit and frame bit."""
        found: dict[str, list[tuple[int, int]]] = {}
        offset = 0
        for field, shift, bits, _ in self.slots:
            if field is not None:  # padding only moves what follows
                found.setdefault(field, []).extend((shift + bit, offset + bit) for bit in range(bits))
            offset += bits
        return found

    def _runs_in(self, order: ByteOrder) -> dict[str, tuple[Run, ...]]:
        # In big-endian order, the first byte is the word's highest; bits keep their order within a byte.
        flip = 8 * (self.length - 1) if order == "big" else 0

        def in_word(place: int) -> int:
            return abs(flip - place // 8 * 8) + place % 8

        return {field: merged(map(in_word, places)) for field, places in self._places.items()}

    def places(self, field: str) -> list[int]:
        """Return the frame bits (8 times the byte, plus the bit in it) of a field's bits 0, 1, 2, ..."""
        return list(self._places[field])

    def shortest(self, needed: Iterable[str]) -> int:
        """Return the length in bytes of the shortest frame that contains all `needed` fields."""
        return max((max(self._places[field]) // 8 + 1 for field in needed), default=0)

    def place(self, field: str, raw: int) -> int:
        """Return a raw value's bits at their places in the word."""
        return sum(run.place(raw) for run in self.runs[field])


def _whole(field: str, pairs: list[tuple[int, int]]) -> list[int]:
    """Return the frame bits of a value's bits 0, 1, 2, ...; raises LayoutError unless each is there once."""
    value_bits = [value_bit for value_bit, _ in pairs]
    for bit in range(max(value_bits)):
        if bit not in value_bits:
            raise LayoutError(f"{field}: bit {bit} is mapped nowhere")
    # Two copies of a bit could contradict each other.
    if len(set(value_bits)) != len(pairs):
        raise LayoutError(f"{field}: bits are mapped twice")
    return [place for _, place in sorted(pairs)]


def merged(places: Iterable[int], most: int = MAX_BITS) -> tuple[Run, ...]:
    """Return the runs of a value whose bits 0, 1, 2, ... are at `places` in the word; a run ends after `most` bits."""
    runs: list[Run] = []
    for bit, place in enumerate(places):
        if runs and place == runs[-1].offset + runs[-1].bits and place % most:
            runs[-1] = runs[-1]._replace(bits=runs[-1].bits + 1)
        else:
            runs.append(Run(bit, place, 1))
    return tuple(runs)


TABLE_BITS = 6
"""Widest field whose meanings are in a table if they are not numbers, such as those of enums, in bits."""

REMEMBERED = 1024
"""Number of meanings of a wider field that are cached; a bus carries few different ones."""

UNENCODABLE = (FieldError, ValueError, TypeError, LookupError, AttributeError, OverflowError)
"""Exceptions of a column's `write` for a value that cannot be sent, and of unpacking a wrong tuple.

The last two come from NumPy's numbers, which have no `to_bytes`.
"""


class Column(NamedTuple):
    """Functions that read and write one field of a message.

    `read` converts the raw value; it is None for a field that is not mapped, which always has its `default`. `write`
    converts back, and raises one of UNENCODABLE. Raw values in `numbers` and values in `sendable` need no conversion.
    """

    field: str
    read: Callable[[int], Any] | None
    write: Callable[[Any], int]
    default: Any = None
    numbers: range = range(0)
    sendable: range = range(0)

    def raw(self, number: int) -> str:
        """Return the source of the expression for its raw value; `number` is its position in the message."""
        low, high = self.sendable.start, self.sendable.stop
        asked = f"write{number}(f{number})"
        return f"(f{number} if {low} <= f{number} < {high} else {asked})" if self.sendable else asked


class Unknown(NamedTuple):
    """Bits of the word that together mean "unknown": the raw values in `codes`; each alone may be a valid value."""

    mask: int
    code: int
    codes: dict[str, int]


# Source of expressions


def extract(layout: Layout, field: str) -> str:
    """Return the source of the expression that extracts a raw value from `word`."""
    runs = layout.runs[field]
    # There are several runs only if a file maps a value in slices, or if the device sends the most significant byte
    # first.
    at = {run: f"word >> {run.offset}" if run.offset else "word" for run in runs}
    parts = (f"({at[run]} & {run.mask:#x})" + (f" << {run.shift}" if run.shift else "") for run in runs)
    bits = " | ".join(f"({part})" for part in parts)
    if field not in layout.signed:
        return bits
    # Two's complement (CiA 301, 7.1.4.4): the highest bit weighs minus what it would weigh without a sign.
    sign = layout.raws[field].stop  # flipping the sign bit and subtracting its weight extends the sign
    return f"(({bits}) ^ {sign:#x}) - {sign:#x}"


def _insert(layout: Layout, field: str, raw: str) -> str:
    """Return the source of the expression that places a raw value in the word."""
    runs = layout.runs[field]
    if len(runs) == 1 and field not in layout.signed:
        return f"{raw} << {runs[0].offset}"  # also by 0, so that a float raises TypeError
    return " | ".join(f"({raw} >> {run.shift} & {run.mask:#x}) << {run.offset}" for run in runs)


# Functions


def unpacker(layout: Layout) -> Callable[[bytes], tuple[int, ...]]:
    """Generate `unpack(data) -> (raw, ...)`, in the order of `layout.fields`, for data of the layout's length."""
    source = f"""
def unpack(data):
    word = from_bytes(data, {layout.byte_order!r})
    return ({"".join(f"{extract(layout, field)}, " for field in layout.fields)})
"""
    return compiled("unpack", source, {"from_bytes": int.from_bytes})


def reader(
    layout: Layout, columns: Sequence[Column], message: type, irregular: Callable[[Data], Any], unknown: Unknown | None
) -> Callable[[Data], Any]:
    """Generate `read(data) -> message`; `irregular` is called for data of another length than the layout's."""
    names: dict[str, Any] = {"new": tuple.__new__, "message": message, "irregular": irregular}
    names["from_bytes"] = int.from_bytes
    values = []
    for number, column in enumerate(columns):
        expression, name, helper = _meaning(layout, column, number)
        values.append(expression)
        names[name] = helper
    # One comparison for the whole word, because each code alone may be a valid value.
    whole = ""
    if unknown is not None:
        nothing = ("None" if each.field in unknown.codes else value for each, value in zip(columns, values))
        whole = f"if word & {unknown.mask:#x} == {unknown.code:#x}: return new(message, ({_listed(nothing)}))"
    source = f"""
def read(data):
    if len(data) != {layout.length}: return irregular(data)
    word = from_bytes(data, {layout.byte_order!r})
    {whole}
    return new(message, ({_listed(values)}))
"""
    return compiled("read", source, names)


def _meaning(layout: Layout, column: Column, number: int) -> tuple[str, str, Any]:
    """Return the source of a field's meaning, and the name and value of the table or function that it uses."""
    name = f"read{number}"
    numbers = column.numbers
    if column.read is None:
        return name, name, column.default
    raw = extract(layout, column.field)
    # Most fields are plain numbers, which need no call; this makes decoding fast.
    if numbers:
        return f"r if {numbers.start} <= (r := {raw}) < {numbers.stop} else {name}(r)", name, column.read
    if layout.widths[column.field] <= TABLE_BITS:
        raws = layout.raws[column.field]
        # Negative values are last, because Python's index -1 is the last item of a tuple.
        return f"{name}[{raw}]", name, tuple(map(column.read, (*range(raws.stop), *range(raws.start, 0))))
    # A table for a wide field with codes could need 2^64 items; recent values usually repeat.
    return f"{name}({raw})", name, lru_cache(REMEMBERED)(column.read)


def writer(
    layout: Layout, columns: Sequence[Column], cob_id: int, careful: Callable[[Any], Frame], unknown: Unknown | None
) -> Callable[[Any], Frame]:
    """Generate `write(message) -> Frame`; `careful` is called for a message with an invalid value or unknown position.

    Adding `()` makes a plain tuple, which Python unpacks faster than a named tuple.
    """
    if not columns:  # a message without data is always the same frame
        empty = Frame(cob_id, bytes(layout.length))
        return lambda _: empty
    names: dict[str, Any] = {"new": tuple.__new__, "Frame": Frame, "careful": careful, "unencodable": UNENCODABLE}
    # For a field that is not mapped, the name is its default: any other object cannot be sent in the PDO.
    names |= {f"write{n}": each.default if each.read is None else each.write for n, each in enumerate(columns)}
    mapped = [(number, column) for number, column in enumerate(columns) if column.read is not None]
    parts = (f"({_insert(layout, column.field, column.raw(number))})" for number, column in mapped)
    odd = [f"f{number} is not write{number}" for number, column in enumerate(columns) if column.read is None]
    if unknown is not None:
        odd.append(f"word & {unknown.mask:#x} == {unknown.code:#x}")  # a valid value that would be read as "unknown"
    source = f"""
def write(message):
    try:
        {_listed(f"f{number}" for number in range(len(columns)))} = message + ()
        word = {" | ".join(parts)}
        data = word.to_bytes({layout.length}, {layout.byte_order!r})
    except unencodable:
        return careful(message)
    {f"if {' or '.join(odd)}: return careful(message)" if odd else ""}
    return new(Frame, ({cob_id}, data))
"""
    return compiled("write", source, names)


def _listed(items: Iterable[str]) -> str:
    """Return the source of a tuple's items; the last comma makes a tuple of a single item, too."""
    return "".join(f"{item}, " for item in items)


def compiled(name: str, source: str, names: dict[str, Any]) -> Callable[[Any], Any]:
    """Return the function `name` of a source whose global names are `names`."""
    # `exec` is safe here: see the end of the module's docstring. Compiled once for each message and device.
    exec(compile(source, f"<generated {name}>", "exec"), names)
    function: Callable[[Any], Any] = names[name]  # `exec` defines it in its globals
    return function
