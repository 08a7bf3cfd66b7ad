"""The object dictionary in a document: objects, sub-indices, and their entries.

Nothing here raises or guesses. A missing or malformed value is None or an empty text, so that lint can check any file;
`normal` decides what a usable file must have.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import NamedTuple

from eurobot_od.od import values
from eurobot_od.od.document import COMMISSIONING, OBJECT_LISTS, TYPED, Document, Entry, Section
from eurobot_od.od.standard import MANDATORY, UNCONFIGURED
from eurobot_od.od.values import Address, MappingEntry, Multiplex, Number, PdoDirection, PdoRecords, parse_number


class ObjectCode(Enum):
    """Object codes (CiA 301)."""

    NULL = 0x0
    DOMAIN = 0x2
    DEFTYPE = 0x5
    DEFSTRUCT = 0x6
    VAR = 0x7
    ARRAY = 0x8
    RECORD = 0x9


SIMPLE = (ObjectCode.VAR, ObjectCode.DOMAIN)
"""Objects without sub-indices."""

COMPOSED = (ObjectCode.DEFSTRUCT, ObjectCode.ARRAY, ObjectCode.RECORD)
"""Objects with sub-indices."""

_CODES = {each.value: each for each in ObjectCode}


class SectionName(NamedTuple):
    """Parts of the name of an object's section.

    `sub` is -1 without a sub-index; `list` is `name`, `value` or `denotation` for a list of a compact object, else
    empty.
    """

    object_index: int
    sub: int = -1
    list: str = ""


SECTION_NAME = re.compile(
    r"([0-9A-F]{4})(?:sub(0|[1-9A-F][0-9A-F]?)|(name|value|denotation))?", re.IGNORECASE | re.ASCII
)
"""Names of sections of objects, of sub-indices, and of lists such as [xxxxName] for a compact object."""


def parse_section_name(name: str) -> SectionName | None:
    """Parse the name of an object's section, such as `1018`, `1018sub1` or `2000Name`; None for others."""
    match = SECTION_NAME.fullmatch(name)
    if match is None:
        return None
    index, sub, list_name = match.groups()
    return SectionName(int(index, 16), int(sub, 16) if sub else -1, list_name.lower() if list_name else "")


def listed(indices: Iterable[int]) -> dict[str, list[int]]:
    """Return indices by the object list to which they belong (CiA 306-1, 4.6.1)."""
    lists: dict[str, list[int]] = {name: [] for name in OBJECT_LISTS}
    for index in indices:
        lists[_list_of(index)].append(index)
    return lists


def _list_of(index: int) -> str:
    mandatory, optional, manufacturer = OBJECT_LISTS
    if index in MANDATORY:
        return mandatory
    return manufacturer if index in values.MANUFACTURER else optional


def list_entries(indices: Sequence[int]) -> dict[str, str]:
    """Return the entries of an object list."""
    numbered = {str(number): f"0x{index:04X}" for number, index in enumerate(indices, start=1)}
    return {"SupportedObjects": str(len(indices)), **numbered}


class DescribedVariable:
    """A VAR (sub-index 0) or a sub-index, and the section that describes it.

    `type` is its basic data type (None: missing, unknown or not basic); `access` its AccessType in lower case, or
    NO_ACCESS. Its value is the ParameterValue (DCF) or else the DefaultValue.
    """

    def __init__(self, index: int, sub: int, section: Section) -> None:
        self.index, self.sub, self.section = index, sub, section
        code = parse_number(section.text("datatype"))
        self.type = values.DATA_TYPES.get(code.value) if code else None
        written = section.text("accesstype")
        self.access = values.NO_ACCESS if written.upper() == values.NO_ACCESS_IN_EDS else written.lower()

    @cached_property
    def value_entry(self) -> Entry | None:
        """Entry of the value; an empty ParameterValue is ignored."""
        entries = self.section.entries
        parameter = entries.get("parametervalue")
        return parameter if parameter and parameter.value else entries.get("defaultvalue") or parameter

    @cached_property
    def value(self) -> Number | None:
        """The value, if it is a number."""
        return self.read(self.value_entry.value) if self.value_entry else None

    @property
    def is_mappable(self) -> bool:
        """Whether it may be mapped into a PDO."""
        return parse_number(self.section.text("pdomapping")) == (1, False)

    @property
    def is_writable(self) -> bool:
        """Whether an SDO may write it."""
        return self.access in values.WRITABLE

    @property
    def name(self) -> str:
        """The ParameterName."""
        return self.section.text("parametername")

    def number(self, key: str) -> Number | None:
        """Return the number of a key (in lower case), or None."""
        return self.read(self.section.text(key)) if key in TYPED else parse_number(self.section.text(key))

    def read(self, text: str) -> Number | None:
        """Return the number of a value or limit by its type: 0xFF is -1 in an INTEGER8."""
        number = parse_number(text)
        # Only hexadecimal digits are bits: a decimal 255 in an INTEGER8 is too large, which lint reports.
        if number is None or self.type is None or number.relative or "0X" not in text.upper():
            return number
        return Number(self.type.meant(number.value))

    @property
    def where(self) -> str:
        """Address such as `0x1018 sub 1`."""
        return f"0x{self.index:04X} sub {self.sub}"

    @property
    def place(self) -> Entry | Section:
        """Place of the value, else of the section."""
        return self.value_entry or self.section


class DescribedObject:
    """An object: its section (None if only sub-indices have one), its sub-indices, its lists."""

    def __init__(
        self, index: int, section: Section | None, subs: dict[int, DescribedVariable], lists: dict[str, Section]
    ) -> None:
        self.index, self.section, self.subs, self.lists = index, section, subs, lists
        # A VAR or DOMAIN has one variable, described by the object's section.
        if section and not subs and self.code not in COMPOSED and not self.compact:
            self.subs = {0: DescribedVariable(index, 0, section)}

    @property
    def name(self) -> str:
        """The ParameterName."""
        return self.section.text("parametername") if self.section else ""

    @cached_property
    def code(self) -> ObjectCode | None:
        """The object code, VAR if it is missing; None for an unknown one."""
        if self.section is None:
            return None
        text = self.section.text("objecttype")
        number = parse_number(text) if text else Number(ObjectCode.VAR.value)
        return _CODES.get(number.value) if number else None

    @cached_property
    def compact(self) -> int:
        """Number of sub-indices that CompactSubObj describes, 0 for none."""
        count = parse_number(self.section.text("compactsubobj")) if self.section else None
        # Bounded, because a file may ask for a billion sub-indices.
        return max(0, min(count.value, values.MOST_SUBS)) if count else 0

    @property
    def place(self) -> Section:
        """The object's section, else the first section of its sub-indices or lists."""
        return self.section or next(iter([*(each.section for each in self.subs.values()), *self.lists.values()]))

    @cached_property
    def is_writable(self) -> bool:
        """Whether an SDO may write any sub-index other than 0."""
        if self.compact and self.section:
            return DescribedVariable(self.index, 1, self.section).is_writable
        return any(each.is_writable for sub, each in self.subs.items() if sub)

    def variable(self, sub: int) -> DescribedVariable | None:
        """Return the variable at a sub-index, also of a compact object, or None."""
        found = self.subs.get(sub)
        if found or self.section is None or not self.compact or sub > self.compact:
            return found
        return DescribedVariable(self.index, sub, self._written_out(sub, self.section))

    def variables(self) -> Iterator[DescribedVariable]:
        """Yield all variables, with compact ones expanded."""
        for sub in sorted({*self.subs, *range(self.compact + 1 if self.compact else 0)}):
            variable = self.variable(sub)
            if variable:
                yield variable

    def _written_out(self, sub: int, template: Section) -> Section:
        """Return the section that a compact sub-index would have (CiA 306-1, 4.6.3.2)."""
        if sub == 0:
            count = template.entries["compactsubobj"]
            zero = {key: count._replace(key=key, value=text) for key, text in _COMPACT_ZERO.items()}
            return template._replace(entries={**zero, "defaultvalue": count})
        entries = {key: each for key, each in template.entries.items() if key not in _COMPACT_ONLY}
        # [xxxxName] and [xxxxValue] have decimal sub-indices, unlike sections of objects.
        for list_name, key in (("value", "parametervalue"), ("name", "parametername")):
            own = self.lists[list_name].entries.get(str(sub)) if list_name in self.lists else None
            if own:
                entries[key] = own
        return template._replace(entries=entries)


_COMPACT_ONLY = ("compactsubobj", "objecttype", "subnumber")
_COMPACT_ZERO = {"parametername": "NrOfObjects", "datatype": "0x0005", "accesstype": "ro"}


@dataclass(frozen=True, eq=False)
class DescribedRecords(PdoRecords):
    """The records of a PDO in a file: communication and mapping; one of them may be missing."""

    direction: PdoDirection
    index: int
    communication: DescribedObject | None
    mapping: DescribedObject | None

    @property
    def name(self) -> str:
        """The ParameterName of its communication record."""
        return self.communication.name if self.communication else ""

    def setting(self, sub: int) -> DescribedVariable | None:
        """Return a variable of the communication record."""
        return self.communication.variable(sub) if self.communication else None

    def value(self, sub: int) -> Number | None:
        """Return the value of a communication parameter."""
        setting = self.setting(sub)
        return setting.value if setting else None

    def entry(self, sub: int) -> DescribedVariable | None:
        """Return a variable of the mapping record."""
        return self.mapping.variable(sub) if self.mapping else None

    @property
    def amount(self) -> Number | None:
        """Number of mapped objects, from sub-index 0 of the mapping."""
        zero = self.entry(0)
        return zero.value if zero else None

    @property
    def is_multiplexed(self) -> bool:
        """Whether this is a multiplexed PDO."""
        return self.amount is not None and self.amount.value in set(Multiplex)

    @property
    def is_valid(self) -> bool:
        """Whether the COB-ID is valid."""
        cob_id = self.value(values.COB_ID)
        return cob_id is not None and not cob_id.value & values.NOT_VALID

    def identifier(self, node_id: int) -> int | None:
        """Return the 11-bit identifier in a node; None if it is missing, extended or not valid."""
        cob_id = self.value(values.COB_ID)
        if cob_id is None or cob_id.at(node_id) & (values.NOT_VALID | values.EXTENDED):
            return None
        return cob_id.at(node_id) & values.BASE_IDENTIFIER

    def mapped(self) -> Iterator[tuple[MappingEntry, DescribedVariable]]:
        """Yield the first `amount` entries of the mapping that are numbers, with their variables."""
        # Bounded, because a file may have any number.
        amount = self.amount.value if self.amount and not self.is_multiplexed else 0
        for sub in range(1, min(amount, values.MOST_SUBS) + 1):
            variable = self.entry(sub)
            entry = variable.value if variable else None
            if variable and entry and not entry.relative and entry.value > 0:
                yield MappingEntry.of(entry.value), variable

    @property
    def bits(self) -> int:
        """Number of mapped bits."""
        return sum(entry.bits for entry, _ in self.mapped())


class DescribedDevice:
    """The device in a document."""

    def __init__(self, document: Document) -> None:
        self.document = document

    def section(self, name: str) -> Section | None:
        """Return a section by its name in lower case."""
        return self.document.sections.get(name)

    @cached_property
    def commissioning(self) -> Section | None:
        """[DeviceComissioning], in the standard's spelling or spelled correctly."""
        return self.section(COMMISSIONING.lower()) or self.section("devicecommissioning")

    @cached_property
    def _named_sections(self) -> list[tuple[SectionName | None, Section]]:
        return [(parse_section_name(each.name.strip()), each) for each in self.document.sections.values()]

    @cached_property
    def object_sections(self) -> list[tuple[SectionName, Section]]:
        """All sections of objects, in the file's order."""
        return [(name, each) for name, each in self._named_sections if name]

    @cached_property
    def other_sections(self) -> list[Section]:
        """All sections that are not an object's, in the file's order."""
        return [each for name, each in self._named_sections if name is None]

    @cached_property
    def objects(self) -> dict[int, DescribedObject]:
        """All objects by index, also those with sub-indices but without a section."""
        heads: dict[int, Section] = {}
        subs: dict[int, dict[int, DescribedVariable]] = {}
        lists: dict[int, dict[str, Section]] = {}
        for (index, sub, list_name), section in self.object_sections:
            subs.setdefault(index, {})  # for every index, also without sub-indices
            if list_name:
                lists.setdefault(index, {})[list_name] = section
            elif sub >= 0:
                subs[index][sub] = DescribedVariable(index, sub, section)
            else:
                heads[index] = section
        return {index: DescribedObject(index, heads.get(index), subs[index], lists.get(index, {})) for index in subs}

    def variable(self, index: int, sub: int = 0) -> DescribedVariable | None:
        """Return the variable at an index and sub-index, or None."""
        found = self.objects.get(index)
        return found.variable(sub) if found else None

    def value(self, index: int, sub: int = 0) -> Number | None:
        """Return a variable's value in the file, if it is a number."""
        variable = self.variable(index, sub)
        return variable.value if variable else None

    @cached_property
    def pdos(self) -> list[DescribedRecords]:
        """All PDOs with at least one record, RPDOs first."""
        found = {values.pdo_of(index) for index in self.objects} - {None}
        every = ((direction, index) for direction in PdoDirection for index in values.COMMUNICATION_RECORDS[direction])
        there = ((direction, index, index + values.MAPPING_OFFSET) for direction, index in every if index in found)
        return [
            DescribedRecords(each, one, self.objects.get(one), self.objects.get(other)) for each, one, other in there
        ]

    @cached_property
    def mapped(self) -> list[tuple[DescribedRecords, MappingEntry, DescribedVariable]]:
        """All mapping entries of all PDOs: PDO, entry, variable of the entry."""
        return [(pdo, entry, by) for pdo in self.pdos for entry, by in pdo.mapped()]

    def commissioned(self, key: str) -> Number | None:
        """Return the number of a key (in lower case) of the commissioning, valid or not."""
        return parse_number(self.commissioning.text(key)) if self.commissioning else None

    @cached_property
    def own_node_id(self) -> DescribedVariable | None:
        """The manufacturer-specific setting with the device's node-ID, found by its name, or None."""
        own = (self.objects[index] for index in sorted(self.objects) if index in values.MANUFACTURER)
        settings = (each for whole in own for each in whole.subs.values())
        return next((each for each in settings if each.name.lower() in values.NODE_ID_NAMES), None)

    @property
    def node_id_address(self) -> Address | None:
        """Address of the setting with the device's node-ID, or None."""
        return (self.own_node_id.index, self.own_node_id.sub) if self.own_node_id else None

    @property
    def commissioned_node_id(self) -> int | None:
        """NodeID of the commissioning; None in an EDS."""
        number = self.commissioned("nodeid")
        return number.value if number else None

    @property
    def said_node_id(self) -> int | None:
        """The commissioned node-ID, else the value of the setting with the device's node-ID.

        A setting of `$NODEID` does not determine the node-ID.
        """
        commissioned = self.commissioned("nodeid")
        if commissioned:
            return None if commissioned.relative else commissioned.value
        own = self.own_node_id
        settings = [own.number(key) for key in ("parametervalue", "defaultvalue")] if own else []
        # 0xFF is an unconfigured device (CiA 305).
        said = (each.value for each in settings if each and not each.relative and each.value != UNCONFIGURED)
        return next(said, None)
