"""A device's object dictionary: canopen's, read from the normal form of an EDS or DCF.

canopen's own reader refuses or misreads much that is common practice; of the normal form (`normal`) its functions read
all but a few attributes, which are set here. Beside canopen's `objects` there is the `device` that the normal form
describes, for whatever writes files.

Rule of this file: nothing is guessed. What cannot be read with certainty is left out, and `left_out` says so; a file of
which nothing can be used is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from copy import copy
from functools import cached_property, partial
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Self

from eurobot_od.errors import DictionaryError
from eurobot_od.od import cia401, cia402, formats, standard, values
from eurobot_od.od import objects as od
from eurobot_od.od.description import SIMPLE, DescribedDevice, DescribedObject, ObjectCode
from eurobot_od.od.document import Document, Section, parse, read_bytes
from eurobot_od.od.maker import MakersWords, device_yaml_of, read_maker
from eurobot_od.od.meanings import ObjectMeaning, read_meanings
from eurobot_od.od.modules import Module, Modules
from eurobot_od.od.normal import Change, Normal, Refusal, normal
from eurobot_od.od.patches import Patch, read_patch
from eurobot_od.od.pdos import Mapped, OnRefused, Part, Pdo, PdoReader, fatal, part_of
from eurobot_od.od.values import Address, Number, PdoDirection, Value
from eurobot_od.od.words import profile_of
from eurobot_od.support.files import UNREADABLE, why_unreadable
from eurobot_od.support.texts import encodable

if TYPE_CHECKING:
    from canopen.objectdictionary import ObjectDictionary, ODArray, ODRecord, ODVariable

IDENTITY_KEYS = ("vendornumber", "productnumber", "revisionnumber", "")
"""Keys of [DeviceInfo] for the sub-indices of 0x1018 from 1 on; there is no key for the serial number."""


class Dictionary:
    """A loaded EDS or DCF: its `file` with the `content`, its `name` (the file's stem or another) and `node_id`.

    `objects` are canopen's.
    """

    def __init__(
        self,
        file: Path,
        content: bytes,
        normal: Normal,
        node_id: int | None = None,
        name: str = "",
        makers: Sequence[MakersWords] = (),
    ) -> None:
        # The EDS that says the same: what a device keeps of itself in 0x1021, and what a DCF is made of.
        self.content = normal.text.encode(normal.encoding) if normal.is_xml or normal.is_patched else content
        self.file, self.name = file, name or encodable(file.stem)
        self._normal = normal
        self.node_id = self._checked_node_id(self._said_node_id() if node_id is None else node_id)
        self.objects = _imported(file, normal, self.device, self.node_id)
        if not self.members:
            for each in normal.refusals:
                raise DictionaryError(file, None, str(each))
            raise DictionaryError(file, None, formats.no_objects(content))
        self._present: Mapping[Address, Value] = {}
        for address, meaning in self.meanings.items():
            if (variable := self.variable(address)) is not None:
                meaning.describe(variable)
        self.makers = tuple(makers)
        for maker in self.makers:
            maker.describe(self.objects)

    def described_by(self, maker: MakersWords, *, over: bool = True) -> Self:
        """Return the same device with what a maker says of it; it counts more than what is said already, or less."""
        return self._made(self.node_id, (*self.makers, maker) if over else (maker, *self.makers))

    def _made(self, node_id: int, makers: Sequence[MakersWords]) -> Self:
        return type(self)(self.file, self.content, self._normal, node_id, self.name, makers)

    @property
    def error_words(self) -> dict[int, str]:
        """The makers' words for its emergency error codes."""
        return {code: words for each in self.makers for code, words in each.emcy.items()}

    @classmethod
    def load(
        cls,
        file: str | Path,
        node_id: int | None = None,
        name: str = "",
        modules: Sequence[str] | None = None,
        patch: Sequence[str | Path] = (),
    ) -> Self:
        """Read an EDS or DCF for a node-ID, `modules` being those of a modular device, by numbers or names.

        `patch` are files that say something in its place, laid over it in their order (see `patches`).

        Without a node-ID it is the NodeID of a DCF's commissioning, or else the value of the object that holds the
        device's own node-ID; without modules, those that the file says are connected. Raises DictionaryError if there
        is not a node-ID or no such module, if a patch does not fit, or if the file cannot be read as an EDS.
        """
        path, patches = Path(file), [read_patch(each) for each in patch]
        beside = device_yaml_of(path)
        read = cls.read(read_bytes(file), path, node_id, name, modules, patches)
        return read.described_by(read_maker(beside)) if beside else read

    @classmethod
    def read(
        cls,
        data: bytes,
        file: Path,
        node_id: int | None = None,
        name: str = "",
        modules: Sequence[str] | None = None,
        patches: Sequence[Patch] = (),
    ) -> Self:
        """Read the bytes of an EDS or DCF; `file` is what errors call it. Raises as `load`."""
        try:
            return cls(file, data, normal(data, file, modules, patches), node_id, name)
        except UNREADABLE as error:
            raise DictionaryError(file, None, why_unreadable(error)) from error

    def renumbered(self, node_id: int) -> Self:
        """Return the same file's dictionary for another node-ID; raises DictionaryError."""
        return self._made(node_id, self.makers)

    @property
    def changes(self) -> list[Change]:
        """What the file does not write as CiA 306 asks for, and was read as it is meant."""
        return [each for each in self._normal.changes if not each.standard]

    @property
    def has_modules(self) -> bool:
        """Whether connected modules have brought some of its objects."""
        return self._normal.has_modules

    @property
    def idle_modules(self) -> tuple[Module, ...]:
        """The modules that a modular device supports, if none is connected: their objects are not there."""
        return () if self.has_modules else tuple(Modules(self.device.document).supported.values())

    @property
    def left_out(self) -> list[Refusal]:
        """The objects, or sub-indices, that cannot be used as the file has them: the dictionary is without them."""
        return self._normal.refusals

    @property
    def encoding(self) -> str:
        """The encoding of the file's texts."""
        return self._normal.encoding

    @cached_property
    def device(self) -> DescribedDevice:
        """The device as the normal form describes it; see `Normal.device`."""
        return self._normal.device

    @cached_property
    def document(self) -> Document:
        """The file as it was written, with the lists of objects that it has itself."""
        read = self._normal.read
        return read.document if read else parse(self.content.decode("latin-1"))  # which decodes all

    # Which node it is

    def _said_node_id(self) -> int | None:
        """Return the node-ID that is commissioned, or else the value of the device's own setting.

        `$NODEID` as that value says that the setting is the node-ID, but not which one.
        """
        own = self.device.own_node_id
        settings = [own.number(key) for key in ("parametervalue", "defaultvalue")] if own else []
        commissioned = self.device.commissioned("nodeid")
        if commissioned:
            return None if commissioned.relative else commissioned.value
        # A setting of 0xFF says that the device has not been given a node-ID yet (CiA 305).
        said = (each.value for each in settings if each and not each.relative and each.value != standard.UNCONFIGURED)
        return next(said, None)

    def _checked_node_id(self, node_id: int | None) -> int:
        if node_id is None:
            if not any(index >= values.FIRST for index in self.device.objects):
                raise DictionaryError(self.file, None, formats.no_objects(self.content))
            raise DictionaryError(self.file, None, f"the file names no node-ID; give one, as in 5={self.file.name}")
        if node_id not in values.NODE_IDS:
            what = f"node-ID {node_id!r} is not in {values.NODE_IDS[0]}..{values.NODE_IDS[-1]}"
            raise DictionaryError(self.file, None, what)
        return node_id

    @property
    def commissioned_node_id(self) -> int | None:
        """The NodeID of the commissioning; None in an EDS."""
        number = self.device.commissioned("nodeid")
        return number.value if number else None

    @cached_property
    def node_id_address(self) -> Address | None:
        """Where the device keeps its own node-ID among its settings; None if it does not."""
        own = self.device.own_node_id
        return (own.index, own.sub) if own else None

    @property
    def restored_node_id(self) -> int | None:
        """The node-ID that the device has once its defaults are restored (0x1011); None if it keeps this one."""
        stock = self.stock_value(self.node_id_address) if self.node_id_address else None
        return stock if isinstance(stock, int) and stock != self.node_id else None

    # Objects

    @cached_property
    def members(self) -> dict[int, dict[int, ODVariable]]:
        """The variables by index and sub-index; a VAR is its own member 0."""
        entries = self.objects.indices.items()
        return {index: od.members_of(entry) for index, entry in entries if index not in values.DUMMIES}

    @cached_property
    def _by_address(self) -> dict[Address, ODVariable]:
        entries = self.objects.indices.items()
        return {(index, sub): each for index, entry in entries for sub, each in od.members_of(entry).items()}

    def variable(self, address: Address) -> ODVariable | None:
        """Return canopen's variable at an index and sub-index, None if there is none."""
        return self._by_address.get(address)

    @cached_property
    def meanings(self) -> Mapping[Address, ObjectMeaning]:
        """What the file's comments say about objects: units and codes; see `meanings`."""
        section = self.device.document.sections.get("comments")
        return read_meanings(each.value for each in section.entries.values()) if section else {}

    def flags(self, address: Address) -> int:
        """Return the ObjFlags of a variable, 0 without any (CiA 306)."""
        described = self.device.variable(*address)
        number = described.number("objflags") if described else None
        return number.value if number else 0

    def addresses(self) -> Iterator[Address]:
        """Give the addresses of all variables, in the file's order."""
        return ((index, sub) for index, subs in self.members.items() for sub in subs)

    def default(self, address: Address) -> Value:
        """Return a variable's ParameterValue (DCF) or DefaultValue; None if it has neither."""
        if address in self._present:  # what a live device has counts more than its file
            return self._present[address]
        variable = self.variable(address)
        return None if variable is None else od.default_of(variable)

    def stock_value(self, address: Address) -> Value:
        """Return what all devices of this kind have there, the DefaultValue; None without one."""
        variable = self.variable(address)
        value: Value = None if variable is None else variable.default
        return value

    def has_own_value(self, address: Address) -> bool:
        """Whether a variable's value is this device's own, a ParameterValue, not what all of its kind have."""
        variable = self.variable(address)
        return address in self._present or (variable is not None and variable.value is not None)

    def number(self, address: Address) -> int | None:
        """Return the number that a variable has by default; None if it has none."""
        value = self.default(address)
        return value if isinstance(value, int) else None

    def cob_id(self, address: Address, base: int) -> int:
        """Return the identifier that an object has for a service of the device.

        It is `base` plus the node-ID if the file says none, or one that is not valid (CiA 301, 7.3.3).
        """
        said = values.base_identifier(self.default(address))
        return base + self.node_id if said is None else said

    @property
    def identity(self) -> tuple[int, ...]:
        """Vendor-ID, product code, revision and serial number (0x1018); 0 for what the file does not say.

        Many files give 0x1018 no default, or 0, and say it in [DeviceInfo] only.
        """
        return tuple(self._identity(sub, key) for sub, key in enumerate(IDENTITY_KEYS, start=1))

    def _identity(self, sub: int, key: str) -> int:
        if self.variable((standard.IDENTITY, sub)) is None:
            return 0
        info = values.parse_number(self.device.document.text("deviceinfo", key))
        return self.number((standard.IDENTITY, sub)) or (info.value & 0xFFFFFFFF if info else 0)

    def named(self, name: str) -> Self:
        """Return the same device with another name."""
        other = copy(self)
        other.name = name
        return other

    def configured(self, present: Mapping[Address, Value]) -> Self:
        """Return the same device with values that it has at `present` in place of the file's."""
        other = copy(self)
        other._present = {**self._present, **present}
        for made_of_values in ("pdos", "process_data"):
            other.__dict__.pop(made_of_values, None)
        return other

    def completed(self, other: Dictionary) -> Self:
        """Return the same device with the variables of another description besides its own, or in their place."""
        made = copy(self)
        made.objects = copy(self.objects)
        made.objects.indices = dict(self.objects.indices)
        for index, subs in other.members.items():
            made.objects.indices[index] = _joined(self.objects.indices.get(index), index, subs)
        for made_of_objects in ("members", "_by_address", "_by_name", "pdos", "process_data"):
            made.__dict__.pop(made_of_objects, None)
        return made

    @cached_property
    def _by_name(self) -> dict[str, Address]:
        names = {self.objects.indices[index].name: (index, 0) for index in self.members}
        return names | {each.qualname: od.address_of(each) for subs in self.members.values() for each in subs.values()}

    @property
    def names(self) -> tuple[str, ...]:
        """The names that `address` knows."""
        return tuple(self._by_name)

    def address(self, name: str) -> Address:
        """Return index and sub-index of `record.member` or `object` by ParameterName, as a program names it.

        Raises DictionaryError if there is none of that name.
        """
        if name not in self._by_name:
            raise DictionaryError(self.file, None, f"no object is named {name!r}")
        return self._by_name[name]

    def data_index(self, name: str) -> int | None:
        """Return the index of the manufacturer-specific object with a ParameterName, None if there is none.

        A PDO's record may have the same name as the data it carries.
        """
        named = (index for index in self.members if self.objects.indices[index].name == name)
        return next((index for index in named if index in values.MANUFACTURER), None)

    # Parameters

    def is_parameter(self, address: Address) -> bool:
        """Whether an object is a setting: what a configuration writes, a device stores and a DCF of it has.

        A setting may be mapped into PDOs; what is not one is `process_data`, a command or a history.
        """
        variable = self.variable(address)
        if variable is None or not od.is_described(variable) or not variable.writable:
            return False
        return address[0] not in standard.NOT_PARAMETERS and address not in self.process_data

    @cached_property
    def process_data(self) -> frozenset[Address]:
        """What is process data by its profile (CiA 401, CiA 402), or by the mappings of the PDOs that are valid.

        An RPDO brings it; of what a TPDO carries, only `rwr` is not set by a master.
        """
        found = set()
        for pdo in self.read_pdos(self.default, lambda _: None, listening=True):
            for each in pdo.mapping if pdo.valid else ():
                if pdo.direction is PdoDirection.RPDO or each.variable.access_type == "rwr":
                    part = self.part(each.address)
                    found |= {each.address, part.whole if part else each.address}
        of_profile = PROCESS_DATA.get(profile_of(self.objects), {})
        known = (each for each in self.addresses() if each[1] in of_profile.get(cia402.on_first_axis(each[0]), ()))
        return frozenset(found).union(known)

    # PDOs

    @cached_property
    def pdos(self) -> tuple[Pdo, ...]:
        """All PDOs with their default communication and mapping parameters; see `read_pdos`."""
        return self.read_pdos(self.default)

    def read_pdos(
        self, value: Callable[[Address], Value], refused: OnRefused = fatal, listening: bool = False
    ) -> tuple[Pdo, ...]:
        """Read RPDOs, then TPDOs, from the parameter values that `value` gives; see `PdoReader`."""
        return self._reader(value).pdos(refused, listening)

    def mapped(self, mapping_index: int, entry: int) -> Mapped:
        """Return what a mapping entry stands for; raises MappingError."""
        return self._reader(self.default).mapped(mapping_index, entry)

    def _reader(self, value: Callable[[Address], Value]) -> PdoReader:
        return PdoReader(self.file, self.objects, self.node_id, value, self.meanings)

    def part(self, address: Address) -> Part | None:
        """Return what a slice is a part of; None for what is not a slice."""
        variable = self.variable(address)
        return None if variable is None else part_of(self.objects, variable)


PROCESS_DATA = {cia401.PROFILE: cia401.PROCESS_DATA, cia402.PROFILE: cia402.PROCESS_DATA}


class _Read:
    """A `configparser` as far as canopen asks one about a variable, over a section that is read already."""

    @staticmethod
    def get(section: Section, key: str, fallback: str | None = None) -> str | None:
        entry = section.entries.get(key.lower())
        return fallback if entry is None else entry.value

    @staticmethod
    def has_option(section: Section, key: str) -> bool:
        return key.lower() in section.entries


def _add(objects: ObjectDictionary, each: DescribedObject, node_id: int, left_out: Container[object]) -> None:
    """Add an object of a normal form, as canopen reads it, with its sub-indices."""
    from canopen.objectdictionary import ODArray, ODRecord, eds

    read = partial(eds.build_variable, _Read, node_id=node_id, index=each.index)
    kinds: dict[ObjectCode | None, type[ODArray | ODRecord]] = {ObjectCode.ARRAY: ODArray, ObjectCode.RECORD: ODRecord}
    kind = kinds.get(each.code)
    if each.section and kind:
        whole = kind(each.section.text("parametername"), each.index)
        whole.storage_location = _Read.get(each.section, "StorageLocation")  # type: ignore[assignment]
        for sub, member in each.subs.items():
            if (each.index, sub) not in left_out:
                whole.add_member(read(section=member.section, subindex=sub))
        objects.add_object(whole)
    elif each.section and each.code in SIMPLE:
        objects.add_object(read(section=each.section))


def _joined(
    entry: ODVariable | ODArray | ODRecord | None, index: int, more: Mapping[int, ODVariable]
) -> ODVariable | ODArray | ODRecord:
    """Return an object with more variables, which keep their names if the object has them already."""
    from canopen.objectdictionary import ODRecord

    subs = {} if entry is None else od.members_of(entry)
    joined = subs | {sub: od.changed(each, name=subs[sub].name) if sub in subs else each for sub, each in more.items()}
    if list(joined) == [0]:
        return joined[0]
    whole = next(iter(more.values())).parent if entry is None else entry
    record = ODRecord("" if whole is None else str(getattr(whole, "name", "")), index)
    for sub in sorted(joined):
        record.add_member(od.changed(joined[sub]))
    return record


def _imported(file: Path, normal: Normal, device: DescribedDevice, node_id: int) -> ObjectDictionary:
    """Have canopen read a normal form, and set what it does not read.

    Only what is said of the device goes through its `configparser`, which takes half of the time.
    """
    import configparser
    import logging

    from canopen.objectdictionary import ObjectDictionaryError, eds

    logging.getLogger("canopen").addHandler(logging.NullHandler())  # an error is reported once: by what is raised
    try:
        objects: ObjectDictionary = eds.import_eds(StringIO(normal.about), node_id)  # type: ignore[no-untyped-call]
        left_out = {(each.index, each.sub) for each in normal.refusals}
        for described in device.objects.values():
            if (described.index, None) not in left_out:
                _add(objects, described, node_id, left_out)
    except (ValueError, KeyError, configparser.Error, ObjectDictionaryError) as error:
        raise DictionaryError(file, None, f"canopen cannot read it: {error}") from error
    objects.node_id = node_id
    for index, sub, attribute, value in normal.dropped:
        entry = objects.indices.get(index)
        target = od.members_of(entry).get(sub) if entry is not None and sub is not None else entry
        if target is not None:  # it is one of the refusals
            setattr(target, attribute, value.at(node_id) if isinstance(value, Number) else value)
    return objects


# Where the SDO server is: the one rule for the simulated device, the master, logs, checks and the page.
#
# The file's 0x1200 counts, ParameterValue before DefaultValue, as for every other identifier of the device; without a
# valid one it is at its default identifiers (CiA 301, 7.3.3). Only both default identifiers of another node are not
# taken at their word unless they are ParameterValues: many files were written for one node and have its numbers where
# $NODEID belongs. Nor are those of the node that a DCF is commissioned for, where the DCF is used for another one.


class SdoChannel(NamedTuple):
    """The COB-IDs of a node's SDO server: of the requests to it, and of its answers."""

    requests: int
    answers: int

    @classmethod
    def default(cls, node_id: int) -> SdoChannel:
        """Return where a node's SDO server is by default (CiA 301, 7.3.3)."""
        return cls(values.SDO_REQUEST_BASE + node_id, values.SDO_RESPONSE_BASE + node_id)

    @classmethod
    def of(cls, device: Dictionary) -> SdoChannel:
        """Return where a device's SDO server is, as its file says."""
        said_at = standard.SDO_REQUESTS, standard.SDO_ANSWERS
        said = cls(*map(device.cob_id, said_at, cls.default(0)))
        node_id = said.usual_for
        if node_id is None:
            return said
        # A ParameterValue was set for this device; a DefaultValue was perhaps only copied.
        is_set = all(map(device.has_own_value, said_at))
        is_for_another = node_id in (0, device.commissioned_node_id)
        return said if is_set and not is_for_another else cls.default(device.node_id)

    @property
    def usual_for(self) -> int | None:
        """The node-ID whose default identifiers both are, 0 if they lack one; None if they belong to no node."""
        node_id = self.requests - values.SDO_REQUEST_BASE
        return node_id if node_id in (0, *values.NODE_IDS) and self == self.default(node_id) else None


def moved_server(device: Dictionary) -> str:
    """Say where a device's SDO server is, if its file has moved it from where every tool looks for it; else nothing."""
    at = SdoChannel.of(device)
    if at == SdoChannel.default(device.node_id):
        return ""
    others = f": there node {at.usual_for} has its own by default" if at.usual_for else ""
    return f"its SDO server is at 0x{at.requests:03X}, answers at 0x{at.answers:03X}, as its file says (0x1200){others}"


def sdo_channels(dictionary: Dictionary) -> Iterator[tuple[int, int, int, int]]:
    """Yield node-IDs of server and client, identifiers of requests and answers, of each channel that a file describes.

    The client's is 0 if no file names it: of the default channel it is the master (CiA 301, 7.5.2.33).
    """
    yield dictionary.node_id, 0, *SdoChannel.of(dictionary)
    records = [index for index in (*standard.SDO_SERVERS[1:], *standard.SDO_CLIENTS) if index in dictionary.members]
    for index in records:
        request, answer, other = (dictionary.number((index, sub)) for sub in (1, 2, 3))
        own = dictionary.node_id
        server, client = (own, other or 0) if index in standard.SDO_SERVERS else (other, own)
        if request and answer and server and not (request | answer) & values.NOT_VALID:
            yield server, client, values.identifier(request), values.identifier(answer)
