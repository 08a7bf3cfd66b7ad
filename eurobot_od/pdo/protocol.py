"""Binds the message types to the PDOs of loaded dictionaries: frames in, typed messages out, and back.

Rule of this file: identifiers and bits come from the dictionaries, meanings from the kinds; here they are only put
together, and whatever does not fit together stops the load with file and index.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any, TypeAlias

from eurobot_od.errors import FieldError, FrameLengthError, MappingError, UnknownIdentifier, UnknownName
from eurobot_od.frame import Data, Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.outline import Outline
from eurobot_od.od.pdos import MappedObject, Pdo
from eurobot_od.od.values import Limits, PdoDirection
from eurobot_od.pdo import codec
from eurobot_od.pdo.codec import Column, Layout, LayoutError, Unknown
from eurobot_od.pdo.kinds import Coordinate, Heading, Kind
from eurobot_od.robot import dialects
from eurobot_od.robot.messages import Message, field_name, kinds, type_named
from eurobot_od.robot.values import OutOfRange

TABLE_BITS = 12
"""Fields up to this wide are written by a complete table, of wider ones the codec learns what is sent."""


class Binding:
    """One message as a dictionary maps it: `name`, message `type`, `cob_id`, `layout`, and who has it.

    `senders` and `receivers` are the names of the dictionaries that have it as a TPDO and as an RPDO.
    Raises MappingError if the mapping and the message type's fields do not fit.
    """

    def __init__(self, file: Path, pdo: Pdo) -> None:
        self.file, self.pdo, self.name, self.cob_id = file, pdo, pdo.name, pdo.cob_id
        self.senders: list[str] = []
        self.receivers: list[str] = []
        self.type = self._message_type()
        self.kinds = kinds(self.type)
        self.defaults: Mapping[str, Any] = self.type._field_defaults
        self.layout = self._layout()
        self._check_fields()
        self.limits = dict(self._field_limits())

    def _error(self, index: int, what: str) -> MappingError:
        return MappingError(self.file, index, what)

    def _message_type(self) -> type[Message]:
        try:
            return type_named(self.name)
        except UnknownName:
            raise self._error(self.pdo.index, f"{self.name!r} is no message of the protocol") from None

    def _layout(self) -> Layout:
        try:
            return Layout(map(_slot, self.pdo.mapping))
        except LayoutError as error:
            raise self._error(self.pdo.mapping_index, f"{self.name}: {error}") from None

    def _check_fields(self) -> None:
        mapped, known = set(self.layout.fields), set(self.kinds)
        if mapped - known or known - set(self.defaults) - mapped:
            has, wants = (", ".join(fields) or "nothing" for fields in (self.layout.fields, self.kinds))
            raise self._error(self.pdo.mapping_index, f"{self.name} maps {has}; its fields are {wants}")

    def _field_limits(self) -> Iterator[tuple[str, Limits]]:
        for entry in self.pdo.mapping:
            field = _slot(entry).field
            if field is not None:
                yield field, Limits(entry.limits.low, min(entry.limits.high, (1 << self.layout.widths[field]) - 1))

    @property
    def optional(self) -> list[str]:
        """Fields that a frame may leave out at its end: those with a default."""
        return [field for field in self.layout.fields if field in self.defaults]

    @cached_property
    def lengths(self) -> tuple[int, ...]:
        """Lengths in bytes that a frame of this message may have; the last is that of the whole mapping."""
        shortest = self.layout.shortest(field for field in self.layout.fields if field not in self.defaults)
        return tuple(sorted({shortest, self.layout.length}))

    def raw(self, field: str, value: Any) -> int:
        """Return the raw value of a field's meaning; raises FieldError."""
        if field not in self.limits:
            if value == self.defaults[field]:
                return 0
            default = self.kinds[field].text(self.defaults[field])
            raise FieldError(self.name, field, value, f"{default}, as the loaded EDS does not map it")
        try:
            raw = self.kinds[field].write(value, self.limits[field])
        except (ValueError, TypeError):
            raise FieldError(self.name, field, value, self.kinds[field].allowed(self.limits[field])) from None
        if raw >> self.layout.widths[field]:
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
        """Return the data with these raw values; optional fields may be left out.

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
        width = self.layout.widths[field]
        if not isinstance(value, int) or value >> width:
            raise FieldError(self.name, field, value, f"0..{(1 << width) - 1}")
        return self.layout.place(field, value)

    def _to_bytes(self, word: int) -> bytes:
        return word.to_bytes(self.layout.length, self.layout.byte_order)

    def complete(self, data: Data) -> bytes:
        """Return data of the mapping's full length.

        What is longer is cut (CiA 301, EMCY 0x8220); optional fields that a shorter frame leaves out get their
        defaults. Raises FrameLengthError for any other length (EMCY 0x8210).
        """
        if len(data) >= self.layout.length:
            return bytes(data[: self.layout.length])
        if len(data) not in self.lengths:
            expected = " or ".join(map(str, self.lengths))
            raise FrameLengthError(self.name, self.cob_id, len(data), expected)
        word = int.from_bytes(bytes(data) + bytes(self.layout.length - len(data)), self.layout.byte_order)
        for field in self.optional:
            word &= ~self.layout.place(field, -1)
            word |= self.layout.place(field, self.raw(field, self.defaults[field]))
        return self._to_bytes(word)

    # Meanings

    @cached_property
    def decode(self) -> Callable[[Data], Message]:
        """The function from a frame's data to the typed message; it raises FrameLengthError."""
        read: Callable[[Data], Message] = codec.reader(
            self.layout, self._columns, self.type, lambda data: read(self.complete(data)), self.unknown
        )
        return read

    @cached_property
    def encode(self) -> Callable[[Any], Frame]:
        """The function from a typed message to its frame; it raises FieldError."""
        return codec.writer(self.layout, self._columns, self.cob_id, self._write_carefully, self.unknown)

    @cached_property
    def _columns(self) -> list[Column]:
        return [self._column(field, kind) for field, kind in self.kinds.items()]

    def _column(self, field: str, kind: Kind) -> Column:
        if field not in self.limits:
            return Column(field, None, {}, self.defaults[field])
        limits, width = self.limits[field], self.layout.widths[field]
        read = partial(kind.read, limits=limits)
        if width > TABLE_BITS:
            numbers = kind.numbers(limits)[: 1 << width]
            return Column(field, read, lambda value: self.layout.place(field, self.raw(field, value)), numbers=numbers)
        return Column(field, read, _placed(kind, limits, width, self.layout.runs[field]))

    @cached_property
    def unknown(self) -> Unknown | None:
        """The bits that mean "position unknown": the codes of x, y and angle together (document Table 2)."""
        codes = {f: kind.UNKNOWN for f, kind in self.kinds.items() if isinstance(kind, (Coordinate, Heading))}
        if not any(isinstance(self.kinds[field], Coordinate) for field in codes):
            return None
        mask = sum(self.layout.place(field, -1) for field in codes)
        return Unknown(mask, sum(self.layout.place(field, code) for field, code in codes.items()), codes)

    def _write_carefully(self, message: Message) -> Frame:
        """Encode what the tables do not hold: angles to be normalised, an unknown position; or say what is wrong."""
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
        if unknown and word & unknown.mask == unknown.code:
            field = next(iter(unknown.codes))
            raise FieldError(self.name, field, values[field], "another place: with an unknown angle it means unknown")
        return Frame(self.cob_id, self._to_bytes(word))


def _slot(entry: MappedObject) -> codec.Slot:
    if entry.is_padding:
        return codec.Slot(None, 0, entry.bits)
    return codec.slot(entry.name, entry.bits, field_name)


@cache
def _placed(kind: Kind, limits: Limits, width: int, runs: tuple[codec.Run, ...]) -> Mapping[Any, int]:
    """Return the bits of every meaning that may be sent, at their places; messages and nodes share what is alike."""
    read = ((kind.read(raw, limits), raw) for raw in range(1 << width))
    return {meaning: codec.place(runs, raw) for meaning, raw in read if not isinstance(meaning, OutOfRange)}


Loaded: TypeAlias = Dictionary | Outline
"""A file's content; of either only its name is needed beside its PDOs."""

Source: TypeAlias = tuple[Loaded, Iterable[Pdo]]


class Protocol:
    """The messages of one or more dictionaries, encoded and decoded as those map them.

    Raises MappingError if a mapping does not fit its message type, if two messages share a COB-ID, or if two
    dictionaries disagree about a message.
    """

    def __init__(self, sources: Iterable[Source]) -> None:
        self._bindings: dict[str, Binding] = {}
        for dictionary, pdos in sources:
            for pdo in pdos:
                if pdo.valid:
                    self._bind(dictionary, pdo)
        self._by_type = {binding.type: binding for binding in self._bindings.values()}
        self._by_cob_id = {binding.cob_id: binding for binding in self._bindings.values()}
        # plain dictionaries: Python looks something up in one of a subclass more slowly
        self._readers: dict[int, Callable[[bytes], Message]] = {}
        self._writers: dict[type[Message], Callable[[Any], Frame]] = {}
        for binding in self._bindings.values():
            self._enter(binding)

    def _enter(self, binding: Binding) -> None:
        """Enter functions that make way for a message's own, which are generated when they are needed first."""

        def read(data: bytes) -> Message:
            self._readers[binding.cob_id] = binding.decode
            return binding.decode(data)

        def write(message: Message) -> Frame:
            self._writers[binding.type] = binding.encode
            return binding.encode(message)

        self._readers[binding.cob_id], self._writers[binding.type] = read, write

    @classmethod
    def load(cls, dialect: str | Path | None = None) -> Protocol:
        """Load all EDS files of a dialect by its name or folder; raises UnknownName, DictionaryError."""
        return cls((each, each.pdos) for each in dialects.outlines(dialect))

    @classmethod
    def of(cls, dictionary: Dictionary) -> Protocol:
        """Return the messages of one device as its EDS or DCF maps them; raises MappingError."""
        return cls([(dictionary, dictionary.pdos)])

    def _bind(self, dictionary: Loaded, pdo: Pdo) -> None:
        binding = self._bindings.get(pdo.name)
        if binding is None:
            self._refuse_shared(dictionary, pdo)
            binding = self._bindings[pdo.name] = Binding(dictionary.file, pdo)
        else:
            _refuse_difference(binding, dictionary, Binding(dictionary.file, pdo))
        (binding.senders if pdo.direction is PdoDirection.TPDO else binding.receivers).append(dictionary.name)

    def _refuse_shared(self, dictionary: Loaded, pdo: Pdo) -> None:
        for other in self._bindings.values():
            if other.cob_id == pdo.cob_id:
                where = f"{other.name} ({other.file.name} 0x{other.pdo.index:04X})"
                raise MappingError(
                    dictionary.file, pdo.index, f"{pdo.name}: COB-ID 0x{pdo.cob_id:03X} is already that of {where}"
                )

    # Typed messages

    def encode(self, message: Message) -> Frame:
        """Return the frame of a message; raises FieldError for a value that may not be sent."""
        try:
            write = self._writers[type(message)]
        except KeyError:
            raise UnknownName("message", type(message).__name__, self.names()) from None
        return write(message)

    def decode(self, cob_id: int, data: bytes) -> Message:
        """Return the typed message of a frame; a value outside its range is an OutOfRange in its field.

        Raises UnknownIdentifier, FrameLengthError.
        """
        try:
            read = self._readers[cob_id]
        except KeyError:
            raise UnknownIdentifier(cob_id) from None
        return read(data)

    # Raw unsigned integers

    def pack(self, name: str, /, **values: int) -> bytes:
        """Return the data of a message from raw integers; only their width is checked.

        Raises UnknownName for a message or field, FieldError for a value that is missing or too wide.
        """
        return self.binding(name).pack(values)

    def unpack(self, cob_id: int, data: bytes) -> tuple[str, dict[str, int]]:
        """Return name and raw integers of a frame; raises UnknownIdentifier, FrameLengthError."""
        binding = self.binding_of(cob_id)
        return binding.name, binding.unpack(data)

    # What there is

    @property
    def bindings(self) -> tuple[Binding, ...]:
        """All messages in the order of their COB-IDs, which is that of their priority."""
        return tuple(self._by_cob_id[cob_id] for cob_id in sorted(self._by_cob_id))

    def names(self) -> list[str]:
        """Return the names of all messages, most urgent first."""
        return [binding.name for binding in self.bindings]

    def binding(self, message: str | type[Message]) -> Binding:
        """Return how a message is mapped, by its name as in the document or by its type; raises UnknownName."""
        try:
            return self._by_type[type_named(message) if isinstance(message, str) else message]
        except (KeyError, UnknownName):
            name = message if isinstance(message, str) else message.__name__
            raise UnknownName("message", name, self.names()) from None

    def binding_of(self, cob_id: int) -> Binding:
        """Return how the message with a COB-ID is mapped; raises UnknownIdentifier."""
        try:
            return self._by_cob_id[cob_id]
        except KeyError:
            raise UnknownIdentifier(cob_id) from None

    def cob_id(self, message: str | type[Message]) -> int:
        """Return the COB-ID of a message; raises UnknownName."""
        return self.binding(message).cob_id

    def name(self, message_type: type[Message]) -> str:
        """Return a message type's name as the EDS writes it; raises UnknownName."""
        return self.binding(message_type).name


def _refuse_difference(known: Binding, dictionary: Loaded, other: Binding) -> None:
    """Two dictionaries that speak of one message must mean the same frame."""
    if known.cob_id != other.cob_id:
        what = f"COB-ID 0x{other.cob_id:03X}, but 0x{known.cob_id:03X} in {known.file.name}"
        raise MappingError(dictionary.file, other.pdo.index, f"{other.name}: {what}")
    if known.layout.slots != other.layout.slots:
        what = f"mapping differs from that in {known.file.name} 0x{known.pdo.mapping_index:04X}"
        raise MappingError(dictionary.file, other.pdo.mapping_index, f"{other.name}: {what}")
