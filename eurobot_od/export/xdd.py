"""A device's EDS or DCF as CANopen device description in XML (CiA 311, schema 1.1; ISO 15745-1 profiles).

The device profile has the device and its manufacturer, the communication profile the objects with all their entries.
Values keep `$NODEID`. Only elements that the schema declares globally have its namespace, `co:`. Characters that XML
does not allow become U+FFFD.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from datetime import datetime
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from eurobot_od.od import formats, xdd
from eurobot_od.od.description import SIMPLE, DescribedDevice, DescribedVariable, ObjectCode
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import BIT_RATES, Section
from eurobot_od.od.units import RAW, UnitScale, digits, own_scale_of
from eurobot_od.od.values import COMMUNICATION_RECORDS, DOMAIN, DUMMIES, NO_ACCESS, PdoDirection

SCHEMA = "http://www.canopen.org/xml/1.1"
INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"

NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that cannot be in an XML file (XML 1.0, production 2)."""

SAME_ACCESS = ("const", "ro", "wo", "rw")
MAPPED_ACCESS = {access: split for split, access in xdd.MAPPED_ACCESS.items()}
"""Access and mapping in an XDD, by access type of an EDS."""

COMMISSIONED = {
    "nodeID": ("nodeid", "0"),
    "nodeName": ("nodename", ""),
    "actualBaudRate": ("baudrate", ""),
    "networkNumber": ("netnumber", "0"),
    "networkName": ("networkname", ""),
}
"""Attributes of a commissioned device: key in a DCF, and default value."""

PARAMETER_ACCESS = {access: name for name, access in xdd.PARAMETER_ACCESS.items()} | {NO_ACCESS: "noAccess"}
"""Access of a parameter, by access type of an EDS."""

PARAMETER_TYPES = {code: name for name, code in reversed(xdd.SIMPLE_TYPES.items())}
"""Data types of the application process, by CANopen's code."""

NO_DAY = "1970-01-01"
"""Date of a file without one, which the schema requires."""


def xdd_text(dictionary: Dictionary) -> str:
    """Return the XDD of a device; raises DictionaryError for an unreadable value."""
    return _XddWriter(dictionary).text()


def _element(tag: str, attributes: Mapping[str, str | None], *children: Element, text: str | None = None) -> Element:
    made = Element(tag, {name: NOT_XML.sub("\ufffd", value) for name, value in attributes.items() if value is not None})
    made.text = None if text is None else NOT_XML.sub("\ufffd", text)
    made.extend(children)
    return made


def _texts(texts: Mapping[str, str | None]) -> list[Element]:
    """Return an element for each text."""
    return [_element(tag, {}, text=text) for tag, text in texts.items()]


def _parameter_id(index: int, sub: int | None = None) -> str:
    return f"UID_{index:04X}" + ("" if sub is None else f"{sub:02X}")


def _properties(section: Section) -> list[Element]:
    """Return CANopenNode's own properties of an object."""
    entries = (each for key, each in section.entries.items() if key.startswith(xdd.PROPERTY.lower()))
    return [_element("co:property", {"name": each.key, "value": each.value}) for each in entries]


def _boolean(flag: bool) -> str:
    return "true" if flag else "false"


class _XddWriter:
    """Writer of one file."""

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._device = dictionary.device
        # Unlike the normal form, an XDD may have manufacturer-specific types and values.
        self._said = DescribedDevice(formats.read(dictionary.content))

    def text(self) -> str:
        names = {"xmlns:co": SCHEMA, "xmlns:xsi": INSTANCE}
        rates = (f"{rate} Kbps" for rate in BIT_RATES if self._info(f"baudrate_{rate}"))
        supported = (_element("supportedBaudRate", {"value": each}) for each in rates)
        transport = _element("TransportLayers", {}, _element("PhysicalLayer", {}, _element("baudRate", {}, *supported)))
        objects = _element("co:CANopenObjectList", {}, *map(self._object, self._dictionary.members))
        used = ((f"Dummy{code:04X}", self._file("dummyusage", f"dummy{code:04x}") == "1") for code in DUMMIES)
        dummies = (_element("dummy", {"entry": f"{name}={int(is_used)}"}) for name, is_used in used)
        application = _element("ApplicationLayers", {}, objects, _element("dummyUsage", {}, *dummies))
        network = [application, transport, self._management()]  # the schema wants them in this order
        profiles = (
            self._profile("Device", "CANopen device profile", self._device_parts()),
            self._profile("CommunicationNetwork", "CANopen communication network profile", network),
        )
        whole = _element("co:ISO15745ProfileContainer", names, *profiles)
        ElementTree.indent(whole)
        return f'<?xml version="1.0" encoding="utf-8"?>\n{ElementTree.tostring(whole, "unicode")}\n'

    def _file(self, section: str, key: str) -> str:
        return self._device.document.text(section, key)

    def _info(self, key: str) -> int:
        """Return a number of [DeviceInfo], 0 if there is none."""
        section = self._device.section("deviceinfo")
        number = DescribedVariable(0, 0, section).number(key) if section else None
        return number.value if number else 0

    # Profiles

    def _profile(self, class_id: str, title: str, content: list[Element]) -> Element:
        unnamed = dict.fromkeys(("ProfileName", "ProfileSource"))
        named = {"ProfileIdentification": title, "ProfileRevision": "1.1", **unnamed, "ProfileClassID": class_id}
        reference = _texts({"ISO15745Part": "1", "ISO15745Edition": "1", "ProfileTechnology": "CANopen"})
        head = [*_texts(named), _element("ISO15745Reference", {}, *reference)]
        body = {"xsi:type": f"co:ProfileBody_{class_id}_CANopen", "formatName": "CANopen", "formatVersion": "1.0"}
        version = re.match(r"\d{1,3}", self._file("fileinfo", "fileversion"))  # UNSIGNED8 in CiA 306
        origin = {
            "fileName": self._dictionary.file.with_suffix(".xdd").name,
            "fileCreator": self._file("fileinfo", "createdby"),
            "fileCreationDate": NO_DAY,
            "fileVersion": version.group() if version else "0",
            "fileModifiedBy": self._file("fileinfo", "modifiedby") or None,
        }
        moments = dict((*self._moments("Creation"), *self._moments("Modification")))
        parts = _element("ProfileHeader", {}, *head), _element("ProfileBody", {**body, **origin, **moments}, *content)
        return _element("co:ISO15745Profile", {}, *parts)

    def _moments(self, what: str) -> Iterator[tuple[str, str]]:
        """Yield date and time of creation or modification, which CiA 306 writes `11-23-2013` and `09:45PM`."""
        for key, form, part in (("Date", "%m-%d-%Y", datetime.date), ("Time", "%I:%M%p", datetime.time)):
            with suppress(ValueError):
                read = datetime.strptime(self._file("fileinfo", f"{what}{key}".lower()), form)
                yield f"file{what}{key}", part(read).isoformat()

    def _device_parts(self) -> list[Element]:
        # In decimal, as CANopenEditor requires.
        texts = {
            "co:vendorName": self._file("deviceinfo", "vendorname"),
            "co:vendorID": str(self._info("vendornumber")),
            "co:productName": self._file("deviceinfo", "productname"),
            "co:productID": str(self._info("productnumber")),
            "co:orderNumber": self._file("deviceinfo", "ordercode"),
        }
        identity = _element("co:DeviceIdentity", {}, *_texts(texts))
        # The schema requires at least one characteristic: the name of the source file.
        about = (("co:characteristicName", "Made from"), ("co:characteristicContent", self._dictionary.file.name))
        parts = (_element(tag, {}, _element("label", {"lang": "en"}, text=text)) for tag, text in about)
        listed = _element("co:characteristicsList", {}, _element("co:characteristic", {}, *parts))
        function = _element("co:DeviceFunction", {}, _element("co:capabilities", {}, listed))
        return [identity, function, *self._application_process()]

    def _application_process(self) -> Iterator[Element]:
        """Yield the parameters of objects: only a parameter can say `noAccess`, a unit, or CANopenNode's properties."""
        listed = []
        for index in self._dictionary.members:
            described = self._device.objects[index]
            if described.code not in SIMPLE and (properties := _properties(described.place)):
                label = _element("label", {"lang": "en"}, text=described.name)
                listed.append(_element("co:parameter", {"uniqueID": _parameter_id(index)}, label, *properties))
            listed += [self._parameter(each) for each in described.variables() if self._is_parameter(each)]
        if listed:
            yield _element("co:ApplicationProcess", {}, _element("co:parameterList", {}, *listed))

    def _is_parameter(self, variable: DescribedVariable) -> bool:
        is_said = variable.access == NO_ACCESS or bool(_properties(variable.section))
        return is_said or self._scale(variable) != RAW

    def _scale(self, variable: DescribedVariable) -> UnitScale:
        known = self._dictionary.variable((variable.index, variable.sub))
        return own_scale_of(known) if known is not None else RAW

    def _parameter(self, variable: DescribedVariable) -> Element:
        type_ = variable.type.code if variable.type else DOMAIN.code
        scale = self._scale(variable)
        offset = {"offset": digits(scale.offset)} if scale.offset else {}
        access = PARAMETER_ACCESS.get(variable.access)
        names = {"uniqueID": _parameter_id(variable.index, variable.sub), "access": access}
        label = _element("label", {"lang": "en"}, text=variable.name)
        parts = [label, _element(PARAMETER_TYPES.get(type_, "BITSTRING"), {})]
        if scale != RAW:
            unit = _element("label", {"lang": "en"}, text=scale.unit)
            parts.append(_element("co:unit", {"multiplier": digits(scale.factor), "unitURI": ""}, unit))
        return _element("co:parameter", {**names, **offset}, *parts, *_properties(variable.section))

    # Communication

    def _management(self) -> Element:
        general = {
            "granularity": str(min(max(self._info("granularity"), 0), 64)),  # its range in CiA 306-1
            "nrOfRxPDO": self._count(PdoDirection.RPDO),
            "nrOfTxPDO": self._count(PdoDirection.TPDO),
            "groupMessaging": _boolean(bool(self._info("groupmessaging"))),
            "bootUpSlave": _boolean(bool(self._info("simplebootupslave"))),
            "layerSettingServiceSlave": _boolean(bool(self._info("lss_supported"))),
        }
        master = {"bootUpMaster": _boolean(bool(self._info("simplebootupmaster")))}
        parts = [_element("CANopenGeneralFeatures", general), _element("CANopenMasterFeatures", master)]
        section = self._device.commissioning
        if section and section.text("nodeid"):  # a DCF; an EDS is not for one particular device
            texts = {name: section.text(key) or nothing for name, (key, nothing) in COMMISSIONED.items()}
            is_manager = DescribedVariable(0, 0, section).number("canopenmanager") == (1, False)
            parts.append(_element("deviceCommissioning", {**texts, "CANopenManager": _boolean(is_manager)}))
        return _element("NetworkManagement", {}, *parts)

    def _count(self, direction: PdoDirection) -> str:
        return str(sum(index in COMMUNICATION_RECORDS[direction] for index in self._dictionary.members))

    # Objects

    def _object(self, index: int) -> Element:
        described = self._device.objects[index]
        code = (described.code or ObjectCode.VAR).value
        attributes: dict[str, str | None] = {"index": f"{index:04X}", "name": described.name, "objectType": str(code)}
        if described.code in SIMPLE:
            (only,) = described.subs.values()
            return _element("CANopenObject", {**attributes, **self._variable(only)})
        listed = []
        for sub, each in described.subs.items():
            is_domain = each.number("objecttype") == (ObjectCode.DOMAIN.value, False) or each.type is DOMAIN
            type_ = str((ObjectCode.DOMAIN if is_domain else ObjectCode.VAR).value)
            named = {"subIndex": f"{sub:02X}", "name": each.name, "objectType": type_}
            listed.append(_element("CANopenSubObject", {**named, **self._variable(each)}))
        if _properties(described.place):
            attributes["uniqueIDRef"] = _parameter_id(index)
        attributes |= self._remarks(DescribedVariable(index, 0, described.place))
        return _element("CANopenObject", {**attributes, "subNumber": str(len(listed))}, *listed)

    def _variable(self, variable: DescribedVariable) -> dict[str, str | None]:
        access, mapping = MAPPED_ACCESS.get(variable.access, (variable.access, "optional"))
        return {
            "dataType": self._type(variable),
            "accessType": access if access in SAME_ACCESS else None,
            "uniqueIDRef": _parameter_id(variable.index, variable.sub) if self._is_parameter(variable) else None,
            "PDOmapping": mapping if variable.is_mappable else "no",
            **{name: self._value(variable, key.lower()) for name, key in xdd.VALUES.items()},
            **self._remarks(variable),
        }

    def _remarks(self, each: DescribedVariable) -> dict[str, str | None]:
        """Return what an object of any kind, and a sub-index, may say."""
        flags = each.number("objflags")
        return {
            "denotation": each.section.text("denotation") or None,
            "objFlags": f"{flags.value:04X}" if flags and 0 <= flags.value <= 0xFFFF else None,
        }

    def _type(self, variable: DescribedVariable) -> str:
        """Return the code of a data type: the file's own, which may be a maker's, or else the basic one."""
        said = self._said.variable(variable.index, variable.sub)
        own = said.number("datatype") if said and said.type is None else None
        if own and not own.relative and 0 < own.value <= 0xFFFF:
            return f"{own.value:04X}"
        return f"{(variable.type or DOMAIN).code:02X}"

    def _value(self, variable: DescribedVariable, key: str) -> str | None:
        """Return an entry as text: a whole number in the form of CiA 306, anything else unchanged."""
        entry = variable.section.entries.get(key)
        if entry is None:
            said = self._said.variable(variable.index, variable.sub)
            return (said and said.section.text(key)) or None
        text = entry.value  # may be empty: a text without letters is a value
        number = variable.number(key) if variable.type and variable.type.is_integer else None
        if number is None or number.relative:
            return text
        return f"0x{number.value:X}" if number.value >= 0 else str(number.value)
