"""The objects of a device over SDO: who may access what, limits, what a refused access leaves, what a value does."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import canopen
import pytest
from canopen import SdoAbortedError

from eurobot_od.device.device import Device
from eurobot_od.device.node import Node
from eurobot_od.device.objects import FileStore, MemoryStore, Objects
from eurobot_od.errors import DamagedFile, DictionaryError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address, Value
from eurobot_od.sdo.wire import Abort, AbortCode, Reason
from tests.device import io_module
from tests.device.master import wired
from tests.eds_text import DEVICE_TYPE, record, variable
from tests.kit import lift

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
    ((0x2101, 0), 2, 1, AbortCode.READ_ONLY, "const"),
    ((0x2101, 1), 500, 4, AbortCode.TOO_LONG, "UNSIGNED16 with 4 bytes"),
    ((0x2101, 1), 5, 1, AbortCode.TOO_SHORT, "UNSIGNED16 with 1 byte"),
    ((0x2101, 1), 5, 9, AbortCode.TOO_LONG, "UNSIGNED16 with 9 bytes, segmented"),
    ((0x2102, 2), 501, 2, AbortCode.TOO_HIGH, "above HighLimit"),
    ((0x2101, 1), 0, 2, AbortCode.TOO_LOW, "below LowLimit"),
    ((0x2100, 1), 0, 1, AbortCode.TOO_LOW, "node-ID 0"),
    ((0x2100, 1), 128, 1, AbortCode.TOO_HIGH, "node-ID 128"),
    ((0x1003, 0), 1, 1, AbortCode.VALUE, "the error field can only be cleared"),
    ((0x1010, 1), 1, 4, AbortCode.NOT_TRANSFERRED, "store without its signature"),
    ((0x1011, 1), 0x65766173, 4, AbortCode.NOT_TRANSFERRED, "restore with the signature of store"),
    ((0x1029, 1), 3, 1, AbortCode.TOO_HIGH, "no such error behaviour"),
]


@pytest.mark.parametrize(("address", "value", "size", "code", "why"), UNWRITABLE)
def test_a_refused_write_names_the_cause_and_changes_nothing(
    address: Address, value: int, size: int, code: AbortCode, why: str
) -> None:
    wire = wired()
    before = dict(wire.device.objects.values)
    assert wire.refused(address, value, size) == code, why
    assert wire.device.objects.values == before


def test_a_setting_takes_effect_at_once() -> None:
    wire = wired()
    wire.write(0x2101, 1, 321, size=2)
    assert wire.device.objects.number((0x2101, 1)) == 321


@pytest.mark.parametrize("dialect", [lift.DIALECT, lift.REVERSED])
@pytest.mark.parametrize("node", ["panel", "cabin", "door"])
def test_every_readable_object_is_read_with_the_length_of_its_type(node: str, dialect: str) -> None:
    wire = wired(node, dialect)
    for entry in wire.device.dictionary.objects.values():
        for each in getattr(entry, "subindices", {0: entry}).values():
            if entry.index != 0x1003 and each.fixed_size:
                assert len(wire.sdo.sdo.upload(each.index, each.subindex)) * 8 == len(each)


def test_names_are_read_as_text() -> None:
    assert wired().sdo.sdo.upload(0x1008, 0) == b"Lift cabin"


def test_a_part_and_its_whole_are_one_value() -> None:
    wire = wired("cabin", lift.REVERSED)
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


CABIN = lift.dictionary("cabin")
SETTINGS: dict[Address, Value] = {(0x2101, 1): 333, (0x1017, 0): 250, (0x1403, 1): 0x8000_0123, (0x2100, 1): 9}


@pytest.fixture
def store(tmp_path: Path) -> FileStore:
    return FileStore(tmp_path / "cabin.dcf", CABIN)


def test_without_a_file_there_are_no_settings(store: FileStore) -> None:
    assert store.load() == {}


def test_saved_values_are_loaded(store: FileStore) -> None:
    store.save(SETTINGS, 9)
    assert store.load() == SETTINGS
    store.save({}, 2)
    assert store.load() == {}


@pytest.mark.parametrize(("rates", "said"), [((), "500"), ((250,), "250")])
def test_the_file_says_the_bit_rate(tmp_path: Path, rates: tuple[int, ...], said: str) -> None:
    store = FileStore(tmp_path / "cabin.dcf", CABIN, *rates)
    store.save(SETTINGS, 9)
    assert f"Baudrate={said}" in store.file.read_text().splitlines()


def test_a_device_starts_with_what_it_stored(store: FileStore) -> None:
    device = Device(CABIN, store)
    device.objects.write((0x2101, 1), (333).to_bytes(2, "little"))
    device.objects.write((0x2100, 1), b"\x09")
    device.objects.write((0x1010, 1), b"save")
    restarted = Device(CABIN, store)
    assert restarted.objects.number((0x2101, 1)) == 333
    assert restarted.node_id == 9


def test_other_programs_read_the_file(store: FileStore) -> None:
    store.save(SETTINGS, 9)
    objects: Any = canopen.import_od(str(store.file))
    assert objects.node_id == 9
    assert objects[0x2101][1].value == 333
    checked = subprocess.run([Path(sys.executable).with_name("dcfchk"), store.file], capture_output=True, check=False)
    assert (checked.returncode, checked.stdout, checked.stderr) == (0, b"", b"")


def test_no_temporary_file_is_left(store: FileStore) -> None:
    store.save(SETTINGS, 9)
    assert [each.name for each in store.file.parent.iterdir()] == ["cabin.dcf"]


def test_a_file_half_written_beside_is_no_matter(store: FileStore) -> None:
    store.save(SETTINGS, 9)
    store.file.with_name("cabin.dcf.0123abcd.new").write_text("[FileInfo]\nFileNa")
    assert store.load() == SETTINGS
    store.save({}, 2)
    assert store.load() == {}


def test_the_settings_of_another_device_are_refused(store: FileStore) -> None:
    FileStore(store.file, lift.dictionary("panel")).save({}, 1)
    with pytest.raises(DictionaryError, match=r"cabin\.dcf: 0x1018: sub 2 is 1, not 2: the configuration of another"):
        store.load()


def without_checksum(store: FileStore) -> bytes:
    """Return what the file holds after its first line, as another program would have written it."""
    return store.file.read_bytes().partition(b"\n")[2]


@pytest.mark.parametrize("part", [0.2, 0.5, 0.9, 0.98])
def test_a_file_that_was_cut_off_is_refused(store: FileStore, part: float) -> None:
    store.save(SETTINGS, 9)
    for content in (store.file.read_bytes(), without_checksum(store)):
        store.file.write_bytes(content[: int(len(content) * part)])
        with pytest.raises(DictionaryError, match=r"cabin\.dcf"):
            store.load()


def test_a_dcf_of_another_program_has_no_checksum_and_is_loaded(store: FileStore) -> None:
    store.save(SETTINGS, 9)
    store.file.write_bytes(without_checksum(store))
    assert store.load() == SETTINGS


@pytest.mark.parametrize("place", [0.01, 0.3, 0.6, 0.999])
@pytest.mark.parametrize("bit", [0, 2, 6])
def test_a_stored_file_with_a_flipped_bit_is_refused_by_name_and_the_defaults_are_taken(
    store: FileStore, place: float, bit: int
) -> None:
    store.save(SETTINGS, 9)
    content = bytearray(store.file.read_bytes())
    start = content.index(b"\n") + 1
    content[start + int((len(content) - start) * place)] ^= 1 << bit
    store.file.write_bytes(content)
    with pytest.raises(DamagedFile):
        store.load()
    device = Device(CABIN, store)
    (said,) = device.storage.refused
    assert said.startswith(f"{store.file}: damaged: ")
    assert device.objects.number((0x2101, 1)) == 800


OUT_OF_LIMITS = [
    ("cabin", (0x2101, 2), 0, "0x2101:2 Control period = 0, allowed: 1..255"),
    ("cabin", (0x2102, 2), 501, "0x2102:2 Offset = 501, allowed: -500..500"),
    ("panel", (0x2101, 1), 0, "0x2101:1 Check wait = 0, allowed: 1..65535"),
    ("panel", (0x1017, 0), 70_000, "0x1017:0 Producer heartbeat time = 70000, allowed: 0..65535"),
]


@pytest.mark.parametrize(("role", "address", "value", "what"), OUT_OF_LIMITS, ids=[row[3] for row in OUT_OF_LIMITS])
def test_a_stored_value_outside_the_limits_of_the_eds_is_refused_by_name_and_the_default_taken(
    tmp_path: Path, role: str, address: Address, value: int, what: str
) -> None:
    dictionary = lift.dictionary(role)
    store = FileStore(tmp_path / "stored.dcf", dictionary)
    store.save({address: value, (0x1400, 5): 7}, dictionary.node_id)
    device = Device(dictionary, store)
    assert device.storage.refused == (f"stored value refused: {what}; the default is taken",)
    assert device.objects.value(address) == dictionary.default(address)
    assert device.objects.value((0x1400, 5)) == 7


def test_refused_values_are_told_by_emcy_at_each_start_until_the_device_stores_again(store: FileStore) -> None:
    store.save({(0x2101, 2): 0}, 2)
    node = Node(CABIN, store=store)
    alarms: list[str] = []
    node.alarm = alarms.append
    refused = Frame(0x082, bytes.fromhex("0063010000000000"))
    assert refused in node.start(0.0)
    assert len(alarms) == 1
    assert refused in node.receive(Frame(0x000, b"\x81\x02"), 1.0)
    node.device.objects.write((0x1010, 1), b"save")
    assert node.device.storage.refused == ()
    assert refused not in node.receive(Frame(0x000, b"\x81\x02"), 2.0)
    assert Node(CABIN, store=store).device.storage.refused == ()


def test_a_file_that_is_no_dcf_is_refused(store: FileStore) -> None:
    store.file.write_bytes(b"\x00\xff nothing to see here")
    with pytest.raises(DictionaryError, match="not a"):
        store.load()


def test_anybodys_device_keeps_its_settings_and_not_what_pdos_bring(tmp_path: Path) -> None:
    text = f"[FileInfo]\n{io_module.TEXT}" + variable("6000", "Output", "UNSIGNED8", "0").replace("=rw\n", "=rww\n")
    text += variable("2900", "Gain", "UNSIGNED16").replace("=rw\nPDOMapping=1", "=rww\nPDOMapping=0")
    file = tmp_path / "module.eds"
    file.write_text(text, encoding="ascii")
    dictionary = Dictionary.load(file, io_module.NODE_ID)
    stored = FileStore(tmp_path / "stored.dcf", dictionary)
    device = Device(dictionary, stored)
    for address, data in (((0x2000, 4), b"hall 3"), ((0x2100, 0), b"\xf0\xff"), ((0x6000, 0), b"\x07")):
        device.objects.write(address, data)
    device.objects.write((0x2900, 0), b"\x09\x00")  # of no default
    stored.save(device.objects.configuration(), io_module.NODE_ID)
    # An RPDO that is valid maps 0x2100; nothing maps 0x6000, though it could be.
    assert stored.load() == {(0x2000, 4): "hall 3", (0x6000, 0): 7, (0x2900, 0): 9}


COMPACT = "[2300]\nParameterName=Gains\nObjectType=8\nDataType=0x0005\nAccessType=rw\nCompactSubObj=4\nDefaultValue=1\n"


def module_with_a_store(folder: Path, encoding: str = "ascii", more: str = "") -> Device:
    file = folder / "module.eds"
    store = record(0x1010, "Store parameters", (0, "UNSIGNED8", "1"), (1, "UNSIGNED32", "1"))
    text = io_module.TEXT + COMPACT + variable("2301", "Note", "UNICODE_STRING", "") + store + more
    file.write_text(text, encoding)
    dictionary = Dictionary.load(file, io_module.NODE_ID)
    return Device(dictionary, FileStore(folder / "stored.dcf", dictionary))


def test_a_member_of_a_compact_array_is_stored(tmp_path: Path) -> None:
    device = module_with_a_store(tmp_path)
    device.objects.write((0x2300, 2), b"\x07")
    device.objects.write((0x1010, 1), b"save")
    assert module_with_a_store(tmp_path).objects.value((0x2300, 2)) == 7


NAMED = variable("2302", "Gr\u00fcn", "VISIBLE_STRING", "caf\u00e9")
"""What is not ASCII in the file itself."""

STORED = [
    ((0x2000, 2), bytes.fromhex("cdcccc3d"), "0.1 as a REAL32"),
    ((0x2000, 4), b"hall 3", "a VISIBLE_STRING"),
    ((0x2201, 0), bytes.fromhex("010000000500"), "a TIME_OF_DAY"),
    ((0x2301, 0), "\u2713 caf\u00e9".encode("utf-16-le"), "a UNICODE_STRING, of which Latin-1 has no first letter"),
    ((0x2302, 0), b"tea", "beside a name and a default that are not ASCII"),
]


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-8-sig"])
@pytest.mark.parametrize(("address", "data", "why"), STORED)
def test_stored_bytes_are_restored_for_any_encoding_of_the_eds(
    tmp_path: Path, encoding: str, address: Address, data: bytes, why: str
) -> None:
    device = module_with_a_store(tmp_path, encoding, NAMED)
    device.objects.write(address, data)
    device.objects.write((0x1010, 1), b"save")
    restarted = module_with_a_store(tmp_path, encoding, NAMED)
    assert restarted.storage.refused == ()
    assert restarted.objects.read(address) == data, why


def test_bytes_that_no_line_can_hold_are_an_abort_and_the_file_stays(tmp_path: Path) -> None:
    device = module_with_a_store(tmp_path)
    device.objects.write((0x2000, 4), b"hall 3")
    device.objects.write((0x1010, 1), b"save")
    device.objects.write((0x2000, 4), b"caf\xe9")  # no ASCII, which a VISIBLE_STRING is
    with pytest.raises(Abort) as abort:
        device.objects.write((0x1010, 1), b"save")
    assert abort.value.reason is Reason.NOT_STORED
    assert module_with_a_store(tmp_path).objects.read((0x2000, 4)) == b"hall 3"


# In memory


def test_in_memory_settings_last_as_long_as_the_store() -> None:
    store = MemoryStore({(0x2100, 1): 5})
    assert store.load() == {(0x2100, 1): 5}
    store.save({(0x2100, 2): 6}, 1)
    assert store.load() == {(0x2100, 2): 6}


@pytest.mark.parametrize(("type_", "found"), [("UNSIGNED16", 7), ("UNSIGNED32", 0x0502F014)])
def test_an_identity_too_wide_for_its_object_stays_what_the_object_says(type_: str, found: int) -> None:
    info = "[DeviceInfo]\nProductNumber=0x0502F014\n"
    default = "7" if type_ == "UNSIGNED16" else "0"
    identity = record(0x1018, "Identity", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", "1"), (2, type_, default))
    device = Device(Dictionary.read((info + DEVICE_TYPE + identity).encode(), Path("a.eds"), 5))
    assert int.from_bytes(device.objects.read((0x1018, 2)), "little") == found
