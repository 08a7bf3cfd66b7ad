"""Modules of a modular device (CiA 306-1, chapter 8): which a file supports, and the objects that connected ones bring.

A bus coupler's EDS describes itself and the modules that may be plugged into it. `[M1FixedObjects]` lists the objects
that a device has once as soon as module 1 is there, described by `[M1Fixed6423]`; `[M1SubExtends]` the arrays to which
each module 1 adds sub-indices, described by `[M1SubExt6000]`. `Count=2` there means two sub-indices of a module;
`Count=0;4` means 4 bits, of which as many modules as fit share a sub-index. A DCF says in `[ConnectedModules]` what is
plugged in, by position.

The file itself is not changed, and an object that the file has already is left as it is.
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
"""Names of modules' sections, in lower case."""

EXTENSION_KEYS = ("count", "objextend")
"""Keys of a [MxSubExt....] beside those of an object."""

COUNT = re.compile(r"(?:0\s*;\s*(?P<bits>[1-9]\d*)|(?P<subs>0[xX][0-9A-Fa-f]+|\d+))")
"""Count: sub-indices of each module, or bits of it after `0;`."""

HIGHEST = {"ParameterName": "Highest sub-index supported", "DataType": "0x0005", "AccessType": "ro"}
"""What is said of a sub-index 0 that the file does not describe."""

FIXED = re.compile(r"(m[0-9]+fixed[0-9a-f]{4})((?:sub.*)?)")
"""A section of a fixed object, and the rest of its name."""


def is_of_modules(name: str) -> bool:
    """Return whether the section of a name, in lower case, describes modules that may be connected."""
    return name == SUPPORTED or MODULE_SECTION.fullmatch(name) is not None


class Module(NamedTuple):
    """A module that a file describes: its number, and what it is called."""

    number: int
    name: str
    order_code: str

    def __str__(self) -> str:
        return f"{self.number} ({self.name})" if self.name else str(self.number)


class Extension(NamedTuple):
    """What a module adds to an array: `subs` sub-indices, or `bits` of a shared one, as `section` describes them.

    `last` is the highest sub-index, after which the next object goes on; 0 for none.
    """

    section: Section
    subs: int
    bits: int
    last: int


def _position(key: str) -> tuple[int, str]:
    """Return what sorts numbers, however long: a file may have thousands of digits."""
    digits = key.lstrip("0")
    return len(digits), digits


class Modules:
    """The modules that a document describes, by number."""

    def __init__(self, document: Document) -> None:
        self.document = document

    @cached_property
    def supported(self) -> dict[int, Module]:
        """The modules with a [MxModuleInfo], by number."""
        matches = ((MODULE_SECTION.fullmatch(name), section) for name, section in self.document.sections.items())
        infos = [(int(m["module"]), s) for m, s in matches if m and m["part"] == "moduleinfo" and not m["rest"]]
        return {number: Module(number, info.text("productname"), info.text("ordercode")) for number, info in infos}

    @cached_property
    def connected(self) -> list[Entry]:
        """The entries of [ConnectedModules] in their positions."""
        section = self.document.sections.get(CONNECTED)
        return sorted(section.numbered(), key=lambda each: _position(each.key)) if section else []

    def find(self, text: str) -> Module | None:
        """Return the module with a number, or else with a name or an order code; None without."""
        # The number first: [ConnectedModules] has nothing else, and a module may be called by digits.
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
        """The indices of the objects that any module brings or extends; of those that overflow the first."""
        parts = ("fixedobjects", "subextends")
        return frozenset(each for number in self.supported for part in parts for each in self.indices(number, part))

    @cached_property
    def fixed(self) -> dict[str, list[tuple[str, Section]]]:
        """The sections of fixed objects by module and index, such as `m1fixed2000`, with the rest of their names."""
        found: dict[str, list[tuple[str, Section]]] = {}
        for name, section in self.document.sections.items():
            match = FIXED.fullmatch(name)
            if match:
                found.setdefault(match[1], []).append((match[2], section))
        return found

    def extension(self, module: int, index: int) -> Extension | None:
        """Return what a module adds to the array at an index; None if no section describes it, or no Count fits."""
        sections, head = self.document.sections, f"m{module}subext"
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
    """Return a document with the objects of the connected modules, and what could not be connected.

    `texts` are numbers or names of the modules in their positions; None for those of [ConnectedModules].
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
    """An array that modules extend: its sub-indices from the modules, and the bits that are free in the last one."""

    def __init__(self, first_free: int, head: Section | None) -> None:
        self.first, self.next, self.free, self.head = first_free, first_free, 0, head
        self.subs: dict[int, Section] = {}

    def add(self, section: Section) -> None:
        self.subs[self.next] = section
        self.next += 1


class _Built:
    """The sections that connected modules add to a document."""

    def __init__(self, modules: Modules, from_file: bool) -> None:
        self._modules, self._there, self._from_file = modules, modules.document.sections, from_file
        self._fixed: dict[str, Section] = {}
        self._arrays: dict[int, _Array] = {}
        self._first_with_room: dict[tuple[int, int], int] = {}
        self._described = DescribedDevice(modules.document).objects
        self._fixed_modules: set[int] = set()
        self.numbers: list[int] = []
        self.misfits: list[Remark] = []

    def connect(self, module: Module) -> None:
        """Add the objects of one more module."""
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
        """Add an object that is there once, whatever the number of modules."""
        for tail, section in self._modules.fixed.get(f"m{module}fixed{index:04x}", ()):
            own = f"{index:04X}{tail}"
            if own.lower() not in self._there:
                self._fixed.setdefault(own.lower(), section._replace(name=own))

    def _extend(self, module: Module, index: int, extension: Extension) -> None:
        if extension.bits:
            array = self._array_with_room(index, extension)
            # A module shares the sub-index of the one before as long as there are bits left (Count=0;bits).
            if array and array.free >= extension.bits:
                array.free -= extension.bits
                return
            type_ = values.DATA_TYPES.get((parse_number(extension.section.text("datatype")) or values.Number(0)).value)
            self._add(module, index, extension, (type_.bits if type_ else 8) - extension.bits)
        # No array takes more; a Count of billions must not keep a reader busy.
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
        """Return the array that takes the next sub-index: that at the index, or the one after it (ObjExtend)."""
        last, asked = extension.last or values.MOST_SUBS, index
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
            if not extension.bits:  # whole sub-indices never come free again: the full ones are passed once
                self._first_with_room[asked, last] = index
        return None

    def sections(self) -> dict[str, Section]:
        """Return all sections that are new, or have other values than in the file."""
        # A DCF that gives those sub-indices values has written out what its modules add: they are there already.
        extended = ((index, array) for index, array in self._arrays.items() if array.subs)
        arrays = [(index, each) for index, each in extended if not (self._from_file and each.first > len(each.subs))]
        made = (each for index, array in arrays for each in self._array_sections(index, array))
        return {**self._fixed, **{each.name.lower(): each for each in (*made, *self._module_list())}}

    def _module_list(self) -> Iterator[Section]:
        """Yield the values of 0x1027, the modules' numbers, as far as the file describes it (CiA 301)."""
        for sub, number in enumerate([len(self.numbers), *self.numbers]):
            section = self._there.get(f"{MODULE_LIST:x}sub{sub:x}")
            if section is not None:
                yield section.saying(DefaultValue=str(number))

    def _array_sections(self, index: int, array: _Array) -> Iterator[Section]:
        first = next(iter(array.subs.values()))
        highest, title = array.next - 1, first.text("parametername")
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
            # CiA 306 has one name for all of them, by which none could be found.
            own = section._replace(name=f"{index:04X}sub{sub:X}", entries=entries)
            yield own.saying(ParameterName=f"{title} {sub}")
