"""An EDS or DCF for one node-ID: values, names and PDOs, straight from the document.

This is all that decoding, showing and checking frames need, and it does without canopen, whose import alone takes
longer than to decode 50 000 lines of a log. `dictionary` adds canopen's objects to it.

Rule of this file: what is read wrongly by guessing is refused, with file and index; everything else is taken as it was
meant (a byte order mark, comments after values, sections twice, numbers in any base).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from eurobot_od.errors import DictionaryError, MappingError
from eurobot_od.od import values
from eurobot_od.od.completion import completed
from eurobot_od.od.description import SIMPLE, DescribedDevice, DescribedObject, DescribedVariable, ObjectCode
from eurobot_od.od.document import HIDING, read, read_bytes
from eurobot_od.od.pdos import PADDING, MappedObject, OnRefused, Part, Pdo, fatal
from eurobot_od.od.standard import known_type
from eurobot_od.od.values import Address, DataType, Limits, PdoDirection, Value, parse_number

if TYPE_CHECKING:
    from typing_extensions import Self

    from eurobot_od.od.repairs import Repair

SLICES = " slices"
"""End of the ParameterName of a record that holds another record's values in parts."""

MOST_BITS = 64
"""Bits of a PDO, and so of anything mapped into one (CiA 301, 7.4.8.2)."""

NO_VALUE = (ObjectCode.NULL, ObjectCode.DEFTYPE)
"""Objects that hold nothing: a placeholder, and a type that is only named."""


class Described(NamedTuple):
    """An object: its ParameterName, after that of its record and a dot, and its data type."""

    name: str
    type: DataType


class Outline:
    """The outline of one file: its `file`, `name` (the file's stem or another), `node_id`, the `device` it describes.

    `members` are the variables that can be used, by index and sub-index; a VAR is its own member 0.
    """

    def __init__(self, file: Path, device: DescribedDevice, node_id: int | None = None, name: str = "") -> None:
        self.file, self.name, self.device = file, name or file.stem, device
        self._defaults: dict[Address, Value] = {}  # as they are asked for
        self._refuse_what_hides_objects()
        self.members = {index: self._members(each) for index, each in self._usable_objects()}
        if not self.members:
            raise self._error(None, "not an EDS: it describes no object")
        self.node_id = self._checked_node_id(self._said_node_id() if node_id is None else node_id)

    @classmethod
    def load(cls, file: str | Path, node_id: int | None = None, name: str = "") -> Self:
        """Read an EDS or DCF for a node-ID.

        Without one it is the NodeID of a DCF's commissioning, or else the value of the object that holds the device's
        own node-ID. Raises DictionaryError if there is none, or if the file cannot be read as an EDS.
        """
        return cls.read(read_bytes(file), Path(file), node_id, name)

    @classmethod
    def read(cls, data: bytes, file: Path, node_id: int | None = None, name: str = "") -> Self:
        """Read the bytes of an EDS or DCF; `file` is what errors call it. Raises as `load`."""
        return cls(file, DescribedDevice(completed(read(data))), node_id, name)

    @cached_property
    def repairs(self) -> tuple[Repair, ...]:
        """What the file writes otherwise than CiA 306 asks for, and was read as it is meant."""
        from eurobot_od.od.repairs import repairs  # only where somebody asks

        return repairs(self.device.document)

    # What must hold

    def _error(self, index: int | None, what: str) -> DictionaryError:
        return DictionaryError(self.file, index, what)

    def _refuse_what_hides_objects(self) -> None:
        for each in self.device.document.oddities:
            if each.kind in HIDING:
                what = f"{each.kind.value} ({each.text})" if each.text else each.kind.value
                raise self._error(None, f"not a readable EDS: line {each.line}: {what}")

    def _usable_objects(self) -> Iterator[tuple[int, DescribedObject]]:
        for index, each in self.device.objects.items():
            if each.section is None:
                raise self._error(index, f"[{each.place.name}] has no object [{index:04X}]")
            if each.code is None:
                raise self._error(index, f"ObjectType {each.section.text('objecttype')!r} is not one of CiA 301")
            if each.code not in NO_VALUE:
                yield index, each

    def _members(self, each: DescribedObject) -> dict[int, DescribedVariable]:
        section, variables = each.section, each.variables()
        if section and each.code in SIMPLE and not each.compact and section.text("datatype"):
            # a VAR by its own description, whatever sections for sub-indices there are
            first = each.subs[0]
            variables = iter([first if section is first.section else DescribedVariable(each.index, 0, section)])
        return {variable.sub: self._checked_variable(variable) for variable in variables}

    def _checked_variable(self, variable: DescribedVariable) -> DescribedVariable:
        """Refuse a variable that lacks what it needs to be used."""
        if variable.type and variable.access:  # nearly all: this decides how fast a file is read
            return variable
        section = variable.section
        if not variable.access:
            raise self._error(variable.index, f"sub {variable.sub} has no AccessType")
        if section.text("datatype") and not variable.number("datatype"):
            what = f"DataType {section.text('datatype')!r} is not a number"
            raise self._error(variable.index, f"sub {variable.sub}: {what}")
        return variable

    def _said_node_id(self) -> int | None:
        """Return the node-ID that is commissioned, or else the value of the device's own setting.

        `$NODEID` as that value says that the setting is the node-ID, but not which one.
        """
        commissioned, own = self.device.commissioned("nodeid"), self.device.own_node_id
        settings = [own.number(key) for key in ("parametervalue", "defaultvalue")] if own else []
        said = [commissioned] if commissioned else settings
        return next((each.value for each in said if each and not each.relative), None)

    def _checked_node_id(self, node_id: int | None) -> int:
        if node_id is None:
            raise self._error(None, f"the file names no node-ID; give one, as in 5={self.file.name}")
        if node_id not in values.NODE_IDS:
            raise self._error(None, f"node-ID {node_id!r} is not in {values.NODE_IDS[0]}..{values.NODE_IDS[-1]}")
        return node_id

    # Objects

    @cached_property
    def node_id_address(self) -> Address | None:
        """Where the device keeps its own node-ID among its settings; None if it does not."""
        own = self.device.own_node_id
        return (own.index, own.sub) if own else None

    def type(self, variable: DescribedVariable) -> DataType:
        """Return a variable's data type.

        CanFestival's editor makes types of its own, and describes each as an object whose sub-index 1 is the basic
        type. One that is left out is the standard's, or that of the array. Any other type is taken as DOMAIN: bytes.
        """
        if variable.type:
            return variable.type
        if not variable.section.text("datatype"):
            return self._type_left_out(variable)
        code = variable.number("datatype")
        basic = parse_number(self.device.document.text(f"{code.value:x}sub1", "defaultvalue")) if code else None
        return values.DATA_TYPES.get(basic.value, values.DOMAIN) if basic else values.DOMAIN

    def _type_left_out(self, variable: DescribedVariable) -> DataType:
        whole = self.device.objects[variable.index]
        if variable.sub == 0 and whole.code not in SIMPLE:
            return values.UNSIGNED8  # CiA 301: sub-index 0 always is
        first = whole.subs.get(1) if whole.code is ObjectCode.ARRAY else None
        said = known_type(variable.index, variable.sub) or (first.type if first else None)
        return said or values.DOMAIN

    def described(self, address: Address) -> Described | None:
        """Return what an object is called and its type, None if there is none."""
        variable = self._at(address)
        if variable is None:
            return None
        record = f"{self.device.objects[address[0]].name}." if self.is_composed(address[0]) else ""
        return Described(record + variable.name, self.type(variable))

    def is_composed(self, index: int) -> bool:
        """Whether an object has sub-indices; a VAR's only member is described by the object's own section."""
        only = self.members[index].get(0)
        return only is None or only.section is not self.device.objects[index].section

    def _at(self, address: Address) -> DescribedVariable | None:
        return self.members.get(address[0], {}).get(address[1])

    def addresses(self) -> Iterator[Address]:
        """Give the addresses of all variables, in the file's order."""
        return ((index, sub) for index, subs in self.members.items() for sub in subs)

    def default(self, address: Address) -> Value:
        """Return an object's ParameterValue (DCF) or DefaultValue; None if it has neither."""
        if address not in self._defaults:
            variable = self._at(address)
            said = (self.typed(variable, key) for key in ("parametervalue", "defaultvalue") if variable)
            self._defaults[address] = next((each for each in said if each is not None), None)
        return self._defaults[address]

    def configured(self, present: Mapping[Address, Value]) -> Self:
        """Return the same device with values that it has at `present` in place of the file's."""
        from copy import copy  # only where somebody asks

        other = copy(self)
        other._defaults = {**self._defaults, **present}
        other.__dict__.pop("pdos", None)  # made of the values, and kept
        return other

    def number(self, address: Address) -> int | None:
        """Return the number that an object has by default; None if it has none."""
        value = self.default(address)
        return value if isinstance(value, int) else None

    def typed(self, variable: DescribedVariable, key: str) -> Value:
        """Return what an entry of a variable (its key in lower case) says, in the variable's data type.

        None without one, or if it is nothing of that type. Raises DictionaryError for a malformed `$NODEID+...`.
        """
        entry, type_ = variable.section.entries.get(key), self.type(variable)
        if entry is None:
            return None
        if type_ in (values.VISIBLE_STRING, values.UNICODE_STRING):
            return entry.value
        try:
            if type_ in (values.OCTET_STRING, values.DOMAIN):
                return bytes.fromhex(entry.value)
            if type_ in values.REALS:
                return _real(entry.value, type_)
        except (ValueError, OverflowError):
            return None
        return self._integer(variable, entry.value, type_)

    def _integer(self, variable: DescribedVariable, text: str, type_: DataType) -> int | None:
        number = parse_number(text)
        if number is None:
            if values.NODE_ID in text.upper():
                raise self._error(variable.index, f"sub {variable.sub}: {text!r} is not a number with $NODEID")
            return None
        return type_.meant(number.at(self.node_id))

    @cached_property
    def _by_name(self) -> dict[str, Address]:
        names = {self.device.objects[index].name: (index, 0) for index in self.members}
        return names | {entry.name: address for address in self.addresses() if (entry := self.described(address))}

    def address(self, name: str) -> Address:
        """Return index and sub-index of `record.member` or `object` by ParameterName.

        Raises DictionaryError if there is none of that name.
        """
        if name not in self._by_name:
            raise self._error(None, f"no object is named {name!r}")
        return self._by_name[name]

    def data_index(self, name: str) -> int | None:
        """Return the index of the manufacturer-specific object with a ParameterName, None if there is none.

        A PDO's record may have the same name as the data it carries.
        """
        named = (index for index in self.members if self.device.objects[index].name == name)
        return next((index for index in named if index in values.MANUFACTURER), None)

    # PDOs

    @cached_property
    def pdos(self) -> tuple[Pdo, ...]:
        """All PDOs with their default communication and mapping parameters; see `read_pdos`."""
        return self.read_pdos(self.default)

    def read_pdos(self, value: Callable[[Address], Value], refused: OnRefused = fatal) -> tuple[Pdo, ...]:
        """Read RPDOs, then TPDOs, from the parameter values that `value` gives.

        `refused` gets the MappingError, with file and index, of each that does not hold; by default it is raised.
        """
        pdos = []
        for direction, records in values.COMMUNICATION_RECORDS.items():
            for index in sorted(each for each in self.members if each in records):
                try:
                    pdos.append(self._pdo(direction, index, value))
                except MappingError as error:
                    refused(error)
        return tuple(pdos)

    def _pdo(self, direction: PdoDirection, index: int, value: Callable[[Address], Value]) -> Pdo:
        entry, record = self._cob_id(direction, index, value), index + values.MAPPING_OFFSET
        inhibit_time, event_timer = (
            self._setting((index, sub), value, 0) for sub in (values.INHIBIT_TIME, values.EVENT_TIMER)
        )
        if entry & values.EXTENDED:
            raise MappingError(self.file, index, f"COB-ID 0x{entry:08X} asks for a 29-bit identifier")
        return Pdo(
            direction=direction,
            index=index,
            name=self.device.objects[index].name,
            cob_id=entry & values.BASE_IDENTIFIER,
            valid=not entry & values.NOT_VALID,
            transmission_type=self._setting((index, values.TRANSMISSION_TYPE), value, values.EVENT_DRIVEN),
            mapping=tuple(
                self.mapped_object(record, self._parameter((record, subindex), value))
                for subindex in range(1, self._parameter((record, 0), value) + 1)
            ),
            inhibit_time=inhibit_time,
            event_timer=event_timer,
        )

    def _cob_id(self, direction: PdoDirection, index: int, value: Callable[[Address], Value]) -> int:
        """Return a COB-ID entry; the first four PDOs have one also where the file leaves it out (CiA 301, 7.3.3)."""
        number = index - direction.value
        base = values.DEFAULT_PDO_BASES[direction][number : number + 1]
        address = index, values.COB_ID
        return self._setting(address, value, base[0] + self.node_id) if base else self._parameter(address, value)

    def _setting(self, address: Address, value: Callable[[Address], Value], default: int) -> int:
        """Return a communication parameter that a file may leave out."""
        number = value(address)
        return number if isinstance(number, int) else default

    def _parameter(self, address: Address, value: Callable[[Address], Value]) -> int:
        number = value(address)
        if not isinstance(number, int):
            raise MappingError(self.file, address[0], f"sub {address[1]} is missing or has no number as its value")
        return number

    def mapped_object(self, mapping_index: int, entry: int) -> MappedObject:
        """Return what a mapping entry (index, sub-index, length in one UNSIGNED32) stands for.

        Raises MappingError if the object is missing or longer than its type.
        """
        index, subindex, bits = entry >> 16, entry >> 8 & 0xFF, entry & 0xFF
        if index in values.DUMMIES:
            return MappedObject(index, subindex, bits, PADDING, Limits(0, 0), values.DATA_TYPES[index])
        variable = self._at((index, subindex))
        where = f"maps 0x{index:04X} sub {subindex}"
        if variable is None:
            raise MappingError(self.file, mapping_index, f"{where}, which is missing")
        most = self.type(variable).size * 8 or MOST_BITS
        if not 1 <= bits <= most:
            raise MappingError(self.file, mapping_index, f"{where} with {bits} bits, its type has {most}")
        part = self.part((index, subindex))
        whole = (self._at(part.whole) if part else None) or variable
        return MappedObject(index, subindex, bits, variable.name, self._limits(whole), self.type(whole))

    def _limits(self, variable: DescribedVariable) -> Limits:
        """Return the limits of an integer, and for anything else those of its bits."""
        type_ = self.type(variable) if self.type(variable).is_integer else values.UNSIGNED64
        low, high = self.typed(variable, "lowlimit"), self.typed(variable, "highlimit")
        return Limits(low if isinstance(low, int) else type_.low, high if isinstance(high, int) else type_.high)

    def part(self, address: Address) -> Part | None:
        """Return what a slice is a part of: the member so named of the record without ` slices`.

        None for an object that is not a slice, and for a slice without a whole.
        """
        variable = self._at(address)
        match = values.SLICE.match(variable.name) if variable else None
        if match is None:
            return None
        record = self.device.objects[address[0]].name.removesuffix(SLICES)
        whole = self._wholes.get(f"{record}.{match['name']}")
        high, low = int(match["high"]), int(match["low"])
        return None if whole is None else Part(whole, low, high - low + 1)

    @cached_property
    def _wholes(self) -> dict[str, Address]:
        """The members of records, by both names, of which slices may be parts."""
        found = [address for address in self.addresses() if address[0] >= values.MANUFACTURER[0]]
        return {entry.name: address for address in reversed(found) if (entry := self.described(address))}


def _real(text: str, type_: DataType) -> Value:
    """Read a REAL: a decimal number, or its bits in hexadecimal; raises ValueError."""
    bits = parse_number(text) if text[:2].lower() == "0x" else None
    return type_.read(bits.value.to_bytes(type_.size, "little")) if bits else float(text)
