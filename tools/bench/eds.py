"""Writes the EDS of a device with any number of objects, as input for the checker, which finds nothing in it."""

from __future__ import annotations

from collections.abc import Sequence

PDOS = 16
"""How many RPDOs, and as many TPDOs, the device has."""
FIRST, SUBS = 0x2000, 4
SINGLE = (0x1000, 0x1001, 0x1017, 0x1018)


def make_eds(count: int, pdos: int = PDOS) -> str:
    """Write the EDS of a device with `count` objects.

    They are those of its PDOs, and data, half in variables and half in records.
    """
    communication = [*SINGLE, *_records(0x1400, pdos), *_records(0x1800, pdos)]
    data = range(FIRST, FIRST + max(count - len(communication), 2 * pdos))
    parts = [_head(communication, data, pdos), *map(_communication, communication), *(_data(i, pdos) for i in data)]
    return "\n".join(parts)


def _records(start: int, pdos: int) -> list[int]:
    return [*range(start, start + pdos), *range(start + 0x200, start + 0x200 + pdos)]


def _head(communication: Sequence[int], data: Sequence[int], pdos: int) -> str:
    rates = "".join(f"BaudRate_{rate}=1\n" for rate in (10, 20, 50, 125, 250, 500, 800, 1000))
    mandatory = [0x1000, 0x1001, 0x1018]
    lists = {
        "MandatoryObjects": mandatory,
        "OptionalObjects": [each for each in sorted(communication) if each not in mandatory],
        "ManufacturerObjects": data,
    }
    return (
        "[FileInfo]\nFileName=bench.eds\nFileVersion=1\nFileRevision=1\nEDSVersion=4.0\nDescription=bench\n"
        "CreationTime=09:30AM\nCreationDate=03-01-2014\nCreatedBy=bench\nModificationTime=09:30AM\n"
        "ModificationDate=03-01-2014\nModifiedBy=bench\n\n[DeviceInfo]\nVendorName=Example\nVendorNumber=1\n"
        f"ProductName=Bench\nProductNumber=1\nRevisionNumber=1\nOrderCode=B\n{rates}SimpleBootUpMaster=0\n"
        "SimpleBootUpSlave=1\nGranularity=8\nDynamicChannelsSupported=0\nGroupMessaging=0\n"
        f"NrOfRXPDO={pdos}\nNrOfTXPDO={pdos}\nLSS_Supported=0\n\n"
    ) + "\n".join(_list(name, indices) for name, indices in lists.items())


def _list(name: str, indices: Sequence[int]) -> str:
    entries = "".join(f"{number}=0x{index:04X}\n" for number, index in enumerate(indices, start=1))
    return f"[{name}]\nSupportedObjects={len(indices)}\n{entries}"


def _variable(name: str, type_: int, access: str, default: object, mappable: int = 0) -> str:
    return (
        f"[{name}]\nParameterName=Object {name}\nObjectType=0x7\nDataType=0x{type_:04X}\nAccessType={access}\n"
        f"DefaultValue={default}\nPDOMapping={mappable}\n"
    )


def _record(index: int, subs: Sequence[str]) -> str:
    head = f"[{index:04X}]\nParameterName=Record {index:04X}\nObjectType=0x9\nSubNumber={len(subs) + 1}\n"
    zero = _variable(f"{index:04X}sub0", 5, "const", len(subs))
    return "\n".join([head, zero, *subs])


def _communication(index: int) -> str:
    single = {0x1000: (7, "ro"), 0x1001: (5, "ro"), 0x1017: (6, "rw")}
    if index in single:
        return _variable(f"{index:04X}", *single[index], 0)
    if index == 0x1018:
        return _record(index, [_variable(f"1018sub{sub}", 7, "ro", 1) for sub in (1, 2, 3)])
    number = index & 0x1FF
    is_mapping = bool(index & 0x200)
    return _mapping(index, number) if is_mapping else _pdo(index, number)


def _pdo(index: int, number: int) -> str:
    base = 0x180 if index >= 0x1800 else 0x200
    cob_id = f"$NODEID+0x{base + 0x100 * number:X}" if number < 4 else "0x80000000"
    values = ((7, cob_id), (5, 255), (6, 0), (5, 0), (6, 0))
    return _record(
        index, [_variable(f"{index:04X}sub{n}", type_, "rw", value) for n, (type_, value) in enumerate(values, start=1)]
    )


def _mapping(index: int, number: int) -> str:
    target = FIRST + number + (PDOS if index >= 0x1800 else 0)
    entry = f"0x{target:04X}{target % 2:02X}10"
    subs = [_variable(f"{index:04X}sub{n}", 7, "rw", entry if n == 1 else 0) for n in range(1, 9)]
    return _record(index, subs).replace("AccessType=const\nDefaultValue=8", "AccessType=rw\nDefaultValue=1")


def _data(index: int, pdos: int) -> str:
    access = "rww" if index < FIRST + pdos else "rwr"
    if index % 2 == 0:
        return _variable(f"{index:04X}", 6, access, 0, 1)
    return _record(index, [_variable(f"{index:04X}sub{sub}", 6, access, 0, 1) for sub in range(1, SUBS + 1)])
