"""A device's object dictionary: canopen's, read from the normal form of an EDS or DCF.

canopen's own reader refuses or misreads common practice. Its functions read the normal form (`normal`) except for a few
attributes, which are set here. Beside canopen's `objects` there is the `device` in the normal form, for writing files.
`Parameters` tells settings from process data, `pdos` reads PDOs, `sdo_channels` finds the SDO server, `identity` reads
the identity.

Nothing is guessed. Objects that cannot be read with certainty are left out and listed in the `refusals` of the `normal`
form; a file without any usable object is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from copy import copy
from functools import cached_property, partial
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Self

from eurobot_od.errors import DictionaryError, LocalError, meant
from eurobot_od.od import cia401, cia402, formats, standard, values
from eurobot_od.od import objects as od
from eurobot_od.od.description import SIMPLE, DescribedDevice, DescribedObject, ObjectCode
from eurobot_od.od.document import Document, Section, parse, read_bytes
from eurobot_od.od.maker import MakersWords, device_yaml_of, read_maker
from eurobot_od.od.meanings import ObjectMeaning, read_meanings
from eurobot_od.od.modules import Module, Modules
from eurobot_od.od.normal import NormalizedEds, normal
from eurobot_od.od.patches import Patch, read_patch
from eurobot_od.od.pdos import OnRefused, Pdo, PdoReader, fatal, part_of, unheard
from eurobot_od.od.values import Address, Number, PdoDirection, Value
from eurobot_od.od.words import profile_of
from eurobot_od.support.files import UNREADABLE, why_unreadable
from eurobot_od.support.texts import encodable

if TYPE_CHECKING:
    from canopen.objectdictionary import ObjectDictionary, ODArray, ODRecord, ODVariable


NO_NODE_ID = "the file names no node-ID"
"""Begins the error about a file that can be loaded only with a given node-ID."""


class _Read:
    """The two methods of `configparser` that canopen calls for a variable, for a section that is already read."""

    @staticmethod
    def get(section: Section, key: str, fallback: str | None = None) -> str | None:
        entry = section.entries.get(key.lower())
        return fallback if entry is None else entry.value

    @staticmethod
    def has_option(section: Section, key: str) -> bool:
        return key.lower() in section.entries


def _add(objects: ObjectDictionary, each: DescribedObject, node_id: int, left_out: Container[object]) -> None:
    """Add an object of a normal form, with its sub-indices, as canopen reads it."""
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


def completed(objects: ObjectDictionary, more: Mapping[int, Mapping[int, ODVariable]]) -> ObjectDictionary:
    """Return objects with added or replaced variables, given by index and sub-index."""
    made = copy(objects)
    made.indices = dict(objects.indices)
    for index, subs in more.items():
        made.indices[index] = _joined(objects.indices.get(index), index, subs)
    return made


def _joined(
    entry: ODVariable | ODArray | ODRecord | None, index: int, more: Mapping[int, ODVariable]
) -> ODVariable | ODArray | ODRecord:
    """Return an object with more variables; a replaced one keeps its name."""
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


def imported(file: Path, normal: NormalizedEds, device: DescribedDevice, node_id: int) -> ObjectDictionary:
    """Import the normalized EDS with canopen, then set the attributes that it ignores.

    Only the sections about the device go through canopen's `configparser`, which is slow.
    """
    import configparser
    import logging

    from canopen.objectdictionary import ObjectDictionaryError, eds

    logging.getLogger("canopen").addHandler(logging.NullHandler())  # errors are reported by exceptions only
    try:
        objects: ObjectDictionary = eds.import_eds(StringIO(normal.about), node_id)  # type: ignore[no-untyped-call]
        left_out = {(each.index, each.sub) for each in normal.refusals}
        for described in device.objects.values():
            if (described.index, None) not in left_out:
                _add(objects, described, node_id, left_out)
    except (ValueError, KeyError, configparser.Error, ObjectDictionaryError) as error:
        raise DictionaryError(file, None, f"canopen cannot read it: {error}") from error
    objects.node_id = node_id
    for index, sub, attribute, value in normal.canopen_attributes:
        entry = objects.indices.get(index)
        target = od.members_of(entry).get(sub) if entry is not None and sub is not None else entry
        if target is not None:  # None for a refused object
            setattr(target, attribute, value.at(node_id) if isinstance(value, Number) else value)
    return objects


PROCESS_DATA = {cia401.PROFILE: cia401.PROCESS_DATA, cia402.PROFILE: cia402.PROCESS_DATA}


class Parameters:
    """The settings of a device: objects that are configured, stored, and written to a DCF.

    Settings may be mapped into PDOs; `process_data`, commands and histories are not settings.
    """

    def __init__(self, objects: ObjectDictionary, pdo_reader: PdoReader) -> None:
        self._objects, self._pdo_reader = objects, pdo_reader

    def __contains__(self, address: Address) -> bool:
        variable = od.variable_at(self._objects, address)
        if variable is None or not od.is_described(variable) or not variable.writable:
            return False
        return address[0] not in standard.NOT_PARAMETERS and address not in self.process_data

    @cached_property
    def process_data(self) -> frozenset[Address]:
        """Process data by the device profile (CiA 401, CiA 402), or by the mappings of valid PDOs.

        All objects in RPDOs are process data; in TPDOs only those with access `rwr`, as a master may set others.
        """
        found = set()
        for pdo in self._pdo_reader.pdos(unheard, listening=True):
            if not pdo.valid:
                continue
            for each in pdo.mapping:
                if pdo.direction is PdoDirection.RPDO or each.variable.access_type == "rwr":
                    part = part_of(self._objects, each.variable)
                    found |= {each.address, part.whole if part else each.address}
        of_profile = PROCESS_DATA.get(profile_of(self._objects), {})
        for index, entry in self._objects.indices.items():
            subs = of_profile.get(cia402.on_first_axis(index), ()) if index not in values.DUMMIES else ()
            found |= {(index, sub) for sub in od.members_of(entry) if sub in subs}
        return frozenset(found)


class Dictionary:
    """A loaded EDS or DCF: `file` with its `content`, `name` (the file's stem or another) and `node_id`.

    `normal` is the normal form, with changes and refusals; `device` is the device in it, `objects` are canopen's.
    `makers` are the manufacturers' texts about the device.
    """

    def __init__(
        self,
        file: Path,
        content: bytes,
        normal: NormalizedEds,
        node_id: int | None = None,
        name: str = "",
        makers: Sequence[MakersWords] = (),
    ) -> None:
        # As an EDS, for 0x1021 and for making a DCF.
        self.content = normal.text.encode(normal.encoding) if normal.is_xml or normal.is_patched else content
        self.file = file
        self.name = name or encodable(file.stem)
        self.normal = normal
        self.device = normal.device
        self.node_id = self._checked_node_id(self.device.said_node_id if node_id is None else node_id)
        self.objects = imported(file, normal, self.device, self.node_id)
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
        """Return the device with another manufacturer's texts, which have priority over present ones if `over`."""
        return self._made(self.node_id, (*self.makers, maker) if over else (maker, *self.makers))

    def _made(self, node_id: int, makers: Sequence[MakersWords]) -> Self:
        return type(self)(self.file, self.content, self.normal, node_id, self.name, makers)

    @property
    def error_words(self) -> dict[int, str]:
        """The manufacturers' texts for emergency error codes."""
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
        """Read an EDS or DCF.

        Args:
            file: path of the file
            node_id: 1..127; default: the commissioned one, else the value of the setting with the device's node-ID
            name: name of the device; default: the file's stem
            modules: modules of a modular device, by numbers or names; default: those connected in the file
            patch: files that change objects, applied in order (see `patches`)

        Raises:
            DictionaryError: no node-ID, an unknown module, a patch that does not fit, or an unreadable file
            LocalError: not a path
        """
        if not isinstance(file, (str, Path)):
            raise LocalError(f"a device's file is a path, such as 'motor.eds', and not {file!r}")
        path = Path(file)
        patches = [read_patch(each) for each in patch]
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
        """Read the bytes of an EDS or DCF; `file` is its name in errors. Raises as `load`."""
        try:
            return cls(file, data, normal(data, file, modules, patches), node_id, name)
        except UNREADABLE as error:
            raise DictionaryError(file, None, why_unreadable(error)) from error

    def renumbered(self, node_id: int) -> Self:
        """Return the dictionary for another node-ID; raises DictionaryError."""
        return self._made(node_id, self.makers)

    @property
    def idle_modules(self) -> tuple[Module, ...]:
        """Modules of a modular device, if none is connected."""
        return () if self.normal.has_modules else tuple(Modules(self.device.document).supported.values())

    @cached_property
    def document(self) -> Document:
        """The file as it was written, with its own lists of objects."""
        read = self.normal.read
        return read.document if read else parse(self.content.decode("latin-1"))  # decodes any bytes

    def _checked_node_id(self, node_id: int | None) -> int:
        if node_id is None:
            if not any(index >= values.FIRST for index in self.device.objects):
                raise DictionaryError(self.file, None, formats.no_objects(self.content))
            how = f"give one, as in 5={self.file.name}, or in Python node_id=5"
            raise DictionaryError(self.file, None, f"{NO_NODE_ID}; {how}")
        if node_id not in values.NODE_IDS:
            what = f"node-ID {node_id!r} is not in {values.NODE_IDS[0]}..{values.NODE_IDS[-1]}"
            raise DictionaryError(self.file, None, what)
        return node_id

    @property
    def restored_node_id(self) -> int | None:
        """The node-ID after the defaults are restored (0x1011); None if it stays the same."""
        own = self.device.node_id_address
        stock = self.stock_value(own) if own else None
        return stock if isinstance(stock, int) and stock != self.node_id else None

    # Objects

    @cached_property
    def members(self) -> dict[int, dict[int, ODVariable]]:
        """Variables by index and sub-index; a VAR has sub-index 0."""
        entries = self.objects.indices.items()
        return {index: od.members_of(entry) for index, entry in entries if index not in values.DUMMIES}

    @cached_property
    def _by_address(self) -> dict[Address, ODVariable]:
        entries = self.objects.indices.items()
        return {(index, sub): each for index, entry in entries for sub, each in od.members_of(entry).items()}

    def variable(self, address: Address) -> ODVariable | None:
        """Return canopen's variable at an index and sub-index, or None."""
        return self._by_address.get(address)

    @cached_property
    def meanings(self) -> Mapping[Address, ObjectMeaning]:
        """Units and codes of objects from the file's comments; see `meanings`."""
        section = self.device.document.sections.get("comments")
        return read_meanings(each.value for each in section.entries.values()) if section else {}

    def flags(self, address: Address) -> int:
        """Return the ObjFlags of a variable, 0 if it has none (CiA 306)."""
        described = self.device.variable(*address)
        number = described.number("objflags") if described else None
        return number.value if number else 0

    def addresses(self) -> Iterator[Address]:
        """Yield the addresses of all variables, in the file's order."""
        return ((index, sub) for index, subs in self.members.items() for sub in subs)

    def default(self, address: Address) -> Value:
        """Return a variable's ParameterValue (DCF) or DefaultValue; None if it has neither."""
        if address in self._present:  # observed values replace those of the file
            return self._present[address]
        variable = self.variable(address)
        return None if variable is None else od.default_of(variable)

    def stock_value(self, address: Address) -> Value:
        """Return the DefaultValue, which all devices of this type have, or None."""
        variable = self.variable(address)
        value: Value = None if variable is None else variable.default
        return value

    def has_own_value(self, address: Address) -> bool:
        """Return whether a variable has a ParameterValue, which is this device's own."""
        variable = self.variable(address)
        return address in self._present or (variable is not None and variable.value is not None)

    def number(self, address: Address) -> int | None:
        """Return the number in a variable's default, or None."""
        value = self.default(address)
        return value if isinstance(value, int) else None

    def cob_id(self, address: Address, base: int) -> int:
        """Return the identifier in an object for a service of the device.

        It is `base` plus the node-ID if the file has none, or one that is not valid (CiA 301, 7.3.3).
        """
        said = values.base_identifier(self.default(address))
        return base + self.node_id if said is None else said

    def named(self, name: str) -> Self:
        """Return the device with another name."""
        other = copy(self)
        other.name = name
        return other

    def configured(self, present: Mapping[Address, Value]) -> Self:
        """Return the device with values at `present` that replace those of the file."""
        other = copy(self)
        other._present = {**self._present, **present}
        for made_of_values in ("pdos", "parameters"):
            other.__dict__.pop(made_of_values, None)
        return other

    def completed(self, other: Dictionary) -> Self:
        """Return the device with variables of another description added or replaced."""
        made = copy(self)
        made.objects = completed(self.objects, other.members)
        for made_of_objects in ("members", "_by_address", "_by_name", "pdos", "parameters"):
            made.__dict__.pop(made_of_objects, None)
        return made

    @cached_property
    def _by_name(self) -> dict[str, Address]:
        names = {self.objects.indices[index].name: (index, 0) for index in self.members}
        return names | {each.qualname: od.address_of(each) for subs in self.members.values() for each in subs.values()}

    @property
    def names(self) -> tuple[str, ...]:
        """Names that `address` accepts."""
        return tuple(self._by_name)

    def address(self, name: str) -> Address:
        """Return index and sub-index of `record.member` or `object` by ParameterName.

        Raises DictionaryError if there is no such name.
        """
        if name not in self._by_name:
            raise DictionaryError(self.file, None, f"no object is named {name!r}{meant(name, self.names)}")
        return self._by_name[name]

    def data_index(self, name: str) -> int | None:
        """Return the index of the manufacturer-specific object with a ParameterName, or None.

        A PDO's record may have the same name as its data.
        """
        named = (index for index in self.members if self.objects.indices[index].name == name)
        return next((index for index in named if index in values.MANUFACTURER), None)

    @cached_property
    def parameters(self) -> Parameters:
        """The device's settings and process data."""
        return Parameters(self.objects, self.pdo_reader(self.default))

    # PDOs

    @cached_property
    def pdos(self) -> tuple[Pdo, ...]:
        """All PDOs with their default parameters; see `read_pdos`."""
        return self.read_pdos(self.default)

    def read_pdos(
        self, value: Callable[[Address], Value], refused: OnRefused = fatal, listening: bool = False
    ) -> tuple[Pdo, ...]:
        """Read RPDOs, then TPDOs, from the parameter values that `value` returns; see `PdoReader`."""
        return self.pdo_reader(value).pdos(refused, listening)

    def pdo_reader(self, value: Callable[[Address], Value]) -> PdoReader:
        """Return the reader of its PDOs for the parameter values that `value` returns."""
        return PdoReader(self.file, self.objects, self.node_id, value, self.meanings)
