"""The device that rules check: values, PDOs, and whether the file is a DCF; `od.description` has its objects.

Nothing here raises or guesses. A missing or malformed value is None or an empty text; a rule that needs it is then
silent, because another rule reports the defect.
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
"""Place of a finding about the whole file."""


class GivenValue(NamedTuple):
    """A limit or value in the file; `number` is None if it is not a valid number.

    `key` is the entry's key in lower case, or `parametervalue` for an entry of an [xxxxValue] section.
    """

    variable: DescribedVariable
    type: DataType
    key: str
    entry: Entry
    number: Number | None

    @property
    def has_node_id(self) -> bool:
        """Whether the text contains `$NODEID`."""
        return values.NODE_ID in self.entry.value.upper()


def load(data: bytes, file: str, patches: Iterable[str] = (), modules: Sequence[str] | None = None) -> LintedDevice:
    """Read an EDS or DCF, connect modules, and apply patches.

    Raises DictionaryError for patches and modules that do not fit, never for the file's content.
    """
    document = read(data)
    if patches or modules is not None:
        from eurobot_od.od.patches import patched, read_patch, with_settings

        over = [read_patch(each) for each in patches]
        whole, misfits = with_modules(with_settings(document, over), modules)
        if misfits:
            raise DictionaryError(file, None, misfits[0].what)
        document = patched(whole, over)
    # Without pathlib, for a fast start; a path may be from Windows.
    return LintedDevice(document, file.replace("\\", "/").rpartition("/")[2])


class LintedDevice(DescribedDevice):
    """The device that a file describes; `name` is the file's name without its folder."""

    def __init__(self, document: Document, name: str) -> None:
        super().__init__(document)
        self.name = name

    def number(self, section: str, key: str) -> Number | None:
        """Return the number of a key of a section (both in lower case), or None."""
        return parse_number(self.document.text(section, key))

    def at(self, section: str, key: str) -> Entry | Section:
        """Return the place of a key of a section (both in lower case), else of the section, else of the file."""
        found = self.section(section)
        return found.at(key) if found else TOP

    def subs(self, index: int) -> Mapping[int, DescribedVariable]:
        """Return an object's variables by sub-index; none if there is no such object."""
        found = self.objects.get(index)
        return found.subs if found else {}

    @cached_property
    def is_dcf(self) -> bool:
        """Whether the file is a DCF."""
        return self.commissioning is not None or self.name.lower().endswith((".dcf", ".xdc"))

    @cached_property
    def modules(self) -> Modules:
        """The modules that the file supports."""
        return Modules(self.document)

    @cached_property
    def connected(self) -> DescribedDevice:
        """The device with the objects of its connected modules."""
        whole, _ = with_modules(self.document)
        return self if whole is self.document else DescribedDevice(whole)

    @cached_property
    def variables(self) -> list[DescribedVariable]:
        """All variables with a section of their own, and the template of each compact object as sub-index 1."""
        objects = self.objects.values()
        templates = [DescribedVariable(o.index, 1, o.section) for o in objects if o.compact and o.section]
        return [each for whole in objects for each in whole.subs.values()] + templates

    @cached_property
    def given(self) -> list[GivenValue]:
        """Limits, defaults and parameter values of all variables with a basic type, also from [xxxxValue]."""
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
        """Limits and values of variables with an integer type."""
        return [each for each in self.given if each.type.is_integer]

    @cached_property
    def others(self) -> list[GivenValue]:
        """Limits and values of variables with another basic type."""
        return [each for each in self.given if not each.type.is_integer]

    @cached_property
    def node_id(self) -> int | None:
        """The DCF's NodeID, or None."""
        number = self.commissioned("nodeid")
        return number.value if number and number.value in values.NODE_IDS else None

    @cached_property
    def node_ids(self) -> tuple[int, ...]:
        """Node-IDs for which values with `$NODEID` are checked; lowest and highest cover those between."""
        return (values.NODE_IDS[0], values.NODE_IDS[-1]) if self.node_id is None else (self.node_id,)

    @cached_property
    def entries(self) -> Mapping[str, list[tuple[Section, Entry]]]:
        """Entries of objects and sub-indices by key in lower case, with their sections."""
        found: dict[str, list[tuple[Section, Entry]]] = defaultdict(list)
        for name, section in self.object_sections:
            if not name.list:
                for key, entry in section.entries.items():
                    found[key].append((section, entry))
        return found
