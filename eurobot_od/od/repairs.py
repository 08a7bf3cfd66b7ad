"""What a file writes otherwise than CiA 306 asks for, and the file as it was meant: for tools that read less.

Our own reading (`document`, `completion`, `outline`) takes such a file as it is; here is the list of what it had to
look over, and the text in which nothing of that is left. Both are read as the same objects with the same values.

Rule of this file: no value is guessed. A repair writes down what the file says already, or is left undone; what is
given twice becomes a comment, so that nothing is lost.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple, TypeAlias

from eurobot_od.errors import DictionaryError
from eurobot_od.od import values
from eurobot_od.od.completion import USUAL_NAME, looks_odd, usual_name
from eurobot_od.od.description import COMMISSIONING, COMPOSED, SIMPLE, DescribedDevice, DescribedObject, ObjectCode
from eurobot_od.od.document import HIDING, Document, Entry, Odd, Oddity, Section, parse, read
from eurobot_od.od.keys import IDENTITY, OBJECT_KEYS, OBJECT_LISTS, SECTION_KEYS
from eurobot_od.od.standard import known_type
from eurobot_od.od.values import DataType, Number, is_standard_number, parse_number

ROUNDS = 5
"""So often a repair may show another thing to repair, such as an entry that stood in a section given twice."""


class Repair(NamedTuple):
    """One change: the line it is about, what is done, and the lines that come in place of that line."""

    line: int
    what: str
    lines: tuple[str, ...]


class Repaired(NamedTuple):
    """A file as it was meant: its bytes, and what was changed, by the lines of the file as it was."""

    data: bytes
    repairs: tuple[Repair, ...]


def repaired(data: bytes, file: str) -> Repaired:
    """Repair the bytes of an EDS or DCF; raises DictionaryError for what is no EDS, or hides objects."""
    document = read(data)
    hiding = next((each for each in document.oddities if each.kind in HIDING), None)
    if hiding:
        raise DictionaryError(file, None, f"cannot be repaired: line {hiding.line}: {hiding.kind.value}")
    marks = [Repair(each.line, MARKS[each.kind], ()) for each in document.oddities if each.kind in MARKS]
    text, done = _text(document)
    encoding = "latin-1" if document.encoding == "latin-1" else "utf-8"
    ends = "\r\n" if b"\r\n" in data else "\n"
    return Repaired(ends.join(text).encode(encoding), tuple(sorted([*marks, *done])))


def repairs(document: Document) -> tuple[Repair, ...]:
    """Return what was to be looked over in a file."""
    marks = [Repair(each.line, MARKS[each.kind], ()) for each in document.oddities if each.kind in MARKS]
    return tuple(sorted([*marks, *_text(document)[1]]))


MARKS = {
    Odd.WIDE: "UTF-16 written as UTF-8",
    Odd.BYTE_ORDER_MARK: "byte order mark taken off",
    Odd.LINE_ENDS: "line ends made alike",
}
"""What is repaired by writing the file anew."""


def _text(document: Document) -> tuple[list[str], list[Repair]]:
    """Return the repaired lines, and the repairs by the lines as they were."""
    lines, numbers = list(document.lines), list(range(1, len(document.lines) + 1))
    done: list[Repair] = []
    for _ in range(ROUNDS):
        changes = {each.line: each for each in _changes(DescribedDevice(parse("\n".join(lines))))}  # one a line
        if not changes:
            break
        done += (each._replace(line=numbers[line - 1]) for line, each in changes.items())
        parts = [changes[n].lines if n in changes else (line,) for n, line in enumerate(lines, start=1)]
        numbers = [number for number, part in zip(numbers, parts) for _ in part]
        lines = [line for part in parts for line in part]
    return lines, done


def _changes(device: DescribedDevice) -> Iterator[Repair]:
    for find in REPAIRS:
        yield from find(device)


def _line(device: DescribedDevice, at: Entry | Section | Oddity) -> str:
    return device.document.lines[at.line - 1]


# How it is written


def _written(device: DescribedDevice) -> Iterator[Repair]:
    """Comments, indents, what is given twice."""
    for each in device.document.oddities:
        line = _line(device, each)
        if each.kind is Odd.COMMENT_AFTER_VALUE:
            value, comment = line[: each.column - 1].rstrip(), line[each.column - 1 :]
            yield Repair(each.line, "comment put on a line of its own", (comment, value))
        elif each.kind is Odd.HASH:
            yield Repair(each.line, "comment with ; instead of #", (f";{line.lstrip()[1:]}",))
        elif each.kind is Odd.INDENTED:
            yield Repair(each.line, "indent taken off", (line.lstrip(),))
        elif each.kind is Odd.TWO_ENTRIES:
            yield Repair(each.line, f"key {each.text}: the second made a comment", (f";{line}",))


def _sections_twice(device: DescribedDevice) -> Iterator[Repair]:
    headers = [*device.document.headers, len(device.document.lines) + 1]
    for each in device.document.oddities:
        if each.kind is Odd.TWO_SECTIONS:
            end = next(header for header in headers if header > each.line)
            for number in range(each.line, end):
                line = device.document.lines[number - 1]
                if line.strip():
                    yield Repair(number, f"section {each.text}: the second made a comment", (f";{line}",))


def renamed(device: DescribedDevice) -> Iterator[Repair]:
    """Sections and keys in the spelling of CiA 306."""
    for name, section in device.document.sections.items():
        usual = SECTION_NAMES.get(name) or _object_name(name, section.name)
        if usual is not None and usual != section.name:
            yield Repair(section.line, f"section [{section.name}] named [{usual}]", (f"[{usual}]",))
        spelled = KEYS.get(name, OBJECTS if usual else {})
        for key, entry in section.entries.items():
            if entry.key != spelled.get(key, entry.key):
                yield _set(entry, spelled[key], entry.value, f"key {entry.key} spelled {spelled[key]}")


def _object_name(name: str, written: str) -> str | None:
    if USUAL_NAME.fullmatch(name):
        return written.strip().replace("SUB", "sub")
    usual = usual_name(name) if looks_odd(name) else None
    return usual and usual.upper().replace("SUB", "sub")


def _set(entry: Entry, key: str, value: str, what: str) -> Repair:
    return Repair(entry.line, what, (f"{key}={value}",))


SECTION_NAMES = {
    each.lower(): each for each in (*SECTION_KEYS, "Comments", *OBJECT_LISTS)
} | {"devicecommissioning": COMMISSIONING}  # fmt: skip
OBJECTS = {each.lower(): each for each in OBJECT_KEYS}
KEYS: Mapping[str, Mapping[str, str]] = {
    **{name.lower(): {each.lower(): each for each in keys} for name, keys in SECTION_KEYS.items()},
    "comments": {"lines": "Lines", **{f"line{number}": f"Line{number}" for number in range(1, 1000)}},
    **{name.lower(): {"supportedobjects": "SupportedObjects"} for name in OBJECT_LISTS},
}

# Values

NUMBERS = ("objecttype", "datatype", "subnumber", "pdomapping", "objflags", "compactsubobj")
VALUES = ("lowlimit", "highlimit", "defaultvalue", "parametervalue")
INFO_NUMBERS = tuple(each.lower() for each in (*IDENTITY, "NrOfRXPDO", "NrOfTXPDO", "Granularity", "CompactPDO"))


def _numbers(device: DescribedDevice) -> Iterator[Repair]:
    """Numbers in the spelling of CiA 306; an empty one is none."""
    for entry in _numeric_entries(device):
        number = parse_number(entry.value)
        if not entry.value:
            yield Repair(entry.line, f"{entry.key} without a value left out", ())
        elif number and not is_standard_number(entry.value):
            value = standard_number(number, entry.value)
            yield _set(entry, entry.key, value, f"{entry.key} {entry.value[:40]} written {value}")


def _numeric_entries(device: DescribedDevice) -> Iterator[Entry]:
    info = device.section("deviceinfo")
    sections: list[tuple[Section, tuple[str, ...]]] = [(info, INFO_NUMBERS)] if info else []
    for name, section in device.object_sections:
        if not name.list:
            type_ = parse_number(section.text("datatype"))
            is_integer = type_ and type_.value in values.DATA_TYPES and values.DATA_TYPES[type_.value].is_integer
            sections.append((section, NUMBERS + VALUES if is_integer else NUMBERS))
    return (section.entries[key] for section, keys in sections for key in keys if key in section.entries)


def standard_number(number: Number, like: str) -> str:
    """Write a number as CiA 306 does, in hexadecimal if it was."""
    sign, size = "-" * (number.value < 0), abs(number.value)
    is_hexadecimal = "0X" in like.upper() or like.upper().endswith("H")
    text = f"{sign}0x{size:X}" if is_hexadecimal else f"{sign}{size}"
    if not number.relative:
        return text
    return f"{values.NODE_ID}+{text}" if number.value else values.NODE_ID


# What is missing


def _kinds(device: DescribedDevice) -> Iterator[Repair]:
    """ObjectType and SubNumber, as the sub-indices say them; DataType, where the standard or the array says it."""
    for whole in device.objects.values():
        section = whole.section
        if section is None or whole.compact:
            continue
        real = sum(sub != 0xFF for sub, each in whole.subs.items() if each.section is not section)
        if real and not section.text("objecttype") and not section.text("datatype"):
            yield _added(device, section, "ObjectType", f"0x{ObjectCode.RECORD.value:X}")
        elif real and whole.code in COMPOSED and parse_number(section.text("subnumber")) != Number(real):
            yield _added(device, section, "SubNumber", str(real))
        for sub, variable in whole.subs.items():
            type_ = None if variable.section.text("datatype") else _type_of(whole, sub)
            if type_ and variable.access:
                yield _added(device, variable.section, "DataType", f"0x{type_.code:04X}")


def _type_of(whole: DescribedObject, sub: int) -> DataType | None:
    if sub == 0 and whole.code not in SIMPLE:
        return values.UNSIGNED8
    first = whole.subs.get(1) if whole.code is ObjectCode.ARRAY else None
    return known_type(whole.index, sub) or (first.type if first else None)


def _added(device: DescribedDevice, section: Section, key: str, value: str) -> Repair:
    """Give a key its value: in its line, or in a new one below the section's header."""
    entry = section.entries.get(key.lower())
    if entry:
        return _set(entry, key, value, f"{key} {entry.value[:40] or 'without a value'} written {value}")
    return Repair(section.line, f"[{section.name}]: {key}={value} added", (_line(device, section), f"{key}={value}"))


def _information(device: DescribedDevice) -> Iterator[Repair]:
    """[FileInfo], all dummies, the number of comment lines."""
    document = device.document
    if "fileinfo" not in document.sections and document.lines:
        yield Repair(1, "[FileInfo] added", ("[FileInfo]", "", document.lines[0]))
    dummies, comments = device.section("dummyusage"), device.section("comments")
    missing = [f"Dummy{code:04X}" for code in values.DUMMIES]
    missing = [each for each in missing if dummies and each.lower() not in dummies.entries]
    if dummies and missing:
        lines = (_line(device, dummies), *(f"{each}=0" for each in missing))
        yield Repair(dummies.line, f"[{dummies.name}]: {', '.join(missing)} added as 0", lines)
    if comments:
        yield from _counted(device, comments, "Lines", len(comments.entries.keys() - {"lines"}))


def _counted(device: DescribedDevice, section: Section, key: str, real: int) -> Iterator[Repair]:
    said = parse_number(section.text(key.lower()))
    if said is None or said.value != real:
        yield _added(device, section, key, str(real))


def _lists(device: DescribedDevice) -> Iterator[Repair]:
    """The lists of objects: their counts, and all three where there is none."""
    sections = [each for name in OBJECT_LISTS if (each := device.section(name.lower()))]
    for section in sections:
        yield from _counted(device, section, "SupportedObjects", sum(key.isdecimal() for key in section.entries))
    if not sections and device.objects:
        first = min(each.place.line for each in device.objects.values())
        indices = sorted(index for index in device.objects if index >= MANDATORY[0])
        lines = [line for name in OBJECT_LISTS for line in _list(name, (i for i in indices if _list_of(i) == name))]
        yield Repair(first, "lists of objects added", (*lines, device.document.lines[first - 1]))


MANDATORY = (0x1000, 0x1001, 0x1018)


def _list_of(index: int) -> str:
    return OBJECT_LISTS[0 if index in MANDATORY else 2 if index in values.MANUFACTURER else 1]


def _list(name: str, indices: Iterable[int]) -> list[str]:
    entries = [f"{number}=0x{index:04X}" for number, index in enumerate(indices, start=1)]
    return [f"[{name}]", f"SupportedObjects={len(entries)}", *entries, ""]


Find: TypeAlias = Callable[[DescribedDevice], Iterator[Repair]]

REPAIRS: tuple[Find, ...] = (_lists, _information, _numbers, _kinds, renamed, _written, _sections_twice)
"""What is looked for; where several concern one line, the last is done first, and the others in the next round."""
