"""Reads the `.od` of CanFestival's editor, objdictgen: a Python object in XML, which is read as data only.

Such a file has the values of all objects; it has names and types only for objects outside CiA 301, those of CiA 301 are
here.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterator, Mapping, Sequence
from typing import NamedTuple

from eurobot_od.od import standard, values
from eurobot_od.od.description import ObjectCode, list_entries, listed
from eurobot_od.od.document import BIT_RATE_KEYS, Document, Section, section_at
from eurobot_od.od.values import COMMUNICATION_RECORDS, DEFAULT_PDO_BASES, MAPPING_RECORDS, NODE_ID, parse_number
from eurobot_od.od.xml_tree import XmlElement

ROOT = "PyObject"
"""First element of such a file, and its document type."""

MAPPINGS = ("UserMapping", "Profile", "DS302")
"""Attributes with descriptions of objects; the attribute `Dictionary` has their values."""


def read(root: XmlElement) -> Document:
    """Convert the first element of a file into a document."""
    attributes = {each.attributes.get("name", ""): each for each in root.children}
    whole = attributes.get("Dictionary", root)
    rows = [row for name in MAPPINGS if name in attributes for row in _rows(attributes[name])]
    valued = dict(sorted(_by_number(whole)))
    lists = listed(index for index in valued if index >= values.FIRST)
    sections = [
        *_about(root, attributes, _subs(valued.get(standard.IDENTITY))),
        *(section_at(name, whole, list_entries(found)) for name, found in lists.items()),
        *(section for index, each in valued.items() for section in _object(index, each, rows)),
    ]
    return Document({each.name.lower(): each for each in sections}, is_xml=True)


# A Python object as XML

CONSTANTS = {"True": "1", "False": "0", "None": ""}
COLLECTIONS = ("list", "tuple", "dict")


def _text(element: XmlElement | None) -> str:
    """Return a value as text; empty if there is none, or a collection."""
    if element is None or element.attributes.get("type") in COLLECTIONS:
        return ""
    written = element.attributes.get("value", element.text)
    return CONSTANTS.get(element.attributes.get("type", ""), written.strip('"'))


def _whole(element: XmlElement | None) -> int:
    """Return a whole number, at most the highest index; 0 for anything else."""
    number = parse_number(_text(element))
    return min(max(number.value, 0), 0xFFFF) if number else 0


def _items(element: XmlElement) -> dict[str, XmlElement]:
    """Return a dictionary's values by the texts of their keys."""
    pairs = (each.children for each in element.children if each.tag == "entry")
    return {_text(pair[0]): pair[1] for pair in pairs if len(pair) == 2}


def _by_number(element: XmlElement) -> Iterator[tuple[int, XmlElement]]:
    """Yield a dictionary's values by index."""
    for key, each in _items(element).items():
        number = parse_number(key)
        if number and 0 < number.value <= 0xFFFF:
            yield number.value, each


def _subs(each: XmlElement | None) -> list[XmlElement]:
    """Return an object's values from sub-index 1 on."""
    return each.children if each is not None and each.attributes.get("type") in COLLECTIONS else []


# Descriptions of objects

ALIKE = 4
"""Bit of `struct` for an array, whose sub-indices from 1 on have one description."""


class SubRow(NamedTuple):
    """Description of a sub-index, or of `repeated` equal ones."""

    name: str
    type: str
    access: str
    is_mappable: bool = False
    repeated: int = 1


class Row(NamedTuple):
    """Description of the objects at some indices."""

    indices: range
    name: str
    is_array: bool
    members: Sequence[SubRow]


def _rows(mapping: XmlElement) -> Iterator[Row]:
    for index, each in _by_number(mapping):
        said = _items(each)
        structure, step, most = (_whole(said.get(key)) for key in ("struct", "incr", "nbmax"))
        indices = range(index, index + step * most, step) if step and most else range(index, index + 1)
        members = [_member(_items(one)) for one in _subs(said.get("values"))]
        yield Row(indices, _text(said.get("name")), bool(structure & ALIKE), members)


def _member(said: Mapping[str, XmlElement]) -> SubRow:
    name, type_, access, pdo = (_text(said.get(key)) for key in ("name", "type", "access", "pdo"))
    return SubRow(name, type_, access, pdo == "1", max(1, _whole(said.get("nbmax"))))


COMPUTED = re.compile(r"(?P<words>[^%]*?)\s*(?:0x)?%.*\[.*\]")
"""Pattern of a name with computed numbers, such as `Read inputs 0x%X to 0x%X[(sub*8-7,sub*8)]`."""


def _named(name: str, number: int) -> str:
    """Return a name, with a plain number in place of computed ones."""
    match = COMPUTED.fullmatch(name)
    return f"{match['words']} {number}" if match else name


SDO = ("COB-ID client to server", "COB-ID server to client", "Node-ID of the partner")

NAMES: Mapping[Container[int], tuple[str, ...]] = {
    (0x1000,): ("Device type",),
    (0x1001,): ("Error register",),
    (0x1002,): ("Manufacturer status register",),
    (0x1003,): ("Pre-defined error field",),
    (0x1005,): ("COB-ID SYNC message",),
    (0x1006,): ("Communication cycle period",),
    (0x1007,): ("Synchronous window length",),
    (0x1008,): ("Manufacturer device name",),
    (0x1009,): ("Manufacturer hardware version",),
    (0x100A,): ("Manufacturer software version",),
    (0x100C,): ("Guard time",),
    (0x100D,): ("Life time factor",),
    (0x1010,): ("Store parameters",),
    (0x1011,): ("Restore default parameters",),
    (0x1012,): ("COB-ID time stamp message",),
    (0x1013,): ("High resolution time stamp",),
    (0x1014,): ("COB-ID EMCY",),
    (0x1015,): ("Inhibit time EMCY",),
    (0x1016,): ("Consumer heartbeat time",),
    (0x1017,): ("Producer heartbeat time",),
    (0x1018,): ("Identity object", "Vendor-ID", "Product code", "Revision number", "Serial number"),
    (0x1019,): ("Synchronous counter overflow value",),
    (0x1020,): ("Verify configuration", "Configuration date", "Configuration time"),
    (0x1029,): ("Error behaviour", "Communication error"),
    standard.SDO_SERVERS: ("SDO server parameter", *SDO),
    standard.SDO_CLIENTS: ("SDO client parameter", *SDO),
    **{
        each: (f"{key.name} communication parameter", *standard.PDO_SETTINGS)
        for key, each in COMMUNICATION_RECORDS.items()
    },
    **{each: (f"{key.name} mapping parameter",) for key, each in MAPPING_RECORDS.items()},
}
"""Names of objects of CiA 301, each followed by those of its sub-indices from 1 on."""

ARRAYS = (0x1003, 0x1010, 0x1011, 0x1016, 0x1029)
MAPPABLE = (0x1001, 0x1002)


def _of_standard(index: int, count: int) -> Row:
    """Return CiA 301's description of an object with `count` sub-indices."""
    name, *subs = next((names for indices, names in NAMES.items() if index in indices), (f"Object {index:04X}",))
    numbered = [*subs, *(f"{name} {sub}" for sub in range(len(subs) + 1, count + 1))]
    names = ["Highest sub-index supported", *numbered] if count else [name]
    members = []
    for sub, each in enumerate(names):
        known = next((row for row in standard.KNOWN if index in row.indices and sub in row.subs), None)
        is_fixed = bool(known and "ro" in known.access) or index in standard.SDO_SERVERS
        is_counted = count and not sub and index not in (standard.ERROR_FIELD, *values.MAPPINGS)
        type_ = known.type if known else None
        if type_ is None and count and not sub:
            type_ = values.UNSIGNED8
        access = "ro" if is_fixed or is_counted else "rw"
        members.append(SubRow(each, str(type_.code) if type_ else "", access, index in MAPPABLE))
    return Row(range(index, index + 1), name, index in ARRAYS, members)


# Sections


def _about(root: XmlElement, attributes: Mapping[str, XmlElement], identity: Sequence[XmlElement]) -> Iterator[Section]:
    said = {name: _text(each) for name, each in attributes.items()}
    yield section_at("FileInfo", root, {"EDSVersion": "4.0", "Description": said.get("Description", "")})
    kind = said.get("Type", "")
    starts = {f"SimpleBootUp{each}": str(int(kind == each.lower())) for each in ("Master", "Slave")}
    numbers = dict(zip(("VendorNumber", "ProductNumber", "RevisionNumber"), map(_text, identity)))
    rates = dict.fromkeys(BIT_RATE_KEYS, "1")  # as in that editor's EDS files
    yield section_at("DeviceInfo", root, {"ProductName": said.get("Name", ""), **numbers, **rates, **starts})


def _object(index: int, each: XmlElement, rows: Sequence[Row]) -> Iterator[Section]:
    subs = _subs(each)
    name = f"{index:04X}"
    row = next((row for row in rows if index in row.indices), None) or _of_standard(index, len(subs))
    members = [member for member in row.members for _ in range(member.repeated)]
    title = _named(row.name, row.indices.index(index) + 1)
    if each.attributes.get("type") not in COLLECTIONS:
        yield section_at(name, each, _variable(index, 0, each, members[:1]) | {"ParameterName": title})
        return
    code = ObjectCode.ARRAY if row.is_array else ObjectCode.RECORD
    head = {"ParameterName": title, "ObjectType": f"0x{code.value:X}", "SubNumber": str(len(subs) + 1)}
    yield section_at(name, each, head)
    for sub, one in enumerate([each, *subs]):
        said = _variable(index, sub, one, members[sub : sub + 1])
        yield section_at(f"{name}sub{sub:X}", one, said | ({} if sub else {"DefaultValue": str(len(subs))}))


def _variable(index: int, sub: int, each: XmlElement, said: Sequence[SubRow]) -> dict[str, str]:
    """Return the entries of a variable, as far as it is described."""
    entries = {"ObjectType": "0x7", "DefaultValue": _value(index, _text(each))}
    for member in said:
        number = parse_number(member.type)
        entries |= {"ParameterName": _named(member.name, sub), "AccessType": member.access}
        entries |= {"PDOMapping": str(int(member.is_mappable))}
        entries |= {"DataType": f"0x{number.value:04X}"} if number and number.value > 0 else {}
    return entries


COB_ID = re.compile(r"\{True:.*,False:(?P<other>\w+)\}\[base<4\]")
"""Pattern of the formula for a PDO's COB-ID: the default one for the first four PDOs."""


def _value(index: int, text: str) -> str:
    match = COB_ID.fullmatch(text)
    if match is None:
        return text.removesuffix("L") if text[:1].isdecimal() else text.replace("self.ID", NODE_ID)
    bases = next((DEFAULT_PDO_BASES[key] for key, each in COMMUNICATION_RECORDS.items() if index in each), range(0))
    number = index & values.PDO_COUNT - 1
    return f"{NODE_ID}+0x{bases[number]:X}" if number < len(bases) else match["other"]
