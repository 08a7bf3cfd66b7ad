"""What rules need to know about a file: its values, its PDOs, whether it is a DCF; its objects are in `od.description`.

Nothing here raises or guesses. What is missing or malformed is None or an empty text; a rule that needs it then stays
silent, because another rule reports it.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

from eurobot_od.errors import DictionaryError
from eurobot_od.od import values
from eurobot_od.od.description import DescribedDevice, DescribedVariable
from eurobot_od.od.document import TYPED, Document, Entry, Section
from eurobot_od.od.formats import read
from eurobot_od.od.modules import Modules, with_modules
from eurobot_od.od.values import DataType, Number, parse_number

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


def load(data: bytes, file: str, patches: Iterable[str] = (), modules: Sequence[str] | None = None) -> LintedDevice:
    """Read the bytes of an EDS or DCF as a device, with modules plugged into it, and patches over it.

    Nothing raises but patches and modules that do not fit: they raise DictionaryError.
    """
    document = read(data)
    if patches or modules is not None:
        from eurobot_od.od.patches import patched, read_patch, with_settings

        over = [read_patch(each) for each in patches]
        whole, misfits = with_modules(with_settings(document, over), modules)
        if misfits:
            raise DictionaryError(file, None, misfits[0].what)
        document = patched(whole, over)
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
                subs = (key for key in section.entries if key.isdecimal() and len(key) < 4)
                variables = ((DescribedVariable(name.object_index, int(key), head), key) for key in subs)
                found += [(variable, "parametervalue", section.entries[key]) for variable, key in variables]
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
