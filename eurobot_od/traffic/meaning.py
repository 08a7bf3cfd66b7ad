"""Meanings of frames: a message of the protocol, a CANopen service, or damage.

Rule of this file: nothing raises, whatever the frame; what is wrong with it is part of its meaning.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache, partial
from struct import unpack
from types import MappingProxyType
from typing import Any, NamedTuple

from eurobot_od.errors import FrameLengthError, shown_identifier
from eurobot_od.frame import EXTENDED, MOST_BYTES, Frame, RemoteFrame
from eurobot_od.od import values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.pdos import OnRefused, Pdo, fatal
from eurobot_od.od.values import ALL_NODES, Address, PdoDirection
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.codec import compiled, extract
from eurobot_od.pdo.in_force import Describe, InForce, LeftIdentifier, nothing_known
from eurobot_od.pdo.kinds import NOTHING, UNKNOWN, Catalogue, Kind, Message, OutOfRange, flagged_fields
from eurobot_od.pdo.protocol import ErrorWords, Protocol
from eurobot_od.support.texts import amount, one_line
from eurobot_od.traffic import services
from eurobot_od.traffic.dbc import ForeignMessage, FramesOfDevice, only_canopen
from eurobot_od.traffic.entries import MASTER, REMEMBERED, Damage, Foreign, Raw
from eurobot_od.traffic.services import (
    FOLLOWED,
    GUARDING,
    HEARTBEAT,
    SDO,
    CanopenService,
    Fields,
    SdoEnd,
    plain,
)

CANOPEN = "CANopen"
"""Group of the services; messages have theirs in the catalogue."""

DBC = "DBC"
"""Group of the messages of DBC files."""

REQUEST = "remote frame: asks for it"
"""Text of a remote frame."""


class Defect(NamedTuple):
    """A defect of a frame: its kind, a description, and the likely reason (empty if there are too many)."""

    damage: Damage
    text: str
    reason: str = ""


NOT_NAMED = "of a device whose file is not named (--eds), or of another robot (--robot)?"
MAPPED_OTHERWISE = "the device is likely mapped otherwise than its file says: `pdo NODE` or `monitor --ask` shows how"
"""Likely reason for a length that does not fit the PDO's mapping."""


REWRITTEN = "its mapping was written before the log begins, or the log does not have what was written, or the answer"
"""Likely reason for an unknown field."""


class SdoTransfer(NamedTuple):
    """A finished SDO transfer: its object, kind, size in bytes, and duration in s.

    `aborted` is the abort code, None if it was not; `lost` counts the segments that the log does not have. Without the
    end in the log it is not `whole`. `end` is that of its requests; `address` is None if its beginning is missing, and
    `content` if not all of it came, or too much to keep; a write that was refused has it as well.
    """

    object: str
    is_upload: bool
    how: str
    size: int
    seconds: float
    aborted: int | None = None
    lost: int = 0
    is_whole: bool = True
    end: SdoEnd | None = None
    address: Address | None = None
    content: bytes | None = None

    @property
    def fields(self) -> Fields:
        """Transfer as data."""
        said: Fields = {"node": self.end.server} if self.end else {}
        said |= {
            "direction": services.READ if self.is_upload else services.WRITE,
            "how": self.how,
            "seconds": self.seconds,
        }
        said["size"] = self.size
        if self.address is not None:
            said |= {"index": self.address[0], "subindex": self.address[1]}
            if self.content is not None and self.aborted is None:
                said |= services.content_fields(self.end and self.end.dictionary, self.address, self.content)
        return said if self.aborted is None else said | services.abort_fields(self.aborted)


class Meaning(NamedTuple):
    """Meaning of a frame: the message or service `name`, its `group`, its `nodes`, and its text.

    `message` is None for a service and for what could not be decoded. `name` is empty if nothing is known, `sender` if
    nothing says who sent it. `transfer` is the SDO transfer that this frame ends, if a `TrackingDecoder` knows it;
    `service` is its identifier's, or another protocol's message: it tells what the frame by itself says as data.
    `kinds` are those of the message's fields.
    """

    raw: Raw
    name: str
    group: str
    nodes: tuple[str, ...]
    message: Message | None
    text: str
    defects: tuple[Defect, ...] = ()
    transfer: SdoTransfer | None = None
    sender: str = ""
    service: CanopenService | ForeignMessage | None = None
    kinds: Mapping[str, Kind] = MappingProxyType({})

    @property
    def fields(self) -> Fields:
        """Data of a service; of the frame that ends an SDO transfer, the whole transfer."""
        if self.transfer and self.transfer.is_whole and self.name == SDO:
            return self.transfer.fields
        frame = self.raw.frame if isinstance(self.raw, Foreign) else self.raw
        return self.service.fields(frame[1]) if self.service and frame else {}

    @property
    def is_read(self) -> bool:
        """Whether the frame itself could be read, even if the log lacks frames before it."""
        if not self.defects or self.message is not None:
            return True
        return all(each.damage is Damage.INCOMPLETE for each in self.defects)


class MessageMeaning(Meaning):
    """Meaning of a message's frame, whose text is computed on each access, as few readers need it."""

    __slots__ = ()

    @property
    def text(self) -> str:
        """Fields as text."""
        text: Any = self[TEXT]
        return text if isinstance(text, str) else text(self.raw[1])


TEXT = Meaning._fields.index("text")
"""Index of the text, or of the function that computes it from the data."""


def wrong(meaning: Meaning) -> str:
    """Return the defects of a frame as text, empty without any."""
    return "; ".join(f"{each.damage.value}: {each.text}" for each in meaning.defects)


def with_defects(meaning: Meaning) -> str:
    """Return a frame's text as far as it could be read, with its defects after `!`."""
    if not meaning.defects:
        return meaning.text
    return f"{meaning.text}  ! {wrong(meaning)}" if meaning.is_read else f"! {wrong(meaning)}"


class Decoder:
    """Decodes frames by the EDS files of the nodes on the bus and the catalogue of their messages.

    Args:
        dictionaries: the devices' files
        catalogue: classes of messages
        refused: called with each PDO that cannot be used
        errors: words for emergency error codes of single nodes, by node-ID; 0 stands for all nodes
        master: name of the network's master
        learned: what the bus has shown of devices without files: where their PDOs and services are
        others: messages of other protocols, by COB-ID: names for what no device is known to send
        former: messages that may be the same still
        describe: finds a file for a node that shows its identity
        left: identifiers that PDOs have left, by node-ID and identifier
        frames: returns what a device is known to send outside CANopen; a message of `others` counts more
    """

    def __init__(
        self,
        dictionaries: Iterable[Dictionary],
        catalogue: Catalogue = NOTHING,
        refused: OnRefused = fatal,
        errors: Mapping[int, Mapping[int, str]] = MappingProxyType({}),
        master: str = MASTER,
        learned: Iterable[Dictionary] = (),
        others: Mapping[int, ForeignMessage] = MappingProxyType({}),
        former: Iterable[Binding] = (),
        describe: Describe = nothing_known,
        left: Mapping[int, Mapping[int, LeftIdentifier]] = MappingProxyType({}),
        frames: FramesOfDevice = only_canopen,
    ) -> None:
        self._left, self._frames = left, frames
        self.dictionaries = tuple(dictionaries)
        self.describe = describe
        self.others = {cob_id: each for device in self.dictionaries for cob_id, each in frames(device).items()}
        self.others |= others
        self.learned = tuple(learned)
        devices = (*self.dictionaries, *self.learned)
        self.protocol = Protocol.of_devices(devices, catalogue, refused, listening=True, former=former)
        self._own_errors = errors
        self._master = master or MASTER
        self._bindings = {each.cob_id: each for each in self.protocol.bindings}
        self._readers: dict[int | Damage, Callable[[Any], Meaning]] = {}

    def as_shown(self, shown: InForce) -> Decoder:
        """Return a decoder for the present settings of the devices; invalid PDOs are left out."""
        known = shown.described, self.protocol.catalogue, lambda _: None, self._own_errors, self._master
        former = self.protocol.bindings
        return Decoder(*known, shown.learned, self.others, former, self.describe, shown.left, self._frames)

    def binding(self, cob_id: int) -> Binding | None:
        """Return the message of an identifier, None without one."""
        return self._bindings.get(cob_id)

    @cached_property
    def remembered(self) -> Callable[[Raw], Meaning]:
        """Cached function for the meaning of a frame, as most frames repeat."""
        return lru_cache(REMEMBERED)(self)

    @cached_property
    def services(self) -> Mapping[int, CanopenService]:
        """Services by identifier, computed on first use."""
        found = services.services(self.dictionaries, self.errors, self._master, self.learned)
        for cob_id, each in self.others.items():
            if (service := found.get(cob_id)) and service.name == services.EMCY_NAME:
                found[cob_id] = _with_makers(service, each)
        return found

    @cached_property
    def errors(self) -> ErrorWords:
        """Meanings of the devices' emergency error codes."""
        return ErrorWords.of_devices(self.dictionaries, self.protocol.catalogue, self._own_errors, self.learned)

    @cached_property
    def unmapped(self) -> Unmapped:
        """PDOs besides the messages, computed on first use."""
        return Unmapped(self.dictionaries, self._left)

    @cached_property
    def followed(self) -> frozenset[int]:
        """Identifiers of frames that can change how later frames decode."""
        messages = self._bindings.keys()
        return frozenset(cob_id for cob_id, each in self.services.items() if each.name in FOLLOWED) - messages

    def __call__(self, raw: Raw) -> Meaning:
        """Return the meaning of a frame."""
        if raw.__class__ is RemoteFrame:
            return self._request(raw)
        read = self._readers.get(raw[0])  # by COB-ID; a Damage is never found
        if read:
            return read(raw)
        if isinstance(raw, Foreign):
            return self._foreign(raw)
        # A reader is made at the first frame of its identifier, as a log has few of a network's messages.
        binding = self._bindings.get(raw.cob_id)
        read = self._readers[raw.cob_id] = _reader(binding) if binding else self._service
        return read(raw)

    @cached_property
    def foreign(self) -> Mapping[int, ForeignMessage]:
        """Messages of `others` whose identifier no device, and no CANopen service on the bus, uses."""
        devices = {each.name for each in (*self.dictionaries, *self.learned)}

        def is_known(cob_id: int) -> bool:
            service = self.services.get(cob_id)
            is_named = service is not None and (service.node in devices or bool(devices and not service.node))
            return is_named or self.unmapped.is_in_file(cob_id)

        return {cob_id: each for cob_id, each in self.others.items() if not is_known(cob_id)}

    def _foreign(self, raw: Foreign) -> Meaning:
        """Return the meaning of an entry that is no classic frame; CAN FD is other traffic, not damage."""
        if raw.damage is Damage.OTHERS:
            return Meaning(raw, raw.damage.value, "", (), None, raw.text)
        if raw.damage is not Damage.FD:
            return Meaning(raw, "", "", (), None, raw.text, (Defect(raw.damage, raw.text),))
        cob_id, data = raw.frame or (-1, b"")
        if other := self.others.get(cob_id):
            return _other(other, raw, data)
        return Meaning(raw, f"CAN FD, {amount(len(data), 'byte')}", "", (), None, raw.text)

    def _service(self, frame: Frame) -> Meaning:
        if other := self.foreign.get(frame.cob_id):
            return _other(other, frame, frame.data)
        found = self.services.get(frame.cob_id)
        if found is None:
            return self._pdo(frame)
        nodes = self._nodes(found)
        if found.lengths and len(frame.data) not in found.lengths:
            text = f"{len(frame.data)} bytes of data, expected {found.expected}"
            defect = Defect(Damage.WRONG_LENGTH, f"{found.name} {frame}: {text}")
            return Meaning(frame, found.name, CANOPEN, nodes, None, text, (defect,), sender=found.sender)
        text = ", ".join(filter(None, (found.node, found.text(frame.data))))
        return Meaning(frame, found.name, CANOPEN, nodes, None, text, sender=found.sender, service=found)

    def _nodes(self, service: CanopenService) -> tuple[str, ...]:
        return (service.node,) if service.node else tuple(each.name for each in self.dictionaries)

    def _pdo(self, frame: Frame) -> Meaning:
        """Return the meaning of a frame that is neither a message nor a service."""
        found = self.unmapped.get(frame.cob_id)
        if found is None and frame.cob_id & EXTENDED:  # other traffic, not damage
            return Meaning(frame, f"29-bit frame, {amount(len(frame.data), 'byte')}", "", (), None, str(frame))
        damage, why = self.unmapped.defect(frame.cob_id)
        defects = (Defect(damage, f"{frame}{why}", NOT_NAMED),) if damage else ()
        if found is None or not found.name:
            return Meaning(frame, "", "", (), None, str(frame), defects)
        if frame.is_remote:
            return Meaning(frame, found.name, "", found.nodes, None, REQUEST, defects)
        if found.length not in (None, len(frame.data)):
            text = str(FrameLengthError(found.name, frame.cob_id, len(frame.data), str(found.length)))
            defects = (Defect(Damage.WRONG_LENGTH, text),)
        else:
            text = found.text(frame.data)
        # Without files, PDOs are distinguished by identifier and length.
        name = found.name if self.dictionaries else f"{found.name}, {amount(len(frame.data), 'byte')}"
        sender = found.nodes[0] if found.is_sent else ""
        return Meaning(frame, name, "", found.nodes, None, text, defects, sender=sender)

    def _request(self, frame: RemoteFrame) -> Meaning:
        """Return the meaning of a remote frame, which requests the frame of its identifier."""
        if binding := self._bindings.get(frame.cob_id):
            nodes = (*binding.senders, *binding.receivers)
            return Meaning(frame, binding.name, binding.group, nodes, None, REQUEST)
        if other := self.foreign.get(frame.cob_id):
            return Meaning(frame, other.name, DBC, other.nodes, None, REQUEST)
        found = self.services.get(frame.cob_id)
        if found is None:
            return self._pdo(frame)
        # Only for error control does a remote frame have a meaning of its own (CiA 301, 7.2.8.2.2.1).
        name, sender = (GUARDING, self._master) if found.name == HEARTBEAT else (found.name, "")
        text = ", ".join(filter(None, (found.node, REQUEST)))
        return Meaning(frame, name, CANOPEN, self._nodes(found), None, text, sender=sender)


def _with_makers(service: CanopenService, message: ForeignMessage) -> CanopenService:
    """Return a service extended by its maker's description of the same frames."""

    def text(data: bytes) -> str:
        return ", ".join(filter(None, (service.text(data), message.words(message.fields(data)))))

    return service._replace(text=text, fields=lambda data: {**service.fields(data), **message.fields(data)})


def _other(message: ForeignMessage, raw: Raw, data: bytes) -> Meaning:
    """Return the meaning of another protocol's frame with this data."""
    sender = next(iter(message.nodes), "")
    return Meaning(raw, message.name, DBC, message.nodes, None, message.text(data), sender=sender, service=message)


def _reader(binding: Binding) -> Callable[[Frame], Meaning]:
    """Return the function that decodes the frames of one message."""
    if not binding.is_whole:
        return partial(_read_in_part, binding)
    name = binding.name
    group = binding.group
    nodes = (*binding.senders, *binding.receivers)
    sender = next(iter(binding.senders), "")
    # `tuple.__new__` is faster than the constructor of the named tuple.
    length = binding.layout.length
    decode = binding.decode
    new = tuple.__new__
    known = binding.kinds
    allowed = lru_cache(None)(lambda field: binding.kinds[field].allowed(binding.limits[field]))

    writer = cache(partial(compile_text_writer, binding))  # compiled when the first text is read

    def text(data: bytes) -> str:
        (text,) = writer()("", words_of(binding, [binding.complete(data)]))
        return text.replace(OUTSIDE, "")

    def read(frame: Frame) -> Meaning:
        data = frame[1]  # faster than unpacking
        try:
            if len(data) > length and not binding.reads_longer:
                raise binding.wrong_length(data)
            message = decode(data)
        except FrameLengthError as error:
            defect = Defect(Damage.WRONG_LENGTH, str(error), MAPPED_OTHERWISE)
            return Meaning(frame, name, group, nodes, None, str(error), (defect,), sender=sender)
        defects: tuple[Defect, ...] = ()
        # Checked in C for speed, as it is hardly ever true.
        if len(data) > length or OutOfRange in map(type, message):
            defects = (*_too_long(frame, binding), *_out_of_range(message, binding, allowed))
        return new(MessageMeaning, (frame, name, group, nodes, message, text, defects, None, sender, None, known))

    return read


def _read_in_part(binding: Binding, frame: Frame) -> Meaning:
    """Decode a frame of a message whose mapping is only partly known."""
    data = frame.data
    length = binding.layout.length
    known = binding.known_fields(len(data))
    whole = binding.decode(data[:length] + bytes(length - len(data[:length])))
    message = whole._replace(**{field: None for field in binding.kinds if field not in known})
    values = zip(binding.kinds.items(), message)
    text = ", ".join(f"{field}={UNKNOWN if value is None else kind.text(value)}" for (field, kind), value in values)
    defects = Defect(Damage.UNKNOWN_MAPPING, f"{binding.name}: {REWRITTEN}")
    odd = _out_of_range(message, binding, lambda field: binding.kinds[field].allowed(binding.limits[field]))
    nodes = (*binding.senders, *binding.receivers)
    sender = next(iter(binding.senders), "")
    found = (defects, *odd)
    known_as = binding.name, binding.group, nodes
    return Meaning(frame, *known_as, message, one_line(text), found, sender=sender, kinds=binding.kinds)


OUTSIDE = "\0"
"""Marks a text with a value out of range; it occurs in no other text."""

LISTED_BITS = 12
"""Maximum width of fields whose texts are all cached, in bits."""


class FieldTexts(dict[int, str]):
    """Cache of the texts of a field by raw value."""

    def __init__(self, text: Callable[[int], str]) -> None:
        self._text = text

    def __missing__(self, raw: int) -> str:
        made = self[raw] = self._text(raw)
        return made


def words_of(binding: Binding, data: Sequence[bytes]) -> tuple[int, ...]:
    """Return frames' data, each of full length, as integers that contain the message's fields."""
    layout = binding.layout
    rest = bytes(MOST_BYTES - layout.length)
    order = layout.byte_order
    filled = rest.join(data) + rest if order == "little" else rest + rest.join(data)
    return unpack(f"{'<' if order == 'little' else '>'}{len(data)}Q", filled)


def compile_text_writer(binding: Binding) -> Callable[[str, Sequence[int]], list[str]]:
    """Generate `write(head, words) -> [head and the mapped fields for a person, ...]`.

    Nearly all values are plain numbers, or few; neither takes a call. Goto XY's function is, shortened to two fields:

        def write(head, words):
            return [f"{head}{text0[word & 0xfff]}, {text4(word >> 42 & 0xffff)}" for word in words]
    """
    unknown = binding.unknown
    names: dict[str, Any] = {}
    parts: list[str] = []
    nothing: list[str] = []
    for field, kind in binding.kinds.items():
        if field in binding.limits:
            is_unknown = unknown is not None and field in unknown.codes
            parts.append(_field_text(binding, field, len(parts), names))
            names[f"nothing{len(nothing)}"] = one_line(f"{field}={kind.text(None)}") if is_unknown else ""
            nothing.append(f"{{nothing{len(nothing)}}}" if is_unknown else parts[-1])
    row = f'f"{{head}}{", ".join(parts)}"'
    if unknown is not None:  # one comparison for all that are unknown together, as in the codec
        row += f' if word & {unknown.mask} != {unknown.code} else f"{{head}}{", ".join(nothing)}"'
    # Safe to compile, as it contains only numbers and names made here.
    return compiled("write", f"def write(head, words):\n    return [{row} for word in words]\n", names)  # type: ignore[return-value]


def _field_text(binding: Binding, field: str, number: int, names: dict[str, Any]) -> str:
    """Return the expression of a field's text, in braces, and add to `names` what it needs."""
    kind = binding.kinds[field]
    limits = binding.limits[field]
    raw = extract(binding.layout, field)

    numbers = range(0) if kind.says_more else kind.numbers(limits)
    name = one_line(f"{field}=")
    unit = one_line(f" {kind.unit}".rstrip())

    def text(raw: int) -> str:
        if raw in numbers:
            return f"{name}{raw}{unit}"
        value = kind.read(raw, limits)
        return name + one_line(kind.text(value)) + OUTSIDE * isinstance(value, OutOfRange)

    if binding.layout.widths[field] <= LISTED_BITS:
        names[f"text{number}"] = FieldTexts(text)
        return f"{{text{number}[{raw}]}}"
    names |= {f"text{number}": lru_cache(REMEMBERED)(text), f"name{number}": name, f"unit{number}": unit}
    if not numbers:
        return f"{{text{number}({raw})}}"
    plain = f"f'{{name{number}}}{{raw}}{{unit{number}}}'"
    return f"{{{plain} if {numbers.start} <= (raw := {raw}) < {numbers.stop} else text{number}(raw)}}"


def _too_long(frame: Frame, binding: Binding) -> Iterator[Defect]:
    if len(frame.data) > binding.layout.length:
        error = FrameLengthError(binding.name, frame.cob_id, len(frame.data), str(binding.layout.length))
        yield Defect(Damage.WRONG_LENGTH, f"{error}; read all the same", MAPPED_OTHERWISE)


def _out_of_range(message: Message, binding: Binding, allowed: Callable[[str], str]) -> Iterator[Defect]:
    for field in flagged_fields(message):
        value = int(getattr(message, field))
        yield Defect(Damage.OUT_OF_RANGE, f"{binding.name}: {field} = {value}, allowed: {allowed(field)}")


# Counts of defects


SEVERAL = 3
"""Number of defects from which the likely reason is reported."""


@dataclass
class DamageCount:
    """Number of defects of one kind, and the place, text and likely reason of the first."""

    log: str
    line: int
    text: str
    reason: str
    number: int = 0


class DamageCounts:
    """Counts of defects over any number of logs, with `notes` on what the logs do not show."""

    def __init__(self) -> None:
        self.counts: dict[Damage, DamageCount] = {}
        self.notes: list[str] = []

    def add(self, log: str, line: int, defects: Iterable[Defect]) -> None:
        """Count the defects of the entry at a line of a log."""
        for each in defects:
            count = self.counts.get(each.damage)
            if count is None:
                count = self.counts[each.damage] = DamageCount(log, line, each.text, each.reason)
            count.number += 1

    @property
    def total(self) -> int:
        """Number of all defects."""
        return sum(count.number for count in self.counts.values())

    def report(self) -> Iterator[str]:
        """Yield a line for each kind of damage, worst first, one for its likely reason, and the notes."""
        for damage in Damage:
            if damage in self.counts:
                count = self.counts[damage]
                where = one_line(f"{count.log}:{count.line}: {count.text}")
                yield f"{count.number:8} x {damage.value:18} first at {where}"
                if count.number >= SEVERAL and count.reason:
                    yield f"{'':11}{count.reason}"
        yield from map(one_line, self.notes)


DEFAULT_PDOS = tuple(each for each in values.PREDEFINED if each.is_per_node)
"""Predefined owners of identifiers (CiA 301, 7.3.3)."""


class IdentifierMeaning(NamedTuple):
    """Meaning of an identifier without a message: name, nodes, formatter; `damage` and `why` if uncertain.

    Without `is_sent` its one node receives it. `length` is what it has to have, in bytes; None if nothing says it.
    """

    name: str
    nodes: tuple[str, ...]
    text: Callable[[bytes], str]
    is_sent: bool
    damage: Damage | None = None
    why: str = ""
    length: int | None = None


def _is_sent(pdo: Pdo) -> bool:
    return pdo.direction is PdoDirection.TPDO


class Unmapped:
    """PDOs that are not messages, by identifier, and guesses by the predefined connection set."""

    def __init__(
        self,
        dictionaries: Iterable[Dictionary],
        left: Mapping[int, Mapping[int, LeftIdentifier]] = MappingProxyType({}),
    ) -> None:
        devices = {each.node_id: each for each in dictionaries}
        self._nodes = {node_id: each.name for node_id, each in devices.items()}
        self._known: dict[int, IdentifierMeaning] = {}
        read = ((each, each.read_pdos(each.default, lambda _: None, listening=True)) for each in devices.values())
        pdos = [(device, pdo) for device, found in read for pdo in found if pdo.cob_id]
        # Later ones take precedence: valid PDOs, and of these those of senders.
        for device, pdo in sorted(pdos, key=lambda each: (each[1].valid, each[1].valid and _is_sent(each[1]))):
            if not pdo.valid:
                why = f": {pdo.title} of {device.name}, off in its {device.file.suffix.lstrip('.').upper() or 'file'}"
                known = IdentifierMeaning(pdo.title, (device.name,), plain, _is_sent(pdo), Damage.SWITCHED_OFF, why)
            elif pdo.multiplex is not None:
                name = f"{device.name}.{pdo.key}"
                words = partial(_mpdo_words, devices)
                known = IdentifierMeaning(name, (device.name,), words, _is_sent(pdo), length=MPDO_LENGTH)
            else:
                continue
            self._known[pdo.cob_id] = known
        valid = {pdo.cob_id for _, pdo in pdos if pdo.valid}
        for node_id, by_identifier in left.items():
            for cob_id, each in by_identifier.items():
                if node_id in devices and cob_id not in valid:
                    self._known[cob_id] = _left(devices[node_id], each)

    def is_in_file(self, cob_id: int) -> bool:
        """Return whether a file describes an identifier."""
        return cob_id in self._known

    def get(self, cob_id: int) -> IdentifierMeaning | None:
        """Return the meaning of an identifier by the files or else a guess; None without any."""
        if cob_id in self._known:
            return self._known[cob_id]
        if found := values.owner(cob_id, DEFAULT_PDOS):
            if not self._nodes:  # without any file, none is missing
                return IdentifierMeaning(f"PDO 0x{cob_id:03X}", (), plain, is_sent=False)
            node_id = found.node_id(cob_id)
            node = self._nodes.get(node_id or 0, f"node {node_id}")
            why = f": in no file; a guess by its identifier: {found.owner} of {node}"
            is_sent = PdoDirection.RPDO.name not in found.owner
            return IdentifierMeaning(found.owner, (node,), plain, is_sent, Damage.UNKNOWN_IDENTIFIER, why)
        if found := values.owner(cob_id, values.RESERVED):
            why = f": in no file; its identifier is reserved for {found.owner}"
            return IdentifierMeaning("", (), plain, False, Damage.UNKNOWN_IDENTIFIER, why)
        return None

    def defect(self, cob_id: int) -> tuple[Damage | None, str]:
        """Return the defect of an identifier's frames (None without one) and its reason."""
        if found := self.get(cob_id):
            return found.damage, found.why
        return (None if cob_id & EXTENDED else Damage.UNKNOWN_IDENTIFIER), ""


def _left(device: Dictionary, left: LeftIdentifier) -> IdentifierMeaning:
    """Return the meaning of an identifier that a PDO has left."""
    direction = next(each for each, records in values.COMMUNICATION_RECORDS.items() if left.record in records)
    title = f"{direction.name} {left.record - direction.value + 1}"
    what = "switched off" if left.now is None else f"moved to {shown_identifier(left.now)}"
    why = f": {title} of {device.name}, {what} {left.how}"
    is_sent = direction is PdoDirection.TPDO
    return IdentifierMeaning(title, (device.name,), plain, is_sent, Damage.SWITCHED_OFF, why)


MPDO_LENGTH = values.MAX_BITS // 8
"""Length of an MPDO in bytes: node-ID, index, sub-index and four bytes of value."""

DESTINATION = 1 << 7
"""Bit of an MPDO's first byte: its node-ID is the destination, not the source (CiA 301, 7.2.2.6.2)."""


def _mpdo_words(devices: Mapping[int, Dictionary], data: bytes) -> str:
    """Format an MPDO: object, node and value (CiA 301, 7.2.2.6); data of MPDO_LENGTH."""
    node_id = data[0] & ~DESTINATION
    address = (data[1] | data[2] << 8, data[3])
    octets = data[4:]
    device = devices.get(node_id)
    node = device.name if device else f"node {node_id}"
    receiver = "all nodes" if node_id == ALL_NODES else node
    whose = f"to {receiver}" if data[0] & DESTINATION else f"of {node}"
    variable = device.variable(address) if device else None
    type_ = values.DATA_TYPES.get(variable.data_type or 0) if variable else None
    # A shorter object uses the first bytes; a type without a size may use all.
    size = type_.size if type_ and 0 < type_.size < 4 else 4
    return f"{services.object_words(device, address)} {whose} = {services.value_words(device, address, octets[:size])}"
