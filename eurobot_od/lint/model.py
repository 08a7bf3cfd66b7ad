"""What rules need to know about a file: its values, its PDOs, whether it is a DCF; its objects are in `od.description`.

Rule of this file: nothing here raises or guesses. What is missing or malformed is None or an empty text, and a rule
that needs it stays silent, as another rule reports it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property
from typing import NamedTuple

from eurobot_od.od import values
from eurobot_od.od.description import DescribedDevice, DescribedObject, DescribedVariable
from eurobot_od.od.document import Document, Entry, Section
from eurobot_od.od.formats import read
from eurobot_od.od.keys import TYPED
from eurobot_od.od.modules import Modules, with_modules
from eurobot_od.od.values import DataType, Number, PdoDirection, parse_number

TOP = Entry("", "", 1, 1)
"""Where a finding about the whole file stands."""


class GivenValue(NamedTuple):
    """A limit or value of a variable, and its number if it is one.

    `key` is the entry's in lower case; `parametervalue` for an entry of a [xxxxValue] section.
    """

    variable: DescribedVariable
    type: DataType
    key: str
    entry: Entry
    number: Number | None

    @property
    def has_node_id(self) -> bool:
        """Whether its text has `$NODEID` anywhere."""
        return values.NODE_ID in self.entry.value.upper()


MULTIPLEXED = (254, 255)
"""Values of a mapping's sub 0 for multiplexed PDOs, whose mapping is not a list of objects."""


class MappingEntry:
    """An entry of a mapping: the object, its bits, and the variable of the mapping record that holds it."""

    def __init__(self, entry: int, by: DescribedVariable) -> None:
        self.index, self.sub, self.bits, self.by = entry >> 16 & 0xFFFF, entry >> 8 & 0xFF, entry & 0xFF, by

    @property
    def where(self) -> str:
        """Name the object: 0x2000 sub 1."""
        return f"0x{self.index:04X} sub {self.sub}"


class LintedPdo(NamedTuple):
    """A PDO: its number (from 1), its communication and its mapping record, of which one may be missing."""

    direction: PdoDirection
    number: int
    communication: DescribedObject | None
    mapping: DescribedObject | None

    @property
    def name(self) -> str:
        """Name it: TPDO 3."""
        return f"{self.direction.name} {self.number}"

    @property
    def title(self) -> str:
        """Return the ParameterName of its communication record."""
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
        """Return the number of mapped objects, sub 0 of the mapping."""
        zero = self.entry(0)
        return zero.value if zero else None

    @property
    def is_multiplexed(self) -> bool:
        """Whether it is a multiplexed PDO."""
        return self.amount is not None and self.amount.value in MULTIPLEXED

    @property
    def default_base(self) -> range:
        """The base of its default identifier, as a range of one; empty from the fifth PDO on, which has no default."""
        return values.DEFAULT_PDO_BASES[self.direction][self.number - 1 : self.number]

    @property
    def is_valid(self) -> bool:
        """Whether it has a COB-ID that is valid."""
        cob_id = self.value(1)
        return cob_id is not None and not cob_id.value & values.NOT_VALID

    def identifier(self, node_id: int) -> int | None:
        """Return the base identifier it uses in a node; None if it has none, is not valid or has an extended one."""
        cob_id = self.value(1)
        if cob_id is None or cob_id.at(node_id) & (values.NOT_VALID | values.EXTENDED):
            return None
        return cob_id.at(node_id) & values.BASE_IDENTIFIER

    def mapped(self) -> Iterator[MappingEntry]:
        """Give the first `amount` entries of the mapping, those that are there and are numbers."""
        # Bounded, as a file may say any number; there is one more sub-index, 0xFF, which is not an entry.
        amount = self.amount.value if self.amount and not self.is_multiplexed else 0
        for sub in range(1, min(amount, values.MOST_SUBS) + 1):
            variable = self.entry(sub)
            entry = variable.value if variable else None
            if variable and entry and not entry.relative and entry.value > 0:
                yield MappingEntry(entry.value, variable)

    @property
    def bits(self) -> int:
        """Return how many bits it carries."""
        return sum(each.bits for each in self.mapped())


def load(data: bytes, file: str, patches: Iterable[str] = ()) -> LintedDevice:
    """Read the bytes of an EDS or DCF as a device, with patches over it.

    Nothing raises but patches that do not fit: they raise DictionaryError.
    """
    document = read(data)
    if patches:
        from eurobot_od.od.patches import patched, read_patch, with_settings

        over = [read_patch(each) for each in patches]
        document = patched(with_settings(document, over), over)
    # By hand, as `lint` starts without pathlib; of Windows' paths as well.
    return LintedDevice(document, file.replace("\\", "/").rpartition("/")[2])


class LintedDevice(DescribedDevice):
    """What one file describes; `name` is the file's own, without folder."""

    def __init__(self, document: Document, name: str) -> None:
        super().__init__(document)
        self.name = name

    def number(self, section: str, key: str) -> Number | None:
        """Return the number that a key of a section has (both in lower case); None without one."""
        return parse_number(self.document.text(section, key))

    def at(self, section: str, key: str) -> Entry | Section:
        """Return where a key of a section stands (both in lower case), or else the section, or the file's start."""
        found = self.section(section)
        return found.at(key) if found else TOP

    @cached_property
    def is_dcf(self) -> bool:
        """Whether it is a device configuration file."""
        return self.commissioning is not None or self.name.lower().endswith((".dcf", ".xdc"))

    @cached_property
    def modules(self) -> Modules:
        """The modules that may be plugged into it."""
        return Modules(self.document)

    @cached_property
    def connected(self) -> DescribedDevice:
        """The device with the objects of the modules that it says are connected."""
        whole, _ = with_modules(self.document)
        return self if whole is self.document else DescribedDevice(whole)

    @cached_property
    def variables(self) -> list[DescribedVariable]:
        """All variables that have a section of their own, and compact objects' templates as sub-index 1."""
        objects = self.objects.values()
        templates = [DescribedVariable(o.index, 1, o.section) for o in objects if o.compact and o.section]
        return [each for whole in objects for each in whole.subs.values()] + templates

    @cached_property
    def given(self) -> list[GivenValue]:
        """The limits, defaults and parameter values of all variables with a basic type, those of [xxxxValue] too."""
        found = [(each, key, each.section.entries.get(key)) for each in self.variables for key in TYPED]
        for name, section in self.object_sections:
            head = self.objects[name.object_index].section
            if name.list == "value" and head:
                variable = DescribedVariable(name.object_index, 1, head)
                found += [
                    (variable, "parametervalue", each) for key, each in section.entries.items() if key != "nrofentries"
                ]
        return [
            GivenValue(variable, variable.type, key, entry, variable.read(entry.value))
            for variable, key, entry in found
            if variable.type and entry and entry.value
        ]

    @cached_property
    def integers(self) -> list[GivenValue]:
        """The limits and values of variables with an integer type."""
        return [each for each in self.given if each.type.is_integer]

    @cached_property
    def others(self) -> list[GivenValue]:
        """The limits and values of variables with another basic type."""
        return [each for each in self.given if not each.type.is_integer]

    @cached_property
    def pdos(self) -> list[LintedPdo]:
        """All PDOs of which at least one record is there, RPDOs first."""
        return [
            LintedPdo(direction, number + 1, communication, mapping)
            for direction in PdoDirection
            for number in range(values.PDO_COUNT)
            for communication in [self.objects.get(direction.value + number)]
            for mapping in [self.objects.get(direction.value + values.MAPPING_OFFSET + number)]
            if communication or mapping
        ]

    @cached_property
    def mapped(self) -> list[tuple[LintedPdo, MappingEntry]]:
        """All mapping entries of all PDOs."""
        return [(pdo, each) for pdo in self.pdos for each in pdo.mapped()]

    @cached_property
    def node_id(self) -> int | None:
        """The NodeID a DCF gives to the device, if it is one."""
        number = self.commissioned("nodeid")
        return number.value if number and number.value in values.NODE_IDS else None

    @cached_property
    def node_ids(self) -> tuple[int, ...]:
        """The node-IDs for which values with `$NODEID` have to hold: if for these two, then for all between."""
        return (values.NODE_IDS[0], values.NODE_IDS[-1]) if self.node_id is None else (self.node_id,)

    @cached_property
    def entries(self) -> Mapping[str, list[tuple[Section, Entry]]]:
        """The entries of a key (in lower case), wherever an object's section, or a sub-index's, has it."""
        found: dict[str, list[tuple[Section, Entry]]] = defaultdict(list)
        for name, section in self.object_sections:
            for key, entry in section.entries.items() if not name.list else ():
                found[key].append((section, entry))
        return found
