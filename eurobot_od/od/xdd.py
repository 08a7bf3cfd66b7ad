"""Reads a device's file in XML: XDD and XDC (CiA 311), and `_project.xml` of CANopenNode before version 4.

Every section and entry has the line of its element.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TypeAlias

from eurobot_od.od import document as cia306
from eurobot_od.od import values
from eurobot_od.od.description import list_entries, listed
from eurobot_od.od.document import Document, Odd, Oddity, Section, section_at
from eurobot_od.od.values import parse_number
from eurobot_od.od.xml_tree import XmlElement


def read(root: XmlElement) -> Document:
    """Convert the first element of a file into a document."""
    parameters = _Parameters(root)
    objects, lost = _addressed(root.all("CANopenObject"), "index")
    oddities = lost + [oddity for _, each in objects for oddity in _subs(each)[1]]
    disabled = ((index, each) for index, each in objects if parameters.is_disabled(each))
    oddities += [Oddity(Odd.DISABLED, each.line, each.column, f"0x{index:04X}") for index, each in disabled]
    sections = _sections(root, [pair for pair in objects if not parameters.is_disabled(pair[1])], parameters)
    return Document({each.name.lower(): each for each in sections}, oddities, is_xml=True)


def _keys(*same: str, **others: str) -> dict[str, str]:
    """Return keys of an EDS by names in XML; `same` begin with a small letter in XML, `others` have other names."""
    return {name: name[:1].upper() + name[1:] for name in same} | others


BODY_INFO = _keys("fileName", "fileVersion", fileCreator="CreatedBy", fileModifiedBy="ModifiedBy")
"""Keys in [FileInfo] by attribute of a profile's body."""

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
"""Keys in [DeviceInfo] by attribute of the general and the master's features."""

COMMISSIONED = _keys(
    *("nodeID", "nodeName", "networkName", "cANopenManager"), actualBaudRate="Baudrate", networkNumber="NetNumber"
)
DUMMY = re.compile(r"(Dummy[0-9A-Fa-f]{4})=([01])")
BOOLEANS = {"true": "1", "false": "0"}
MAPPED_ACCESS = {("rw", "TPDO"): "rwr", ("rw", "RPDO"): "rww"}
"""Access types of an EDS by access and mapping, which are separate in CiA 311."""

VALUES = _keys("lowLimit", "highLimit", "defaultValue", actualValue="ParameterValue")
"""Keys by attribute of an object's limits and values."""

PARAMETER_ACCESS = {
    "const": "const",
    "read": "ro",
    "write": "wo",
    "readWrite": "rw",
    "readWriteInput": "rwr",
    "readWriteOutput": "rww",
    "noAccess": values.NO_ACCESS_IN_EDS,
}
"""Access types by `access` of a parameter of the application process."""

BITS = values.OCTET_STRING.code
MOST_TEMPLATES = 10
"""Most levels of templates, and of derived types; schemas have one or two."""

SIMPLE_TYPES = {
    each: code
    for code, names in (
        (0x01, "BOOL"), (0x02, "SINT CHAR"), (0x03, "INT"), (0x04, "DINT"), (0x15, "LINT"), (0x05, "USINT BYTE"),
        (0x06, "UINT WORD"), (0x07, "UDINT DWORD"), (0x1B, "ULINT LWORD"), (0x08, "REAL"), (0x11, "LREAL"),
        (0x09, "STRING"), (0x0B, "WSTRING"), (0x0A, "BITSTRING"),
    )
    for each in names.split()
}  # fmt: skip
"""CANopen's data types by those of the application process (IEC 61131-3)."""


def _sections(root: XmlElement, objects: Sequence[Addressed], parameters: _Parameters) -> Iterator[Section]:
    yield _file_info(root)
    yield _device_info(root)
    dummies = [match for each in root.all("dummy") if (match := DUMMY.fullmatch(each.attributes.get("entry", "")))]
    if dummies:
        yield section_at("DummyUsage", root.first("dummyUsage") or root, {each[1]: each[2] for each in dummies})
    yield from _lists(root.first("CANopenObjectList") or root, [index for index, _ in objects])
    for index, each in objects:
        yield from _object(index, each, parameters)
    commissioning = root.first("deviceCommissioning")
    if commissioning:
        # The schema has `NodeID`, many writers have `nodeID`.
        said = {key[:1].lower() + key[1:]: value for key, value in commissioning.attributes.items()}
        yield section_at(cia306.COMMISSIONING, commissioning, _renamed(said, COMMISSIONED))


ADDRESS = {name: re.compile(f"(?:0x)?([0-9A-Fa-f]{{1,{most}}})") for name, most in (("index", 4), ("subIndex", 2))}
"""Patterns of index and sub-index in hexadecimal; some editors write 0x in front."""

Addressed: TypeAlias = tuple[int, XmlElement]
"""An element with its index or sub-index."""


def _addressed(elements: Iterable[XmlElement], name: str) -> tuple[list[Addressed], list[Oddity]]:
    """Return the elements with an address, and oddities about the others, which are lost."""
    found: list[Addressed] = []
    lost: list[Oddity] = []
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
    """Return attributes under the keys of an EDS, with 0 and 1 for `false` and `true`."""
    found = ((key, attributes[name]) for name, key in names.items() if name in attributes)
    return {key: BOOLEANS.get(value, value).removesuffix(" Kbps") for key, value in found}


def _file_info(root: XmlElement) -> Section:
    bodies = (each for each in root.all("ProfileBody") if each.first("CANopenObjectList"))
    body = next(bodies, None) or root.first("file") or root
    said = _renamed(body.attributes, BODY_INFO)
    for name, key in DATES.items():
        year, _, day = body.attributes.get(name, "").partition("-")
        said |= {key: f"{day}-{year}"} if day else {}  # 2014-05-28 is 05-28-2014 in an EDS
    for name, key in TIMES.items():
        hour, _, rest = body.attributes.get(name, "").partition(":")
        if hour.isdecimal() and len(hour) <= 2 and rest:
            # 17:05 is 05:05PM in an EDS, and 00:05 is 12:05AM (CiA 306-1).
            said[key] = f"{(int(hour) + 11) % 12 + 1:02}:{rest[:2]}{'AM' if int(hour) < 12 else 'PM'}"
    return section_at("FileInfo", body, {**said, "EDSVersion": "4.0"})


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
    return section_at("DeviceInfo", identity or root, said)


def _lists(at: XmlElement, indices: Iterable[int]) -> Iterator[Section]:
    # Lower indices are data types, which are in no list of CiA 306.
    for name, found in listed(each for each in indices if each >= values.FIRST).items():
        yield section_at(name, at, list_entries(found))


def _object(index: int, each: XmlElement, parameters: _Parameters) -> Iterator[Section]:
    """Yield the sections of an object and its sub-indices."""
    name = f"{index:04X}"
    subs = _subs(each)[0]
    if not subs and "subNumber" not in each.attributes:
        yield section_at(name, each, _entries(each, parameters))
        return
    head = {key: text for key, text in _entries(each, parameters).items() if key in HEAD or key.startswith(PROPERTY)}
    # SubNumber does not include sub-index 0xFF, the structure (CiA 306-1).
    yield section_at(name, each, {**head, "SubNumber": str(sum(sub != values.STRUCTURE for sub, _ in subs))})
    inherited = {key: each.attributes[key] for key in INHERITED if key in each.attributes}
    for sub, at in subs:
        is_inheriting = sub and "uniqueIDRef" not in at.attributes
        whole = at._replace(attributes={**inherited, **at.attributes}) if is_inheriting else at
        yield section_at(f"{name}sub{sub:X}", at, _entries(whole, parameters))


def _subs(each: XmlElement) -> tuple[list[Addressed], list[Oddity]]:
    return _addressed((sub for sub in each.children if sub.tag == "CANopenSubObject"), "subIndex")


def _entries(each: XmlElement, parameters: _Parameters) -> dict[str, str]:
    """Return the entries of an object or sub-index, and of the parameter that it refers to."""
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
    # An EDS has no `true` and `false`.
    if parse_number(entries.get("DataType", "")) == values.Number(values.BOOLEAN.code):
        entries = {key: BOOLEANS.get(text, text) for key, text in entries.items()}
    return entries


INHERITED = ("dataType", "accessType", "PDOmapping")
"""Attributes of an array that its members inherit in `_project.xml`."""

HEAD = ("ParameterName", "ObjectType", "ObjFlags", "Denotation")
"""Keys of an object with sub-indices."""

PROPERTY = "CO_"
"""Prefix of CANopenNode's own properties, such as CO_storageGroup."""

PARAMETER_VALUES = (("defaultValue", "DefaultValue"), ("actualValue", "ParameterValue"))
SCALE = {"multiplier": "Factor", "offset": "Offset"}
PARAMETER_LISTS = ("parameterList", "templateList", "dataTypeList", "unitList")


def _limits(parameter: XmlElement) -> dict[str, str]:
    """Return the lowest and the highest value of a parameter.

    `allowedValues` may contain several ranges and single values (CiA 311, schema 1.1); some editors write a range
    directly below the parameter. An EDS has one range, which contains all of them.
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
    """Parameters of the application process, each read once."""

    def __init__(self, root: XmlElement) -> None:
        lists = [each for tag in PARAMETER_LISTS for each in root.all(tag)]
        self._elements = {each.attributes.get("uniqueID", ""): each for found in lists for each in found.children}
        self._said: dict[str, dict[str, str]] = {}
        self._disabled = {name for name, each in self._elements.items() if any(map(_disables, each.children))}

    def said(self, name: str) -> dict[str, str]:
        """Return type, access and values of a parameter, also from its template; empty for an unknown one."""
        if name not in self._said:
            parameter = self._elements.get(name)
            # The default of `access` is `read` (CiA 311, schema 1.1, t_parameter and t_parameterTemplate).
            access = {"AccessType": "ro"} if parameter else {}
            self._said[name] = {**access, **self._written(parameter, MOST_TEMPLATES)} if parameter else {}
        return self._said[name]

    def is_disabled(self, each: XmlElement) -> bool:
        """Return whether an object is disabled in CANopenEditor, which then omits it from EDS and device."""
        said = each.attributes
        return said.get("disabled") == "true" or said.get("uniqueIDRef", "") in self._disabled

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
        """Return unit, factor and offset of a parameter, from its own unit or a referenced one."""
        said = {key: parameter.attributes[name] for name, key in SCALE.items() if name in parameter.attributes}
        unit = parameter.child("unit") or self._elements.get(parameter.attributes.get("unitIDRef", ""))
        if unit is None:
            return said
        # `multiplier` may be an attribute of the unit or of the parameter.
        multiplier = unit.attributes.get("multiplier") or said.get("Factor", "")
        label = unit.child("label")
        text = label.text if label else unit.attributes.get("unitURI", "")
        return said | ({"Factor": multiplier} if multiplier else {}) | ({"Unit": text} if text else {})

    def _type(self, each: XmlElement, depth: int) -> int | None:
        """Return the simple type of a parameter, or of a derived type."""
        simple = next((SIMPLE_TYPES[one.tag] for one in each.children if one.tag in SIMPLE_TYPES), None)
        named = each.child("dataTypeIDRef")
        derived = self._elements.get(named.attributes.get("uniqueIDRef", "")) if named else None
        is_whole = derived is not None and derived.tag not in ("array", "struct")
        return self._type(derived, depth - 1) if simple is None and derived and is_whole and depth else simple
