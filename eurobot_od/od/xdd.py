"""Reads a device description in XML (CiA 311: XDD, and XDC with a device's values) as the sections of an EDS or DCF.

Every section and entry has the line of the element that says it. The XML is read by expat alone. A file with a document
type, and so with any entity, is not read as a device description.

As in `document`, reading never raises; what is not XML becomes an `Oddity`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple
from xml.parsers import expat

from eurobot_od.od import keys, values
from eurobot_od.od.document import Document, Entry, Odd, Oddity, Section
from eurobot_od.od.standard import MANDATORY
from eurobot_od.od.values import parse_number

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


class _Refused(Exception):
    """What a device description never has; the text says what."""


def read(data: bytes) -> Document:
    """Read the bytes of an XDD or XDC; what is not XML gives a document without sections."""
    try:
        root = parse(data)
    except expat.ExpatError as error:
        return Document(
            {}, [Oddity(Odd.XML, error.lineno, error.offset + 1, expat.ErrorString(error.code))], is_xml=True
        )
    except _Refused as error:
        what, line = error.args
        return Document({}, [Oddity(Odd.XML, line, 1, what)], is_xml=True)
    sections = {each.name.lower(): each for each in _sections(root)}
    return Document(sections, is_xml=True)


def parse(data: bytes) -> XmlElement:
    """Read XML into its elements; raises ExpatError, _Refused."""
    parser = expat.ParserCreate()
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

BODY_INFO = {
    "fileName": "FileName",
    "fileCreator": "CreatedBy",
    "fileModifiedBy": "ModifiedBy",
    "fileVersion": "FileVersion",
}
"""Attributes of a profile's body, and their keys in [FileInfo]."""

DATES = {"fileCreationDate": "CreationDate", "fileModificationDate": "ModificationDate"}
TIMES = {"fileCreationTime": "CreationTime", "fileModificationTime": "ModificationTime"}

IDENTITY = {
    "vendorName": "VendorName",
    "vendorID": "VendorNumber",
    "productName": "ProductName",
    "productID": "ProductNumber",
    "orderNumber": "OrderCode",
}
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

COMMISSIONED = {
    "nodeID": "NodeID",
    "nodeName": "NodeName",
    "actualBaudRate": "Baudrate",
    "networkNumber": "NetNumber",
    "networkName": "NetworkName",
    "CANopenManager": "CANopenManager",
}
DUMMY = re.compile(r"(Dummy[0-9A-Fa-f]{4})=([01])")
BREAKS = re.compile(r"[\x00-\x08\x0a-\x1f\x7f]")
BOOLEANS = {"true": "1", "false": "0"}
MAPPED_ACCESS = {("rw", "TPDO"): "rwr", ("rw", "RPDO"): "rww"}
"""Access types of an EDS by access and mapping, which CiA 311 has apart."""

VALUES = {
    "lowLimit": "LowLimit",
    "highLimit": "HighLimit",
    "defaultValue": "DefaultValue",
    "actualValue": "ParameterValue",
    "denotation": "Denotation",
}
"""Attributes of an object, and their keys."""

PARAMETER_ACCESS = {
    "const": "const",
    "read": "ro",
    "write": "wo",
    "readWrite": "rw",
    "readWriteInput": "rwr",
    "readWriteOutput": "rww",
}
"""Access of a parameter of the application process."""

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


def _sections(root: XmlElement) -> Iterator[Section]:
    objects = [each for each in root.all("CANopenObject") if _digits(each, "index") is not None]
    yield _file_info(root)
    yield _device_info(root)
    dummies = [match for each in root.all("dummy") if (match := DUMMY.fullmatch(each.attributes.get("entry", "")))]
    if dummies:
        yield _section("DummyUsage", root.first("dummyUsage") or root, {each[1]: each[2] for each in dummies})
    yield from _lists(root.first("CANopenObjectList") or root, objects)
    parameters = {each.attributes.get("uniqueID", ""): each for each in root.all("parameter")}
    for each in objects:
        yield from _object(each, parameters)
    commissioning = root.first("deviceCommissioning")
    if commissioning:
        yield _section(keys.COMMISSIONING, commissioning, _renamed(commissioning.attributes, COMMISSIONED))


def _section(name: str, at: XmlElement, entries: Mapping[str, str]) -> Section:
    # A line end in a value, which XML can have, would make two lines of an EDS.
    lines = {key: BREAKS.sub(" ", value).strip() for key, value in entries.items()}
    said = {key.lower(): Entry(key, value, at.line, at.column) for key, value in lines.items()}
    return Section(name, at.line, at.column, said)


def _digits(each: XmlElement, name: str, most: int = 4) -> int | None:
    """Return the number that an attribute has in hexadecimal digits; None for anything else."""
    text = each.attributes.get(name, "")
    return int(text, 16) if 0 < len(text) <= most and not text.strip(values.DIGITS[16]) else None


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
    said |= {key: str(int(key.removeprefix("BaudRate_") in rates)) for key in keys.BIT_RATE_KEYS}
    for tag in ("CANopenGeneralFeatures", "CANopenMasterFeatures"):
        features = root.first(tag)
        said |= _renamed(features.attributes, FEATURES) if features else {}
    return _section("DeviceInfo", identity or root, said)


def _lists(at: XmlElement, objects: Iterable[XmlElement]) -> Iterator[Section]:
    indices: dict[str, list[int]] = {name: [] for name in keys.OBJECT_LISTS}
    for each in objects:
        index = _digits(each, "index") or 0
        kind = 0 if index in MANDATORY else 2 if index in values.MANUFACTURER else 1
        if index >= values.FIRST:  # below are the data types, which no list of CiA 306 has
            indices[keys.OBJECT_LISTS[kind]].append(index)
    for name, found in indices.items():
        rows = {str(number): f"0x{index:04X}" for number, index in enumerate(found, start=1)}
        yield _section(name, at, {"SupportedObjects": str(len(found)), **rows})


def _object(each: XmlElement, parameters: Mapping[str, XmlElement]) -> Iterator[Section]:
    """Give the sections of an object and its sub-indices."""
    name, subs = f"{_digits(each, 'index') or 0:04X}", list(each.all("CANopenSubObject"))
    if not subs and "subNumber" not in each.attributes:
        yield _section(name, each, _entries(each, parameters))
        return
    head = {key: text for key, text in _entries(each, parameters).items() if key in ("ParameterName", "ObjectType")}
    # SubNumber does not count sub-index 0xFF, the structure (CiA 306-1).
    yield _section(name, each, {**head, "SubNumber": str(sum(_sub(sub) != values.STRUCTURE for sub in subs))})
    for sub in subs:
        yield _section(f"{name}sub{_sub(sub):X}", sub, _entries(sub, parameters))


def _sub(each: XmlElement) -> int:
    return _digits(each, "subIndex", 2) or 0


def _entries(each: XmlElement, parameters: Mapping[str, XmlElement]) -> dict[str, str]:
    """Return what an object, or a sub-index, says, with what the parameter that it refers to says."""
    said = each.attributes
    parameter = parameters.get(said.get("uniqueIDRef", ""))
    entries = {"ParameterName": said.get("name", "")}
    kind = parse_number(said.get("objectType", ""))
    entries |= {"ObjectType": f"0x{kind.value:X}"} if kind and kind.value >= 0 else {}
    entries |= _of_parameter(parameter) if parameter else {}
    if "dataType" in said:
        entries["DataType"] = f"0x{said['dataType'].zfill(4).upper()}"
    mapping = said.get("PDOmapping", "no")
    access = said.get("accessType") or entries.get("AccessType", "")
    if access:
        entries["AccessType"] = MAPPED_ACCESS.get((access, mapping), access)
    if "PDOmapping" in said or parameter:
        entries["PDOMapping"] = str(int(mapping != "no"))
    entries |= {key: said[name] for name, key in VALUES.items() if name in said}
    if "objFlags" in said:
        entries["ObjFlags"] = f"0x{said['objFlags']}"
    # XML writes true and false; an EDS has no such words.
    if parse_number(entries.get("DataType", "")) == values.Number(values.BOOLEAN.code):
        entries = {key: BOOLEANS.get(text, text) for key, text in entries.items()}
    return entries


def _of_parameter(parameter: XmlElement) -> dict[str, str]:
    """Return type, access and values of a parameter of the application process."""
    said: dict[str, str] = {}
    type_ = next((SIMPLE_TYPES[each.tag] for each in parameter.children if each.tag in SIMPLE_TYPES), None)
    if type_ is not None:
        said["DataType"] = f"0x{type_:04X}"
    if parameter.attributes.get("access") in PARAMETER_ACCESS:
        said["AccessType"] = PARAMETER_ACCESS[parameter.attributes["access"]]
    for tag, key in (("defaultValue", "DefaultValue"), ("actualValue", "ParameterValue")):
        each = parameter.first(tag)
        if each and "value" in each.attributes:
            said[key] = each.attributes["value"]
    limits = parameter.first("range")
    for tag, key in (("minValue", "LowLimit"), ("maxValue", "HighLimit")):
        each = limits.first(tag) if limits else None
        if each and "value" in each.attributes:
            said[key] = each.attributes["value"]
    return said
