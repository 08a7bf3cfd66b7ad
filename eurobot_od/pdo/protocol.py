"""The messages of loaded dictionaries: frames in, typed messages out, and back.

Identifiers and bits come from the dictionaries, meanings from the kinds of the catalogue's message types. If they do
not fit, loading raises an error with file and index.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple, Self, TypeAlias
from typing import Protocol as Interface

from eurobot_od.errors import LocalError, MappingError, UnknownIdentifier, UnknownName, shown_identifier
from eurobot_od.frame import Frame
from eurobot_od.od import values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.network import is_network, load, read_network
from eurobot_od.od.pdos import OnRefused, Pdo, fatal
from eurobot_od.od.values import ALL_NODES, PdoDirection
from eurobot_od.od.words import error_words, profile_of
from eurobot_od.pdo.binding import Binding, parse
from eurobot_od.pdo.kinds import NOTHING, Catalogue, CatalogueEntry, Message, plain_name, readable_name

NAMES_NOTHING = re.compile(r"PDO|parameter|^\W*$", re.IGNORECASE)
"""Pattern of record names that do not tell one PDO from another."""


class Described(Interface):
    """Anything with dictionaries, such as a network of devices."""

    @property
    def dictionaries(self) -> Iterable[Dictionary]:
        """The dictionaries of its devices."""


PdoSource: TypeAlias = tuple[Dictionary, Iterable[Pdo]]
"""A dictionary, and the PDOs to use of it."""


class Protocol:
    """The messages of one or more dictionaries, encoded and decoded as those map them.

        protocol = Protocol.of("motor.eds", node_id=5)
        print(protocol.decode(0x185, bytes(8)))

    Args:
        sources: dictionaries, each with the PDOs to use
        catalogue: message types; a PDO that is not in it becomes a named tuple of plain numbers
        refused: called with a MappingError if a mapping does not fit its message type, if two messages share a
            COB-ID, or if two dictionaries disagree about a message; default: the error is raised
        former: earlier bindings, reused where unchanged
    """

    CATALOGUE: ClassVar[Catalogue] = NOTHING
    """Message types for `of`."""

    def __init__(
        self,
        sources: Iterable[PdoSource],
        catalogue: Catalogue = NOTHING,
        refused: OnRefused = fatal,
        former: Iterable[Binding] = (),
    ) -> None:
        self.catalogue = catalogue
        self._former = {each.name: each for each in former}
        self._bindings: dict[str, Binding] = {}
        self._by_cob_id: dict[int, Binding] = {}
        every = ((dictionary, pdo) for dictionary, pdos in sources for pdo in pdos)
        valid = [(dictionary, pdo) for dictionary, pdo in every if pdo.valid and pdo.multiplex is None]
        # Senders first, because a message has its sender's name and fields.
        for dictionary, pdo in sorted(valid, key=lambda each: each[1].direction is PdoDirection.RPDO):
            try:
                self._bind(dictionary, pdo)
            except MappingError as error:
                refused(error)
        self._by_type = {binding.type: binding for binding in self._bindings.values()}
        self._by_name = {plain_name(name): binding for name, binding in self._bindings.items()}
        # Filled on first use of each message, when its function is generated.
        self._readers: dict[int, Callable[[bytes], Message]] = {}
        self._writers: dict[type[Message], Callable[[Any], Frame]] = {}

    @classmethod
    def of(cls, source: str | Path | Dictionary | Described, node_id: int | None = None) -> Self:
        """Return the messages of a device, or of all devices of a network.

        Args:
            source: a device's EDS or DCF, or its dictionary; or an `eurobot_od.Network`, a network file (YAML,
                nodelist.cpj) or a folder of EDS files
            node_id: node-ID (1..127) for a file that has none

        Raises:
            FileError: a file cannot be read
            MappingError: as the class raises it
        """
        if isinstance(source, Dictionary):
            dictionaries: Iterable[Dictionary] = [source]
        elif isinstance(source, (str, Path)):
            dictionaries = (
                load(read_network(source).nodes) if is_network(source) else [Dictionary.load(source, node_id)]
            )
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
        """Return the messages of devices as their files map them; `refused` is also called for incomplete mappings.

        `listening` adds PDOs with 29-bit identifiers, which can only be received.
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

        Outside the catalogue, the record's name may not identify the PDO: half of all EDS files use "TPDO communication
        parameter" or another name for every PDO. Such a PDO belongs to the message that already has its COB-ID, as
        another sender or receiver. Otherwise its name is the record's, if that is specific and free, or is made from
        device, direction and number.
        """
        entry = self.catalogue.find(pdo.name)
        if entry is not None:
            return pdo.name, entry
        same = self._by_cob_id.get(pdo.cob_id)
        name = readable_name(pdo.name)
        # A name in the catalogue is unique: another PDO with its COB-ID is an error.
        if same and self.catalogue.find(same.name) is None:
            return same.name, None
        if NAMES_NOTHING.search(name) or plain_name(name) in map(plain_name, self._bindings):
            return f"{dictionary.name}.{pdo.key}", None
        return name, None

    # Typed messages

    def encode(self, message: Message) -> Frame:
        """Return the frame of a message; raises UnknownName, and FieldError for a value that is not allowed."""
        try:
            write = self._writers[type(message)]
        except KeyError:
            if isinstance(message, str):
                raise LocalError(f"{message!r} is a text; a message is an object of its class") from None
            write = self._writers[type(message)] = self.binding(type(message)).encode
        return write(message)

    def decode(self, cob_id: int, data: bytes) -> Message:
        """Return the typed message of a frame; a value outside its range is an OutOfRange.

        Raises UnknownIdentifier, FrameLengthError.
        """
        try:  # cheaper than a test, as it fails only once for each message
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

    # All messages

    @property
    def bindings(self) -> tuple[Binding, ...]:
        """All messages, ordered by COB-ID, which is their priority."""
        return tuple(self._by_cob_id[cob_id] for cob_id in sorted(self._by_cob_id))

    def names(self) -> list[str]:
        """Return the names of all messages, highest priority first."""
        return [binding.name for binding in self.bindings]

    def binding(self, message: str | type[Message]) -> Binding:
        """Return a message's binding by its name or type; raises UnknownName."""
        try:
            return self._by_name[plain_name(message)] if isinstance(message, str) else self._by_type[message]
        except KeyError:
            name = message if isinstance(message, str) else message.__name__
            raise UnknownName("message", name, self.names()) from None

    def binding_of(self, cob_id: int) -> Binding:
        """Return the binding of the message with a COB-ID; raises UnknownIdentifier."""
        try:
            return self._by_cob_id[cob_id]
        except KeyError:
            raise UnknownIdentifier(cob_id) from None

    def cob_id(self, message: str | type[Message]) -> int:
        """Return the COB-ID of a message; raises UnknownName."""
        return self.binding(message).cob_id

    def name(self, message_type: type[Message]) -> str:
        """Return a message type's name in the EDS; raises UnknownName."""
        return self.binding(message_type).name


def _refuse_difference(known: Binding, dictionary: Dictionary, other: Binding, renamed: bool) -> None:
    """Check that two dictionaries map a message equally, except for names if `renamed`; raises MappingError.

    Outside the catalogue, a message is identified only by its COB-ID.
    """
    if known.cob_id != other.cob_id:
        what = f"COB-ID {shown_identifier(other.cob_id)}, but {shown_identifier(known.cob_id)} in {known.file.name}"
        raise MappingError(dictionary.file, other.pdo.index, f"{other.name}: {what}")
    if known.layout.bits != other.layout.bits if renamed else known.layout.slots != other.layout.slots:
        what = f"mapping differs from that in {known.file.name} 0x{known.pdo.mapping_index:04X}"
        raise MappingError(dictionary.file, other.pdo.mapping_index, f"{other.name}: {what}")
    if [each.meaning for each in known.pdo.mapping] != [each.meaning for each in other.pdo.mapping]:
        what = f"units or codes differ from those in {known.file.name}"
        raise MappingError(dictionary.file, other.pdo.mapping_index, f"{other.name}: {what}")


class ErrorWords(NamedTuple):
    """Texts for the error codes of a network's devices: the robot's, those of single nodes, and those of profiles.

    A node's texts have priority. The `robot`'s apply only to its `own` devices, by node-ID, because codes from 0xFF00
    on differ between manufacturers.
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
        learned: Iterable[Dictionary] = (),
    ) -> ErrorWords:
        """Return the texts for devices; those with PDOs of the catalogue are the robot's own.

        `learned` are devices without files, which have only a profile.
        """
        devices = tuple(dictionaries)
        own = frozenset(each.node_id for each in devices if any(map(catalogue.find, pdo_names(each))))
        said = {each.node_id: {**each.error_words, **nodes.get(each.node_id, {})} for each in devices}
        nodes = {**nodes, **said}
        profiles = {each.node_id: profile_of(each.objects) for each in (*learned, *devices)}
        return cls(catalogue.errors, nodes, profiles, own)

    def of(self, node_id: int) -> Callable[[int], str]:
        """Return the function that returns the text for an error code of a node."""
        robot = self.robot if node_id in self.own else {}
        own = {**robot, **self.nodes.get(ALL_NODES, {}), **self.nodes.get(node_id, {})}
        return partial(error_words, own=own, profile=self.profiles.get(node_id, 0))


def pdo_names(dictionary: Dictionary) -> list[str]:
    """Return the names of a device's PDOs, as the catalogue has them."""
    return [dictionary.objects[index].name for index in values.COMMUNICATIONS.intersection(dictionary.members)]


FRAME_MARK = "#"
"""Occurs in each frame in candump's notation, and in no name of a message."""


class FrameToSend(NamedTuple):
    """A frame to send, and its message; None for a frame that is written as bytes."""

    frame: Frame
    message: Message | None


def frame_to_send(protocol: Protocol, text: str, fields: Sequence[str]) -> FrameToSend:
    """Read a frame in candump's notation, or the name of a message with `name=value` fields.

    Raises UnknownName, FieldError or LocalError.
    """
    if FRAME_MARK not in text:
        message = parse(protocol.binding(text), fields)
        return FrameToSend(protocol.encode(message), message)
    if fields:
        raise LocalError(f"the frame {text} has no fields: {', '.join(fields)}")
    return FrameToSend(Frame.parse(text), None)
