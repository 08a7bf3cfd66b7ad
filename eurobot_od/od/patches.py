"""Patches of a device's file: YAML, or a DCF, with entries of objects that replace those of the file.

    0x6065: {DefaultValue: 2000, HighLimit: 5000}       # an object by index, index:sub-index or name
    Motion.Speed: {AccessType: rw, ParameterValue: 10}
    0x2100: {LowLimit: }                                # an empty value removes what the file says
    Motor.Temperature: {unit: degC, factor: 0.1}        # one step of its raw value is 0.1 degC; `offset:` comes on top
    0x2200: {ParameterName: Fan, DataType: UNSIGNED16, AccessType: rw}      # a new object
    0x2201: {ParameterName: Lamps, ObjectType: RECORD}                      # a new one with sub-indices
    0x2201:1: {ParameterName: Left, DataType: BOOLEAN, AccessType: rw}

From a DCF, only the values of its objects, its commissioning and its connected modules are used.

A patch that does not fit is refused with its line, so that no part of it is silently without effect.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from eurobot_od.errors import DictionaryError, LocalError, UnknownName
from eurobot_od.od import document as cia306
from eurobot_od.od import formats, values
from eurobot_od.od.description import COMPOSED, DescribedDevice, DescribedVariable, ObjectCode
from eurobot_od.od.document import Document, Entry, Section, is_text, read_bytes
from eurobot_od.od.formats import completed, plain_number, plain_value
from eurobot_od.od.modules import CONNECTED, HIGHEST
from eurobot_od.od.objects import numbered
from eurobot_od.od.standard import known_type
from eurobot_od.od.values import DATA_TYPES, REAL64, DataType, label, parse_number

CONFIGURATIONS = (".dcf", ".xdc")
"""Suffixes of patches that are DCFs; any other patch is YAML."""

COMMISSIONINGS = {cia306.COMMISSIONING.lower(), "devicecommissioning"}
SETTINGS = (*COMMISSIONINGS, CONNECTED)
"""Sections of a DCF that replace those of the file."""

FILES = ("uploadfile", "downloadfile")
"""Keys for a value in a file beside the DCF."""

NEEDED = ("ParameterName", "DataType", "AccessType")
"""Required keys of a new variable."""


class ObjectPatch(NamedTuple):
    """A patch of one object or variable, `target`: its line, and its entries with their lines."""

    target: str
    line: int
    entries: Sequence[Entry]


class Patch(NamedTuple):
    """A patch from a `file`: patches of `objects`, and `settings`, sections that replace those of the file."""

    file: str
    objects: Sequence[ObjectPatch]
    settings: Mapping[str, Section] = MappingProxyType({})

    def wrong(self, line: int, what: str) -> DictionaryError:
        """Return the error for a line; 0 if the patch does not come from a file."""
        return DictionaryError(f"{self.file}:{line}" if line else self.file, None, what)


def read_patch(file: str | Path) -> Patch:
    """Read a patch; raises DictionaryError with the line of the first error."""
    bus, _, node = str(file).rpartition(NODE_OF_BUS)
    if Path(bus).suffix.lower() in BUS_FILES:
        return _of_bus(bus, node)
    data = read_bytes(file)
    if Path(file).suffix.lower() in CONFIGURATIONS:
        return _of_configuration(data, Path(file))
    return _of_yaml(data.decode("utf-8", "replace"), str(file))


BUS_FILES = (".yaml", ".yml")

NODE_OF_BUS = "#"
"""Separator of a bus file and the name of the node for the patch: `bus.yml#drive`."""


def _of_bus(file: str, name: str) -> Patch:
    from eurobot_od.od.bus_file import load_bus

    _, writes = load_bus(file).writes(name)
    last = {label(each.address): each for each in writes}  # the last write applies
    said = {target: Entry("ParameterValue", str(each.value), each.line, 1) for target, each in last.items()}
    return Patch(file, [ObjectPatch(target, entry.line, [entry]) for target, entry in said.items()])


def _of_yaml(text: str, file: str) -> Patch:
    from eurobot_od.support.yaml_shapes import SCALAR, mapping, read_yaml

    said = read_yaml(text, mapping(mapping(SCALAR, SCALAR), SCALAR), file)
    objects = ((target, [Entry(str(k), str(v), *k.place) for k, v in own.items()]) for target, own in said.items())
    return Patch(file, [ObjectPatch(str(target), target.place.line, entries) for target, entries in objects])


def _of_configuration(data: bytes, file: Path) -> Patch:
    document = completed(formats.read(data))
    if document.hiding:
        raise DictionaryError(f"{file}:{document.hiding.line}", None, document.hiding.kind.value)
    variables = (each for whole in DescribedDevice(document).objects.values() for each in whole.variables())
    said = (ObjectPatch(label((v.index, v.sub)), v.section.line, list(_configured(v, file))) for v in variables)
    objects = [each for each in said if each.entries]
    return Patch(str(file), objects, {name: document.sections[name] for name in SETTINGS if name in document.sections})


def _configured(variable: DescribedVariable, file: Path) -> Iterator[Entry]:
    """Yield the entries of a variable's value in a DCF, with absolute paths of files."""
    for key in ("parametervalue", *FILES):
        entry = variable.section.entries.get(key)
        if entry and entry.value:
            text = str(file.parent.absolute() / entry.value) if key in FILES else entry.value
            # The value of a compact object has its sub-index as key.
            yield entry._replace(key=cia306.SPELLED_OBJECT_KEYS[key], value=text)


# Keys: each reader returns a text in the form of the file, or None if it is invalid


def _object_type(text: str) -> str | None:
    known = {each.name: each for each in (*COMPOSED[1:], ObjectCode.VAR, ObjectCode.DOMAIN)}
    number = parse_number(text)
    code = known.get(text.upper()) or next((each for each in known.values() if number == (each.value, False)), None)
    return f"0x{code.value:X}" if code else None


def _data_type(text: str) -> str | None:
    number = parse_number(text)
    named = {each.name: code for code, each in DATA_TYPES.items()}
    code = named.get(text.upper()) if number is None else number.value
    return f"0x{code:04X}" if code in DATA_TYPES else None


class PatchKey(NamedTuple):
    """Reader of a key's text, and the description of allowed texts."""

    read: Callable[[str], str | None]
    allowed: str


KEYS: Mapping[str, PatchKey] = {
    "parametername": PatchKey(lambda text: text or None, "a name"),
    "denotation": PatchKey(str, "a text"),
    "objecttype": PatchKey(_object_type, "VAR, DOMAIN, ARRAY or RECORD"),
    "datatype": PatchKey(_data_type, "a basic data type, such as UNSIGNED16 or 0x0006"),
    "accesstype": PatchKey(
        lambda text: text.lower() if text.lower() in values.ACCESS_TYPES else None, ", ".join(values.ACCESS_TYPES)
    ),
    "pdomapping": PatchKey(lambda text: text if text in ("0", "1") else None, "0 or 1"),
    "objflags": PatchKey(plain_number, "a number"),
    "unit": PatchKey(str, "a text"),
    **dict.fromkeys(("factor", "offset"), PatchKey(lambda text: plain_value(text, REAL64), "a number")),
    **dict.fromkeys(FILES, PatchKey(lambda text: text or None, "a file")),
}
"""Keys with a format of their own; those of `document.TYPED` depend on the variable's type."""

OF_A_RECORD = ("parametername", "objecttype", "objflags", "denotation")
"""Keys that an object with sub-indices may have itself."""


def with_settings(document: Document, patches: Iterable[Patch]) -> Document:
    """Return a document with the sections of patches in place of its own."""
    sections = dict(document.sections)
    for each in patches:
        if COMMISSIONINGS & each.settings.keys():  # one section in two spellings
            sections = {name: section for name, section in sections.items() if name not in COMMISSIONINGS}
        # Without the lines of the other file, so that no comment of this one is attached to them.
        sections |= {name: section.without_lines() for name, section in each.settings.items()}
    return document._replace(sections=sections)


def patched(document: Document, patches: Iterable[Patch]) -> Document:
    """Return a document with patches of its objects, applied in order.

    Raises DictionaryError with the patch's line for an entry that does not fit.
    """
    for patch in patches:
        document = _Patching(document, patch).document()
    return document


def address_in(document: Document, target: str) -> tuple[int, int | None]:
    """Return index and sub-index of a target, None for a whole object or a VAR; raises as `patched`."""
    return _Patching(document, Patch(target, ())).address(ObjectPatch(target, 0, ()))


def section_name(index: int, sub: int | None) -> str:
    """Return the name of the section of an object or sub-index."""
    return f"{index:04X}" if sub is None else f"{index:04X}sub{sub:X}"


class _Patching:
    """Applies one patch to a document; new objects have line 0, so that they get no comments of the file."""

    def __init__(self, document: Document, patch: Patch) -> None:
        self._base, self._patch = document, patch
        self._objects = DescribedDevice(document).objects
        self._sections = dict(document.sections)
        self._grown: dict[int, int] = {}  # previous highest sub-index, by index

    def document(self) -> Document:
        """Return the patched document."""
        for each in self._patch.objects:
            self._apply(each)
        for index, highest in self._grown.items():
            self._count(index, highest)
        return self._base._replace(sections=self._sections)

    def _apply(self, each: ObjectPatch) -> None:
        index, sub = self.address(each)
        section = self._section(index, sub)
        own: dict[str, Entry] = {}
        for entry in each.entries:
            if own.setdefault(entry.key.lower(), entry) is not entry:
                raise self._patch.wrong(entry.line, f"key {entry.key!r} is given twice")
        if section is None:
            section = self._new(each, index, sub, own)
        elif "objecttype" in own:
            what = f"{each.target} exists already, with an ObjectType: `set` changes it; a new one takes a free index"
            raise self._patch.wrong(own["objecttype"].line, what)
        entries = dict(section.entries)
        replaced: tuple[str, ...] = ()  # with both a value and a file, tools would disagree
        if "parametervalue" in own:
            replaced = FILES
        elif "downloadfile" in own:
            replaced = ("parametervalue",)
        for key in replaced:
            entries.pop(key, None)
        is_record = sub is None and self._is_record(index, own)
        # The type comes first, because values depend on it.
        for key, entry in sorted(own.items(), key=lambda pair: pair[0] in cia306.TYPED):
            if is_record and key not in OF_A_RECORD:
                what = f"{entry.key}: {each.target} has sub-indices, which are named as 0x{index:04X}:1"
                raise self._patch.wrong(entry.line, what)
            text = self._text(entry, DescribedVariable(index, sub or 0, section._replace(entries=entries)))
            spelled = cia306.SPELLED_OBJECT_KEYS.get(key, entry.key)
            line = entries[key].line if key in entries else section.line
            entries[key] = Entry(spelled, text, line, section.column)
            if not text:
                del entries[key]
        name = section_name(index, sub)
        self._sections[name.lower()] = section._replace(name=name, entries=entries)

    # Addresses

    def address(self, each: ObjectPatch) -> tuple[int, int | None]:
        """Return index and sub-index of a patch's target, None for a whole object or a VAR."""
        try:
            found = numbered(each.target)
        except LocalError as error:
            raise self._patch.wrong(each.line, str(error)) from None
        index, sub = found or self._named(each)
        if index < values.FIRST:
            raise self._patch.wrong(each.line, f"index {each.target} is not in 0x{values.FIRST:04X}..0xFFFF")
        whole = self._objects.get(index)
        is_own = sub == 0 and whole and 0 in whole.subs and whole.subs[0].section is whole.section
        return index, None if is_own else sub

    @cached_property
    def _names(self) -> dict[str, list[tuple[int, int | None]]]:
        """Addresses by ParameterName in lower case; `object.sub-index` for sub-indices."""
        found: dict[str, list[tuple[int, int | None]]] = {}
        for index, whole in self._objects.items():
            found.setdefault(whole.name.lower(), []).append((index, None))
            for each in whole.variables():
                if each.section is not whole.section or whole.compact:
                    found.setdefault(f"{whole.name}.{each.name}".lower(), []).append((index, each.sub))
        return found

    def _named(self, each: ObjectPatch) -> tuple[int, int | None]:
        found = self._names.get(each.target.lower(), [])
        if not found:
            raise self._patch.wrong(each.line, str(UnknownName("object", each.target, self._names)))
        if len(found) > 1:
            several = ", ".join(label((index, sub or 0)) for index, sub in found)
            raise self._patch.wrong(each.line, f"{each.target!r} may be {several}; write which")
        return found[0]

    def _section(self, index: int, sub: int | None) -> Section | None:
        """Return the section of an object or variable, also of a compact object."""
        section = self._sections.get(section_name(index, sub).lower())
        if section or sub is None or index not in self._objects:
            return section
        variable = self._objects[index].variable(sub)
        return variable.section if variable else None

    def _is_record(self, index: int, own: Mapping[str, Entry]) -> bool:
        whole = self._objects.get(index)
        if whole:
            return not (0 in whole.subs and whole.subs[0].section is whole.section)
        text = _object_type(own["objecttype"].value) if "objecttype" in own else None
        number = parse_number(text) if text else None
        return number is not None and number.value in {each.value for each in COMPOSED}

    def _new(self, each: ObjectPatch, index: int, sub: int | None, own: Mapping[str, Entry]) -> Section:
        """Return the empty section of a new object or sub-index."""
        needed = NEEDED[:1] if sub is None and self._is_record(index, own) else NEEDED
        missing = [key for key in needed if key.lower() not in own]
        if missing:
            what = f"the file has no {each.target}, and a new one needs {' and '.join(missing)}"
            raise self._patch.wrong(each.line, what)
        if sub is not None:
            self._grow(each, index)
        elif needed is not NEEDED:
            self._grown[index] = 0
        return Section(section_name(index, sub), 0, 1, {})

    def _grow(self, each: ObjectPatch, index: int) -> None:
        """Note the highest sub-index of an object before one is added."""
        whole = self._objects.get(index)
        if whole is None and index not in self._grown:
            raise self._patch.wrong(each.line, f"there is no 0x{index:04X}: name it above, with `ObjectType: RECORD`")
        if whole and not self._is_record(index, {}):
            raise self._patch.wrong(each.line, f"0x{index:04X} is a variable: it has no sub-indices")
        if whole:
            self._grown.setdefault(index, _highest(each.sub for each in whole.variables()))

    # Entries

    def _text(self, entry: Entry, variable: DescribedVariable) -> str:
        """Return an entry's text in the form that every tool reads; empty for a removed entry."""
        name, text = entry.key, entry.value
        key = name.lower()
        if not is_text(text, self._base.text_encoding):
            raise self._patch.wrong(entry.line, f"{name}: a line of an EDS cannot hold {text!r}")
        if key in cia306.TYPED:
            type_ = variable.type or known_type(variable.index, variable.sub)
            plain = _value(text, type_) if type_ and text else text
            allowed = type_.allowed if type_ else ""
        elif key in KEYS:
            plain = KEYS[key].read(text)
            allowed = KEYS[key].allowed
        else:
            known = (cia306.SPELLED_OBJECT_KEYS.get(each, each.capitalize()) for each in (*KEYS, *cia306.TYPED))
            raise self._patch.wrong(entry.line, str(UnknownName("key", name, known)))
        if plain is None:
            raise self._patch.wrong(entry.line, f"{name} {text!r}: expected {allowed}")
        return plain

    def _count(self, index: int, before: int) -> None:
        """Update an object's number of sub-indices."""
        described = DescribedDevice(Document({k: v for k, v in self._sections.items() if k[:4] == f"{index:04x}"}))
        whole = described.objects[index]
        subs = [each.sub for each in whole.variables()]
        if whole.section is None:
            return
        zero = whole.variable(0)
        highest = str(_highest(subs))
        if zero is None:
            self._set(whole.section._replace(name=section_name(index, 0), entries={}), DefaultValue=highest, **HIGHEST)
        elif zero.value == (before, False):
            # Not for a mapping record, whose sub-index 0 is the number of mapped objects.
            self._set(zero.section._replace(name=section_name(index, 0)), DefaultValue=highest)
        count = len({*subs, 0} - {values.STRUCTURE})
        if not whole.compact:
            self._set(whole.section, SubNumber=str(count))

    def _set(self, section: Section, **entries: str) -> None:
        self._sections[section.name.strip().lower()] = section.saying(**entries)


def _highest(subs: Iterable[int]) -> int:
    return max((each for each in subs if each != values.STRUCTURE), default=0)


def _value(text: str, type_: DataType) -> str | None:
    """Return a value or limit in the form that every tool reads; None if it does not fit the type."""
    plain = plain_value(text, type_)
    number = parse_number(text) if type_.is_integer else None
    if number is None or number.relative:
        return plain
    # Only hexadecimal digits are bits: a decimal 40000 in an INTEGER16 is too large.
    value = type_.meant(number.value) if "0x" in text.lower() else number.value
    return plain if type_.low <= value <= type_.high else None
