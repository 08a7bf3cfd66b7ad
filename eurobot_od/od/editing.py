"""Changes to the text of an EDS or DCF; all other bytes stay the same.

A change is a function from the present document to the new one; `edited` writes the lines that differ. Everything that
a patch can say, a change can write into the file (see `patches`).
"""

from __future__ import annotations

import re
from bisect import bisect_right
from codecs import BOM_UTF8
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import TypeAlias

from eurobot_od.errors import DictionaryError, LocalError, look_up
from eurobot_od.od import document as cia306
from eurobot_od.od import formats, values
from eurobot_od.od.description import (
    DescribedDevice,
    DescribedRecords,
    DescribedVariable,
    SectionName,
    list_entries,
    listed,
    parse_section_name,
)
from eurobot_od.od.document import Document, Entry, Section
from eurobot_od.od.objects import numbered
from eurobot_od.od.patches import ObjectPatch, Patch, address_in, patched, read_patch, section_name
from eurobot_od.od.values import DATA_TYPES, DUMMIES, MAPPING_OFFSET, Address, MappingEntry, PdoDirection, label

Change: TypeAlias = Callable[[Document], Document]

PROFILES = {each.stem: each for each in sorted(Path(__file__).with_name("profiles").glob("*.yaml"))}
"""Files with the objects of profiles, as patches, by the profile's number."""

PDO_BITS, PDO_NUMBERS = 64, 512
MAPPED = {"DataType": "UNSIGNED32", "AccessType": "rw", "PDOMapping": "0"}
"""Entries of a new mapping entry."""


def said(target: str, entries: Mapping[str, str]) -> Change:
    """Return the change that sets entries of an object or sub-index; an empty text removes a key.

    `target` is an address or a name; a new object is added. The change raises DictionaryError.
    """
    patch = Patch(target, [ObjectPatch(target, 0, [Entry(key, text, 0, 1) for key, text in entries.items()])])
    return lambda document: patched(document, [patch])


def removed(target: str) -> Change:
    """Return the change that removes an object or sub-index; it raises DictionaryError, LocalError."""

    def change(document: Document) -> Document:
        index, sub = address_in(document, target)
        whole = DescribedDevice(document).objects.get(index)
        gone = section_name(index, sub).lower()
        left = {name: each for name, each in document.sections.items() if not _is_part(name, index, sub)}
        if whole is None or len(left) == len(document.sections):
            has = ", ".join(map(str, sorted({*whole.subs} - {values.STRUCTURE}))) if whole else ""
            known = f"; 0x{index:04X} has the sub-indices {has}" if whole and sub is not None else ""
            raise LocalError(f"{target}: the file does not describe it in a section [{gone}]{known}")
        if sub is not None and whole.section:
            count = len({*whole.subs, 0} - {sub, values.STRUCTURE})
            left[whole.section.name.strip().lower()] = whole.section.saying(SubNumber=str(count))
        return document._replace(sections=left)

    return change


def _is_part(name: str, index: int, sub: int | None) -> bool:
    """Return whether a section, by its lower-case name, belongs to an object, or to a sub-index if given."""
    named = parse_section_name(name)
    return named is not None and named.object_index == index and (sub is None or named.sub == sub)


def mapped(pdo: str, targets: Sequence[str]) -> Change:
    """Return the change that maps objects into a PDO, such as TPDO2, which is added if missing.

    The change raises DictionaryError, LocalError.
    """

    def change(document: Document) -> Document:
        document = patched(document, [Patch(pdo, _new_records(document, pdo))])
        device = DescribedDevice(document)
        records = next(each for each in device.pdos if each.key == pdo.upper())
        carried = {each.address: each for each, _ in records.mapped()}
        entries = [_mapping_entry(device, carried, each) for each in targets]
        bits = sum(each.bits for each in entries)
        if bits > PDO_BITS:
            raise LocalError(f"{pdo}: {bits} bits; a PDO has {PDO_BITS}")
        return patched(document, [Patch(pdo, list(_mapping(records, entries)))])

    return change


PDO_NAME = re.compile(r"(?P<direction>[RT]PDO)(?P<number>[1-9][0-9]{0,2})", re.IGNORECASE)


def _new_records(document: Document, pdo: str) -> list[ObjectPatch]:
    """Return the records of a missing PDO, as CiA 301's profile has them for the first PDO."""
    match = PDO_NAME.fullmatch(pdo)
    number = int(match["number"]) if match else 0
    if not match or number > PDO_NUMBERS:
        raise LocalError(f"{pdo} is not a PDO; write RPDO1 or TPDO1, up to {PDO_NUMBERS}")
    direction = PdoDirection[match["direction"].upper()]
    first = direction.value
    index = direction.value + number - 1
    if index in DescribedDevice(document).objects:
        return []
    found = []
    for each in read_patch(PROFILES["301"]).objects:
        whole, colon, sub = each.target.partition(":")
        if int(whole, 16) in (first, first + MAPPING_OFFSET):
            entries = list(each.entries)
            if int(whole, 16) == first and sub == str(values.COB_ID):
                entries = [
                    e._replace(value=_default_cob_id(direction, number)) if e.key == "DefaultValue" else e
                    for e in entries
                ]
            found.append(ObjectPatch(f"0x{int(whole, 16) + number - 1:04X}{colon}{sub}", 0, entries))
    return found


def _default_cob_id(direction: PdoDirection, number: int) -> str:
    """Return the COB-ID of a new PDO, which is not valid; from the fifth PDO on it has no identifier."""
    bases = values.DEFAULT_PDO_BASES[direction]
    return (
        f"$NODEID+0x{values.NOT_VALID | bases[number - 1]:X}" if number <= len(bases) else f"0x{values.NOT_VALID:08X}"
    )


def _mapping_entry(device: DescribedDevice, carried: Mapping[Address, MappingEntry], target: str) -> MappingEntry:
    """Return the mapping entry of an object or dummy, with its present length or the length of its type."""
    index, sub = numbered(target) or (0, None)
    if index not in DUMMIES:
        index, sub = address_in(device.document, target)
    address = index, sub or 0
    if address in carried:  # may be a part of a text, or a BOOLEAN in a whole byte
        return carried[address]
    variable = device.variable(*address)
    type_ = DATA_TYPES.get(index) if variable is None else variable.type  # a dummy need not be in the file
    if type_ is None or not type_.bits:
        raise LocalError(f"{target}: it has no data type of a fixed length, and so cannot be mapped")
    return MappingEntry(*address, type_.bits)


def _mapping(records: DescribedRecords, entries: Sequence[MappingEntry]) -> Iterator[ObjectPatch]:
    """Yield the patches of a PDO's records: its entries, zeros after them, their number, and whether it is valid."""
    for sub, each in enumerate(entries, start=1):
        variable = records.entry(sub)
        text = f"0x{each.number:08X}"
        if variable is None:
            new = {"ParameterName": f"Application object {sub}", **MAPPED, "DefaultValue": text}
            yield _patch((records.mapping_index, sub), new)
        else:
            yield from _with_value(variable, each.number, text)
    variables = records.mapping.variables() if records.mapping else ()
    for variable in variables:
        if variable.sub == 0:
            yield from _with_value(variable, len(entries), str(len(entries)))
        elif variable.sub > len(entries):
            yield from _with_value(variable, 0, "0x00000000")
    cob_id, setting = records.value(values.COB_ID), records.setting(values.COB_ID)
    if setting and cob_id and cob_id.value & values.BASE_IDENTIFIER:  # without an identifier it cannot be valid
        number = cob_id.value & ~values.NOT_VALID if entries else cob_id.value | values.NOT_VALID
        text = f"{values.NODE_ID}+0x{number:X}" if cob_id.relative else f"0x{number:08X}"
        yield from _with_value(setting, number, text)


def _with_value(variable: DescribedVariable, number: int, text: str) -> Iterator[ObjectPatch]:
    """Yield the patch that sets a variable to a number in its present key, if it differs."""
    if variable.value is None or variable.value.value != number:
        key = "ParameterValue" if variable.section.text("parametervalue") else "DefaultValue"
        yield _patch((variable.index, variable.sub), {key: text})


def _patch(address: Address, entries: Mapping[str, str]) -> ObjectPatch:
    return ObjectPatch(label(address), 0, [Entry(key, text, 0, 1) for key, text in entries.items()])


def profile(name: str) -> Change:
    """Return the change that adds the objects of a profile; present ones are kept. Raises UnknownName."""
    patch = read_patch(look_up("profile", name, PROFILES))

    def change(document: Document) -> Document:
        own = DescribedDevice(document).objects
        new = [each for each in patch.objects if int(each.target.partition(":")[0], 16) not in own]
        return patched(document, [patch._replace(objects=new)])

    return change


# The text


def edited(data: bytes, file: str, changes: Sequence[Change]) -> bytes:
    """Return an EDS or DCF with changes; `file` is its name in errors.

    Raises DictionaryError and LocalError for an impossible change, and for a file without lines.
    """
    before = readable(data, file)
    after = before
    for each in changes:
        after = each(after)
    mark = BOM_UTF8 if data.startswith(BOM_UTF8) else b""
    text = data[len(mark) :].decode(before.encoding)
    if text.encode(before.encoding) != data[len(mark) :]:
        what = f"it is not {before.encoding} throughout; `lint --fix` makes it UTF-8"
        raise DictionaryError(file, None, what)
    return mark + _Lines(text, before).become(_with_lists(before, after)).encode(before.encoding)


def readable(data: bytes, file: str) -> Document:
    """Return the document of an EDS or DCF whose text can be changed; raises DictionaryError for others."""
    if formats.is_xml(data):
        raise DictionaryError(file, None, "a device description in XML; `export eds` makes the EDS that says the same")
    document = cia306.read(data)
    if document.hiding:
        what = f"not a readable EDS: line {document.hiding.line}: {document.hiding.kind.value}"
        raise DictionaryError(file, None, what)
    return document


LINES = re.compile(r"[^\r\n]*(?:\r\n|\r|\n|$)")


class _Lines:
    """The lines of a file with their ends, which are changed from one document to another."""

    def __init__(self, text: str, document: Document) -> None:
        self._before = document
        self._lines: list[str] = LINES.findall(text)
        self._end = next((found[0] for found in re.finditer(r"\r\n|\r|\n", text)), "\n")
        self._headers = [*document.headers, len(self._lines) + 1]
        self._added: dict[int, list[str]] = {}  # new lines by the number of the line that they follow

    def become(self, after: Document) -> str:
        """Return the text of another document."""
        for name, section in after.sections.items():
            if name in self._before.sections and section is not self._before.sections[name]:
                self._change(self._before.sections[name], section)
        for name, section in self._before.sections.items():
            if name not in after.sections:
                self._drop(section)
        new = {name: each for name, each in after.sections.items() if name not in self._before.sections}
        for name in sorted(new, key=_order):
            entries = sorted(new[name].entries.values(), key=_key_order)
            self._add(self._place(name), ["", f"[{new[name].name}]", *(f"{e.key}={e.value}" for e in entries)])
        added = ([line, *self._added.get(number, ())] for number, line in enumerate(self._lines, start=1))
        return "".join([*self._added.get(0, ()), *chain.from_iterable(added)])

    def _change(self, old: Section, new: Section) -> None:
        for key, entry in old.entries.items():
            if key not in new.entries:
                self._lines[entry.line - 1] = ""
            elif new.entries[key].value != entry.value:
                line = self._lines[entry.line - 1]
                start = entry.column - 1 if entry.value else len(line.rstrip("\r\n"))
                end = start + len(entry.value)
                self._lines[entry.line - 1] = line[:start] + new.entries[key].value + line[end:]
        if added := [f"{each.key}={each.value}" for key, each in new.entries.items() if key not in old.entries]:
            self._add(self._last(old), added)

    def _drop(self, section: Section) -> None:
        """Remove the lines of a section, and the empty lines before it."""
        first = section.line
        while first > 1 and not self._lines[first - 2].strip():
            first -= 1
        last = self._last(section)
        self._lines[first - 1 : last] = [""] * (last - first + 1)

    def _add(self, after: int, lines: Sequence[str]) -> None:
        if lines and after and not self._lines[after - 1].endswith(("\r", "\n")):
            self._lines[after - 1] += self._end  # the last line of a file may have no end
        self._added.setdefault(after, []).extend(f"{line}{self._end}" for line in lines)

    def _last(self, section: Section) -> int:
        """Return the number of a section's last line, without trailing empty lines and comments."""
        end = self._headers[bisect_right(self._headers, section.line)]
        said = [each for each in range(section.line, end) if not self._is_aside(each)]
        return max([*said, *(each.line for each in section.entries.values())])

    def _is_aside(self, number: int) -> bool:
        line = self._lines[number - 1].strip()
        return not line or line.startswith((";", "#"))

    def _place(self, name: str) -> int:
        """Return the line after which a new section is inserted: behind the object before it, or 0."""
        sections = {each: section for each, section in self._before.sections.items() if _order(each) < _order(name)}
        ends = [(_order(each), self._last(section)) for each, section in sections.items()]
        return max(ends)[1] if ends else 0


KEY_ORDER = {key.lower(): at for at, key in enumerate(cia306.OBJECT_KEYS)}


def _key_order(entry: Entry) -> int:
    return KEY_ORDER.get(entry.key.lower(), len(KEY_ORDER))


def _order(name: str) -> tuple[int, SectionName]:
    """Return the sort key of a section: objects by index, after all others."""
    named = parse_section_name(name)
    return (1, named) if named else (0, SectionName(0))


PDO_COUNTS = {
    "NrOfRXPDO": frozenset(values.COMMUNICATION_RECORDS[PdoDirection.RPDO]),
    "NrOfTXPDO": frozenset(values.COMMUNICATION_RECORDS[PdoDirection.TPDO]),
}
"""Communication records by the key of their number in [DeviceInfo]."""


def _with_lists(before: Document, after: Document) -> Document:
    """Return a document with updated lists of objects and numbers of PDOs."""
    there, wanted = (DescribedDevice(each).objects.keys() for each in (before, after))
    sections = dict(after.sections)
    for name, indices in listed(sorted(wanted)).items():
        old = sections.get(name.lower())
        present = (
            [number.value for each in old.numbered() if (number := values.parse_number(each.value))] if old else []
        )
        new = [each for each in present if each in wanted or each not in there]
        new += [each for each in indices if each not in there and each not in present]
        if new != present:
            sections[name.lower()] = _list_of(old or Section(name, 0, 1, {}), new)
    info = sections.get("deviceinfo")
    if info:
        counts = {
            key: str(len(wanted & records))
            for key, records in PDO_COUNTS.items()
            if there & records != wanted & records
        }
        sections["deviceinfo"] = info.saying(**counts)
    return after._replace(sections=sections)


def _list_of(section: Section, indices: Sequence[int]) -> Section:
    entries = {key: each for key, each in section.entries.items() if not key.isdecimal()}
    return section._replace(entries=entries).saying(**list_entries(indices))
