"""The messages of loaded dictionaries: frames in, typed messages out, and back.

Identifiers and bits come from the dictionaries, meanings from the kinds of the catalogue's message types. They are put
together here; if they do not fit, loading ends with an error that names file and index.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, Self, TypeAlias
from typing import Protocol as Interface

from eurobot_od.errors import DictionaryError, MappingError, UnknownIdentifier, UnknownName, shown_identifier
from eurobot_od.frame import Frame
from eurobot_od.od import standard, values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.network import READERS, load, read_network
from eurobot_od.od.pdos import OnRefused, Pdo, fatal
from eurobot_od.od.standard import device_profile
from eurobot_od.od.values import ALL_NODES, Address, MappingEntry, Multiplex, PdoDirection, Value
from eurobot_od.od.words import error_words
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import NOTHING, Catalogue, CatalogueEntry, Message, plain_name, readable_name

NAMES_NOTHING = re.compile(r"PDO|parameter|^\W*$", re.IGNORECASE)
"""Names of communication records that any PDO could have."""


class Described(Interface):
    """What has dictionaries: a network of devices."""

    @property
    def dictionaries(self) -> Iterable[Dictionary]:
        """The dictionaries of its devices."""


PdoSource: TypeAlias = tuple[Dictionary, Iterable[Pdo]]
"""What a file says, often a whole `Dictionary`, and those of its PDOs that are looked at."""


class Protocol:
    """The messages of one or more dictionaries, encoded and decoded as those map them.

        protocol = Protocol.of("motor.eds", node_id=5)
        print(protocol.decode(0x185, bytes(8)))

    `catalogue` has the message types; a PDO that it does not know becomes a named tuple of plain numbers. `refused`
    gets a MappingError if a mapping does not fit its message type, if two messages share a COB-ID, or if two
    dictionaries disagree about a message; by default it is raised. `former` are messages that may be the same still.
    """

    CATALOGUE: ClassVar[Catalogue] = NOTHING
    """The message types of what `of` reads."""

    def __init__(
        self,
        sources: Iterable[PdoSource],
        catalogue: Catalogue = NOTHING,
        refused: OnRefused = fatal,
        former: Iterable[Binding] = (),
    ) -> None:
        self.catalogue, self._former = catalogue, {each.name: each for each in former}
        self._bindings: dict[str, Binding] = {}
        self._by_cob_id: dict[int, Binding] = {}
        valid = [
            (dictionary, pdo) for dictionary, pdos in sources for pdo in pdos if pdo.valid and pdo.multiplex is None
        ]
        # senders first: a message has its sender's name and fields
        for dictionary, pdo in sorted(valid, key=lambda each: each[1].direction is PdoDirection.RPDO):
            try:
                self._bind(dictionary, pdo)
            except MappingError as error:
                refused(error)
        self._by_type = {binding.type: binding for binding in self._bindings.values()}
        self._by_name = {plain_name(name): binding for name, binding in self._bindings.items()}
        # filled when a message is first read or written, as its function is generated then
        self._readers: dict[int, Callable[[bytes], Message]] = {}
        self._writers: dict[type[Message], Callable[[Any], Frame]] = {}

    @classmethod
    def of(cls, source: str | Path | Dictionary | Described, node_id: int | None = None) -> Self:
        """Return the messages of a device, or of all devices of a network.

        A device is its EDS or DCF, or what was read of one, with a node-ID (1..127) if the file has none. A network is
        an `eurobot_od.Network`, a network file (YAML, nodelist.cpj), or a folder of EDS files. Raises FileError,
        and MappingError as the class does.
        """
        if isinstance(source, Dictionary):
            dictionaries: Iterable[Dictionary] = [source]
        elif isinstance(source, (str, Path)):
            is_network = Path(source).is_dir() or Path(source).suffix.lower() in READERS
            dictionaries = load(read_network(source).nodes) if is_network else [Dictionary.load(source, node_id)]
        else:
            dictionaries = source.dictionaries
        return cls.of_devices(dictionaries, cls.CATALOGUE)

    @classmethod
    def of_devices(
        cls,
        dictionaries: Iterable[Dictionary],
        catalogue: Catalogue,
        refused: OnRefused = fatal,
        listening: bool = False,
        former: Iterable[Binding] = (),
    ) -> Self:
        """Return the messages of devices as their files map them; `refused` also gets what a file's mapping lacks.

        Who is `listening` gets those with 29-bit identifiers, too.
        """
        sources = ((each, each.read_pdos(each.default, refused, listening)) for each in dictionaries)
        return cls(sources, catalogue, refused, former)

    def _bind(self, dictionary: Dictionary, pdo: Pdo) -> None:
        name, entry = self._identify(dictionary, pdo)
        binding = self._bindings.get(name)
        if binding is None:
            if other := self._by_cob_id.get(pdo.cob_id):
                where = f"{other.name} ({other.file.name} 0x{other.pdo.index:04X})"
                what = f"COB-ID {shown_identifier(pdo.cob_id)} is already that of {where}"
                raise MappingError(dictionary.file, pdo.index, f"{pdo.name}: {what}")
            former = self._former.get(name)
            is_same = former is not None and (former.file, former.pdo) == (dictionary.file, pdo)
            binding = former.again() if former and is_same else Binding(dictionary.file, pdo, name, entry)
            self._bindings[name] = self._by_cob_id[pdo.cob_id] = binding
        else:
            _refuse_difference(binding, dictionary, Binding(dictionary.file, pdo, name, entry), entry is None)
        nodes = binding.senders if pdo.direction is PdoDirection.TPDO else binding.receivers
        if dictionary.name not in nodes:
            nodes.append(dictionary.name)

    def _identify(self, dictionary: Dictionary, pdo: Pdo) -> tuple[str, CatalogueEntry | None]:
        """Return the name of a PDO's message, and its entry in the catalogue.

        Outside the catalogue a record's name need not say which PDO it is: half of the EDS files in the world repeat
        "TPDO communication parameter", or one name for all. Such a PDO is the message that already has its COB-ID, from
        whose sender or to whose receiver it is. Else it has its record's name, if that says something and is free, or
        is named by device, direction and number.
        """
        entry = self.catalogue.find(pdo.name)
        if entry is not None:
            return pdo.name, entry
        same, name = self._by_cob_id.get(pdo.cob_id), readable_name(pdo.name)
        # A message of the catalogue has a name that means something: another PDO on its COB-ID is an error.
        if same and self.catalogue.find(same.name) is None:
            return same.name, None
        if NAMES_NOTHING.search(name) or plain_name(name) in map(plain_name, self._bindings):
            return f"{dictionary.name}.{pdo.key}", None
        return name, None

    # Typed messages

    def encode(self, message: Message) -> Frame:
        """Return the frame of a message; raises UnknownName, and FieldError for a value that may not be sent."""
        try:
            write = self._writers[type(message)]
        except KeyError:
            write = self._writers[type(message)] = self.binding(type(message)).encode
        return write(message)

    def decode(self, cob_id: int, data: bytes) -> Message:
        """Return the typed message of a frame; a value outside its range is an OutOfRange in its field.

        Raises UnknownIdentifier, FrameLengthError.
        """
        try:  # cheaper than a look beforehand: it fails once for each message of a whole log
            read = self._readers[cob_id]
        except KeyError:
            read = self._readers[cob_id] = self.binding_of(cob_id).decode
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
        """Return how a message is mapped, by its name or by its type; raises UnknownName."""
        try:
            return self._by_name[plain_name(message)] if isinstance(message, str) else self._by_type[message]
        except KeyError:
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


def _refuse_difference(known: Binding, dictionary: Dictionary, other: Binding, renamed: bool) -> None:
    """Two dictionaries that speak of one message must mean the same frame; with `renamed` its fields by any names.

    Outside the catalogue only the COB-ID says that it is one message.
    """
    if known.cob_id != other.cob_id:
        what = f"COB-ID {shown_identifier(other.cob_id)}, but {shown_identifier(known.cob_id)} in {known.file.name}"
        raise MappingError(dictionary.file, other.pdo.index, f"{other.name}: {what}")
    if known.layout.bits != other.layout.bits if renamed else known.layout.slots != other.layout.slots:
        what = f"mapping differs from that in {known.file.name} 0x{known.pdo.mapping_index:04X}"
        raise MappingError(dictionary.file, other.pdo.mapping_index, f"{other.name}: {what}")


class ErrorWords(NamedTuple):
    """The words for the error codes of a network's devices: a robot's, those of single nodes, and those of profiles.

    A node's words come before all others. Those of the `robot` count only for its `own` devices, by node-ID: codes from
    0xFF00 on mean something else in every maker's devices.
    """

    robot: Mapping[int, str]
    nodes: Mapping[int, Mapping[int, str]]
    profiles: Mapping[int, int]
    own: frozenset[int] = frozenset()

    @classmethod
    def of_devices(
        cls,
        dictionaries: Iterable[Dictionary],
        catalogue: Catalogue,
        nodes: Mapping[int, Mapping[int, str]] = MappingProxyType({}),
    ) -> ErrorWords:
        """Return the words for the devices of these files; those with PDOs of the catalogue are the robot's own."""
        devices = tuple(dictionaries)
        own = frozenset(each.node_id for each in devices if any(map(catalogue.find, pdo_names(each))))
        return cls(catalogue.errors, nodes, {each.node_id: device_profile(each.number) for each in devices}, own)

    def of(self, node_id: int) -> Callable[[int], str]:
        """Return a function that puts the error codes of a node into words."""
        robot = self.robot if node_id in self.own else {}
        own = {**robot, **self.nodes.get(ALL_NODES, {}), **self.nodes.get(node_id, {})}
        return partial(error_words, own=own, profile=self.profiles.get(node_id, 0))


def pdo_names(dictionary: Dictionary) -> list[str]:
    """Return the names of a device's PDOs; a catalogue knows them by these."""
    return [dictionary.objects[index].name for index in values.COMMUNICATIONS.intersection(dictionary.members)]


# The mapping in force: what a bus has shown of its devices' parameters, over what their files say.
#
# A write that a device has confirmed, and its answer to a read, count more than its file, until the device starts
# anew: then it has what it was told to store, or else its file's values again (CiA 301, 7.5.2.13). Of a device
# without a file, what was shown makes one.


RECORDS = (*values.COMMUNICATION_RECORDS.values(), *values.MAPPING_RECORDS.values())

SERVICES = (standard.SYNC, standard.TIME, standard.EMCY, standard.SDO_REQUESTS, standard.SDO_ANSWERS)
"""Objects that say where a service is, besides those of the PDOs."""

SETTINGS = (standard.SYNC_PERIOD, standard.HEARTBEAT_TIME)
"""Objects that say how often something comes."""


def is_followed(address: Address) -> bool:
    """Whether an object is one of those that say what other frames mean."""
    return any(address[0] in each for each in RECORDS) or address in (*SERVICES, *SETTINGS)


class InForce:
    """What the devices of one bus have in force; at first what their files say, or what was `learned` of them."""

    def __init__(self, dictionaries: Iterable[Dictionary], learned: Iterable[Dictionary] = ()) -> None:
        self._files = {each.node_id: each for each in dictionaries}
        self._present: dict[int, Dictionary] = {}
        self._learned: dict[int, tuple[Dictionary, ...]] = {}
        self._stored: dict[int, dict[Address, int]] = {}
        for each in learned:
            self._learned[each.node_id] = (*self._learned.get(each.node_id, ()), each)
            # After a start, too: nothing is known of what it has then, and most have the same.
            self._stored.setdefault(each.node_id, {}).update(_numbers(each))
        self._shown = {node_id: dict(shown) for node_id, shown in self._stored.items()}

    @property
    def described(self) -> list[Dictionary]:
        """The devices that have files, each as it is now."""
        return [self._present.get(node_id, each) for node_id, each in self._files.items()]

    @property
    def learned(self) -> list[Dictionary]:
        """What is known of the devices that have no files and have shown a mapping."""
        return [each for parts in self._learned.values() for each in parts]

    def show(self, node_id: int, address: Address, octets: bytes) -> bool:
        """Take in what a device has at an address; return whether other frames mean something else now."""
        shown = self._shown.setdefault(node_id, {})
        if address[0] == standard.STORE:
            if octets == standard.SIGNATURES[standard.STORE]:
                self._stored[node_id] = dict(shown)
        elif address[0] == standard.RESTORE:
            if octets == standard.SIGNATURES[standard.RESTORE]:
                self._stored.pop(node_id, None)  # in force from the next start on
        elif is_followed(address):
            before = self._said_by(node_id, address)
            shown[address] = int.from_bytes(octets, "little")
            # A device is made anew when it matters, and not at each of the dozen writes that map one PDO.
            return before != self._said_by(node_id, address) and self._changed(node_id)
        return False

    def _said_by(self, node_id: int, address: Address) -> Any:
        """Return what an object and those beside it say of a device's frames; None for a PDO that is not valid."""
        shown, file = self._shown[node_id], self._files.get(node_id)

        def present(index: int, subindex: int) -> Any:
            found = shown.get((index, subindex))
            return file.default((index, subindex)) if found is None and file else found

        index = address[0] - values.MAPPING_OFFSET * any(address[0] in each for each in values.MAPPING_RECORDS.values())
        if not any(index in each for each in values.COMMUNICATION_RECORDS.values()):
            return present(*address)
        settings = [present(index, sub) for sub in range(1, values.EVENT_TIMER + 1)]
        if settings[0] is None or settings[0] & values.NOT_VALID:
            return None
        mapping = index + values.MAPPING_OFFSET
        return settings, [present(mapping, sub) for sub in range(min(present(mapping, 0) or 0, values.MAX_BITS) + 1)]

    def start(self, node_id: int) -> bool:
        """Take in that a device starts anew, or all; return whether other frames mean something else now."""
        changed = False
        for each in list(self._shown) if node_id == ALL_NODES else [node_id]:
            before, self._shown[each] = self._shown.get(each, {}), dict(self._stored.get(each, {}))
            changed |= before != self._shown[each] and self._changed(each)
        return changed

    def _changed(self, node_id: int) -> bool:
        """Make a device anew; return whether what it sends or receives has changed."""
        file, shown = self._files.get(node_id), self._shown[node_id]
        if file is None:
            known, self._learned[node_id] = self._learned.get(node_id, ()), made(node_id, shown)
            return known != self._learned[node_id]
        before, self._present[node_id] = self._present.get(node_id, file), file.configured(shown)
        return bool(_said(before) != _said(self._present[node_id]))


def _said(device: Dictionary) -> Any:
    """Return what a device's parameters say of its frames."""
    pdos = device.read_pdos(device.default, lambda _: None, listening=True)
    return [each for each in pdos if each.valid], [device.default(each) for each in SERVICES]


# A device without a file

MOST_PDOS = 1 << 11
"""How many that were made are kept: twice as many as a device can have."""

UNSIGNED8, UNSIGNED32 = 5, 7
"""Codes of data types (CiA 301, Table 44)."""


def _numbers(device: Dictionary) -> dict[Address, int]:
    """Return what a device that was made has of what is followed."""
    numbers = {each: device.number(each) for each in device.addresses() if is_followed(each)}
    return {address: number for address, number in numbers.items() if number is not None}


def made(node_id: int, shown: Mapping[Address, Value]) -> tuple[Dictionary, ...]:
    """Return a dictionary of the services that are shown, and of each PDO whose whole mapping is.

    Each has its own, as they are shown one by one: a device of 64 PDOs would be read 64 times.
    """
    numbers = {address: value for address, value in shown.items() if isinstance(value, int)}
    return tuple(
        filter(None, (_read(node_id, text) for text in ("".join(_services(numbers)), *_pdos(numbers)) if text))
    )


@lru_cache(MOST_PDOS)
def _read(node_id: int, text: str) -> Dictionary | None:
    name = f"node {node_id}"
    try:
        return Dictionary.read(text.encode(), Path(name), node_id, name)
    except DictionaryError:  # nothing in it can be used: a mapping of objects that no device can have
        return None


def _services(shown: Mapping[Address, int]) -> Iterator[str]:
    for index in dict.fromkeys(index for index, _ in SERVICES):
        kept = {sub: shown[index, sub] for at, sub in SERVICES if at == index and (index, sub) in shown}
        if list(kept) == [0]:
            yield _variable(f"{index:X}", f"0x{index:04X}", UNSIGNED32, f"DefaultValue={kept[0]}\n")
        elif kept:
            yield _record(index, f"0x{index:04X}", {0: max(kept)} | kept)


def _pdos(shown: Mapping[Address, int]) -> Iterator[str]:
    for direction, records in values.COMMUNICATION_RECORDS.items():
        # Few of the 512 are there, and all are looked for at each change.
        for index in sorted({each - values.MAPPING_OFFSET for each, _ in shown}.intersection(records)):
            mapping, text = index + values.MAPPING_OFFSET, ""
            objects: dict[Address, int] = {}
            count = shown.get((mapping, 0), 0)
            subs = range(1, (0 if count in set(Multiplex) else count) + 1)
            if (mapping, 0) not in shown or any((mapping, sub) not in shown for sub in subs):
                continue
            for record, last in ((index, values.EVENT_TIMER), (mapping, len(subs))):
                kept = {sub: shown[record, sub] for sub in range(1, last + 1) if (record, sub) in shown}
                name = f"{direction.name} {index - records[0] + 1} {'parameter' if record == index else 'mapping'}"
                text += _record(record, name, kept | {0: count if record == mapping else last})
            for entry in (MappingEntry.of(shown[mapping, sub]) for sub in subs):
                objects[entry.address] = max(entry.bits, objects.get(entry.address, 0))
            for each in dict.fromkeys(at for at, _ in objects if at not in values.DUMMIES):
                text += _mapped(each, {sub: bits for (at, sub), bits in objects.items() if at == each})
            yield text


def _record(index: int, name: str, subs: Mapping[int, int]) -> str:
    members = "".join(
        _variable(f"{index:X}sub{sub:X}", f"{sub}", UNSIGNED8 if sub == 0 else UNSIGNED32, f"DefaultValue={value}\n")
        for sub, value in subs.items()
    )
    return f"[{index:X}]\nParameterName={name}\nObjectType=9\nSubNumber={len(subs)}\n{members}"


def _mapped(index: int, bits: Mapping[int, int]) -> str:
    """Write an object that a PDO maps, by the standard's or a profile's name, or else by its index."""
    name, type_ = standard.PROFILE_OBJECTS.get(index, ("", None))

    def code(sub: int) -> int:
        fits = type_ is not None and type_.bits == bits[sub]
        return type_.code if fits and type_ else next(each.code for each in UNSIGNED if each.bits >= bits[sub])

    if list(bits) == [0]:
        return _variable(f"{index:X}", name or f"0x{index:04X}:00", code(0))
    members = (_variable(f"{index:X}sub{sub:X}", f"{name or f'0x{index:04X}'}:{sub:02X}", code(sub)) for sub in bits)
    return f"[{index:X}]\nParameterName=0x{index:04X}\nObjectType=9\nSubNumber={len(bits)}\n{''.join(members)}"


UNSIGNED = sorted(
    (each for each in values.DATA_TYPES.values() if each.is_integer and not each.is_signed and each.bits),
    key=lambda each: each.bits,
)


def _variable(section: str, name: str, type_: int, more: str = "") -> str:
    return f"[{section}]\nParameterName={name}\nObjectType=7\nDataType={type_}\nAccessType=rw\nPDOMapping=1\n{more}"
