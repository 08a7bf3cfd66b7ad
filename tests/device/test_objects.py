"""The objects of a device over SDO: who may access what, limits, what a refused access leaves, what a value does."""

from __future__ import annotations

from pathlib import Path

import pytest
from canopen import SdoAbortedError

from eurobot_od.device.device import Device
from eurobot_od.device.objects import Objects
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address
from eurobot_od.sdo.aborts import Abort, Reason
from eurobot_od.sdo.wire import AbortCode
from tests.device.master import wired
from tests.rows import rows

UNREADABLE: list[tuple[Address, AbortCode, str]] = [
    ((0x2999, 0), AbortCode.NO_OBJECT, "no such object"),
    ((0x0005, 0), AbortCode.NO_OBJECT, "a data type"),
    ((0x1018, 5), AbortCode.NO_SUBINDEX, "an array's sub-index beyond its last"),
    ((0x1000, 1), AbortCode.NO_SUBINDEX, "a sub-index of a variable"),
    ((0x1003, 1), AbortCode.NO_DATA, "an error field without errors"),
]


@pytest.mark.parametrize(("address", "code", "why"), UNREADABLE)
def test_reading_what_is_not_there_names_the_cause(address: Address, code: AbortCode, why: str) -> None:
    with pytest.raises(SdoAbortedError) as refusal:
        wired().read(*address)
    assert refusal.value.code == code, why


UNWRITABLE: list[tuple[Address, int, int, AbortCode, str]] = [
    ((0x2999, 0), 0, 4, AbortCode.NO_OBJECT, "no such object"),
    ((0x2101, 9), 0, 1, AbortCode.NO_SUBINDEX, "no such sub-index"),
    ((0x1000, 0), 0, 4, AbortCode.READ_ONLY, "ro"),
    ((0x2101, 0), 6, 1, AbortCode.READ_ONLY, "const"),
    ((0x2101, 1), 500, 4, AbortCode.TOO_LONG, "UNSIGNED16 with 4 bytes"),
    ((0x2101, 1), 5, 1, AbortCode.TOO_SHORT, "UNSIGNED16 with 1 byte"),
    ((0x2101, 1), 5, 9, AbortCode.TOO_LONG, "UNSIGNED16 with 9 bytes, segmented"),
    ((0x2102, 2), 181, 1, AbortCode.TOO_HIGH, "above HighLimit"),
    ((0x2101, 1), 0, 2, AbortCode.TOO_LOW, "below LowLimit"),
    ((0x2100, 1), 0, 1, AbortCode.TOO_LOW, "node-ID 0"),
    ((0x2100, 1), 128, 1, AbortCode.TOO_HIGH, "node-ID 128"),
    ((0x1003, 0), 1, 1, AbortCode.VALUE, "the error field can only be cleared"),
    ((0x1010, 1), 1, 4, AbortCode.NOT_TRANSFERRED, "store without its signature"),
    ((0x1011, 1), 0x65766173, 4, AbortCode.NOT_TRANSFERRED, "restore with the signature of store"),
    ((0x1029, 1), 3, 1, AbortCode.TOO_HIGH, "no such error behaviour"),
]


@rows("address, value, size, code, why", UNWRITABLE)
def test_a_refused_write_names_the_cause_and_changes_nothing(
    address: Address, value: int, size: int, code: AbortCode, why: str
) -> None:
    wire = wired()
    before = dict(wire.device.objects.values)
    assert wire.refused(address, value, size) == code, why
    assert wire.device.objects.values == before


def test_one_node_is_not_watched_twice() -> None:
    wire = wired("core")
    assert wire.refused((0x1016, 2), wire.read(0x1016, 1), size=4) == AbortCode.INCOMPATIBLE


def test_a_setting_takes_effect_at_once() -> None:
    wire = wired()
    wire.write(0x2101, 1, 321, size=2)
    assert wire.device.number((0x2101, 1)) == 321


@pytest.mark.parametrize("dialect", ["canopen", "firmware2014"])
@pytest.mark.parametrize("node", ["core", "drive", "navigation"])
def test_every_readable_object_is_read_with_the_length_of_its_type(node: str, dialect: str) -> None:
    wire = wired(node, dialect)
    for entry in wire.device.dictionary.objects.values():
        for variable in getattr(entry, "subindices", {0: entry}).values():
            if entry.index != 0x1003 and variable.fixed_size:
                assert len(wire.sdo.sdo.upload(variable.index, variable.subindex)) * 8 == len(variable)


def test_names_are_read_as_text() -> None:
    assert wired().sdo.sdo.upload(0x1008, 0) == b"Eurobot 2014 drive"


def test_a_part_and_its_whole_are_one_value() -> None:
    wire = wired("drive", "firmware2014")
    wire.write(0x2000, 1, 0xABC, size=2)
    assert wire.read(0x3000, 1) == 0xAB
    assert wire.read(0x3000, 3) == 0xC
    wire.write(0x3000, 1, 0x12, size=1)
    assert wire.read(0x2000, 1) == 0x12C


VERIFIED = ((0x1020, 1), (0x1020, 2))
CHANGES: list[tuple[Address, int, int, bool, str]] = [
    ((0x2101, 1), 700, 2, True, "a setting"),
    ((0x1017, 0), 500, 2, True, "a communication object"),
    ((0x1400, 1), 0x80000001, 4, True, "a PDO"),
    ((0x2101, 1), 800, 2, False, "a setting, to the value it has"),
    ((0x2000, 1), 500, 2, False, "what a message carries is no configuration"),
    ((0x1010, 1), 0x65766173, 4, False, "storing does not change it"),
]


@pytest.mark.parametrize(("address", "value", "size", "forgotten", "why"), CHANGES)
def test_a_changed_configuration_is_not_the_verified_one(
    address: Address, value: int, size: int, forgotten: bool, why: str
) -> None:
    wire = wired()
    for day in VERIFIED:
        wire.write(*day, 15_000)
    wire.write(*address, value, size)
    assert [wire.read(*day) for day in VERIFIED] == [0 if forgotten else 15_000] * 2, why


FILE_AND_TEXT = """\
[DeviceInfo]
[MandatoryObjects]
SupportedObjects=1
1=0x1000
[1000]
ParameterName=Device type
DataType=0x0007
AccessType=ro
DefaultValue=0
[ManufacturerObjects]
SupportedObjects=2
1=0x2000
2=0x2001
[2000]
ParameterName=Program
ObjectType=0x2
DataType=0x000F
AccessType=rw
[2001]
ParameterName=Text
DataType=0x0009
AccessType=rw
"""

MEBIBYTE = 1 << 20


@pytest.mark.parametrize(
    ("address", "size", "room"),
    [((0x2000, 0), 16 * MEBIBYTE, 16 * MEBIBYTE), ((0x2000, 0), None, 16 * MEBIBYTE), ((0x2001, 0), None, 65_536)],
)
def test_a_file_may_have_16_mib_and_a_text_64_kib(
    tmp_path: Path, address: Address, size: int | None, room: int
) -> None:
    assert described(tmp_path).admit(address, size) == room


@pytest.mark.parametrize(("address", "size"), [((0x2000, 0), 16 * MEBIBYTE + 1), ((0x2001, 0), 65_537)])
def test_more_than_that_is_refused_before_it_comes(tmp_path: Path, address: Address, size: int) -> None:
    with pytest.raises(Abort) as refusal:
        described(tmp_path).admit(address, size)
    assert refusal.value.reason is Reason.OUT_OF_MEMORY


@pytest.mark.parametrize(
    ("lines", "encoding", "served"),
    [
        ("DefaultValue=Gerät\n", "utf-8", "Gerät".encode()),
        ("DefaultValue=Gerät\n", "latin-1", "Gerät".encode("latin-1")),
        ("DefaultValue=Gerät\nParameterValue=\n", "utf-8", "Gerät".encode()),
        ("DefaultValue=a\nParameterValue=b\n", "utf-8", b"b"),
    ],
)
def test_a_text_is_served_as_the_files_bytes(tmp_path: Path, lines: str, encoding: str, served: bytes) -> None:
    assert described(tmp_path, lines.encode(encoding)).read((0x2001, 0)) == served


def described(folder: Path, more: bytes = b"") -> Objects:
    file = folder / "device.eds"
    file.write_bytes(FILE_AND_TEXT.encode() + more)
    return Device(Dictionary.load(file, 5)).objects
