"""Where each bit of a message lies, and its two functions made from that: data to message, and message to frame.

A frame is read as one integer, the word; a field is then a shift and a mask. Interpreting the layout for each frame
would take several times as long as the shifts. So the few lines for a message are written as source once, and compiled.
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

The source contains only numbers, and names that are made here: nothing from a file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import lru_cache
from typing import Any, Literal, NamedTuple

from eurobot_od.errors import FieldError
from eurobot_od.frame import Data, Frame
from eurobot_od.od.values import MAX_BITS, SLICE


class LayoutError(ValueError):
    """Mapping entries that do not make a layout: a gap, an overlap, a wrong length, or more than 64 bits."""


class Slot(NamedTuple):
    """One mapping entry: `bits` bits of `field` (None: padding), the lowest being the value's bit `shift`.

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
    # Which of the two is wrong cannot be seen, and a wrong guess would shift every field behind it.
    if high - low + 1 != bits:
        raise LayoutError(f"{name} is mapped with {bits} bits")
    return Slot(to_field(match["name"]), low, bits, signed)


class Run(NamedTuple):
    """Bits side by side in value and word alike: value bit `shift` is word bit `offset`, for `bits` bits."""

    shift: int
    offset: int
    bits: int

    @property
    def mask(self) -> int:
        """All its bits, the lowest being bit 0."""
        return (1 << self.bits) - 1

    def place(self, value: int) -> int:
        """Return this run's part of a value, at its place in the word."""
        return (value >> self.shift & self.mask) << self.offset


ByteOrder = Literal["little", "big"]


class Layout:
    """Where each field's bits lie in a PDO: `fields` in wire order, `widths` in bits, `length` in bytes.

    `raws` are the raw values that the bits of each field can hold.

    The frame is read as one integer, in the byte order that leaves the fewest runs: a value whose slices are stored
    most significant first is in one piece again when the frame is read as big-endian. `runs_in` has each field's runs
    for either order, `runs` for that one.
    Raises LayoutError for over 64 bits, and for parts of a field that overlap or leave a gap.
    """

    def __init__(self, slots: Iterable[Slot]) -> None:
        self.slots = tuple(slots)
        self.bits = sum(slot.bits for slot in self.slots)
        if self.bits > MAX_BITS:
            raise LayoutError(f"{self.bits} bits are mapped, a PDO has at most {MAX_BITS}")
        self.length = (self.bits + 7) // 8
        # Bit by bit first, as slices may come in any order; runs, which cost a shift and a mask each, are made of that.
        self._places = {field: _whole(field, places) for field, places in self._collect().items()}
        self.fields = tuple(self._places)
        self.widths = {field: len(places) for field, places in self._places.items()}
        self.signed = frozenset(slot.field for slot in self.slots if slot.signed)
        # Two's complement: half of the values of a signed field are below 0 (CiA 301, 7.1.4.4).
        below = {field: (1 << width) // 2 * (field in self.signed) for field, width in self.widths.items()}
        self.raws = {field: range(-low, (1 << self.widths[field]) - low) for field, low in below.items()}
        orders: tuple[ByteOrder, ...] = ("little", "big")
        self.runs_in = {order: self._runs_in(order) for order in orders}
        # With as many runs either way it is little-endian, CANopen's own order: `min` takes the first of equals.
        self.byte_order: ByteOrder = min(orders, key=lambda order: sum(map(len, self.runs_in[order].values())))
        self.runs = self.runs_in[self.byte_order]

    def _collect(self) -> dict[str, list[tuple[int, int]]]:
        """Return for each field its pairs of value bit and frame bit."""
        found: dict[str, list[tuple[int, int]]] = {}
        offset = 0
        for field, shift, bits, _ in self.slots:
            if field is not None:  # padding only moves what follows
                found.setdefault(field, []).extend((shift + bit, offset + bit) for bit in range(bits))
            offset += bits
        return found

    def _runs_in(self, order: ByteOrder) -> dict[str, tuple[Run, ...]]:
        # Read as big-endian, the first byte is the word's highest; the bits within a byte stay where they are.
        flip = 8 * (self.length - 1) if order == "big" else 0

        def in_word(place: int) -> int:
            return abs(flip - place // 8 * 8) + place % 8

        return {field: merged(map(in_word, places)) for field, places in self._places.items()}

    def places(self, field: str) -> list[int]:
        """Return the frame bits (8 times the byte plus the bit in it) of a field's bits 0, 1, 2, ..."""
        return list(self._places[field])

    def shortest(self, needed: Iterable[str]) -> int:
        """Return the number of bytes that hold all `needed` fields: a frame without the others may end there."""
        return max((max(self._places[field]) // 8 + 1 for field in needed), default=0)

    def place(self, field: str, raw: int) -> int:
        """Return a raw value's bits at their places in the word."""
        return sum(run.place(raw) for run in self.runs[field])


def _whole(field: str, pairs: list[tuple[int, int]]) -> list[int]:
    """Return the frame bits of a value's bits 0, 1, 2, ...; each must be there exactly once."""
    value_bits = [value_bit for value_bit, _ in pairs]
    for bit in range(max(value_bits)):
        if bit not in value_bits:
            raise LayoutError(f"{field}: bit {bit} is mapped nowhere")
    # The frame would say the same bit twice, and could contradict itself.
    if len(set(value_bits)) != len(pairs):
        raise LayoutError(f"{field}: bits are mapped twice")
    return [place for _, place in sorted(pairs)]


def merged(places: Iterable[int], most: int = MAX_BITS) -> tuple[Run, ...]:
    """Return the runs of a value whose bits 0, 1, 2, ... are the word's bits `places`, each within `most` bits."""
    runs: list[Run] = []
    for bit, place in enumerate(places):
        if runs and place == runs[-1].offset + runs[-1].bits and place % most:
            runs[-1] = runs[-1]._replace(bits=runs[-1].bits + 1)
        else:
            runs.append(Run(bit, place, 1))
    return tuple(runs)


TABLE_BITS = 6
"""The meanings of fields up to this wide that are not numbers, such as enums, are kept in a table."""

REMEMBERED = 1024
"""How many meanings of a wider field are kept: a bus carries few different ones, and making one takes a call or two."""

UNENCODABLE = (FieldError, ValueError, TypeError, LookupError, AttributeError, OverflowError)
"""What a column's `write` raises for a value that cannot be sent as it is, and unpacking for a wrong tuple.

The last two are of NumPy's numbers: shifted, they would lose bits, but a word with one of them has no `to_bytes`.
"""


class Column(NamedTuple):
    """How one field of a message is read and written.

    `read` turns the raw value into its meaning; None for a field that is not mapped and always has its `default`.
    `write` is the way back; it raises one of UNENCODABLE. `numbers` are raw values that mean themselves, so that `read`
    is not called for them; `sendable` are meanings that are their own raw value, so that `write` is not called.
    """

    field: str
    read: Callable[[int], Any] | None
    write: Callable[[Any], int]
    default: Any = None
    numbers: range = range(0)
    sendable: range = range(0)

    def raw(self, number: int) -> str:
        """Write the expression of its raw value; `number` is its place in the message."""
        low, high = self.sendable.start, self.sendable.stop
        asked = f"write{number}(f{number})"
        return f"(f{number} if {low} <= f{number} < {high} else {asked})" if self.sendable else asked


class Unknown(NamedTuple):
    """Bits of the word that mean "unknown" together: the raw values of `codes`, each of which alone may be a value."""

    mask: int
    code: int
    codes: dict[str, int]


# Source of expressions


def extract(layout: Layout, field: str) -> str:
    """Write the expression that takes a raw value out of `word`; the lowest run needs no shift to its place."""
    runs = layout.runs[field]
    # More than one run only where a file maps a value in slices, or where the controller sends the most significant
    # byte first: the word is then read in the order that needs fewer runs.
    at = {run: f"word >> {run.offset}" if run.offset else "word" for run in runs}
    parts = (f"({at[run]} & {run.mask:#x})" + (f" << {run.shift}" if run.shift else "") for run in runs)
    bits = " | ".join(f"({part})" for part in parts)
    if field not in layout.signed:
        return bits
    # Two's complement (CiA 301, 7.1.4.4): the highest bit weighs minus what it would weigh without a sign.
    sign = layout.raws[field].stop  # flipping the sign bit and taking its weight off extends it to any length
    return f"(({bits}) ^ {sign:#x}) - {sign:#x}"


def _insert(layout: Layout, field: str, raw: str) -> str:
    """Write the expression that puts a raw value, fitting its width, at its places in the word."""
    runs = layout.runs[field]
    if len(runs) == 1 and field not in layout.signed:
        return f"{raw} << {runs[0].offset}"  # also by 0: a float, which cannot be shifted, must not get any further
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
    """Generate `read(data) -> message`; `irregular` gets data of another length than the layout's."""
    names: dict[str, Any] = {"new": tuple.__new__, "message": message, "irregular": irregular}
    names["from_bytes"] = int.from_bytes
    values = []
    for number, column in enumerate(columns):
        expression, name, helper = _meaning(layout, column, number)
        values.append(expression)
        names[name] = helper
    # One comparison for the whole word: each of the codes alone may be a real value.
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
    """Return the expression of a field's meaning, and the name and value of what it needs: a table or a function."""
    name, numbers = f"read{number}", column.numbers
    if column.read is None:
        return name, name, column.default
    raw = extract(layout, column.field)
    # Most fields are plain numbers, for which no function is called at all: this is what makes decoding fast.
    if numbers:
        return f"r if {numbers.start} <= (r := {raw}) < {numbers.stop} else {name}(r)", name, column.read
    if layout.widths[column.field] <= TABLE_BITS:
        raws = layout.raws[column.field]
        # Negative values come last, since Python's index -1 is the last item of a tuple.
        return f"{name}[{raw}]", name, tuple(map(column.read, (*range(raws.stop), *range(raws.start, 0))))
    # A wide field with words of its own, such as a position with codes for what is not known, would need a table of up
    # to 2^64 items; what has come lately is nearly always what comes next.
    return f"{name}({raw})", name, lru_cache(REMEMBERED)(column.read)


def writer(
    layout: Layout, columns: Sequence[Column], cob_id: int, careful: Callable[[Any], Frame], unknown: Unknown | None
) -> Callable[[Any], Frame]:
    """Generate `write(message) -> Frame`; `careful` gets each message with a value that is not to be sent as it is.

    That is an error to be put in words, or an unknown position, which only all its fields together make. Adding `()`
    makes a plain tuple, which the interpreter takes apart in one step, where a named one goes through an iterator.
    """
    if not columns:  # a message without data is always the same frame
        empty = Frame(cob_id, bytes(layout.length))
        return lambda _: empty
    names: dict[str, Any] = {"new": tuple.__new__, "Frame": Frame, "careful": careful, "unencodable": UNENCODABLE}
    # Of a field that is not mapped the name stands for its default, so that one comparison by identity finds a message
    # that wants to say something which the PDO cannot carry.
    names |= {f"write{n}": each.default if each.read is None else each.write for n, each in enumerate(columns)}
    mapped = [(number, column) for number, column in enumerate(columns) if column.read is not None]
    parts = (f"({_insert(layout, column.field, column.raw(number))})" for number, column in mapped)
    odd = [f"f{number} is not write{number}" for number, column in enumerate(columns) if column.read is None]
    if unknown is not None:
        odd.append(f"word & {unknown.mask:#x} == {unknown.code:#x}")  # a place that would be read as "unknown"
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
    """Write the items of a tuple; the comma at the end makes one of a single item, too."""
    return "".join(f"{item}, " for item in items)


def compiled(name: str, source: str, names: dict[str, Any]) -> Callable[[Any], Any]:
    """Return the function `name` of a source whose global names are `names`."""
    # Safe although it is `exec`: see the end of the docstring above. Compiled once for each message and device.
    exec(compile(source, f"<generated {name}>", "exec"), names)
    function: Callable[[Any], Any] = names[name]  # exec left it there, among the names that it uses
    return function
