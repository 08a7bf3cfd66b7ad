"""Settings in a DCF file: what comes back, who else can read it, and files that are none of ours."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import canopen
import pytest

from eurobot_od.device.device import Device
from eurobot_od.device.node import Node
from eurobot_od.device.storage import FileStore, MemoryStore
from eurobot_od.errors import DamagedFile, DictionaryError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address, Value
from eurobot_od.robot import dialects
from eurobot_od.sdo.aborts import Abort, Reason
from tests.device import io_module
from tests.eds_text import record, variable
from tests.rows import rows

DRIVE = dialects.load("drive")
SETTINGS: dict[Address, Value] = {(0x2101, 1): 333, (0x1017, 0): 250, (0x1403, 1): 0x8000_0123, (0x2100, 1): 9}


@pytest.fixture
def store(tmp_path: Path) -> FileStore:
    return FileStore(tmp_path / "drive.dcf", DRIVE)


def test_without_a_file_there_are_no_settings(store: FileStore) -> None:
    assert store.load() == {}


def test_what_was_saved_is_loaded(store: FileStore) -> None:
    store.save(SETTINGS, 9)
    assert store.load() == SETTINGS
    store.save({}, 2)
    assert store.load() == {}


@pytest.mark.parametrize(("rates", "said"), [((), "500"), ((250,), "250")])
def test_the_file_says_the_bit_rate(tmp_path: Path, rates: tuple[int, ...], said: str) -> None:
    store = FileStore(tmp_path / "drive.dcf", DRIVE, *rates)
    store.save(SETTINGS, 9)
    assert f"Baudrate={said}" in store.file.read_text().splitlines()


def test_a_device_starts_with_what_it_stored(store: FileStore) -> None:
    device = Device(DRIVE, store)
    device.objects.write((0x2101, 1), (333).to_bytes(2, "little"))
    device.objects.write((0x2100, 1), b"\x09")
    device.objects.write((0x1010, 1), b"save")
    restarted = Device(DRIVE, store)
    assert restarted.number((0x2101, 1)) == 333
    assert restarted.node_id == 9


def test_other_programs_read_the_file(store: FileStore) -> None:
    store.save(SETTINGS, 9)
    objects: Any = canopen.import_od(str(store.file))
    assert objects.node_id == 9
    assert objects[0x2101][1].value == 333
    checked = subprocess.run([Path(sys.executable).with_name("dcfchk"), store.file], capture_output=True, check=False)
    assert (checked.returncode, checked.stdout, checked.stderr) == (0, b"", b"")


def test_nothing_is_left_beside_the_file(store: FileStore) -> None:
    store.save(SETTINGS, 9)
    assert [each.name for each in store.file.parent.iterdir()] == ["drive.dcf"]


def test_a_file_half_written_beside_is_no_matter(store: FileStore) -> None:
    store.save(SETTINGS, 9)
    store.file.with_name("drive.dcf.0123abcd.new").write_text("[FileInfo]\nFileNa")
    assert store.load() == SETTINGS
    store.save({}, 2)
    assert store.load() == {}


def test_the_settings_of_another_device_are_refused(store: FileStore) -> None:
    FileStore(store.file, dialects.load("core")).save({}, 1)
    with pytest.raises(DictionaryError, match=r"drive\.dcf: 0x1018: sub 2 is 1, not 2: the configuration of another"):
        store.load()


def without_checksum(store: FileStore) -> bytes:
    """Return what the file holds after its first line, as another program would have written it."""
    return store.file.read_bytes().partition(b"\n")[2]


@pytest.mark.parametrize("part", [0.2, 0.5, 0.9, 0.98])
def test_a_file_that_was_cut_off_is_refused(store: FileStore, part: float) -> None:
    store.save(SETTINGS, 9)
    for content in (store.file.read_bytes(), without_checksum(store)):
        store.file.write_bytes(content[: int(len(content) * part)])
        with pytest.raises(DictionaryError, match=r"drive\.dcf"):
            store.load()


def test_a_dcf_of_another_program_has_no_checksum_and_is_loaded(store: FileStore) -> None:
    store.save(SETTINGS, 9)
    store.file.write_bytes(without_checksum(store))
    assert store.load() == SETTINGS


@rows("place", [0.01, 0.3, 0.6, 0.999])
@rows("bit", [0, 2, 6])
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
    device = Device(DRIVE, store)
    (said,) = device.refused
    assert said.startswith(f"{store.file}: damaged: ")
    assert device.number((0x2101, 1)) == 800


OUT_OF_LIMITS = [
    ("drive", (0x2101, 6), 0, "0x2101:6 Control period = 0, allowed: 1..255"),
    ("drive", (0x2103, 4), 1001, "0x2103:4 Gate = 1001, allowed: 0..1000"),
    ("core", (0x2103, 1), 0, "0x2103:1 Polling period = 0, allowed: 1..65535"),
    ("core", (0x1017, 0), 70_000, "0x1017:0 Producer heartbeat time = 70000, allowed: 0..65535"),
]


@pytest.mark.parametrize(("role", "address", "value", "what"), OUT_OF_LIMITS, ids=[row[3] for row in OUT_OF_LIMITS])
def test_a_stored_value_outside_the_limits_of_the_eds_is_refused_by_name_and_the_default_taken(
    tmp_path: Path, role: str, address: Address, value: int, what: str
) -> None:
    dictionary = dialects.load(role)
    store = FileStore(tmp_path / "stored.dcf", dictionary)
    store.save({address: value, (0x1400, 5): 7}, dictionary.node_id)
    device = Device(dictionary, store)
    assert device.refused == (f"stored value refused: {what}; the default is taken",)
    assert device.objects.value(address) == dictionary.default(address)
    assert device.objects.value((0x1400, 5)) == 7


def test_refused_values_are_told_by_emcy_at_each_start_until_the_device_stores_again(store: FileStore) -> None:
    store.save({(0x2101, 6): 0}, 2)
    node = Node(DRIVE, store=store)
    alarms: list[str] = []
    node.alarm = alarms.append
    refused = Frame(0x082, bytes.fromhex("0063010000000000"))
    assert refused in node.start(0.0)
    assert len(alarms) == 1
    assert refused in node.receive(Frame(0x000, b"\x81\x02"), 1.0)
    node.device.objects.write((0x1010, 1), b"save")
    assert node.device.refused == ()
    assert refused not in node.receive(Frame(0x000, b"\x81\x02"), 2.0)
    assert Node(DRIVE, store=store).device.refused == ()


def test_a_file_that_is_no_dcf_is_refused(store: FileStore) -> None:
    store.file.write_bytes(b"\x00\xff nothing to see here")
    with pytest.raises(DictionaryError, match="not a"):
        store.load()


def test_anybodys_device_keeps_its_settings_and_not_what_pdos_bring(tmp_path: Path) -> None:
    text = f"[FileInfo]\n{io_module.TEXT}" + variable("6000", "Output", "UNSIGNED8", "0").replace("=rw\n", "=rww\n")
    file = tmp_path / "module.eds"
    file.write_text(text, encoding="ascii")
    dictionary = Dictionary.load(file, io_module.NODE_ID)
    stored = FileStore(tmp_path / "stored.dcf", dictionary)
    device = Device(dictionary, stored)
    for address, data in (((0x2000, 4), b"hall 3"), ((0x2100, 0), b"\xf0\xff"), ((0x6000, 0), b"\x07")):
        device.objects.write(address, data)
    stored.save(device.objects.configuration(), io_module.NODE_ID)
    assert stored.load() == {(0x2000, 4): "hall 3", (0x2100, 0): -16}


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


@rows("encoding", ["utf-8", "latin-1", "utf-8-sig"])
@rows("address, data, why", STORED)
def test_what_is_stored_comes_back_to_the_byte_whatever_the_encoding_of_the_eds(
    tmp_path: Path, encoding: str, address: Address, data: bytes, why: str
) -> None:
    device = module_with_a_store(tmp_path, encoding, NAMED)
    device.objects.write(address, data)
    device.objects.write((0x1010, 1), b"save")
    restarted = module_with_a_store(tmp_path, encoding, NAMED)
    assert restarted.refused == ()
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
