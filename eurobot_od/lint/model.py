"""The object dictionary a file describes, for rules to ask: devices, objects, variables, PDOs.

Rule of this file: asking never raises and never guesses; what is missing or malformed is None or an empty text, and
each rule that needs it stays silent where another one already speaks.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import Enum
from functools import cached_property, lru_cache
from typing import NamedTuple

from eurobot_od.od.document import Document, Entry, Section

NODE_ID = "$NODEID"
NODE_IDS = (1, 127)
"""Lowest and highest node-ID: a value with `$NODEID` has to hold for both."""

MOST_SUBS = 254
"""Highest sub-index of data (CiA 301: 0xFF is the object's structure)."""


class Number(NamedTuple):
    """A number of a file: its value, and whether the node-ID is to be added."""

    value: int
    relative: bool = False

    def at(self, node_id: int) -> int:
        """Return the value for a node-ID."""
        return self.value + node_id if self.relative else self.value


@lru_cache(maxsize=4096)
def parse_number(text: str) -> Number | None:
    """Read a number as CiA 306 writes it: decimal, 0x hexadecimal, 0 octal, and `$NODEID+` in front of either."""
    upper = text.strip().upper()
    if not upper.startswith(NODE_ID):
        value = _integer(upper)
        return None if value is None else Number(value)
    plus, rest = upper[len(NODE_ID) :].strip()[:1], upper[len(NODE_ID) :].strip()[1:].strip()
    offset = 0 if not plus else _integer(rest) if plus == "+" and rest[:1] != "-" else None
    return None if offset is None else Number(offset, relative=True)


def _integer(text: str) -> int | None:
    """Read a whole number; its digits are looked at first, because int() takes blanks, underscores and more signs."""
    digits = text.removeprefix("-")
    base = 16 if digits.startswith("0X") else 8 if digits.startswith("0") else 10
    digits = digits.removeprefix("0X")
    if not digits or digits.strip(DIGITS[base]) or len(digits) > LONGEST_NUMBER:
        return None
    return -int(digits, base) if text.startswith("-") else int(digits, base)


DIGITS = {8: "01234567", 10: "0123456789", 16: "0123456789ABCDEFabcdef"}
"""The digits of each base."""

LONGEST_NUMBER = 100
"""More digits than any type has; what is longer is no number, so that nobody has to convert a megabyte of digits."""


class Kind(Enum):
    """What an object is (CiA 301, object codes)."""

    NULL = 0x0
    DOMAIN = 0x2
    DEFTYPE = 0x5
    DEFSTRUCT = 0x6
    VAR = 0x7
    ARRAY = 0x8
    RECORD = 0x9


COMPOSED = (Kind.DEFSTRUCT, Kind.ARRAY, Kind.RECORD)
"""Objects with sub-indices."""


class DataType(NamedTuple):
    """A data type: its name, its bits (0: no fixed length), and the lowest and highest value of an integer."""

    name: str
    bits: int
    low: int = 0
    high: int = -1

    @property
    def is_integer(self) -> bool:
        """Whether values are whole numbers."""
        return self.low <= self.high


def _integers(codes: dict[int, int], name: str) -> dict[int, DataType]:
    signed = name == "INTEGER"
    return {
        code: DataType(f"{name}{bits}", bits, -(1 << bits - 1) if signed else 0, (1 << bits - signed) - 1)
        for code, bits in codes.items()
    }


TYPES: dict[int, DataType] = {
    0x01: DataType("BOOLEAN", 1, 0, 1),
    0x08: DataType("REAL32", 32),
    0x09: DataType("VISIBLE_STRING", 0),
    0x0A: DataType("OCTET_STRING", 0),
    0x0B: DataType("UNICODE_STRING", 0),
    0x0C: DataType("TIME_OF_DAY", 48),
    0x0D: DataType("TIME_DIFFERENCE", 48),
    0x0F: DataType("DOMAIN", 0),
    0x11: DataType("REAL64", 64),
    **_integers({0x02: 8, 0x03: 16, 0x04: 32, 0x10: 24, 0x12: 40, 0x13: 48, 0x14: 56, 0x15: 64}, "INTEGER"),
    **_integers({0x05: 8, 0x06: 16, 0x07: 32, 0x16: 24, 0x18: 40, 0x19: 48, 0x1A: 56, 0x1B: 64}, "UNSIGNED"),
}
"""The basic data types (CiA 301, Table 44)."""

REALS = ("REAL32", "REAL64")
UNSIGNED8, UNSIGNED16, UNSIGNED32 = TYPES[0x05], TYPES[0x06], TYPES[0x07]


WRITABLE = ("rw", "wo", "rwr", "rww")
"""Access types that let an SDO write."""


class Variable:
    """A place for a value: a VAR (sub-index 0) or a sub-index, and the section that describes it.

    `type` is its basic data type (None: missing, unknown or no basic one), `access` its AccessType in lower case,
    `value_entry` the entry with its value, the ParameterValue (DCF) or else the DefaultValue, `value` that as a number.
    """

    def __init__(self, index: int, sub: int, section: Section) -> None:
        self.index, self.sub, self.section = index, sub, section
        entries = section.entries
        code = parse_number(section.text("datatype"))
        self.type = TYPES.get(code.value) if code else None
        self.access = section.text("accesstype").lower()
        self.value_entry = entries.get("parametervalue") or entries.get("defaultvalue")
        self.value = parse_number(self.value_entry.value) if self.value_entry else None
        self.is_mappable = parse_number(section.text("pdomapping")) == (1, False)
        self.is_writable = self.access in WRITABLE

    @property
    def name(self) -> str:
        """Return its ParameterName."""
        return self.section.text("parametername")

    def number(self, key: str) -> Number | None:
        """Return the number a key (in lower case) has; None without one."""
        return parse_number(self.section.text(key))

    @property
    def where(self) -> str:
        """Name it: 0x1018 sub 1."""
        return f"0x{self.index:04X} sub {self.sub}"


class Object:
    """An object: its section (None if only sub-indices are described), its sub-indices, its lists."""

    def __init__(
        self, index: int, section: Section | None, subs: dict[int, Variable], lists: dict[str, Section]
    ) -> None:
        self.index, self.section, self.subs, self.lists = index, section, subs, lists

    @property
    def name(self) -> str:
        """Return its ParameterName."""
        return self.section.text("parametername") if self.section else ""

    @cached_property
    def kind(self) -> Kind | None:
        """Return its object code, VAR if it says none; None for an unknown one."""
        if self.section is None:
            return None
        entry = self.section.entries.get("objecttype")
        code = parse_number(entry.value) if entry and entry.value else Number(Kind.VAR.value)
        return Kind(code.value) if code and code.value in _KINDS else None

    @cached_property
    def compact(self) -> int:
        """Return how many sub-indices CompactSubObj describes at once, 0 for none, never more than there can be."""
        count = parse_number(self.section.text("compactsubobj")) if self.section else None
        return max(0, min(count.value, MOST_SUBS)) if count else 0

    @property
    def place(self) -> Section:
        """Return the section to point at: its own, or else the first of its sub-indices or lists."""
        return self.section or next(iter([*(each.section for each in self.subs.values()), *self.lists.values()]))

    @cached_property
    def is_writable(self) -> bool:
        """Whether an SDO may write any of its sub-indices but 0."""
        if self.compact and self.section:
            return Variable(self.index, 1, self.section).is_writable
        return any(each.is_writable for sub, each in self.subs.items() if sub)

    def variable(self, sub: int) -> Variable | None:
        """Return the variable at a sub-index, also one that CompactSubObj describes; None if there is none."""
        found = self.subs.get(sub)
        if found or not self.compact or self.section is None or sub > self.compact:
            return found
        return Variable(self.index, sub, self._compact_section(sub))

    def _compact_section(self, sub: int) -> Section:
        """Describe a compact sub-index by the entries it would have if it were written out."""
        template = self.section or self.place
        entries = {key: each for key, each in template.entries.items() if key not in _COMPACT_ONLY}
        if sub == 0:
            entries |= {
                "datatype": template.entries.get("datatype", _entry(template))._replace(value="0x0005"),
                "accesstype": template.entries.get("accesstype", _entry(template))._replace(value="ro"),
                "defaultvalue": template.entries["compactsubobj"],
            }
        for list_name, key in (("value", "parametervalue"), ("name", "parametername")):
            own = self.lists[list_name].entries.get(str(sub)) if list_name in self.lists else None
            if own and sub:
                entries[key] = own
        return template._replace(entries=entries)


_KINDS = {each.value for each in Kind}
_COMPACT_ONLY = ("compactsubobj", "objecttype", "subnumber")


def _entry(section: Section) -> Entry:
    return Entry("", "", section.line, section.column)


class ObjectName(NamedTuple):
    """What the name of an object's section says: index, sub-index (-1 without one) and list (`name`, `value`, ``)."""

    object_index: int
    sub: int = -1
    list: str = ""


OBJECT_LISTS = ("name", "value", "denotation")
"""Sections `[xxxxName]` and their like, which give a compact object's sub-indices their own texts and values."""


def parse_object_name(name: str) -> ObjectName | None:
    """Read the name of an object's section: `1018`, `1018sub1`, `2000Name`; None if it is no such name."""
    head, tail = name[:4], name[4:].lower()
    if len(head) != 4 or not _is_hexadecimal(head):
        return None
    if tail in OBJECT_LISTS:
        return ObjectName(int(head, 16), list=tail)
    sub = tail.removeprefix("sub")
    if not tail:
        return ObjectName(int(head, 16))
    if sub == tail or not 1 <= len(sub) <= 2 or not _is_hexadecimal(sub) or (sub[0] == "0" and sub != "0"):
        return None
    return ObjectName(int(head, 16), int(sub, 16))


def _is_hexadecimal(text: str) -> bool:
    return bool(text) and not text.strip(DIGITS[16])


class Value(NamedTuple):
    """A limit or value of a variable, and its number if it is one.

    `key` is the entry's in lower case; `parametervalue` for an entry of a [xxxxValue] section.
    """

    variable: Variable
    type: DataType | None
    key: str
    entry: Entry
    number: Number | None


LIMITS = ("lowlimit", "highlimit")
VALUES = ("defaultvalue", "parametervalue")


class Direction(Enum):
    """RPDO or TPDO, seen from the device; the value is the index of its first communication record (CiA 301)."""

    RPDO = 0x1400
    TPDO = 0x1800


MAPPING_OFFSET = 0x200
PDO_COUNT = 0x200
NOT_VALID, NO_RTR, EXTENDED, BASE_IDENTIFIER = 1 << 31, 1 << 30, 1 << 29, 0x7FF
MULTIPLEXED = (254, 255)
"""Values of a mapping's sub 0 for multiplexed PDOs, whose mapping is no list of objects."""


class Mapped:
    """An entry of a mapping: the object, its bits, and the variable of the mapping record that holds it."""

    def __init__(self, entry: int, by: Variable) -> None:
        self.index, self.sub, self.bits, self.by = entry >> 16 & 0xFFFF, entry >> 8 & 0xFF, entry & 0xFF, by

    @property
    def where(self) -> str:
        """Name the object: 0x2000 sub 1."""
        return f"0x{self.index:04X} sub {self.sub}"

    @property
    def at(self) -> Entry | Section:
        """Return where the entry stands."""
        return self.by.value_entry or self.by.section


class Pdo(NamedTuple):
    """A PDO: its number (from 1), its communication and its mapping record, of which one may be missing."""

    direction: Direction
    number: int
    communication: Object | None
    mapping: Object | None

    @property
    def name(self) -> str:
        """Name it: TPDO 3."""
        return f"{self.direction.name} {self.number}"

    @property
    def title(self) -> str:
        """Return the ParameterName of its communication record."""
        return self.communication.name if self.communication else ""

    def setting(self, sub: int) -> Variable | None:
        """Return a variable of the communication record."""
        return self.communication.variable(sub) if self.communication else None

    def value(self, sub: int) -> Number | None:
        """Return the value of a communication parameter."""
        setting = self.setting(sub)
        return setting.value if setting else None

    @property
    def amount(self) -> Number | None:
        """Return the number of mapped objects, sub 0 of the mapping."""
        variable = self.mapping.variable(0) if self.mapping else None
        return variable.value if variable else None

    @property
    def is_multiplexed(self) -> bool:
        """Whether it is a multiplexed PDO."""
        return self.amount is not None and self.amount.value in MULTIPLEXED

    @property
    def is_valid(self) -> bool:
        """Whether it has a COB-ID that is valid."""
        cob_id = self.value(1)
        return cob_id is not None and not cob_id.value & NOT_VALID

    def identifier(self, node_id: int) -> int | None:
        """Return the base identifier it uses in a node; None if it has none, is not valid or has an extended one."""
        cob_id = self.value(1)
        if cob_id is None or cob_id.at(node_id) & (NOT_VALID | EXTENDED):
            return None
        return cob_id.at(node_id) & BASE_IDENTIFIER

    def mapped(self) -> Iterator[Mapped]:
        """Give the entries of the mapping that count: the first `amount`, as far as they are there and are numbers."""
        if self.mapping is None or self.amount is None or self.is_multiplexed:
            return
        for sub in range(1, min(self.amount.value, MOST_SUBS) + 1):
            variable = self.mapping.variable(sub)
            entry = variable.value if variable else None
            if variable and entry and not entry.relative and entry.value > 0:
                yield Mapped(entry.value, variable)

    @property
    def bits(self) -> int:
        """Return how many bits it carries."""
        return sum(each.bits for each in self.mapped())


class Device:
    """What one file describes; `name` is the file's own, without folder."""

    def __init__(self, document: Document, name: str) -> None:
        self.document, self.name = document, name

    def section(self, name: str) -> Section | None:
        """Return a section by its name in lower case."""
        return self.document.sections.get(name)

    @cached_property
    def commissioning(self) -> Section | None:
        """Return [DeviceComissioning], in the standard's spelling or in the dictionary's."""
        return self.section("devicecomissioning") or self.section("devicecommissioning")

    @cached_property
    def is_dcf(self) -> bool:
        """Whether it is a device configuration file."""
        return self.commissioning is not None or self.name.lower().endswith(".dcf")

    @cached_property
    def _named_sections(self) -> list[tuple[ObjectName | None, Section]]:
        return [(parse_object_name(each.name.strip()), each) for each in self.document.sections.values()]

    @cached_property
    def object_sections(self) -> list[tuple[ObjectName, Section]]:
        """All sections of objects, in the file's order."""
        return [(name, each) for name, each in self._named_sections if name]

    @cached_property
    def other_sections(self) -> list[Section]:
        """All sections that are no object's, in the file's order."""
        return [each for name, each in self._named_sections if name is None]

    @cached_property
    def objects(self) -> dict[int, Object]:
        """All objects by index; one that has no section of its own, but sub-indices, too."""
        heads: dict[int, Section] = {}
        subs: dict[int, dict[int, Variable]] = {}
        lists: dict[int, dict[str, Section]] = {}
        for (index, sub, list_name), section in self.object_sections:
            subs.setdefault(index, {})
            if list_name:
                lists.setdefault(index, {})[list_name] = section
            elif sub >= 0:
                subs[index][sub] = Variable(index, sub, section)
            else:
                heads[index] = section
        return {index: _object(index, heads.get(index), subs[index], lists.get(index, {})) for index in subs}

    @cached_property
    def variables(self) -> list[Variable]:
        """All variables that have a section of their own, and compact objects' templates as sub-index 1."""
        found = [each for obj in self.objects.values() for each in obj.subs.values()]
        return found + [Variable(o.index, 1, o.section) for o in self.objects.values() if o.compact and o.section]

    def variable(self, index: int, sub: int = 0) -> Variable | None:
        """Return the variable at an index and sub-index; None if there is none."""
        found = self.objects.get(index)
        return found.variable(sub) if found else None

    def value(self, index: int, sub: int = 0) -> Number | None:
        """Return the value a variable has in the file."""
        variable = self.variable(index, sub)
        return variable.value if variable else None

    @cached_property
    def values(self) -> list[Value]:
        """All limits, defaults and parameter values of all variables."""
        return [
            Value(each, each.type, key, entry, parse_number(entry.value))
            for each in self.variables
            for key in LIMITS + VALUES
            for entry in [each.section.entries.get(key)]
            if entry and entry.value
        ] + list(self._listed_values())

    def _listed_values(self) -> Iterator[Value]:
        """Give the values of [xxxxValue]."""
        for name, section in self.object_sections:
            head = self.objects[name.object_index].section
            if name.list == "value" and head:
                variable = Variable(name.object_index, 1, head)
                for key, entry in section.entries.items():
                    if key != "nrofentries" and entry.value:
                        yield Value(variable, variable.type, VALUES[1], entry, parse_number(entry.value))

    @cached_property
    def integers(self) -> list[Value]:
        """The limits and values of variables with an integer type."""
        return [each for each in self.values if each.type and each.type.is_integer]

    @cached_property
    def others(self) -> list[Value]:
        """The limits and values of variables with another basic type."""
        return [each for each in self.values if each.type and not each.type.is_integer]

    @cached_property
    def pdos(self) -> list[Pdo]:
        """All PDOs of which at least one record is there, RPDOs first."""
        return [
            Pdo(direction, number + 1, communication, mapping)
            for direction in Direction
            for number in range(PDO_COUNT)
            for communication in [self.objects.get(direction.value + number)]
            for mapping in [self.objects.get(direction.value + MAPPING_OFFSET + number)]
            if communication or mapping
        ]

    @cached_property
    def mapped(self) -> list[tuple[Pdo, Mapped]]:
        """All mapping entries of all PDOs."""
        return [(pdo, each) for pdo in self.pdos for each in pdo.mapped()]

    @cached_property
    def node_id(self) -> int | None:
        """The NodeID a DCF gives to the device, if it is one."""
        number = parse_number(self.commissioning.text("nodeid")) if self.commissioning else None
        return number.value if number and NODE_IDS[0] <= number.value <= NODE_IDS[1] else None

    @cached_property
    def node_ids(self) -> tuple[int, ...]:
        """The node-IDs for which values with `$NODEID` have to hold."""
        return NODE_IDS if self.node_id is None else (self.node_id,)

    def entries(self, key: str) -> list[tuple[Section, Entry]]:
        """Give an entry wherever an object's section, or a sub-index's, has it."""
        return self._entries_by_key.get(key, [])

    @cached_property
    def _entries_by_key(self) -> dict[str, list[tuple[Section, Entry]]]:
        found: dict[str, list[tuple[Section, Entry]]] = {}
        for name, section in self.object_sections:
            if not name.list:
                for key, entry in section.entries.items():
                    found.setdefault(key, []).append((section, entry))
        return found


def _object(index: int, section: Section | None, subs: dict[int, Variable], lists: dict[str, Section]) -> Object:
    """Make an object; a VAR and a DOMAIN are their own and only variable."""
    found = Object(index, section, subs, lists)
    if section and not subs and found.kind not in COMPOSED and not found.compact:
        found.subs = {0: Variable(index, 0, section)}
    return found
