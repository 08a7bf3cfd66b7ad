"""Writes the EDS file of one node: the sections of CiA 306 from the table and the object dictionary.

Rule of this file: the same table gives the same bytes; no clock, no random number, no order that may change. Only keys
that every CANopen tool accepts.
"""

from __future__ import annotations

from collections.abc import Iterable

from eurobot_od.od.make.objects import Entry, Kind, Object, Type, object_dictionary
from eurobot_od.od.make.table import Node, Table
from eurobot_od.yaml_places import Text

BIT_RATES = (10, 20, 50, 125, 250, 500, 800, 1000)
"""The bit rates in kbit/s for which [DeviceInfo] has a key."""
DUMMIES = range(0x0001, 0x0008)
"""The data types for which [DummyUsage] has a key; none of them is used."""
MANDATORY = {0x1000, 0x1001, 0x1018}
MANUFACTURER = range(0x2000, 0x6000)
COMMENTS = ("Made by tools/make_eds.py from eds/protocol.yaml; change it there.",)
NUMBER_FORMS = {Type.UNSIGNED32: "0x{:08X}"}
"""How numbers of a type are written, if not decimal."""

Section = tuple[str, list[tuple[str, object]]]


def eds_text(table: Table, dialect_name: Text, node_name: Text) -> str:
    """Give the whole EDS file of a node in a dialect."""
    dialect = table.dialects[dialect_name]
    objects = object_dictionary(table, dialect, node_name)
    sections: list[Section] = [
        file_info(table, dialect_name, node_name),
        device_info(table, dialect.revision_number, table.nodes[node_name], objects),
        ("DummyUsage", [(f"Dummy{each:04X}", 0) for each in DUMMIES]),
        ("Comments", [("Lines", len(COMMENTS)), *((f"Line{n}", line) for n, line in enumerate(COMMENTS, start=1))]),
        *object_lists(objects),
        *(section for each in objects for section in object_sections(each)),
    ]
    return "\n".join(section_text(name, keys) for name, keys in sections)


def section_text(name: str, keys: Iterable[tuple[str, object]]) -> str:
    """Write one section."""
    return f"[{name}]\n" + "".join(f"{key}={value}\n" for key, value in keys)


def file_info(table: Table, dialect_name: Text, node_name: Text) -> Section:
    """Give [FileInfo]; creation and modification are the table's fixed date."""
    file = table.file
    return "FileInfo", [
        ("FileName", f"{node_name}.eds"),
        ("FileVersion", file.version),
        ("FileRevision", file.revision),
        ("EDSVersion", "4.0"),
        ("Description", f"{table.nodes[node_name].product_name}, dialect {dialect_name}"),
        ("CreationTime", file.time),
        ("CreationDate", file.date),
        ("CreatedBy", file.author),
        ("ModificationTime", file.time),
        ("ModificationDate", file.date),
        ("ModifiedBy", file.author),
    ]


def device_info(table: Table, revision: int, node: Node, objects: Iterable[Object]) -> Section:
    """Give [DeviceInfo]."""
    indices = [each.index for each in objects]
    return "DeviceInfo", [
        ("VendorName", table.vendor.name),
        ("VendorNumber", f"0x{table.vendor.number:08X}"),
        ("ProductName", node.product_name),
        ("ProductNumber", f"0x{node.product_number:08X}"),
        ("RevisionNumber", f"0x{revision:08X}"),
        ("OrderCode", node.order_code),
        *((f"BaudRate_{rate}", int(rate in table.bit_rates)) for rate in BIT_RATES),
        ("SimpleBootUpMaster", 0),
        ("SimpleBootUpSlave", 1),
        ("Granularity", 1),
        ("DynamicChannelsSupported", 0),
        ("GroupMessaging", 0),
        ("NrOfRXPDO", sum(0x1400 <= each < 0x1600 for each in indices)),
        ("NrOfTXPDO", sum(0x1800 <= each < 0x1A00 for each in indices)),
        ("LSS_Supported", 0),
    ]


def object_lists(objects: Iterable[Object]) -> list[Section]:
    """Give the three lists of objects."""
    indices = [each.index for each in objects]
    manufacturer = [each for each in indices if each in MANUFACTURER]
    optional = [each for each in indices if each not in MANDATORY and each not in MANUFACTURER]
    return [
        object_list("MandatoryObjects", sorted(MANDATORY)),
        object_list("OptionalObjects", optional),
        object_list("ManufacturerObjects", manufacturer),
    ]


def object_list(name: str, indices: list[int]) -> Section:
    """Give one list of objects."""
    return name, [("SupportedObjects", len(indices)), *((str(n), f"0x{i:04X}") for n, i in enumerate(indices, start=1))]


def object_sections(each: Object) -> list[Section]:
    """Give the section of an object, and those of its sub-indices."""
    if each.kind is Kind.VAR:
        return [(f"{each.index:04X}", entry_keys(each.entries[0]))]
    head = [("ParameterName", each.name), ("ObjectType", f"0x{each.kind.value:X}"), ("SubNumber", len(each.entries))]
    subs = [(f"{each.index:04X}sub{n:X}", entry_keys(entry)) for n, entry in enumerate(each.entries)]
    return [(f"{each.index:04X}", [*head]), *subs]


def entry_keys(entry: Entry) -> list[tuple[str, object]]:
    """Give the keys of a VAR or a sub-index; limits and default only where there are any."""
    values = {"LowLimit": entry.low, "HighLimit": entry.high, "DefaultValue": entry.default}
    return [
        ("ParameterName", entry.name),
        ("ObjectType", f"0x{Kind.VAR.value:X}"),
        ("DataType", f"0x{entry.type.value:04X}"),
        ("AccessType", entry.access),
        *((key, value_text(entry.type, value)) for key, value in values.items() if value is not None),
        ("PDOMapping", int(entry.mappable)),
    ]


def value_text(type_: Type, value: int | str) -> str:
    """Write a number as its type is written; a text is written as it stands."""
    return value if isinstance(value, str) else NUMBER_FORMS.get(type_, "{:d}").format(value)
