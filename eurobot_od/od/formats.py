"""Reads a device's file whatever its form: EDS and DCF (CiA 306), or XDD and XDC, their like in XML (CiA 311).

`completed` gives what it says in other words than most: its sections under their usual names, PDOs written out. The
file itself is never changed, and nothing is added that it does not say.

XML is read by expat alone, and every section and entry has the line of the element that says it. A file with a document
type, and so with any entity, is not read as a device description. Reading never raises; what is not XML becomes an
`Oddity`.
"""

from __future__ import annotations

import codecs
import re
from codecs import BOM_UTF8
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple, TypeAlias
from xml.parsers import expat

from eurobot_od.errors import LONGEST_NAME, DictionaryError
from eurobot_od.od import document as cia306
from eurobot_od.od import values
from eurobot_od.od.description import parse_section_name
from eurobot_od.od.document import WIDE_MARKS, Document, Odd, Oddity, Remark, Section
from eurobot_od.od.standard import MANDATORY, known_type
from eurobot_od.od.values import NODE_ID, REMEMBERED_NUMBERS, DataType, Number, PdoDirection, parse_number
from eurobot_od.support.files import UNREADABLE, why_unreadable

SUFFIXES = (".xpd", ".xdd", ".eds", ".xdc", ".dcf")
"""Files of devices in a folder; of two with one name the later counts: a DCF is the EDS as it is configured."""


def listed(indices: Iterable[int]) -> dict[str, list[int]]:
    """Return objects by the list that each belongs to (CiA 306-1, 4.6.1)."""
    lists: dict[str, list[int]] = {name: [] for name in cia306.OBJECT_LISTS}
    for index in indices:
        lists[cia306.OBJECT_LISTS[0 if index in MANDATORY else 2 if index in values.MANUFACTURER else 1]].append(index)
    return lists


def list_entries(indices: Sequence[int]) -> dict[str, str]:
    """Return the entries of a list of objects."""
    numbered = {str(number): f"0x{index:04X}" for number, index in enumerate(indices, start=1)}
    return {"SupportedObjects": str(len(indices)), **numbered}


def files_in(folder: str | Path) -> list[Path]:
    """Return a folder's device files, in the order of SUFFIXES and by name; raises DictionaryError if it has none."""
    files = [each for suffix in SUFFIXES for each in sorted(Path(folder).iterdir()) if each.suffix.lower() == suffix]
    if not files:
        raise DictionaryError(folder, None, "no EDS, DCF, XDD or XDC in this folder")
    return files


def read(data: bytes) -> Document:
    """Read the bytes of a file; nothing raises, what is odd is in the document."""
    return read_xml(data) if is_xml(data) else cia306.read(data)


def is_xml(data: bytes) -> bool:
    """Whether a file begins as one in XML: no EDS begins so."""
    is_wide = data.startswith(WIDE_MARKS)
    start = data[:200].decode("utf-16", "replace") if is_wide else data[:200].removeprefix(BOM_UTF8).decode("latin-1")
    return start.lstrip().startswith("<")


# In usual words

COUNTS = {PdoDirection.RPDO: "nrofrxpdo", PdoDirection.TPDO: "nroftxpdo"}

PARAMETERS = ("COB-ID", "Transmission type", "Inhibit time", "Compatibility entry", "Event timer", "SYNC start value")
"""Communication parameters from sub-index 1 on; the device has those whose bit in CompactPDO is set."""


FOREIGN = (
    (re.compile(rb"<EtherCATInfo\b"), "EtherCAT (ESI)"),
    (re.compile(rb"ethernet-powerlink\.org|_Powerlink\b"), "POWERLINK"),
    (re.compile(rb"^\s*\[Device\][^[]*^\s*VendCode\s*=", re.MULTILINE | re.IGNORECASE), "EtherNet/IP"),
)
"""What files of other networks, which have the same suffixes, are recognised by."""


def foreign_network(data: bytes) -> str:
    """Say of which other network a device description is; nothing of one that may be CANopen's."""
    other = next((name for mark, name in FOREIGN if mark.search(data)), "")
    return other and f"a device description of {other}, not of CANopen"


def no_objects(data: bytes) -> str:
    """Say what a file is that describes no object of CANopen."""
    return foreign_network(data) or "not an EDS: it describes no object"


def completed(document: Document) -> Document:
    """Return a document with all objects that it describes under the names that they have in CiA 306."""
    renamed = {name: usual_name(name) for name in document.sections if not name.isalnum() or looks_odd(name)}
    decimal = decimal_subs(document)
    sections = {
        decimal.get(name, name).lower(): each._replace(name=decimal[name]) if name in decimal else each
        for name, each in document.sections.items()
    }
    for name, usual in renamed.items():
        # Beside the odd one, which lint points at, and not in place of a section that is there in the usual form, too.
        if usual is not None and usual not in sections:
            sections[usual] = sections[name]._replace(name=usual)
    whole = document._replace(sections=sections)
    return whole._replace(sections={**sections, **{each.name.lower(): each for each in _compact_pdos(whole)}})


DECIMAL_SUB = re.compile(r"([0-9a-f]{4})sub([0-9]{1,3})")


def decimal_subs(document: Document) -> dict[str, str]:
    """Return the usual names of sub-indices that a file counts in decimal, by their names in lower case.

    `sub9` is followed by `sub10`, there is none with a letter, and sub-index 0 says the highest as a decimal number. As
    hexadecimal numbers they would be the addresses of other objects, so that anything less clear stays as it is.
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
    """Whether a section's name, in lower case, may be that of an object in an unusual form."""
    return name[:1].isdigit() and parse_section_name(name) is None


def usual_name(name: str) -> str | None:
    """Return how CiA 306 names an object's section, from `0x1018`, `01018`, `1018 sub1` or `1018sub01`; else None."""
    # CiA 306 writes four digits of the index, but none in front of the sub-index; editors differ in both.
    head, sub, tail = "".join(name.lower().split()).removeprefix("0x").partition("sub")
    usual = head.lstrip("0").zfill(4) + sub + (tail.lstrip("0") or tail[:1])
    return usual if parse_section_name(usual) else None


def misspelled(document: Document) -> Iterator[Remark]:
    """Give the sections and keys that are not spelled as CiA 306 has them, and how they are spelled there."""
    for name, counted in decimal_subs(document).items():
        section = document.sections[name]
        yield Remark(section.line, f"section [{section.name}] named [{counted}]: its object counts in decimal")
    for name, section in document.sections.items():
        usual = cia306.SECTION_NAMES.get(name) or _object_name(name, section.name)
        if usual is not None and usual != section.name:
            yield Remark(section.line, f"section [{section.name}] named [{usual}]")
        # What is neither a section of CiA 306 nor an object is the maker's own, and so are its keys.
        spelled = cia306.SPELLED_KEYS.get(name, cia306.SPELLED_OBJECT_KEYS if usual else {})
        for key, entry in section.entries.items():
            if entry.key != spelled.get(key, entry.key):
                yield Remark(entry.line, f"key {entry.key} spelled {spelled[key]}")


def _object_name(name: str, written: str) -> str | None:
    if parse_section_name(name):
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
                yield _section(f"{mapping:04X}", info, {"ParameterName": title, "ObjectType": "0x9"})
                yield _variable(info, f"{mapping:04X}sub0", "Mapped objects", values.UNSIGNED8, "0")


def _record(at: Section, index: int, direction: str, mask: int) -> Iterator[Section]:
    present = {sub: each for sub, each in enumerate(PARAMETERS, start=1) if mask >> sub - 1 & 1}
    yield _section(f"{index:04X}", at, {"ParameterName": f"{direction} communication parameter", "ObjectType": "0x9"})
    yield _variable(at, f"{index:04X}sub0", "Highest sub-index", values.UNSIGNED8, str(max(present, default=0)))
    for sub, name in present.items():
        # The first four PDOs have a COB-ID from the pre-defined connection set (CiA 301, 7.3.3), later ones have none.
        is_without = sub == values.COB_ID and index & values.PDO_COUNT - 1 >= values.DEFAULT_PDOS
        default = f"0x{values.NOT_VALID:08X}" if is_without else ""
        yield _variable(at, f"{index:04X}sub{sub}", name, known_type(index, sub) or values.UNSIGNED32, default)


def _variable(at: Section, name: str, title: str, type_: DataType, default: str) -> Section:
    entries = {"ParameterName": title, "DataType": f"0x{type_.code:04X}", "AccessType": "rw", "DefaultValue": default}
    return _section(name, at, entries)


# Numbers and values as every tool reads them, whatever an editor has written


TEXTS = (values.VISIBLE_STRING, values.UNICODE_STRING)
UNKNOWN_TYPE = values.DOMAIN._replace(name="a number, and of an unknown type")
"""Stands for a type that nobody knows: its values are bytes."""
BYTES = (values.OCTET_STRING, values.DOMAIN, UNKNOWN_TYPE)


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
    number = parse_number(text) if type_ is UNKNOWN_TYPE and PLAIN.fullmatch(text) else None
    if number and number.value >= 0:  # as whoever knows the type reads it, least significant byte first
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
"""A number and its unit; not `10 h`, which may be hexadecimal, nor a factor such as `k`."""


def _without_unit(text: str) -> str:
    """Return what stands before a unit, as in `100 ms`; an empty text without one."""
    match = UNIT.fullmatch(text)
    return match["number"] if match else ""


def _plain_integer(text: str, type_: DataType) -> str | None:
    """Write an integer that has one reading, though no number of CiA 306: `20.0`, `+5`, `TRUE`, `100 ms`, `0b101`."""
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
    """Write all the bits of a time as one number; canopen reads no other, and people write `2014-05-28 12:00`."""
    days, _, milliseconds = (parse_number(each) for each in text.partition(" "))
    if days and milliseconds and 0 <= days.value <= 0xFFFF and 0 <= milliseconds.value < values.DAY:
        return f"0x{days.value << 32 | milliseconds.value:X}"  # as Lely writes it
    try:
        return f"0x{int.from_bytes(type_.write(text), 'little'):X}"
    except (ValueError, OverflowError):
        return None


def _plain_bytes(text: str) -> str | None:
    """Write bytes in hexadecimal digits; an editor may put 0x in front of them."""
    digits = text[2:] if text[:2].lower() == "0x" else text
    try:
        bytes.fromhex(digits)
    except ValueError:
        return None
    return digits if digits or not text else None


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


# XML


MOST_DEPTH = 200
"""Elements in each other; a device description has about ten."""


class XmlElement(NamedTuple):
    """An element: its name without a namespace, its attributes, its place, what is in it, and its text."""

    tag: str
    attributes: Mapping[str, str]
    line: int
    column: int
    children: list[XmlElement]
    texts: list[str]

    @property
    def text(self) -> str:
        """Its text, in one line without blanks around it."""
        return " ".join("".join(self.texts).split())

    def all(self, tag: str) -> Iterator[XmlElement]:
        """Give all elements of a name in it, in the file's order."""
        waiting = [self]
        while waiting:
            each = waiting.pop()
            if each.tag == tag:
                yield each
            waiting.extend(reversed(each.children))

    def first(self, tag: str) -> XmlElement | None:
        """Return the first element of a name in it; None without one."""
        return next(self.all(tag), None)

    def child(self, tag: str) -> XmlElement | None:
        """Return the first element of a name right in it; None without one."""
        return next((each for each in self.children if each.tag == tag), None)


class _Refused(Exception):
    """What a device description never has; the text says what."""


def read_xml(data: bytes) -> Document:
    """Read the bytes of an XDD or XDC; what is not XML gives a document without sections."""
    try:
        return _described(parse_xml(*in_known_encoding(data)))
    except expat.ExpatError as error:
        odd = Oddity(Odd.XML, error.lineno, error.offset + 1, expat.ErrorString(error.code))
    except _Refused as error:
        what, line = error.args
        odd = Oddity(Odd.XML, line, 1, what)
    except UNREADABLE as error:
        odd = Oddity(Odd.XML, 1, 1, why_unreadable(error))
    return Document({}, [odd], is_xml=True)


def _described(root: XmlElement) -> Document:
    parameters = _Parameters(root)
    objects, lost = _addressed(root.all("CANopenObject"), "index")
    oddities = lost + [oddity for _, each in objects for oddity in _subs(each)[1]]
    disabled = ((index, each) for index, each in objects if parameters.is_disabled(each))
    oddities += [Oddity(Odd.DISABLED, each.line, each.column, f"0x{index:04X}") for index, each in disabled]
    sections = _sections(root, [pair for pair in objects if not parameters.is_disabled(pair[1])], parameters)
    return Document({each.name.lower(): each for each in sections}, oddities, is_xml=True)


DECLARED_ENCODING = re.compile(rb"""<\?xml\b[^>]*?\bencoding\s*=\s*(["'])([A-Za-z][\w.-]*)\1""")
EXPATS_ENCODINGS = ("utf-8", "utf-16", "iso8859-1", "ascii")
"""Encodings that expat reads by itself, by their names in Python."""

WIDER = {"gb2312": "gb18030", "gbk": "gb18030", "shift_jis": "cp932"}
"""Encodings that contain others: Windows' programs declare the smaller one and write the larger one."""


BY_MARK = {BOM_UTF8: "utf-8", **dict.fromkeys(WIDE_MARKS, "utf-16")}
"""Encodings by the mark at the start of a file: it counts, whatever the file declares after it."""


def in_known_encoding(data: bytes) -> tuple[bytes, str | None]:
    """Return XML in an encoding that expat can read, and which that is; None if expat finds out.

    Raises _Refused if an encoding is declared that nobody knows.
    """
    marked = next((name for mark, name in BY_MARK.items() if data.startswith(mark)), None)
    declared = DECLARED_ENCODING.match(data)
    if marked or declared is None:
        return data, marked
    name = declared[2].decode("ascii")
    try:
        encoding = codecs.lookup(name).name
        if encoding in EXPATS_ENCODINGS:
            return data, None
        # Only the declaration in its own encoding shows that the rest of the file can be XML in it.
        if declared[0].decode(encoding).encode() != declared[0]:
            raise LookupError(name)
        text = data.decode(WIDER.get(encoding, encoding), "replace")
    except (LookupError, ValueError) as error:
        raise _Refused(f"the encoding {name[:LONGEST_NAME]!r}, which is not known", 1) from error
    return text.encode("utf-8", "replace"), "utf-8"


def parse_xml(data: bytes, encoding: str | None = None) -> XmlElement:
    """Read XML into its elements, in an encoding that counts before the declared one; raises ExpatError, _Refused."""
    parser = expat.ParserCreate(encoding)
    root = XmlElement("", {}, 1, 1, [], [])
    stack = [root]

    def start(tag: str, attributes: dict[str, str]) -> None:
        if len(stack) > MOST_DEPTH:
            raise _Refused(f"more than {MOST_DEPTH} elements in each other", parser.CurrentLineNumber)
        named = {key.rpartition(":")[2]: value for key, value in attributes.items()}
        place = parser.CurrentLineNumber, parser.CurrentColumnNumber + 1  # expat counts columns from 0
        each = XmlElement(tag.rpartition(":")[2], named, *place, [], [])
        stack[-1].children.append(each)
        stack.append(each)

    def refuse(*_: object) -> None:
        # Entities can grow a small file into gigabytes, or name other files: there is no reason to have any.
        raise _Refused("a document type, which no device description has", parser.CurrentLineNumber)

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: stack.pop()
    parser.CharacterDataHandler = lambda text: stack[-1].texts.append(text)
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.Parse(data, True)
    return root


# Sections


def _keys(*same: str, **others: str) -> dict[str, str]:
    """Return the keys of an EDS by the names that they have in XML: those with a small letter, and others."""
    return {name: name[:1].upper() + name[1:] for name in same} | others


BODY_INFO = _keys("fileName", "fileVersion", fileCreator="CreatedBy", fileModifiedBy="ModifiedBy")
"""Attributes of a profile's body, and their keys in [FileInfo]."""

DATES = {"fileCreationDate": "CreationDate", "fileModificationDate": "ModificationDate"}
TIMES = {"fileCreationTime": "CreationTime", "fileModificationTime": "ModificationTime"}

IDENTITY = _keys(
    *("vendorName", "productName"), vendorID="VendorNumber", productID="ProductNumber", orderNumber="OrderCode"
)
FEATURES = {
    "granularity": "Granularity",
    "nrOfRxPDO": "NrOfRXPDO",
    "nrOfTxPDO": "NrOfTXPDO",
    "groupMessaging": "GroupMessaging",
    "bootUpSlave": "SimpleBootUpSlave",
    "layerSettingServiceSlave": "LSS_Supported",
    "bootUpMaster": "SimpleBootUpMaster",
}
"""Elements of the identity, attributes of general and of a master's features, and their keys in [DeviceInfo]."""

COMMISSIONED = _keys(
    *("nodeID", "nodeName", "networkName", "cANopenManager"), actualBaudRate="Baudrate", networkNumber="NetNumber"
)
DUMMY = re.compile(r"(Dummy[0-9A-Fa-f]{4})=([01])")
BREAKS = re.compile(r"[\x00-\x08\x0a-\x1f\x7f]")
BOOLEANS = {"true": "1", "false": "0"}
MAPPED_ACCESS = {("rw", "TPDO"): "rwr", ("rw", "RPDO"): "rww"}
"""Access types of an EDS by access and mapping, which CiA 311 has apart."""

VALUES = _keys("lowLimit", "highLimit", "defaultValue", actualValue="ParameterValue")
"""Attributes of an object with its limits and values, and their keys."""

PARAMETER_ACCESS = {
    "const": "const",
    "read": "ro",
    "write": "wo",
    "readWrite": "rw",
    "readWriteInput": "rwr",
    "readWriteOutput": "rww",
    "noAccess": values.NO_ACCESS_IN_EDS,
}
"""Access of a parameter of the application process."""

BITS = values.OCTET_STRING.code
MOST_TEMPLATES = 10
"""Templates, and derived types, of each other; schemas have one or two."""

SIMPLE_TYPES = {
    each: code
    for code, names in (
        (0x01, "BOOL"), (0x02, "SINT CHAR"), (0x03, "INT"), (0x04, "DINT"), (0x15, "LINT"), (0x05, "USINT BYTE"),
        (0x06, "UINT WORD"), (0x07, "UDINT DWORD"), (0x1B, "ULINT LWORD"), (0x08, "REAL"), (0x11, "LREAL"),
        (0x09, "STRING"), (0x0B, "WSTRING"), (0x0A, "BITSTRING"),
    )
    for each in names.split()
}  # fmt: skip
"""Data types of the application process (IEC 61131-3), and CANopen's."""


def _sections(root: XmlElement, objects: Sequence[Addressed], parameters: _Parameters) -> Iterator[Section]:
    yield _file_info(root)
    yield _device_info(root)
    dummies = [match for each in root.all("dummy") if (match := DUMMY.fullmatch(each.attributes.get("entry", "")))]
    if dummies:
        yield _section("DummyUsage", root.first("dummyUsage") or root, {each[1]: each[2] for each in dummies})
    yield from _lists(root.first("CANopenObjectList") or root, [index for index, _ in objects])
    for index, each in objects:
        yield from _object(index, each, parameters)
    commissioning = root.first("deviceCommissioning")
    if commissioning:
        # The schema has `NodeID` beside `nodeName`; many writers have `nodeID`.
        said = {key[:1].lower() + key[1:]: value for key, value in commissioning.attributes.items()}
        yield _section(cia306.COMMISSIONING, commissioning, _renamed(said, COMMISSIONED))


def _section(name: str, at: XmlElement | Section, entries: Mapping[str, str]) -> Section:
    """Return a section that stands where the file says what is in it."""
    # A line end in a value, which XML can have, would make two lines of an EDS.
    lines = {key: BREAKS.sub(" ", value).strip() for key, value in entries.items()}
    return Section(name, at.line, at.column, {}).saying(**lines)


ADDRESS = {name: re.compile(f"(?:0x)?([0-9A-Fa-f]{{1,{most}}})") for name, most in (("index", 4), ("subIndex", 2))}
"""An object's address in hexadecimal digits; some editors write 0x in front."""

Addressed: TypeAlias = tuple[int, XmlElement]
"""An element with the index, or sub-index, that it is at."""


def _addressed(elements: Iterable[XmlElement], name: str) -> tuple[list[Addressed], list[Oddity]]:
    """Return those of some elements that have an address, and what is to be said of the others: they are lost."""
    found, lost = list[Addressed](), list[Oddity]()
    for each in elements:
        text = each.attributes.get(name, "")
        address = ADDRESS[name].fullmatch(text)
        if address is None:
            what = f"{name} {text!r} of {each.attributes.get('name', '')!r} is not a number"
            lost.append(Oddity(Odd.ADDRESS, each.line, each.column, what))
        else:
            found.append((int(address[1], 16), each))
    return found, lost


def _renamed(attributes: Mapping[str, str], names: Mapping[str, str]) -> dict[str, str]:
    """Return attributes under the keys of an EDS, its 0 and 1 for `false` and `true`."""
    found = ((key, attributes[name]) for name, key in names.items() if name in attributes)
    return {key: BOOLEANS.get(value, value).removesuffix(" Kbps") for key, value in found}


def _file_info(root: XmlElement) -> Section:
    body = next((each for each in root.all("ProfileBody") if each.first("CANopenObjectList")), None) or root
    said = _renamed(body.attributes, BODY_INFO)
    for name, key in DATES.items():
        year, _, day = body.attributes.get(name, "").partition("-")
        said |= {key: f"{day}-{year}"} if day else {}  # 2014-05-28 is 05-28-2014 in an EDS
    for name, key in TIMES.items():
        hour, _, rest = body.attributes.get(name, "").partition(":")
        if hour.isdecimal() and len(hour) <= 2 and rest:
            # 17:05 is 05:05PM in an EDS, and 00:05 is 12:05AM (CiA 306-1).
            said[key] = f"{(int(hour) + 11) % 12 + 1:02}:{rest[:2]}{'AM' if int(hour) < 12 else 'PM'}"
    return _section("FileInfo", body, {**said, "EDSVersion": "4.0"})


def _device_info(root: XmlElement) -> Section:
    identity = root.first("DeviceIdentity")
    said: dict[str, str] = {}
    for tag, key in IDENTITY.items():
        each = identity.first(tag) if identity else None
        said |= {key: each.text} if each and each.text else {}
    rates = {each.attributes.get("value", "").removesuffix(" Kbps") for each in root.all("supportedBaudRate")}
    said |= {key: str(int(key.removeprefix("BaudRate_") in rates)) for key in cia306.BIT_RATE_KEYS}
    for tag in ("CANopenGeneralFeatures", "CANopenMasterFeatures"):
        features = root.first(tag)
        said |= _renamed(features.attributes, FEATURES) if features else {}
    return _section("DeviceInfo", identity or root, said)


def _lists(at: XmlElement, indices: Iterable[int]) -> Iterator[Section]:
    # below are the data types, which no list of CiA 306 has
    for name, found in listed(each for each in indices if each >= values.FIRST).items():
        yield _section(name, at, list_entries(found))


def _object(index: int, each: XmlElement, parameters: _Parameters) -> Iterator[Section]:
    """Give the sections of an object and its sub-indices."""
    name, subs = f"{index:04X}", _subs(each)[0]
    if not subs and "subNumber" not in each.attributes:
        yield _section(name, each, _entries(each, parameters))
        return
    head = {key: text for key, text in _entries(each, parameters).items() if key in HEAD or key.startswith(PROPERTY)}
    # SubNumber does not count sub-index 0xFF, the structure (CiA 306-1).
    yield _section(name, each, {**head, "SubNumber": str(sum(sub != values.STRUCTURE for sub, _ in subs))})
    for sub, at in subs:
        yield _section(f"{name}sub{sub:X}", at, _entries(at, parameters))


def _subs(each: XmlElement) -> tuple[list[Addressed], list[Oddity]]:
    return _addressed((sub for sub in each.children if sub.tag == "CANopenSubObject"), "subIndex")


def _entries(each: XmlElement, parameters: _Parameters) -> dict[str, str]:
    """Return what an object, or a sub-index, says, with what the parameter that it refers to says."""
    said = each.attributes
    parameter = parameters.said(said.get("uniqueIDRef", ""))
    entries = {"ParameterName": said.get("name", "")}
    kind = parse_number(said.get("objectType", ""))
    entries |= {"ObjectType": f"0x{kind.value:X}"} if kind and kind.value >= 0 else {}
    entries |= parameter
    if "dataType" in said:
        entries["DataType"] = f"0x{said['dataType'].zfill(4).upper()}"
    mapping = said.get("PDOmapping", "no")
    access = said.get("accessType") or entries.get("AccessType", "")
    if access:
        entries["AccessType"] = MAPPED_ACCESS.get((access, mapping), access)
    if "PDOmapping" in said or parameter:
        entries["PDOMapping"] = str(int(mapping != "no"))
    entries |= {key: said[name] for name, key in (VALUES | _keys("denotation")).items() if name in said}
    if "objFlags" in said:
        entries["ObjFlags"] = f"0x{said['objFlags']}"
    # XML writes true and false; an EDS has no such words.
    if parse_number(entries.get("DataType", "")) == values.Number(values.BOOLEAN.code):
        entries = {key: BOOLEANS.get(text, text) for key, text in entries.items()}
    return entries


HEAD = ("ParameterName", "ObjectType")
"""What an object with sub-indices says for all of them."""

PROPERTY = "CO_"
"""Begins the names of CANopenNode's own properties, such as CO_storageGroup."""

PARAMETER_VALUES = (("defaultValue", "DefaultValue"), ("actualValue", "ParameterValue"))
SCALE = {"multiplier": "Factor", "offset": "Offset"}
PARAMETER_LISTS = ("parameterList", "templateList", "dataTypeList", "unitList")


def _limits(parameter: XmlElement) -> dict[str, str]:
    """Return the lowest and the highest value that a parameter may have.

    `range` stands inside `allowedValues` (CiA 311, schema 1.1), which may have several of them, and single values; some
    editors write it right below the parameter. An EDS has one range: the one that contains all of them.
    """
    allowed = parameter.child("allowedValues") or parameter
    ranges = [each for each in allowed.children if each.tag == "range"]
    single = [each.attributes.get("value", "") for each in allowed.children if each.tag == "value"]
    limits = {}
    for tag, key, outermost in (("minValue", "LowLimit", min), ("maxValue", "HighLimit", max)):
        ends = [end.attributes.get("value", "") for each in ranges if (end := each.child(tag))] + single
        if len(ends) == 1:
            limits[key] = ends[0]
        elif numbers := [number.value for each in ends if (number := parse_number(each))]:
            limits[key] = str(outermost(numbers))
    return limits


def _disables(each: XmlElement) -> bool:
    return each.attributes.get("name") == "CO_disabled" and each.attributes.get("value") == "true"


class _Parameters:
    """The parameters of the application process, each read once, whatever refers to it how often."""

    def __init__(self, root: XmlElement) -> None:
        lists = [each for tag in PARAMETER_LISTS for each in root.all(tag)]
        self._elements = {each.attributes.get("uniqueID", ""): each for found in lists for each in found.children}
        self._said: dict[str, dict[str, str]] = {}
        self._disabled = {name for name, each in self._elements.items() if any(map(_disables, each.children))}

    def said(self, name: str) -> dict[str, str]:
        """Return type, access and values of a parameter, also by its template; nothing if there is none."""
        if name not in self._said:
            parameter = self._elements.get(name)
            # Without `access` it is `read` (CiA 311, schema 1.1, t_parameter and t_parameterTemplate).
            access = {"AccessType": "ro"} if parameter else {}
            self._said[name] = {**access, **self._written(parameter, MOST_TEMPLATES)} if parameter else {}
        return self._said[name]

    def is_disabled(self, each: XmlElement) -> bool:
        """Whether an object is one that CANopenEditor keeps for later: it makes no EDS and no device with it."""
        return each.attributes.get("uniqueIDRef", "") in self._disabled

    def _written(self, parameter: XmlElement, depth: int) -> dict[str, str]:
        template = self._elements.get(parameter.attributes.get("templateIDRef", ""))
        said = self._written(template, depth - 1) if template and depth else {}
        access = PARAMETER_ACCESS.get(parameter.attributes.get("access", ""))
        said |= {"AccessType": access} if access is not None else {}
        for tag, key in PARAMETER_VALUES:
            each = parameter.child(tag)
            if each and "value" in each.attributes:
                said[key] = each.attributes["value"]
        said |= _limits(parameter)
        properties = (each.attributes for each in parameter.children if each.tag == "property")
        said |= {
            each["name"]: each.get("value", "") for each in properties if each.get("name", "").startswith(PROPERTY)
        }
        denotation = parameter.child("denotation")
        label = denotation.child("label") if denotation else None
        said |= {"Denotation": label.text} if label else {}
        said |= self._scale(parameter)
        type_ = self._type(parameter, MOST_TEMPLATES)
        if type_ == BITS and not said.get("DefaultValue"):
            type_ = values.DOMAIN.code  # CANopenEditor has one type for both
        said |= {"DataType": f"0x{type_:04X}"} if type_ is not None else {}
        return said

    def _scale(self, parameter: XmlElement) -> dict[str, str]:
        """Return unit, factor and offset of a parameter: its own unit, or one that it refers to."""
        said = {key: parameter.attributes[name] for name, key in SCALE.items() if name in parameter.attributes}
        unit = parameter.child("unit") or self._elements.get(parameter.attributes.get("unitIDRef", ""))
        if unit is None:
            return said
        # The multiplier is the unit's in the schema's element, and the parameter's as its attribute.
        multiplier = unit.attributes.get("multiplier") or said.get("Factor", "")
        label = unit.child("label")
        text = label.text if label else unit.attributes.get("unitURI", "")
        return said | ({"Factor": multiplier} if multiplier else {}) | ({"Unit": text} if text else {})

    def _type(self, each: XmlElement, depth: int) -> int | None:
        """Return the simple type of a parameter, or of a type that is derived from one."""
        simple = next((SIMPLE_TYPES[one.tag] for one in each.children if one.tag in SIMPLE_TYPES), None)
        named = each.child("dataTypeIDRef")
        derived = self._elements.get(named.attributes.get("uniqueIDRef", "")) if named else None
        is_whole = derived is not None and derived.tag not in ("array", "struct")
        return self._type(derived, depth - 1) if simple is None and derived and is_whole and depth else simple
