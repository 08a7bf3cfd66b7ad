"""The EDS of one device from a small table: identity, profiles, own objects, PDOs.

    device: {product: Thermometer, vendor: Example, vendor_number: 0x5F, product_number: 1}
    profiles: [301, 401]
    objects:
      0x2100: {ParameterName: Filter time, DataType: UNSIGNED16, AccessType: rw, DefaultValue: 20}
    pdos:
      TPDO1: [0x6401:1]

Objects are written as in a patch (see `patches`); they change objects of a profile, or are new. The same table always
makes the same bytes.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, NamedTuple

from eurobot_od.errors import DictionaryError, LocalError
from eurobot_od.od import values
from eurobot_od.od.document import BIT_RATES, Document
from eurobot_od.od.editing import Change, edited, mapped, profile, said
from eurobot_od.od.values import plain_number
from eurobot_od.support.declared import Within
from eurobot_od.support.yaml_places import PlacedError
from eurobot_od.support.yaml_shapes import PLAIN, SCALAR, converted, read_yaml, shape_of

DEVICE_TYPES = {"401": 0x000F0191, "402": 0x00020192}
"""Value of 0x1000 for a module with all kinds of inputs and outputs, and for a servo drive (CiA 401, CiA 402)."""

Number32 = Annotated[int, Within(0, 0xFFFFFFFF, form="0x{:X}")]


class DeviceRow(NamedTuple):
    """A device: 0x1018, 0x1000 (by its profiles if omitted), and entries of [FileInfo] and [DeviceInfo]."""

    product: str
    vendor: str = ""
    vendor_number: Number32 = 0
    product_number: Number32 = 0
    revision_number: Number32 = 0x00010000
    device_type: Number32 | None = None
    order_code: str = "1"
    bit_rates: Sequence[int] = (125, 250, 500, 1000)
    date: str = "01-01-2026"


class DeviceTable(NamedTuple):
    """A device, its profiles by number, entries of its objects, and the objects mapped into its PDOs."""

    device: DeviceRow
    profiles: Sequence[str] = ("301",)
    objects: Mapping[str, Mapping[str, str]] = {}
    pdos: Mapping[str, Sequence[str]] = {}


def is_device_table(text: str) -> bool:
    """Return whether a table describes one device, not the nodes of a network."""
    return re.search(r"^device:", text, re.MULTILINE) is not None


def read_device_table(text: str, file: str) -> DeviceTable:
    """Parse a table; `file` is its path. Raises YamlError with each problem's line."""
    number = replace(converted(SCALAR, plain_number), whole=True)
    table: DeviceTable = read_yaml(text, shape_of(DeviceTable, {**PLAIN, str: SCALAR, int: number}), file)
    return table


def device_eds(table: DeviceTable, file_name: str) -> bytes:
    """Return the EDS for a table; raises PlacedError for an impossible object, otherwise as `edited`."""
    device = table.device
    identity = (device.vendor_number, device.product_number, device.revision_number)
    by_profile = (DEVICE_TYPES[each] for each in table.profiles if each in DEVICE_TYPES)
    device_type = next(by_profile, 0) if device.device_type is None else device.device_type
    numbers = {"0x1000": device_type, **{f"0x1018:{sub}": number for sub, number in enumerate(identity, start=1)}}
    changes: list[Change] = [
        *map(profile, table.profiles),
        *(said(target, {"DefaultValue": f"0x{number:08X}"}) for target, number in numbers.items()),
        *(_placed(target, said(target, entries)) for target, entries in table.objects.items()),
        *(_placed(pdo, mapped(pdo, objects)) for pdo, objects in table.pdos.items()),
    ]
    return edited(_head(table, file_name).encode(), file_name, changes)


def _placed(target: str, change: Change) -> Change:
    """Return the change of an object, whose errors name its place in the table."""

    def placed(document: Document) -> Document:
        try:
            return change(document)
        except (DictionaryError, LocalError) as error:
            raise PlacedError(target, str(error)) from error

    return placed


def _head(table: DeviceTable, file_name: str) -> str:
    """Return the sections about the file and the device."""
    device = table.device
    moment = {"Time": "12:00PM", "Date": device.date}
    info = {
        "FileName": file_name,
        "FileVersion": 1,
        "FileRevision": 0,
        "EDSVersion": "4.0",
        "Description": device.product,
        **{f"Creation{key}": text for key, text in moment.items()},
        "CreatedBy": device.vendor,
        **{f"Modification{key}": text for key, text in moment.items()},
        "ModifiedBy": device.vendor,
    }
    about = {
        "VendorName": device.vendor,
        "VendorNumber": f"0x{device.vendor_number:08X}",
        "ProductName": device.product,
        "ProductNumber": f"0x{device.product_number:08X}",
        "RevisionNumber": f"0x{device.revision_number:08X}",
        "OrderCode": device.order_code,
        **{f"BaudRate_{rate}": int(rate in device.bit_rates) for rate in BIT_RATES},
        **dict.fromkeys(("SimpleBootUpMaster", "DynamicChannelsSupported", "GroupMessaging", "LSS_Supported"), 0),
        "SimpleBootUpSlave": 1,
        "Granularity": 8,
        "NrOfRXPDO": 0,
        "NrOfTXPDO": 0,  # the edits count the PDOs that they add
    }
    sections: dict[str, Mapping[str, object]] = {
        "FileInfo": info,
        "DeviceInfo": about,
        "DummyUsage": {f"Dummy{code:04X}": 0 for code in values.DUMMIES},
        "Comments": {"Lines": 0},
    }
    written = ("".join(f"{key}={value}\n" for key, value in entries.items()) for entries in sections.values())
    return "\n".join(f"[{name}]\n{text}" for name, text in zip(sections, written))
