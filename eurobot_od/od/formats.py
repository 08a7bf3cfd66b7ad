"""Reads a device's file in any format: EDS and DCF (CiA 306), or XML (`xdd`, `objdictgen`).

`completed` renames unusual sections and expands compact PDOs; it adds nothing that the file does not say. Reading never
raises; malformed XML becomes an `Oddity`.
"""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from eurobot_od.errors import DictionaryError
from eurobot_od.od import document as cia306
from eurobot_od.od import values
from eurobot_od.od.description import parse_section_name
from eurobot_od.od.document import WIDE_MARKS, Document, HasPlace, Odd, Oddity, Remark, Section, section_at
from eurobot_od.od.standard import PDO_SETTINGS, known_type
from eurobot_od.od.values import NODE_ID, REMEMBERED_NUMBERS, DataType, Number, PdoDirection, parse_number
from eurobot_od.support.files import UNREADABLE, why_unreadable

SUFFIXES = (".xpd", ".xdd", ".eds", ".xdc", ".dcf")
"""Suffixes of device files; of several with the same stem, the one with the last suffix is used: a DCF, not its EDS."""


def files_in(folder: str | Path) -> list[Path]:
    """Return a folder's device files, in the order of SUFFIXES and by name; raises DictionaryError if there is none."""
    files = [each for suffix in SUFFIXES for each in sorted(Path(folder).iterdir()) if each.suffix.lower() == suffix]
    if not files:
        raise DictionaryError(folder, None, "no EDS, DCF, XDD or XDC in this folder")
    return files


def read(data: bytes) -> Document:
    """Parse a file; nothing raises, irregularities are in the document."""
    return _read_xml(data) if is_xml(data) else cia306.read(data)


def _read_xml(data: bytes) -> Document:
    from eurobot_od.od import objdictgen, xdd  # most files are not XML
    from eurobot_od.od.xml_tree import XmlError, read_xml

    try:
        root = read_xml(data, objdictgen.ROOT)
        return objdictgen.read(root) if root.tag == objdictgen.ROOT else xdd.read(root)
    except XmlError as error:
        odd = Oddity(Odd.XML, error.line, error.column, error.what)
    except UNREADABLE as error:
        odd = Oddity(Odd.XML, 1, 1, why_unreadable(error))
    return Document({}, [odd], is_xml=True)


def is_xml(data: bytes) -> bool:
    """Return whether a file begins like XML."""
    is_wide = data.startswith(WIDE_MARKS)
    start = data[:200].decode("utf-16", "replace") if is_wide else data[:200].removeprefix(BOM_UTF8).decode("latin-1")
    return start.lstrip().startswith("<")


# Usual names

COUNTS = {PdoDirection.RPDO: "nrofrxpdo", PdoDirection.TPDO: "nroftxpdo"}


FOREIGN = (
    (re.compile(rb"<EtherCATInfo\b"), "EtherCAT (ESI)"),
    (re.compile(rb"ethernet-powerlink\.org|_Powerlink\b"), "POWERLINK"),
    (re.compile(rb"^\s*\[Device\][^[]*^\s*VendCode\s*=", re.MULTILINE | re.IGNORECASE), "EtherNet/IP"),
)
"""Patterns of files of other networks with the same suffixes."""


def foreign_network(data: bytes) -> str:
    """Return a sentence about a description for another network; empty if it may be CANopen's."""
    other = next((name for mark, name in FOREIGN if mark.search(data)), "")
    return other and f"a device description of {other}, not of CANopen"


def no_objects(data: bytes) -> str:
    """Return what a file without CANopen objects is."""
    return foreign_network(data) or "not an EDS: it describes no object"


def completed(document: Document) -> Document:
    """Return a document with all its objects under the names of CiA 306."""
    renamed = {name: usual_name(name) for name in document.sections if not name.isalnum() or looks_odd(name)}
    decimal = decimal_subs(document)
    sections = {
        decimal.get(name, name).lower(): each._replace(name=decimal[name]) if name in decimal else each
        for name, each in document.sections.items()
    }
    for name, usual in renamed.items():
        # The odd section stays for lint, and a section with the usual name has priority.
        if usual is not None and usual not in sections:
            sections[usual] = sections[name]._replace(name=usual)
    whole = document._replace(sections=sections)
    return whole._replace(sections={**sections, **{each.name.lower(): each for each in _compact_pdos(whole)}})


DECIMAL_SUB = re.compile(r"([0-9a-f]{4})sub([0-9]{1,3})")


def decimal_subs(document: Document) -> dict[str, str]:
    """Return the hexadecimal names of sub-indices that a file counts in decimal, by lower-case name.

    A file counts in decimal if `sub9` is followed by `sub10`, no sub-index has a letter, and sub-index 0 is the highest
    as a decimal number. Otherwise the numbers stay hexadecimal.
    """
    found: dict[str, str] = {}
    parts: dict[str, list[str]] = {}
    for name in document.sections:
        if name[4:7] == "sub":
            parts.setdefault(name[:4], []).append(name)
    for head, subs in parts.items():
        if f"{head}sub10" not in subs:
            continue
        numbers = {int(match[2]): each for each in subs if (match := DECIMAL_SUB.fullmatch(each))}
        zero = document.sections.get(f"{head}sub0")
        highest = parse_number(zero.text("parametervalue") or zero.text("defaultvalue")) if zero else None
        is_decimal = sorted(numbers) == list(range(len(subs))) and highest == Number(len(subs) - 1)
        if is_decimal and len(subs) <= values.MOST_SUBS + 1:
            found |= {each: f"{head.upper()}sub{number:X}" for number, each in numbers.items() if number > 9}
    return found


def looks_odd(name: str) -> bool:
    """Return whether a lower-case section name may be that of an object in an unusual form."""
    return name[:1].isdigit() and parse_section_name(name) is None


def usual_name(name: str) -> str | None:
    """Return the name in CiA 306 for a section such as `0x1018`, `01018`, `1018 sub1` or `1018sub01`, or None."""
    # CiA 306 has four digits of the index and no leading zero of the sub-index; editors differ.
    head, sub, tail = "".join(name.lower().split()).removeprefix("0x").partition("sub")
    usual = head.lstrip("0").zfill(4) + sub + (tail.lstrip("0") or tail[:1])
    return usual if parse_section_name(usual) else None


def misspelled(document: Document) -> Iterator[Remark]:
    """Yield the sections and keys that differ from CiA 306's spelling, with that spelling."""
    for name, counted in decimal_subs(document).items():
        section = document.sections[name]
        yield Remark(section.line, f"section [{section.name}] named [{counted}]: its object counts in decimal")
    for name, section in document.sections.items():
        usual = cia306.SECTION_NAMES.get(name) or _object_name(name, section.name)
        if usual is not None and usual != section.name:
            yield Remark(section.line, f"section [{section.name}] named [{usual}]")
        # Other sections, and their keys, are the manufacturer's own.
        spelled = cia306.SPELLED_KEYS.get(name, cia306.SPELLED_OBJECT_KEYS if usual else {})
        for key, entry in section.entries.items():
            if entry.key != spelled.get(key, entry.key):
                yield Remark(entry.line, f"key {entry.key} spelled {spelled[key]}")


def _object_name(name: str, written: str) -> str | None:
    if parse_section_name(name):
        return written.strip().replace("SUB", "sub")  # digits may have any letter case
    usual = usual_name(name) if looks_odd(name) else None
    return usual and usual.upper().replace("SUB", "sub")


# CompactPDO (CiA 306-1, 4.5.2): communication records without sections


def _compact_pdos(document: Document) -> Iterator[Section]:
    info = document.sections.get("deviceinfo")
    mask = parse_number(info.text("compactpdo")) if info else None
    if info is None or mask is None or mask.value <= 0:
        return
    at = info.at("compactpdo")
    for direction, key in COUNTS.items():
        count = parse_number(info.text(key))
        # The count includes PDOs with sections; the others get the free numbers.
        described = [each for each in values.COMMUNICATION_RECORDS[direction] if f"{each:04x}" in document.sections]
        missing = (each for each in values.COMMUNICATION_RECORDS[direction] if each not in described)
        for index, _ in zip(missing, range((count.value if count else 0) - len(described))):
            yield from _record(at, index, direction.name, mask.value)
            mapping, title = index + values.MAPPING_OFFSET, f"{direction.name} mapping parameter"
            if f"{mapping:04x}" not in document.sections:
                yield _head(at, mapping, title, 1)
                yield _variable(at, f"{mapping:04X}sub0", "Mapped objects", values.UNSIGNED8, "0")


def _head(at: HasPlace, index: int, title: str, count: int) -> Section:
    return section_at(f"{index:04X}", at, {"ParameterName": title, "ObjectType": "0x9", "SubNumber": str(count)})


def _record(at: HasPlace, index: int, direction: str, mask: int) -> Iterator[Section]:
    present = {sub: each for sub, each in enumerate(PDO_SETTINGS, start=1) if mask >> sub - 1 & 1}
    yield _head(at, index, f"{direction} communication parameter", len(present) + 1)
    yield _variable(at, f"{index:04X}sub0", "Highest sub-index", values.UNSIGNED8, str(max(present, default=0)))
    for sub, name in present.items():
        # Only the first four PDOs have a default COB-ID (CiA 301, 7.3.3).
        is_without = sub == values.COB_ID and index & values.PDO_COUNT - 1 >= values.DEFAULT_PDOS
        default = f"0x{values.NOT_VALID:08X}" if is_without else ""
        yield _variable(at, f"{index:04X}sub{sub}", name, known_type(index, sub) or values.UNSIGNED32, default)


def _variable(at: HasPlace, name: str, title: str, type_: DataType, default: str) -> Section:
    entries = {"ParameterName": title, "DataType": f"0x{type_.code:04X}", "AccessType": "rw"}
    return section_at(name, at, entries | ({"DefaultValue": default} if default else {}))


# Numbers and values in the form that every tool reads


TEXTS = (values.VISIBLE_STRING, values.UNICODE_STRING)
UNKNOWN_TYPE = values.DOMAIN._replace(name="a number, and of an unknown type")
"""Stands for an unknown type, whose values are bytes."""
BYTES = (values.OCTET_STRING, values.DOMAIN, UNKNOWN_TYPE)


@lru_cache(maxsize=REMEMBERED_NUMBERS)
def plain_number(text: str, type_: DataType | None = None) -> str | None:
    """Return a number in a form that every tool reads, unchanged if possible; None if it is not a number."""
    number = parse_number(text)
    if number is None:
        return None
    if number.relative:
        return text if PLAIN_RELATIVE.fullmatch(text) else f"{NODE_ID}+0x{number.value:X}"
    value = type_.meant(number.value) if type_ is not None else number.value
    if PLAIN.fullmatch(text) and int(text, 0) == value:
        return text
    is_hexadecimal = value >= 0 and ("0X" in text.upper() or text.upper().endswith("H"))
    return f"0x{value:X}" if is_hexadecimal else str(value)


PLAIN = re.compile(r"-?(?:0[xX][0-9A-Fa-f]+|0|[1-9][0-9]*)")
PLAIN_RELATIVE = re.compile(r"\$NODEID\+(?:0[xX][0-9A-Fa-f]+|0|[1-9][0-9]*)")


@lru_cache(maxsize=REMEMBERED_NUMBERS)
def plain_value(text: str, type_: DataType) -> str | None:
    """Return a value in a form that every tool reads; None if it does not fit the data type."""
    number = parse_number(text) if type_ is UNKNOWN_TYPE and PLAIN.fullmatch(text) else None
    if number and number.value >= 0:  # as bytes, least significant byte first
        return number.value.to_bytes(-(-number.value.bit_length() // 8) or 1, "little").hex()
    if type_ in TEXTS:
        return text
    if type_ in BYTES:
        return _plain_bytes(text)
    if type_.code in values.TIMES and parse_number(text) is None:
        return _plain_time(text, type_)
    if type_ in values.REALS:
        return _plain_real(text, type_) or _plain_real(_without_unit(text), type_)
    return plain_number(text, type_) or _plain_integer(text, type_)


SPELLED = {"TRUE": "1", "FALSE": "0"}
WHOLE = re.compile(r"(?P<number>[+-]?[0-9]+)\.0*")
UNIT = re.compile(r"(?P<number>[^\s]+)\s+(?![hHkKMG]$)[^\d\s\x00-\x1f+*,.;:=$-]{1,10}[0-9]?")
"""A number with its unit; not `10 h`, which may be hexadecimal, nor a factor such as `k`."""


def _without_unit(text: str) -> str:
    """Return the number in a text with a unit, such as `100 ms`; empty without a unit."""
    match = UNIT.fullmatch(text)
    return match["number"] if match else ""


def _plain_integer(text: str, type_: DataType) -> str | None:
    """Return an unambiguous integer outside CiA 306 in plain form: `20.0`, `+5`, `TRUE`, `100 ms`, `0b101`."""
    text = SPELLED.get(text.upper(), _without_unit(text) or text)
    whole = WHOLE.fullmatch(text)
    text = whole["number"] if whole else text
    if text[:1] == "+":
        text = text[1:] if text[1:2].isdecimal() else ""
    number = plain_number(text, type_)
    if number is None:
        try:
            return str(values.typed_number(text))
        except ValueError:
            return None
    return number


def _plain_time(text: str, type_: DataType) -> str | None:
    """Return a time, such as `2014-05-28 12:00`, as one number, which canopen needs."""
    days, _, milliseconds = (parse_number(each) for each in text.partition(" "))
    if days and milliseconds and 0 <= days.value <= 0xFFFF and 0 <= milliseconds.value < values.DAY:
        return f"0x{days.value << 32 | milliseconds.value:X}"  # as Lely writes it
    try:
        return f"0x{int.from_bytes(type_.write(text), 'little'):X}"
    except (ValueError, OverflowError):
        return None


def _plain_bytes(text: str) -> str | None:
    """Return bytes as hexadecimal digits, without a leading 0x."""
    digits = text[2:] if text[:2].lower() == "0x" else text
    try:
        bytes.fromhex(digits)
    except ValueError:
        return None
    return digits if digits or not text else None


def _plain_real(text: str, type_: DataType) -> str | None:
    """Return a REAL in decimal; editors also write its bits, C's suffix, and a decimal comma."""
    try:
        if text[:2].lower() == "0x":
            bits = parse_number(text)
            return None if bits is None else repr(type_.read(bits.value.to_bytes(type_.size, "big")[::-1]))
        for each in (text, text.rstrip("fF").replace(",", ".", 1)):
            try:
                float(each)
            except ValueError:
                continue
            return each
    except OverflowError:  # more bits than the type has
        pass
    return None
