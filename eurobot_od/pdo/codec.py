"""PDO mapping to pack and unpack functions, for any mapping of 1 to 64 bits at any offset.

Rule of this file: bits only. A layout is worked out once from the mapping (CiA 301, 7.4.8.2: the first mapped object
has the least significant bits, bytes follow in little-endian order) and written out as one short Python function a
message. What a raw value means is not known here; it comes in as a table or a function for each field.

Looking up takes less time than shifting and masking. So a message is read from tables that are indexed with the bytes
of the frame, `_y[b1][b2]`, and written as the sum of its fields' bits, which stand in tables at their places.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, NamedTuple

from eurobot_od.frame import Data, Frame
from eurobot_od.od.values import SLICE

MAX_BITS = 64
"""A PDO carries at most 64 bits (CiA 301, 7.4.8.2)."""

LOOKED_UP_BITS = 16
"""Fields up to this wide are looked up; for wider ones a function is called each time."""


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

    def insert(self, value: str) -> str:
        """Write the expression that brings the run from a value to its place in the word."""
        return f"({value} >> {self.shift} & {self.mask:#x}) << {self.offset}"


def place(runs: Iterable[Run], raw: int) -> int:
    """Return a raw value's bits at the places in the word that its runs say."""
    word = 0
    for run in runs:
        word |= run.place(raw)
    return word


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
        return place(self.runs[field], raw)

    def extract(self, field: str) -> str:
        """Write the expression that takes a field's raw value out of `word`."""
        return " | ".join(f"({run.extract()})" for run in self.runs[field])

    def insert(self, field: str, value: str) -> str:
        """Write the expression that puts a field's raw value at its places in the word."""
        return " | ".join(f"({run.insert(value)})" for run in self.runs[field])


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

    `read` turns the raw value into its meaning; None for a field that is not mapped and always has its `default`.
    `write` turns the meaning into bits at their places in the word: a mapping of every meaning, or a function that
    raises ValueError or TypeError. What the two say must not change, as it is remembered. They need not be called for
    `numbers`: raw values that mean themselves.
    """

    field: str
    read: Callable[[int], Any] | None
    write: Mapping[Any, int] | Callable[[Any], int]
    default: Any = None
    numbers: range = range(0)


class Unknown(NamedTuple):
    """Bits of the word that mean "unknown" together: the raw values of `codes`, each of which alone may be a value."""

    mask: int
    code: int
    codes: Mapping[str, int]


# Reading


class Share(NamedTuple):
    """What one `byte` of a frame has of a field: for each of its 256 values the bits of the raw value (`parts`)."""

    byte: int
    parts: tuple[int, ...]


def _shares(places: Sequence[int]) -> list[Share]:
    """Return the bytes that hold a field; the one with most of its bits, or the lowest, comes last.

    So there are the fewest rows, and values side by side are in the same.
    """
    bits: dict[int, list[tuple[int, int]]] = {}
    for value_bit, place in enumerate(places):
        bits.setdefault(place // 8, []).append((1 << place % 8, 1 << value_bit))
    held = sorted(bits.items(), key=lambda item: (len(item[1]), -item[1][0][1]))
    return [Share(byte, _parts(pairs)) for byte, pairs in held]


def _parts(pairs: Sequence[tuple[int, int]]) -> tuple[int, ...]:
    return tuple(sum(value_bit for bit, value_bit in pairs if byte & bit) for byte in range(256))


class ByteTable:
    """The meanings of a field, to be looked up in `rows` with the bytes that hold it, one after the other.

    Its last rows are lists, empty until `fill` is told of a frame that needs them.
    """

    def __init__(self, read: Callable[[int], Any], shares: Sequence[Share]) -> None:
        self._read = read
        *self._outer, self._last = shares
        self.rows = _rows(self._outer)
        self.index = "".join(f"[b{byte}]" for byte, _ in shares)

    def fill(self, data: Data) -> None:
        """Enter the meanings that the field has in such frames, whatever the last byte is."""
        row, raw = self.rows, 0
        for byte, parts in self._outer:
            row, raw = row[data[byte]], raw | parts[data[byte]]
        if not row:
            row[:] = [self._read(raw | part) for part in self._last.parts]


def _rows(shares: Sequence[Share]) -> Any:
    """Return tuples in tuples with empty lists at the end; bytes with the same part of the field share theirs."""
    if not shares:
        return []
    (_, parts), *others = shares
    rows = {part: _rows(others) for part in set(parts)}
    return tuple(rows[part] for part in parts)


def reader(
    layout: Layout,
    columns: Sequence[Column],
    message: type,
    irregular: Callable[[Data], Any],
    unknown: Unknown | None,
) -> Callable[[Data], Any]:
    """Generate `read(data) -> message`; `irregular` gets data of another length than the layout's."""
    mapped = {column.field: column.read for column in columns if column.read is not None}
    looked_up = {field: read for field, read in mapped.items() if layout.widths[field] <= LOOKED_UP_BITS}
    tables = {field: ByteTable(read, _shares(layout.places(field))) for field, read in looked_up.items()}

    def seldom(data: Data) -> Any:
        if len(data) != layout.length:
            return irregular(data)
        for table in tables.values():
            table.fill(data)
        return read(data)

    known = {field: f"_{field}{table.index}" for field, table in tables.items()}
    called = {each.field: _asked(layout, each) for each in columns if each.field in mapped and each.field not in tables}
    values = {column.field: f"_{column.field}" for column in columns} | known | called
    nothing = values | dict.fromkeys(unknown.codes if unknown else (), "None")
    source = f"""
def read(data):
    try:
        {_sequence(f"b{byte}" for byte in range(layout.length))} = data
        {_if_unknown(layout, unknown, f"new(message, {_sequence(nothing.values())})")}
        {f"word = from_bytes(data, {layout.byte_order!r})" if called else ""}
        return new(message, {_sequence(values.values())})
    except (IndexError, ValueError):
        return seldom(data)
"""
    names = {f"_{column.field}": column.default if column.read is None else column.read for column in columns}
    names |= {f"_{field}": table.rows for field, table in tables.items()}
    names |= {"new": tuple.__new__, "message": message, "seldom": seldom, "from_bytes": int.from_bytes}
    read: Callable[[Data], Any] = generate("read", source, names)
    return read


def _asked(layout: Layout, column: Column) -> str:
    """Write the expression that asks `read` for the meaning of a field in `word`, unless it is among the numbers."""
    field, numbers = column.field, column.numbers
    return f"raw if {numbers.start} <= (raw := {layout.extract(field)}) < {numbers.stop} else _{field}(raw)"


def _sequence(items: Iterable[str]) -> str:
    """Write a tuple, or the target that a sequence of just this length can be unpacked to."""
    return f"({''.join(f'{item}, ' for item in items)})"


def _if_unknown(layout: Layout, unknown: Unknown | None, result: str) -> str:
    """Write what is returned for "unknown"; of most other frames the first byte tells that they are not."""
    if unknown is None:
        return ""
    mask, code = (bits.to_bytes(layout.length, layout.byte_order) for bits in (unknown.mask, unknown.code))
    masked = {byte: f"b{byte} & {bits}" if bits < 0xFF else f"b{byte}" for byte, bits in enumerate(mask) if bits}
    tests = (f"{value} == {code[byte]}" for byte, value in masked.items())
    return f"if {' and '.join(tests)}: return {result}"


# Writing


class Learnt(NamedTuple):
    """The bits that a function has given of the meanings of field `number` of a message so far."""

    number: int
    write: Callable[[Any], int]
    bits: dict[Any, int]


def writer(
    layout: Layout,
    columns: Sequence[Column],
    cob_id: int,
    careful: Callable[[Any], Frame],
    unknown: Unknown | None,
) -> Callable[[Any], Frame]:
    """Generate `write(message) -> Frame`; `careful` gets each message that the tables do not hold, or not yet."""
    if not columns:
        empty = Frame(cob_id, bytes(layout.length))
        return lambda _: empty
    learnt = {
        field: Learnt(number, write, {})
        for number, (field, _, write, *_) in enumerate(columns)
        if callable(write) and layout.widths[field] <= LOOKED_UP_BITS
    }

    def seldom(message: Any) -> Frame:
        frame = careful(message)
        for number, write, bits in learnt.values():
            bits[message[number]] = write(message[number])
        return frame

    tables = {column.field: _written_by(column, learnt) for column in columns}
    values = {column.field: f"v{number}" for number, column in enumerate(columns)}
    mapped = [column for column in columns if column.read is not None]
    seldoms = [*_odd(columns, values, tables), *_ambiguous(values, unknown)]
    source = f"""
def write(message):
    try:
        {_sequence(values.values())} = message + ()
        word = {" + ".join(_writing(layout, each, values[each.field], tables[each.field]) for each in mapped)}
    except (LookupError, TypeError, ValueError):
        return seldom(message)
    {f"if {' or '.join(seldoms)}: return seldom(message)" if seldoms else ""}
    return new(Frame, ({cob_id}, word.to_bytes({layout.length}, {layout.byte_order!r})))
"""
    names = {f"_{field}": table for field, table in tables.items()}
    names |= {"new": tuple.__new__, "Frame": Frame, "seldom": seldom}
    write: Callable[[Any], Frame] = generate("write", source, names)
    return write


def _written_by(column: Column, learnt: Mapping[str, Learnt]) -> Any:
    """Return what a field's bits are looked up in or called from; of one that is not mapped, the only value."""
    if column.read is None:
        return column.default
    if column.field in learnt:
        return learnt[column.field].bits
    return column.write if callable(column.write) else _by_number(column.write)


def _by_number(bits: Mapping[Any, int]) -> Mapping[Any, int] | tuple[int, ...]:
    """Return the bits of the numbers 0, 1, 2, ... as a tuple, which is quicker; those of anything else as they are."""
    plain = all(type(meaning) is int and meaning == number for number, meaning in enumerate(bits))
    return tuple(bits.values()) if plain else bits


def _writing(layout: Layout, column: Column, value: str, table: Any) -> str:
    """Write the expression that looks up a field's bits, or asks `write` for them, unless it is among the numbers."""
    field, numbers = column.field, column.numbers
    if not callable(table):
        return f"_{field}[{value}]"
    number = f"type({value}) is int and {numbers.start} <= {value} < {numbers.stop}"
    return f"({layout.insert(field, value)} if {number} else _{field}({value}))"


def _odd(columns: Sequence[Column], values: Mapping[str, str], tables: Mapping[str, Any]) -> Iterator[str]:
    """Write tests for what the tables let through: another value than the only one, and a place from a tuple's end."""
    for field, read, *_ in columns:
        if read is None:
            yield f"{values[field]} is not _{field}"
        elif isinstance(tables[field], tuple):
            yield f"{values[field]} < 0"


def _ambiguous(values: Mapping[str, str], unknown: Unknown | None) -> Iterator[str]:
    """Write the test for values that would be read as "unknown"; most others are told by the first field."""
    if unknown is not None:
        first, code = next(iter(unknown.codes.items()))
        yield f"{values[first]} == {code} and word & {unknown.mask:#x} == {unknown.code:#x}"


def generate(name: str, source: str, names: dict[str, Any]) -> Callable[[Any], Any]:
    """Compile one generated function; field names are identifiers, and numbers the only other thing put in."""
    exec(compile(source, f"<generated {name}>", "exec"), names)
    function: Callable[[Any], Any] = names[name]
    return function
