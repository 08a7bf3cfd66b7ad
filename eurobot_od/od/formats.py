"""Reads a device's file whatever its form: EDS and DCF (CiA 306), or XDD and XDC, their like in XML (CiA 311).

`completed` gives what it says in other words than most: its sections under their usual names, PDOs written out. The
file itself is never changed, and nothing is added that it does not say.
"""

from __future__ import annotations

import re
from codecs import BOM_UTF8
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

from eurobot_od.errors import DictionaryError
from eurobot_od.od import document, keys, values
from eurobot_od.od.description import parse_section_name
from eurobot_od.od.document import WIDE_MARKS, Document, Entry, Section
from eurobot_od.od.values import NODE_ID, REMEMBERED_NUMBERS, DataType, PdoDirection, parse_number

SUFFIXES = (".xdd", ".eds", ".xdc", ".dcf")
"""Files of devices in a folder; of two with one name the later counts: a DCF is the EDS as it is configured."""


def files_in(folder: str | Path) -> list[Path]:
    """Return a folder's device files, in the order of SUFFIXES and by name; raises DictionaryError if it has none."""
    files = [each for suffix in SUFFIXES for each in sorted(Path(folder).iterdir()) if each.suffix.lower() == suffix]
    if not files:
        raise DictionaryError(folder, None, "no EDS, DCF, XDD or XDC in this folder")
    return files


def read(data: bytes) -> Document:
    """Read the bytes of a file; nothing raises, what is odd is in the document."""
    if not is_xml(data):
        return document.read(data)
    from eurobot_od.od import xdd  # most files are not XML

    return xdd.read(data)


def is_xml(data: bytes) -> bool:
    """Whether a file begins as one in XML: no EDS begins so."""
    is_wide = data.startswith(WIDE_MARKS)
    start = data[:200].decode("utf-16", "replace") if is_wide else data[:200].removeprefix(BOM_UTF8).decode("latin-1")
    return start.lstrip().startswith("<")


# In usual words

COUNTS = {PdoDirection.RPDO: "nrofrxpdo", PdoDirection.TPDO: "nroftxpdo"}

PARAMETERS: tuple[tuple[str, DataType], ...] = (
    ("COB-ID", values.UNSIGNED32),
    ("Transmission type", values.UNSIGNED8),
    ("Inhibit time", values.UNSIGNED16),
    ("Compatibility entry", values.UNSIGNED8),
    ("Event timer", values.UNSIGNED16),
    ("SYNC start value", values.UNSIGNED8),
)
"""Communication parameters from sub-index 1 on; the device has those whose bit in CompactPDO is set."""


USUAL_NAME = re.compile(r"[0-9a-f]{4}(?:sub(?:0|[1-9a-f][0-9a-f]?)|name|value|denotation)?")
"""Names of objects' sections, in lower case; `parse_section_name` says what they mean."""


def completed(document: Document) -> Document:
    """Return a document with all objects that it describes under the names that they have in CiA 306."""
    renamed = {name: usual_name(name) for name in document.sections if not name.isalnum() or looks_odd(name)}
    sections = dict(document.sections)
    for name, usual in renamed.items():
        # Beside the odd one, which lint points at, and not in place of a section that is there in the usual form, too.
        if usual is not None and usual not in sections:
            sections[usual] = sections[name]._replace(name=usual)
    whole = document._replace(sections=sections)
    return whole._replace(sections={**sections, **{each.name.lower(): each for each in _compact_pdos(whole)}})


def looks_odd(name: str) -> bool:
    """Whether a section's name, in lower case, may be that of an object in an unusual form."""
    return name[:1].isdigit() and not USUAL_NAME.fullmatch(name)


def usual_name(name: str) -> str | None:
    """Return how CiA 306 names an object's section, from `0x1018`, `01018`, `1018 sub1` or `1018sub01`; else None."""
    # CiA 306 writes four digits of the index, but none in front of the sub-index; editors differ in both.
    head, sub, tail = "".join(name.lower().split()).removeprefix("0x").partition("sub")
    usual = head.lstrip("0").zfill(4) + sub + (tail.lstrip("0") or tail[:1])
    return usual if parse_section_name(usual) else None


class Misspelling(NamedTuple):
    """A section or key that is not spelled as in CiA 306: its line, and how it is spelled there."""

    line: int
    what: str


def misspelled(document: Document) -> Iterator[Misspelling]:
    """Give the sections and keys that are not spelled as CiA 306 has them."""
    for name, section in document.sections.items():
        usual = keys.SECTION_NAMES.get(name) or _object_name(name, section.name)
        if usual is not None and usual != section.name:
            yield Misspelling(section.line, f"section [{section.name}] named [{usual}]")
        # What is neither a section of CiA 306 nor an object is the maker's own, and so are its keys.
        spelled = keys.SPELLED_KEYS.get(name, keys.SPELLED_OBJECT_KEYS if usual else {})
        for key, entry in section.entries.items():
            if entry.key != spelled.get(key, entry.key):
                yield Misspelling(entry.line, f"key {entry.key} spelled {spelled[key]}")


def _object_name(name: str, written: str) -> str | None:
    if USUAL_NAME.fullmatch(name):
        return written.strip().replace("SUB", "sub")  # the letter case of the digits is left to the file
    usual = usual_name(name) if looks_odd(name) else None
    return usual and usual.upper().replace("SUB", "sub")


# CompactPDO (CiA 306-1, 4.5.2): communication records that have no sections of their own


def _compact_pdos(document: Document) -> Iterator[Section]:
    info = document.sections.get("deviceinfo")
    mask = parse_number(info.text("compactpdo")) if info else None
    if info is None or mask is None or mask.value <= 0:
        return
    for direction, key in COUNTS.items():
        count = parse_number(info.text(key))
        # The count is that of all PDOs, with those that have sections of their own; the others get the free numbers.
        described = [each for each in values.COMMUNICATION_RECORDS[direction] if f"{each:04x}" in document.sections]
        missing = (each for each in values.COMMUNICATION_RECORDS[direction] if each not in described)
        for index, _ in zip(missing, range((count.value if count else 0) - len(described))):
            yield from _record(info, index, direction.name, mask.value)
            mapping, title = index + values.MAPPING_OFFSET, f"{direction.name} mapping parameter"
            if f"{mapping:04x}" not in document.sections:
                yield _section(info, f"{mapping:04X}", ParameterName=title, ObjectType="0x9")
                yield _variable(info, f"{mapping:04X}sub0", "Mapped objects", values.UNSIGNED8, "0")


def _record(at: Section, index: int, direction: str, mask: int) -> Iterator[Section]:
    present = {sub: each for sub, each in enumerate(PARAMETERS, start=1) if mask >> sub - 1 & 1}
    yield _section(at, f"{index:04X}", ParameterName=f"{direction} communication parameter", ObjectType="0x9")
    yield _variable(at, f"{index:04X}sub0", "Highest sub-index", values.UNSIGNED8, str(max(present, default=0)))
    for sub, (name, type_) in present.items():
        # The first four PDOs have a COB-ID from the pre-defined connection set (CiA 301, 7.3.3), later ones have none.
        is_without = sub == values.COB_ID and index & values.PDO_COUNT - 1 >= len(
            values.DEFAULT_PDO_BASES[PdoDirection.RPDO]
        )
        default = f"0x{values.NOT_VALID:08X}" if is_without else ""
        yield _variable(at, f"{index:04X}sub{sub}", name, type_, default)


def _variable(at: Section, name: str, title: str, type_: DataType, default: str) -> Section:
    code = f"0x{type_.code:04X}"
    return _section(at, name, ParameterName=title, DataType=code, AccessType="rw", DefaultValue=default)


def _section(at: Section, name: str, **entries: str) -> Section:
    """Return a section that stands where the file announces it."""
    said = {key.lower(): Entry(key, value, at.line, at.column) for key, value in entries.items()}
    return Section(name, at.line, at.column, said)


# Numbers and values as every tool reads them, whatever an editor has written


TEXTS = (values.VISIBLE_STRING, values.UNICODE_STRING)
BYTES = (values.OCTET_STRING, values.DOMAIN)


@lru_cache(maxsize=REMEMBERED_NUMBERS)
def plain_number(text: str, type_: DataType | None = None) -> str | None:
    """Write a number as every tool reads it, in its own words where they are; None for what is not a number."""
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
    """Write a value of a data type as every tool reads it; None if it does not fit the type."""
    if type_ in TEXTS:
        return text
    if type_ in BYTES:
        return _plain_bytes(text)
    if type_.code in values.TIMES and parse_number(text) is None:
        return _plain_time(text, type_)
    return _plain_real(text, type_) if type_ in values.REALS else plain_number(text, type_)


def _plain_time(text: str, type_: DataType) -> str | None:
    """Write all the bits of a time as one number; canopen reads no other, and people write `2014-05-28 12:00`."""
    try:
        return f"0x{int.from_bytes(type_.write(text), 'little'):X}"
    except (ValueError, OverflowError):
        return None


def _plain_bytes(text: str) -> str | None:
    """Write bytes in hexadecimal digits; an editor may put 0x in front of them."""
    for digits in (text, text[2:] if text[:2].lower() == "0x" else ""):
        try:
            bytes.fromhex(digits)
        except ValueError:
            continue
        return digits if digits or not text else None
    return None


def _plain_real(text: str, type_: DataType) -> str | None:
    """Write a REAL in decimal; editors also write its bits in hexadecimal, C's suffix, and a comma."""
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
