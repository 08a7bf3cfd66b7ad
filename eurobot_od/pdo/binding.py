"""A message as a dictionary maps it: the layout of its PDO, bound to the fields of its type.

A binding works with raw integers (`pack`, `unpack`) and with meanings (`encode`, `decode`). The functions for meanings
are generated on first use, so that a program that uses two messages does not wait for all others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from copy import copy
from functools import cached_property, partial
from itertools import accumulate
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from eurobot_od.errors import FieldError, FrameLengthError, LocalError, MappingError, UnknownName
from eurobot_od.frame import Data, Frame
from eurobot_od.od.meanings import NO_MEANING
from eurobot_od.od.pdos import Mapped, Pdo
from eurobot_od.od.units import UnitScale
from eurobot_od.od.values import SLICE, Address, Limits, label
from eurobot_od.pdo import codec, kinds
from eurobot_od.pdo.codec import Column, Layout, LayoutError, Slot, Unknown, slot
from eurobot_od.pdo.kinds import CatalogueEntry, Kind, MeaningError, Message, OutOfRange
from eurobot_od.support.extras import place_of
from eurobot_od.support.texts import first_free

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable


class Placed(NamedTuple):
    """A mapped object in a frame: `mask` of its value, and `offset`, its lowest bit in the frame (CiA 301, 7.4.8.2)."""

    entry: Mapped
    address: Address
    mask: int
    offset: int


class MappedObject(NamedTuple):
    """A mapped object: its `field` in `show`, logs and the page, and canopen's variable."""

    field: str
    variable: ODVariable


class Binding:
    """A message as a dictionary maps it: `name`, message `type`, `cob_id`, `layout`, and the nodes that have it.

    `group` and `always` come from the catalogue. `reads_longer` is set if frames may be longer than the mapping, which
    only a catalogue allows. `senders` and `receivers` are the names of the dictionaries with it as a TPDO and as an
    RPDO.

    Raises MappingError if the mapping does not fit the message type's fields.
    """

    def __init__(self, file: Path, pdo: Pdo, name: str, entry: CatalogueEntry | None) -> None:
        self.file = file
        self.pdo = pdo
        self.name = name
        self.cob_id = pdo.cob_id
        self.senders: list[str] = []
        self.receivers: list[str] = []
        try:
            self.layout = Layout(_slots(pdo.mapping))
        except LayoutError as error:
            raise MappingError(file, pdo.mapping_index, f"{name}: {error}") from None
        mapped = [(field, each) for (field, *_), each in zip(self.layout.slots, pdo.mapping) if field is not None]
        # A longer frame of a catalogue's message still begins with it; for any other PDO only the mapping counts.
        self.reads_longer = entry is not None
        if entry is None:  # only the types of the mapped objects are known
            widths = self.layout.widths
            made = {field: _kind(each, widths[field]) for field, each in mapped}
            entry = CatalogueEntry(kinds.made_type(name, made))
        self.type, self.group, self.always = entry
        self.kinds = {field: kind.beside(file) for field, kind in kinds.kinds(self.type).items()}
        if self.reads_longer:
            self.kinds |= self._kinds_of_file(mapped)
        self.defaults: Mapping[str, Any] = self.type._field_defaults
        fields = set(self.layout.fields)
        own = set(self.kinds)
        if fields - own or own - set(self.defaults) - fields:  # a field with a default need not be mapped
            has, wants = (", ".join(names) or "nothing" for names in (self.layout.fields, self.kinds))
            what = f"{name} maps {has}; the fields of class {self.type.__name__} are {wants}"
            raise MappingError(file, pdo.mapping_index, what)
        # An object's limits may be wider than its mapped bits.
        ends = {field: (each.limits, self.layout.raws[field]) for field, each in mapped}
        self.limits = {f: Limits(max(said.low, raws[0]), min(said.high, raws[-1])) for f, (said, raws) in ends.items()}

    @cached_property
    def is_whole(self) -> bool:
        """Whether all entries of the mapping are known."""
        return not any(each.is_unknown for each in self.pdo.mapping)

    def known_fields(self, length: int) -> frozenset[str]:
        """Return the fields whose values are certain in a frame of `length` bytes.

        After an entry of an unknown object, a field's place is known only if the frame has the mapping's full length.
        """
        is_placed, offset = True, 0
        has_lengths = all(each.bits for each in self.pdo.mapping) and length == self.layout.length
        unknown: set[str | None] = set()
        for (field, _, bits, _), each in zip(self.layout.slots, self.pdo.mapping):
            offset += bits
            is_placed = is_placed and (not each.is_unknown or has_lengths)
            if each.is_unknown or not is_placed or offset > 8 * length:
                unknown.add(field)
        return frozenset(set(self.layout.fields) - unknown)

    def _kinds_of_file(self, mapped: Iterable[tuple[str, Mapped]]) -> Iterator[tuple[str, Kind]]:
        """Yield the mapped fields' kinds with the units and codes of the file; raises MappingError."""
        known = self.kinds
        for field, each in dict(mapped).items():
            try:
                if field in known:
                    yield field, known[field].of(each.meaning)
            except MeaningError as error:
                what = f"{self.name}: {field} {error} ({label(each.address)}); its class is at {place_of(self.type)}"
                raise MappingError(self.file, self.pdo.mapping_index, what) from None

    def again(self) -> Self:
        """Return a copy without senders and receivers."""
        other = copy(self)
        other.senders, other.receivers = [], []
        return other

    @cached_property
    def placed(self) -> tuple[Placed, ...]:
        """Mapped objects that carry a value, with their places."""
        offsets = accumulate((entry.bits for entry in self.pdo.mapping), initial=0)
        carrying = ((each, offset) for each, offset in zip(self.pdo.mapping, offsets) if not each.is_padding)
        return tuple(Placed(each, each.address, (1 << each.bits) - 1, offset) for each, offset in carrying)

    @cached_property
    def objects(self) -> Mapping[str, MappedObject]:
        """Mapped objects by name in the file; an object that is mapped in slices is one."""
        found = {}
        for entry, (field, *_) in zip(self.pdo.mapping, self.layout.slots):
            if field is not None:
                name: str = entry.variable.qualname or "0x{:04X}:{}".format(*entry.address)
                part = SLICE.match(name)
                found[part["name"] if part else name] = MappedObject(field, entry.variable)
        return found

    def object_name(self, name: str | int) -> str | None:
        """Return the name of the object that `name`, a name, field, index or position, stands for; None if none."""
        if isinstance(name, int):
            by_place: dict[int, str] = dict(enumerate(self.objects))
            return (by_place | {each.variable.index: key for key, each in reversed([*self.objects.items()])}).get(name)
        fields = {kinds.plain_name(each.field): key for key, each in self.objects.items()}
        return (fields | {kinds.plain_name(key): key for key in self.objects}).get(kinds.plain_name(name))

    def field(self, name: str) -> str:
        """Return the field for an object's name in any spelling; raises UnknownName."""
        key = self.object_name(name)
        if key is None:
            raise UnknownName(f"field of {self.name}", name, self.kinds)
        return self.objects[key].field

    @property
    def too_narrow(self) -> list[str]:
        """Fields with valid values that do not fit their mapped bits."""
        limits = {f: entry.limits for entry, (f, *_) in zip(self.pdo.mapping, self.layout.slots) if f is not None}
        extremes = {field: self.kinds[field].extremes(each) for field, each in limits.items()}
        return [f for f, each in extremes.items() if any(raw not in self.layout.raws[f] for raw in each)]

    def message(self, /, **values: Any) -> Message:
        """Return the message with these unchecked field values; raises TypeError for an unknown field."""
        make: Callable[..., Message] = self.type
        return make(**values)

    @property
    def optional(self) -> list[str]:
        """Fields that a frame may omit at its end: those with a default."""
        return [field for field in self.layout.fields if field in self.defaults]

    @cached_property
    def lengths(self) -> tuple[int, ...]:
        """Valid lengths of a frame in bytes; the last one is that of the whole mapping."""
        # No length between the two, because a frame could end within an optional field.
        shortest = self.layout.shortest(field for field in self.layout.fields if field not in self.defaults)
        return tuple(sorted({shortest, self.layout.length}))

    def raw(self, field: str, value: Any) -> int:
        """Return the raw value for a field's value; raises FieldError."""
        if field not in self.limits:  # a field that is not mapped always has its default
            if value == self.defaults[field]:
                return 0
            default = self.kinds[field].text(self.defaults[field])
            raise FieldError(self.name, field, value, f"{default}, as the loaded EDS does not map it")
        try:
            raw = self.kinds[field].write(value, self.limits[field])
        except (ValueError, TypeError):
            raise FieldError(self.name, field, value, self.kinds[field].wanted(value, self.limits[field])) from None
        if raw not in self.layout.raws[field]:
            width = self.layout.widths[field]
            raise FieldError(self.name, field, value, f"what fits into the {width} bits that the loaded EDS maps")
        return raw

    # Raw integers

    @cached_property
    def _unpack(self) -> Callable[[bytes], tuple[int, ...]]:
        return codec.unpacker(self.layout)

    def unpack(self, data: bytes) -> dict[str, int]:
        """Return the raw values in a frame's data; raises FrameLengthError."""
        return dict(zip(self.layout.fields, self._unpack(self.complete(data))))

    def pack(self, values: Mapping[str, int]) -> bytes:
        """Return the data for raw values; optional fields may be omitted, signed ones may be negative.

        Raises UnknownName for a field that is not mapped, FieldError for one that is missing or too wide.
        """
        for field in values:
            if field not in self.layout.fields:
                raise UnknownName(f"field of {self.name}", field, self.layout.fields)
        return self._to_bytes(sum(self._placed(field, values) for field in self.layout.fields))

    def _placed(self, field: str, values: Mapping[str, int]) -> int:
        value: Any = values.get(field)
        if value is None and field in self.defaults:
            value = self.raw(field, self.defaults[field])
        # Checked against the bits, not the limits: `pack` may also make invalid messages.
        raws = self.layout.raws[field]
        if not isinstance(value, Integral) or value not in raws:
            raise FieldError(self.name, field, value, f"{raws[0]}..{raws[-1]}")
        return self.layout.place(field, int(value))

    def _to_bytes(self, word: int) -> bytes:
        return word.to_bytes(self.layout.length, self.layout.byte_order)

    def complete(self, data: Data) -> bytes:
        """Return data of the mapping's full length.

        Longer data is cut (CiA 301, EMCY 0x8220); omitted optional fields get their defaults. Raises FrameLengthError
        for any other length (EMCY 0x8210).
        """
        if len(data) >= self.layout.length:
            return bytes(data[: self.layout.length])
        if len(data) not in self.lengths:
            raise self.wrong_length(data)
        word = int.from_bytes(bytes(data) + bytes(self.layout.length - len(data)), self.layout.byte_order)
        for field in self.optional:  # a partly received field is discarded
            word &= ~self.layout.place(field, -1)
            word |= self.layout.place(field, self.raw(field, self.defaults[field]))
        return self._to_bytes(word)

    def wrong_length(self, data: Data) -> FrameLengthError:
        """Return the error for data of another length than the mapping's."""
        return FrameLengthError(self.name, self.cob_id, len(data), " or ".join(map(str, self.lengths)))

    # Meanings

    @cached_property
    def decode(self) -> Callable[[Data], Message]:
        """Function from a frame's data to the typed message; it raises FrameLengthError."""
        # Data of another length is completed first.
        read: Callable[[Data], Message] = codec.reader(
            self.layout, self._columns, self.type, lambda data: read(self.complete(data)), self.unknown
        )
        return read

    @cached_property
    def encode(self) -> Callable[[Any], Frame]:
        """Function from a typed message to its frame; it raises FieldError."""
        return codec.writer(self.layout, self._columns, self.cob_id, self._write_carefully, self.unknown)

    @cached_property
    def _columns(self) -> list[Column]:
        return [self._column(field, kind) for field, kind in self.kinds.items()]

    def _column(self, field: str, kind: Kind) -> Column:
        write: Callable[[Any], int] = partial(self.raw, field)
        if field not in self.limits:
            return Column(field, None, write, self.defaults[field])
        limits = self.limits[field]
        raws = self.layout.raws[field]
        read = partial(kind.read, limits=limits)
        if self.layout.widths[field] <= codec.TABLE_BITS:  # few values: a table for sending, too
            meanings = {read(raw): raw for raw in raws}
            write = {m: raw for m, raw in meanings.items() if not isinstance(m, OutOfRange)}.__getitem__
        said = (kind.numbers(limits), kind.sendable(limits))
        numbers, sendable = (range(max(each.start, raws.start), min(each.stop, raws.stop)) for each in said)
        return Column(field, read, write, numbers=numbers, sendable=sendable)

    @cached_property
    def unknown(self) -> Unknown | None:
        """Bits that together mean "unknown", such as those of x, y and angle; None without such fields."""
        codes = {f: kind.unknown_as_a_whole for f, kind in self.kinds.items() if kind.unknown_as_a_whole is not None}
        if not codes:
            return None
        mask = sum(self.layout.place(field, -1) for field in codes)
        return Unknown(mask, sum(self.layout.place(field, code) for field, code in codes.items()), codes)

    def _write_carefully(self, message: Message) -> Frame:
        """Encode a message that the generated code refused: an unknown position; raises FieldError for others."""
        values = message._asdict()
        unknown = self.unknown
        word = 0
        if unknown and all(values[field] is None for field in unknown.codes):
            word = unknown.code
            values = {field: value for field, value in values.items() if field not in unknown.codes}
            unknown = None
        for field, value in values.items():
            raw = self.raw(field, value)
            word |= self.layout.place(field, raw) if field in self.limits else 0
        # 255 mm, 255 mm is a valid place, but with the angle's code it would be read as "unknown".
        if unknown and word & unknown.mask == unknown.code:
            field, *_ = unknown.codes
            alone = " and ".join(each for each in unknown.codes if values[each] is None)
            allowed = f"another value: with {alone} unknown all would be unknown"
            raise FieldError(self.name, field, values[field], allowed)
        return Frame(self.cob_id, self._to_bytes(word))


def _kind(entry: Mapped, width: int) -> Kind:
    """Return the kind of a field without a message type, from the mapped object and its file."""
    said = entry.meaning
    if entry.is_unknown:
        return kinds.UnknownKind()
    if said == NO_MEANING or not entry.type.is_integer:
        return kinds.kind_of(entry.type, width, entry.variable)
    words = {raw: name for name, raw in said.codes.items()}
    if words:
        return kinds.Worded(lambda raw: words.get(raw, ""), words, UnitScale(said.unit_alone, said.step))
    return kinds.Quantity(said.unit_alone, said.step)


def _slots(mapping: Iterable[Mapped]) -> list[Slot]:
    """Return the mapping's slots; objects with the same name get different fields, slices of one value the same one."""
    slots: list[Slot] = []
    taken: set[str | None] = {None}
    for entry in mapping:
        signed = entry.type.is_signed
        bits = entry.bits or 1  # 0: of unknown length, so that later fields have no known place
        each = Slot(None, 0, bits) if entry.is_padding else slot(entry.name, bits, kinds.field_name, signed)
        # 86 of 200 real files repeat a name. A slice's field is shorter than its entry's name.
        if each.field == kinds.field_name(entry.name):
            each = each._replace(field=first_free(each.field, taken))
        slots.append(each)
        taken.add(each.field)
    return slots


# Messages as a person writes them, fields as `name=value`


def parse(binding: Binding, fields: Sequence[str]) -> Message:
    """Return the message of `name=value` words; raises UnknownName, FieldError, LocalError."""
    values: dict[str, Any] = {}
    for text in fields:
        written, given, value = text.partition("=")
        if not given and (name := written.partition(":")[0]) in binding.kinds and ":" in written:
            raise LocalError(f"{text}: write FIELD=VALUE, such as {name}={written.partition(':')[2]}")
        field = written if written in binding.kinds else binding.field(written)
        if field in values:
            raise LocalError(f"{binding.name}: {field} given twice")
        kind = binding.kinds[field]
        limits = binding.limits.get(field)
        try:
            values[field] = kind.parse(value)
        except UnknownName:
            raise
        except (ValueError, KeyError):
            allowed = kind.allowed(limits) if limits else "nothing, as the loaded EDS does not map it"
            # without an equals sign, the whole word is the wrong value
            raise FieldError(binding.name, field, value if given else text, allowed) from None
    missing = [field for field in binding.kinds if field not in values and field not in binding.defaults]
    if missing:
        raise LocalError(f"{binding.name}: {', '.join(missing)} missing")
    return binding.message(**values)
