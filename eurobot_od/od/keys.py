"""The sections and keys of CiA 306, as it spells them.

Readers look sections and keys up in lower case; other tools need them as they are written here.
"""

from __future__ import annotations

from collections.abc import Mapping

BIT_RATES = (10, 20, 50, 125, 250, 500, 800, 1000)
"""Bit rates in kbit/s that have a key in [DeviceInfo] (CiA 306) and a bit timing (CiA 301, Table 1)."""

BIT_RATE_KEYS = tuple(f"BaudRate_{rate}" for rate in BIT_RATES)
FLAGS = ("SimpleBootUpMaster", "SimpleBootUpSlave", "GroupMessaging", "LSS_Supported")
IDENTITY = ("VendorNumber", "ProductNumber", "RevisionNumber")
"""Keys of [DeviceInfo] that say the same as 0x1018 sub 1, 2 and 3."""

FILE_INFO = ("FileName", "FileVersion", "FileRevision")
TIMES, DATES = ("CreationTime", "ModificationTime"), ("CreationDate", "ModificationDate")
ORIGIN = ("Description", *TIMES, *DATES, "CreatedBy", "ModifiedBy")
DEVICE_INFO = ("ProductNumber", "RevisionNumber", "OrderCode", *BIT_RATE_KEYS, *FLAGS, "DynamicChannelsSupported",
               "NrOfRXPDO", "NrOfTXPDO", "Granularity")  # fmt: skip
COMMISSIONING_KEYS = ("NodeID", "NodeName", "NodeRefd", "Baudrate", "NetNumber", "NetworkName", "NetRefd",
                      "CANopenManager", "LSS_SerialNumber")  # fmt: skip
OBJECT_KEYS = ("SubNumber", "ParameterName", "ObjectType", "DataType", "AccessType", "LowLimit", "HighLimit",
               "DefaultValue", "PDOMapping", "ObjFlags", "CompactSubObj", "ParameterValue", "UploadFile",
               "DownloadFile", "Denotation", "ParamRefd")  # fmt: skip
"""The keys of an object, and of a sub-index."""

LIMITS, VALUES = ("lowlimit", "highlimit"), ("defaultvalue", "parametervalue")
TYPED = (*LIMITS, *VALUES)
"""Keys whose text goes by the data type, in lower case."""

OF_VARIABLE = ("datatype", "accesstype", "pdomapping", *TYPED)
"""Keys of an object with a value, in lower case; an object with sub-indices does not have them."""

SECTION_KEYS: Mapping[str, tuple[str, ...]] = {
    "FileInfo": (*FILE_INFO, *ORIGIN, "EDSVersion", "LastEDS"),
    "DeviceInfo": (*dict.fromkeys((*DEVICE_INFO, *IDENTITY)), "VendorName", "ProductName", "CompactPDO",
                   "ExtendedBootUpMaster", "ExtendedBootUpSlave"),
    "DeviceComissioning": COMMISSIONING_KEYS,
    "DummyUsage": tuple(f"Dummy{code:04X}" for code in range(1, 0x20)),
}  # fmt: skip
"""The keys of each section with a fixed set of them."""

OBJECT_LISTS = ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")
"""The sections that list the objects of a file (CiA 306-1, 4.6.1)."""

COMMISSIONING = "DeviceComissioning"
"""The section of node-ID and bit rate in a DCF, in the spelling of the standard."""

SECTION_NAMES: Mapping[str, str] = {each.lower(): each for each in (*SECTION_KEYS, "Comments", *OBJECT_LISTS)} | {
    "devicecommissioning": COMMISSIONING
}
"""How the sections that belong to no object are spelled, by their names in lower case."""

SPELLED_OBJECT_KEYS: Mapping[str, str] = {each.lower(): each for each in OBJECT_KEYS}
SPELLED_KEYS: Mapping[str, Mapping[str, str]] = {
    **{name.lower(): {each.lower(): each for each in keys} for name, keys in SECTION_KEYS.items()},
    "comments": {"lines": "Lines", **{f"line{number}": f"Line{number}" for number in range(1, 1000)}},
    **{name.lower(): {"supportedobjects": "SupportedObjects"} for name in OBJECT_LISTS},
}
"""How keys are spelled, by their section and themselves in lower case."""
