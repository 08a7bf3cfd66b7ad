"""Modules of a modular device (CiA 306-1, chapter 8): those in a file, and the objects of connected ones.

A bus coupler's EDS describes the coupler and its possible modules. `[M1FixedObjects]` lists objects that exist once if
any module 1 is connected, described by `[M1Fixed6423]`. `[M1SubExtends]` lists arrays to which each module 1 adds
sub-indices, described by `[M1SubExt6000]`: with `Count=2` two sub-indices; with `Count=0;4` 4 bits of a sub-index that
several modules share. A DCF lists the modules by position in `[ConnectedModules]`.

Objects that the file has already are not changed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

from eurobot_od.od import values
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.document import Document, Entry, Remark, Section
from eurobot_od.od.standard import MODULE_LIST
from eurobot_od.od.values import parse_number

CONNECTED = "connectedmodules"
SUPPORTED = "supportedmodules"
MODULE_SECTION = re.compile(
    r"m(?P<module>\d{1,5})(?P<part>moduleinfo|comments|fixedobjects|subextends|fixed|subext)(?P<rest>.*)"
)
"""Pattern of the names of modules' sections, in lower case."""

EXTENSION_KEYS = ("count", "objextend")
"""Keys of an [MxSubExt....] section in addition to those of an object."""

COUNT = re.compile(r"(?:0\s*;\s*(?P<bits>[1-9]\d*)|(?P<subs>0[xX][0-9A-Fa-f]+|\d+))")
"""Pattern of Count: sub-indices of each module, or bits after `0;`."""

HIGHEST = {"ParameterName": "Highest sub-index supported", "DataType": "0x0005", "AccessType": "ro"}
"""Entries of a sub-index 0 that the file does not describe."""

FIXED = re.compile(r"(m[0-9]+fixed[0-9a-f]{4})((?:sub.*)?)")
"""Pattern of the section of a fixed object, and the rest of its name."""


def is_of_modules(name: str) -> bool:
    """Return whether a section, by its lower-case name, describes modules."""
    return name == SUPPORTED or MODULE_SECTION.fullmatch(name) is not None


class Module(NamedTuple):
    """A module in a file: its number, name and order code."""

    number: int
    name: str
    order_code: str

    def __str__(self) -> str:
        return f"{self.number} ({self.name})" if self.name else str(self.number)


class Extension(NamedTuple):
    """The sub-indices (`subs`), or the `bits` of a shared one, that a module adds to an array.

    `last` is the highest sub-index of the array, after which the next object continues; 0 for none.
    """

    section: Section
    subs: int
    bits: int
    last: int


def _position(key: str) -> tuple[int, str]:
    """Return the sort key of a number, which may have thousands of digits."""
    digits = key.lstrip("0")
    return len(digits), digits


class Modules:
    """The modules in a document."""

    def __init__(self, document: Document) -> None:
        self.document = document

    @cached_property
    def supported(self) -> dict[int, Module]:
        """Modules with an [MxModuleInfo], by number."""
        matches = ((MODULE_SECTION.fullmatch(name), section) for name, section in self.document.sections.items())
        infos = [(int(m["module"]), s) for m, s in matches if m and m["part"] == "moduleinfo" and not m["rest"]]
        return {number: Module(number, info.text("productname"), info.text("ordercode")) for number, info in infos}

    @cached_property
    def connected(self) -> list[Entry]:
        """Entries of [ConnectedModules], by position."""
        section = self.document.sections.get(CONNECTED)
        return sorted(section.numbered(), key=lambda each: _position(each.key)) if section else []

    def find(self, text: str) -> Module | None:
        """Return the module with a number, else with a name or an order code, or None."""
        # The number has priority, because it is used in [ConnectedModules] and a name may consist of digits.
        number = parse_number(text)
        if number is not None and number.value in self.supported:
            return self.supported[number.value]
        known = self.supported.values() if text else ()
        return next((each for each in known if text.lower() in (each.name.lower(), each.order_code.lower())), None)

    def listed(self, module: int, part: str) -> list[Entry]:
        """Return the entries of a module's list: `fixedobjects` or `subextends`."""
        section = self.document.sections.get(f"m{module}{part}")
        return list(section.numbered()) if section else []

    def indices(self, module: int, part: str) -> list[int]:
        """Return the indices in a module's list."""
        numbers = (parse_number(entry.value) for entry in self.listed(module, part))
        return [number.value for number in numbers if number and 0 <= number.value <= 0xFFFF]

    @cached_property
    def brought(self) -> frozenset[int]:
        """Indices of the objects that any module adds or extends; of several consecutive ones the first."""
        parts = ("fixedobjects", "subextends")
        return frozenset(each for number in self.supported for part in parts for each in self.indices(number, part))

    @cached_property
    def fixed(self) -> dict[str, list[tuple[str, Section]]]:
        """Sections of fixed objects by module and index, such as `m1fixed2000`, with the rest of their names."""
        found: dict[str, list[tuple[str, Section]]] = {}
        for name, section in self.document.sections.items():
            match = FIXED.fullmatch(name)
            if match:
                found.setdefault(match[1], []).append((match[2], section))
        return found

    def extension(self, module: int, index: int) -> Extension | None:
        """Return a module's extension of the array at an index; None without a valid description."""
        sections = self.document.sections
        head = f"m{module}subext"
        section = sections.get(f"{head}{index:04x}") or sections.get(f"{head}{index:x}")
        if section is None:
            return None
        count = COUNT.fullmatch(section.text("count") or "1")
        subs = parse_number(count["subs"]) if count and count["subs"] else None
        if count is None or (count["subs"] and subs is None):
            return None
        last = parse_number(section.text("objextend"))
        bits = parse_number(count["bits"] or "0")
        return Extension(section, subs.value if subs else 0, bits.value if bits else 0, last.value if last else 0)


def with_modules(document: Document, texts: Sequence[str] | None = None) -> tuple[Document, list[Remark]]:
    """Return a document with the objects of connected modules, and remarks about those that cannot be connected.

    `texts` has the numbers or names of the modules by position; None for those of [ConnectedModules].
    """
    modules = Modules(document)
    if texts is None and not modules.connected:
        return document, []
    line = document.sections[CONNECTED].line if CONNECTED in document.sections else 1
    wanted = modules.connected if texts is None else [Entry("--module", each, line, 1) for each in texts]
    built = _Built(modules, texts is None)
    for entry in wanted:
        module = modules.find(entry.value)
        if module is not None:
            built.connect(module)
        elif entry.value not in ("0", ""):  # an empty slot
            known = ", ".join(map(str, modules.supported.values())) or "none"
            built.misfits.append(Remark(entry.line, f"module {entry.value[:40]} is not supported; supported: {known}"))
    if not built.numbers:
        return document, built.misfits
    return document._replace(sections={**document.sections, **built.sections()}), built.misfits


class _Array:
    """An array that modules extend: its added sub-indices, and the free bits in the last one."""

    def __init__(self, first_free: int, head: Section | None) -> None:
        self.first = first_free
        self.next = first_free
        self.free = 0
        self.head = head
        self.subs: dict[int, Section] = {}

    def add(self, section: Section) -> None:
        self.subs[self.next] = section
        self.next += 1


class _Built:
    """Sections that connected modules add to a document."""

    def __init__(self, modules: Modules, from_file: bool) -> None:
        self._modules = modules
        self._there = modules.document.sections
        self._from_file = from_file
        self._fixed: dict[str, Section] = {}
        self._arrays: dict[int, _Array] = {}
        self._first_with_room: dict[tuple[int, int], int] = {}
        self._described = DescribedDevice(modules.document).objects
        self._fixed_modules: set[int] = set()
        self.numbers: list[int] = []
        self.misfits: list[Remark] = []

    def connect(self, module: Module) -> None:
        """Add the objects of one module."""
        self.numbers.append(module.number)
        if module.number not in self._fixed_modules:
            self._fixed_modules.add(module.number)
            for index in self._modules.indices(module.number, "fixedobjects"):
                self._fix(module.number, index)
        for entry in self._modules.listed(module.number, "subextends"):
            number = parse_number(entry.value)
            extension = self._modules.extension(module.number, number.value) if number else None
            if extension is None or number is None:
                what = f"module {module}: no [M{module.number}SubExt...] with a Count describes {entry.value[:40]}"
                self.misfits.append(Remark(entry.line, what))
            else:
                self._extend(module, number.value, extension)

    def _fix(self, module: int, index: int) -> None:
        """Add an object that exists once for any number of modules."""
        for tail, section in self._modules.fixed.get(f"m{module}fixed{index:04x}", ()):
            own = f"{index:04X}{tail}"
            if own.lower() not in self._there:
                self._fixed.setdefault(own.lower(), section._replace(name=own))

    def _extend(self, module: Module, index: int, extension: Extension) -> None:
        if extension.bits:
            array = self._array_with_room(index, extension)
            # A module shares the sub-index of the previous one if there are free bits (Count=0;bits).
            if array and array.free >= extension.bits:
                array.free -= extension.bits
                return
            type_ = values.DATA_TYPES.get((parse_number(extension.section.text("datatype")) or values.Number(0)).value)
            self._add(module, index, extension, (type_.bits if type_ else 8) - extension.bits)
        # Bounded, because a file may have a Count of billions.
        for _ in range(min(extension.subs, values.MOST_SUBS)):
            self._add(module, index, extension, 0)

    def _add(self, module: Module, index: int, extension: Extension, free: int) -> None:
        """Add one sub-index to the array at an index, or to the next object if it is full."""
        array = self._array_with_room(index, extension)
        if array is None:
            what = f"module {module}: 0x{index:04X} has no room for a further sub-index"
            self.misfits.append(Remark(extension.section.line, what))
        else:
            array.add(extension.section)
            array.free = free

    def _array_with_room(self, index: int, extension: Extension) -> _Array | None:
        """Return the array for the next sub-index: at the index, or at one after it (ObjExtend)."""
        last = extension.last or values.MOST_SUBS
        asked = index
        index = self._first_with_room.get((asked, last), asked)
        while index <= 0xFFFF:
            if index not in self._arrays:
                whole = self._described.get(index)
                subs = [each.sub for each in whole.variables()] if whole else []
                self._arrays[index] = _Array(max(subs, default=0) + 1, whole.section if whole else None)
            array = self._arrays[index]
            if array.next <= last or 0 < extension.bits <= array.free:
                return array
            if not extension.last:
                return None
            index += 1
            if not extension.bits:  # an array without whole free sub-indices stays full
                self._first_with_room[asked, last] = index
        return None

    def sections(self) -> dict[str, Section]:
        """Return all new or changed sections."""
        # A DCF with values for these sub-indices has the sections already.
        extended = ((index, array) for index, array in self._arrays.items() if array.subs)
        arrays = [(index, each) for index, each in extended if not (self._from_file and each.first > len(each.subs))]
        made = (each for index, array in arrays for each in self._array_sections(index, array))
        return {**self._fixed, **{each.name.lower(): each for each in (*made, *self._module_list())}}

    def _module_list(self) -> Iterator[Section]:
        """Yield the entries of 0x1027, the modules' numbers, that the file describes (CiA 301)."""
        for sub, number in enumerate([len(self.numbers), *self.numbers]):
            section = self._there.get(f"{MODULE_LIST:x}sub{sub:x}")
            if section is not None:
                yield section.saying(DefaultValue=str(number))

    def _array_sections(self, index: int, array: _Array) -> Iterator[Section]:
        first = next(iter(array.subs.values()))
        highest = array.next - 1
        title = first.text("parametername")
        if array.head is None:
            head = first._replace(name=f"{index:04X}", entries={})
            yield head.saying(ParameterName=title, ObjectType="0x8", SubNumber=str(highest + 1))
        elif not array.head.text("compactsubobj"):
            yield array.head.saying(SubNumber=str(len(array.subs) + array.first))
        zero = self._there.get(f"{index:04x}sub0")
        if zero is None:
            zero = first._replace(name=f"{index:04X}sub0", entries={}).saying(**HIGHEST, PDOMapping="0")
        yield zero.saying(DefaultValue=str(highest))
        for sub, section in array.subs.items():
            entries = {key: each for key, each in section.entries.items() if key not in EXTENSION_KEYS}
            # Numbered, because CiA 306 has one name for all sub-indices.
            own = section._replace(name=f"{index:04X}sub{sub:X}", entries=entries)
            yield own.saying(ParameterName=f"{title} {sub}")
