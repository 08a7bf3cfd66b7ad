"""The DCF writer: the lines of the EDS stay, another reader finds the values, and a cut-off file is noticed."""

from __future__ import annotations

import re
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from eurobot_od.errors import DictionaryError, FieldError, UnknownName
from eurobot_od.od import dcf
from eurobot_od.od.dcf import ChosenCobIds, Truncated, chosen_cob_ids, pack, renumbered, unpack
from eurobot_od.od.description import DescribedDevice
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.document import COMMISSIONING, parse
from eurobot_od.od.values import Address, Value
from tests.eds_text import DEVICE_TYPE, pdo, record, variable
from tests.kit import lift

FILES = sorted(lift.files().glob("*/*.eds"))
CABIN = lift.texts()["plain/cabin.eds"]
VALUES: dict[Address, Value] = {(0x1017, 0): 500, (0x1403, 1): 0x18, (0x1014, 0): 0x99, (0x2101, 1): 900}


def cabin_dcf(values: dict[Address, Value], text: str = CABIN) -> str:
    return dcf.with_values(DescribedDevice(parse(text)), values, 2, "cabin", 500)


@pytest.mark.parametrize(
    ("address", "value", "line"),
    [
        ((0x1017, 0), 500, "ParameterValue=500"),  # decimal, as its default
        ((0x1403, 1), 0x18, "ParameterValue=0x00000018"),  # hexadecimal with 8 digits, as its default
        ((0x1014, 0), 0x99, "ParameterValue=0x00000099"),  # a number where the default counts from the node-ID
        ((0x1008, 0), "Fast cabin", "ParameterValue=Fast cabin"),  # text
        ((0x1021, 0), b"\x01\xab", "ParameterValue=01AB"),  # bytes
        ((0x1018, 3), -1, "ParameterValue=-1"),  # a negative number has no hexadecimal form
        ((0x1017, 0), True, "ParameterValue=1"),  # a bool is a number in a DCF
    ],
)
def test_a_value_is_written_in_the_form_of_its_default(address: Address, value: Value, line: str) -> None:
    added = set(cabin_dcf({address: value}).split("\n")) - set(cabin_dcf({}).split("\n"))
    assert added == {line}


def test_every_line_of_the_eds_stays_but_its_own_name() -> None:
    lines = cabin_dcf(VALUES).split("\n")
    assert [line for line in CABIN.split("\n") if line not in lines] == ["FileName=cabin.eds"]


def test_the_dcf_names_the_eds_it_was_made_from() -> None:
    text = cabin_dcf({})
    assert "FileName=cabin.dcf\n" in text
    assert "LastEDS=cabin.eds\n" in text


def test_a_dcf_of_a_dcf_replaces_values_and_doubles_nothing() -> None:
    once = cabin_dcf(VALUES)
    assert cabin_dcf(VALUES, once) == once
    assert cabin_dcf({(0x1017, 0): 501}, once) == once.replace("ParameterValue=500", "ParameterValue=501")


def test_none_removes_the_parameter_value() -> None:
    assert cabin_dcf({(0x1017, 0): None}) == cabin_dcf({})


def test_line_ends_of_windows_are_read() -> None:
    assert cabin_dcf(VALUES, CABIN.replace("\n", "\r\n")) == cabin_dcf(VALUES)


@pytest.mark.parametrize("address", [(0x5000, 0), (0x1017, 1), (0x1018, 0x99), (0x1018, -1)])
def test_an_object_that_the_eds_lacks_is_refused(address: Address) -> None:
    with pytest.raises(UnknownName, match=f"0x{address[0]:04X}"):
        cabin_dcf({address: 1})


@pytest.mark.parametrize("file", FILES)
def test_other_readers_find_values_and_commissioning(file: Path, tmp_path: Path) -> None:
    assert dcf.missing(parse(file.read_text())) == []
    written = tmp_path / "node.dcf"
    values: dict[Address, Value] = {(0x1017, 0): 500, (0x1014, 0): 0x99, (0x2100, 1): 5}
    written.write_text(dcf.with_values(DescribedDevice(parse(file.read_text())), values, 5, "somebody", 250))
    read = Dictionary.load(written)
    assert (read.node_id, read.objects.bitrate) == (5, 250_000)
    assert [read.default((0x1017, 0)), read.default((0x1014, 0))] == [500, 0x99]
    assert read.default((0x1200, 1)) == 0x605  # $NODEID+0x600
    dcfchk = [sys.executable, "-W", "default", "-m", "dcf.cli", str(written)]
    done = subprocess.run(dcfchk, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


# Bytes there and back

TYPED = """\
[MandatoryObjects]
SupportedObjects=1
1=0x2000
[2000]
ParameterName=Any
DataType=0x%04X
AccessType=rw
"""
ADDRESS: Address = (0x2000, 0)


def there_and_back(folder: Path, eds: bytes, contents: dict[Address, bytes]) -> tuple[dcf.Dcf, list[bytes | None]]:
    """Write the DCF of these contents, with the files beside it, and read it again."""
    made = dcf.with_contents(Dictionary.read(eds, folder / "any.eds", 5), contents, 5, "any", 500, "any")
    for name, content in {**made.files, "any.dcf": made.content}.items():
        (folder / name).write_bytes(content)
    read = Dictionary.load(folder / "any.dcf")
    return made, [dcf.content(read, address) for address in contents]


KEPT = [
    (0x09, b"Fast cabin", b"ParameterValue=Fast cabin\n"),
    (0x09, "10 €".encode(), "ParameterValue=10 €\n".encode()),  # in the file's encoding
    (0x09, b"caf\xe9", None),  # not UTF-8, as the file is
    (0x09, b"two\nlines", None),  # would be an entry of its own
    (0x09, b"filled up\0\0", None),  # a control character
    (0x09, b" blank", None),  # blanks around a value are not its
    (0x09, b"a ;comment", None),  # what follows is none of it
    (0x09, b"", None),  # an empty ParameterValue is none
    (0x09, b"x" * 240, b"ParameterValue=" + b"x" * 240),
    (0x09, b"x" * 241, None),  # key and value together have at most 254 characters
    (0x0B, "10 €".encode("utf-16-le"), "ParameterValue=10 €\n".encode()),
    (0x0B, b"a\0b", None),  # half a character
    (0x0A, b"\0\xff", b"ParameterValue=00FF\n"),
    (0x0A, bytes(121), None),  # 242 digits
    (0x0F, b"short", None),  # CiA 306 has files for every DOMAIN
    (0x0C, b"\1\2\3\4\5\6", b"ParameterValue=6618611909121\n"),  # TIME_OF_DAY, its bits as one number
]


@pytest.mark.parametrize(("code", "data", "line"), KEPT)
def test_every_byte_is_kept_in_a_line_or_in_a_file_beside(
    tmp_path: Path, code: int, data: bytes, line: bytes | None
) -> None:
    made, back = there_and_back(tmp_path, (TYPED % code).encode(), {ADDRESS: data})
    assert back == [data]
    if line is None:
        assert made.files == {"any-2000-0.bin": data}
        assert b"UploadFile=any-2000-0.bin\nDownloadFile=any-2000-0.bin\n" in made.content
    else:
        assert line in made.content
        assert made.files == {}


@pytest.mark.parametrize(
    ("code", "data", "in_a_line"),
    [
        (0x09, b"caf\xe9", True),  # the file's bytes are the text's
        (0x09, "€".encode(), False),  # in Latin-1 these are control characters
        (0x0B, "café".encode("utf-16-le"), False),  # which characters it has, another encoding could change
    ],
)
def test_a_latin_1_file_stays_one(tmp_path: Path, code: int, data: bytes, in_a_line: bool) -> None:
    eds = (TYPED % code).encode() + b"; gr\xfcn\n"
    made, back = there_and_back(tmp_path, eds, {ADDRESS: data})
    assert back == [data]
    assert (made.files == {}) is in_a_line
    assert b"; gr\xfcn\n" in made.content


def test_a_new_value_takes_the_place_of_a_file_and_a_file_that_of_a_value(tmp_path: Path) -> None:
    eds = (TYPED % 0x09).encode()
    texts = [b"text", b"two\nlines", b"text again"]
    for text in texts:
        made, back = there_and_back(tmp_path, eds, {ADDRESS: text})
        assert back == [text]
        eds = made.content
    assert b"File=any-2000" not in eds


def test_compact_objects_are_written_out_with_their_values(tmp_path: Path) -> None:
    eds = (TYPED % 0x09).encode() + b"ObjectType=8\nCompactSubObj=3\n"
    contents: dict[Address, bytes] = {(0x2000, 1): b"one", (0x2000, 3): b"three"}
    made, back = there_and_back(tmp_path, eds, contents)
    assert back == [*contents.values()]
    again, back = there_and_back(tmp_path, made.content, {(0x2000, 1): b"ONE"})
    (text,) = re.findall(r"\[2000sub3\][^\[]*", again.content.decode())
    assert "ParameterValue=three\n" in text


def test_pdos_that_compact_pdo_stands_for_are_written_out(tmp_path: Path) -> None:
    eds = b"[DeviceInfo]\nNrOfRXPDO=2\nNrOfTXPDO=0\nCompactPDO=3\n" + (TYPED % 0x09).encode()
    contents: dict[Address, bytes] = {(0x1401, 1): b"\5\3\0\0", (0x1401, 2): b"\1", (0x2000, 0): b"text"}
    made = dcf.with_contents(Dictionary.read(eds, tmp_path / "any.eds", 5), contents, 5, "any", 500, "any")
    read = Dictionary.read(made.content, tmp_path / "any.dcf")
    assert [(pdo.index, pdo.cob_id, pdo.transmission_type) for pdo in read.pdos] == [
        (0x1400, 0x205, 255),
        (0x1401, 0x305, 1),
    ]


def test_sections_under_unusual_names_have_their_values(tmp_path: Path) -> None:
    eds = (TYPED % 0x09).replace("[2000]", "[0x2000]").encode()
    assert there_and_back(tmp_path, eds, {ADDRESS: b"text"})[1] == [b"text"]


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    file = tmp_path / "any.dcf"
    file.write_text(TYPED % 0x0F + "DownloadFile=gone.bin\n")
    with pytest.raises(DictionaryError, match=r"any.dcf: 0x2000: sub 0 \(Any\): DownloadFile .*gone.bin: No such file"):
        dcf.content(Dictionary.load(file, 5), ADDRESS)


def test_digits_that_are_none_are_told(tmp_path: Path) -> None:
    file = tmp_path / "any.dcf"
    file.write_text(TYPED % 0x0A + "ParameterValue=0G\n")
    with pytest.raises(DictionaryError, match=r"0x2000: sub 0 \(Any\): '0G' is not OCTET_STRING"):
        dcf.content(Dictionary.load(file, 5), ADDRESS)


@pytest.mark.parametrize("name", ["two\nlines", "[1000]\nx", " blank"])
def test_a_name_that_would_be_more_than_a_name_is_left_out(tmp_path: Path, name: str) -> None:
    eds = Dictionary.read((TYPED % 9).encode(), tmp_path / "any.eds", 5)
    assert b"\nNodeName=\n" in dcf.with_contents(eds, {}, 5, name, 500, "any").content


@pytest.mark.parametrize("text", ["two\nlines", "a ;comment", b"caf\xe9"])
def test_a_text_that_a_line_cannot_hold_is_refused(text: Value) -> None:
    with pytest.raises(FieldError, match="0x1008:0: Manufacturer device name"):
        cabin_dcf({(0x1008, 0): text})


# What is missing


@pytest.mark.parametrize(
    ("text", "missing"),
    [
        (CABIN.replace("[1017]", "[9999]"), ["1017"]),  # a listed object
        (CABIN.replace("[1018sub4]", "[9999]"), ["1018sub"]),  # a counted member
        (CABIN.replace("[MandatoryObjects]", "[9999]"), ["MandatoryObjects"]),  # the list that every file has
        (CABIN.replace("[OptionalObjects]", "[9999]"), []),
        ("", ["MandatoryObjects"]),  # everything
    ],
)
def test_announced_but_missing_objects_are_named(text: str, missing: list[str]) -> None:
    assert dcf.missing(parse(text)) == missing


def test_a_number_of_members_that_is_none_counts_as_none() -> None:
    assert dcf.missing(parse(CABIN.replace("SubNumber=6", "SubNumber=six"))) == []


@pytest.mark.parametrize("line", range(0, cabin_dcf(VALUES).count("\n") - 8, 97))  # the last section has 8 lines
def test_a_dcf_cut_off_anywhere_misses_something(line: int) -> None:
    cut = "\n".join(cabin_dcf(VALUES).split("\n")[:line])
    assert dcf.missing(parse(cut)) or f"[{COMMISSIONING}]" not in cut


ENTRIES = [((0x1017, 0), b"\xf4\x01"), ((0x1403, 1), b"\x18\0\0\0")]
BYTES = bytes.fromhex("02000000  1710 00 02000000 f401  0314 01 04000000 18000000")


def test_the_bytes_are_those_of_the_standard() -> None:
    assert pack(ENTRIES) == BYTES
    assert unpack(BYTES) == ENTRIES


@pytest.mark.parametrize(
    ("data", "where"),
    [
        (b"", "ends at byte 0, 4 bytes expected at byte 0"),  # no number of entries
        (BYTES[:3], "ends at byte 3, 4 bytes expected at byte 0"),
        (BYTES[:8], "ends at byte 8, 7 bytes expected at byte 4"),  # in an entry's head
        (BYTES[:12], "ends at byte 12, 2 bytes expected at byte 11"),  # in its data
        (BYTES[:13], "ends at byte 13, 7 bytes expected at byte 13"),  # an entry missing
        (BYTES + b"\0", "1 bytes after the last of 2 entries"),
        (b"\xff\xff\xff\xff", "ends at byte 4, 7 bytes expected at byte 4"),  # a number of entries out of nothing
    ],
)
def test_damage_is_told_by_its_place(data: bytes, where: str) -> None:
    with pytest.raises(Truncated, match=where):
        unpack(data)


@settings(deadline=None)
@given(st.lists(st.tuples(st.tuples(st.integers(0, 0xFFFF), st.integers(0, 0xFF)), st.binary(max_size=20))))
def test_writes_come_back_in_their_order(writes: list[tuple[tuple[int, int], bytes]]) -> None:
    assert unpack(pack(writes)) == writes


@settings(deadline=None)
@given(st.binary(max_size=60))
def test_any_bytes_are_entries_or_refused(data: bytes) -> None:
    with suppress(Truncated):
        assert pack(unpack(data)) == data


SDO = record(0x1200, "SDO server", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", None), (2, "UNSIGNED32", None))
EDS = (
    "[MandatoryObjects]\nSupportedObjects=1\n1=0x1000\n"
    + DEVICE_TYPE
    + variable("1005", "COB-ID SYNC", "UNSIGNED32", "0x80")
    + variable("1014", "COB-ID EMCY", "UNSIGNED32", "$NODEID+0x80")
    + variable("2000", "Node-ID", "UNSIGNED8", "0xFF")
    + variable("2001", "Base", "UNSIGNED16", "$NODEID+0x10")
    + variable("2002", "Speed", "INTEGER16", "7")
    + SDO
    + pdo(0x1400, "0x20020010", cob_id="$NODEID+0x200")
    + pdo(0x1800, "0x20020010", cob_id="$NODEID+0x40000180")
    + pdo(0x1801, "0x20020010", cob_id="0x80000000")
    + pdo(0x1804, "0x20020010", cob_id="0x391")
)


def of_node(values: dict[Address, int], node_id: int = 5) -> Dictionary:
    """A DCF with these values as plain numbers, as other tools write them."""
    text = EDS
    for (index, sub), value in values.items():
        section = f"[{index:04X}]\n" if index < 0x1200 or index >= 0x2000 else f"[{index:04X}sub{sub:X}]\n"
        assert section in text
        text = text.replace(section, f"{section}ParameterValue=0x{value:X}\n")
    commissioning = f"[DeviceComissioning]\nNodeID={node_id}\nNodeName=five\nBaudrate=500\n"
    return Dictionary.read((text + commissioning).encode(), Path("five.dcf"), node_id)


EMCY, NODE_ID, BASE, SPEED = (0x1014, 0), (0x2000, 0), (0x2001, 0), (0x2002, 0)
RPDO1, TPDO1, TPDO2, TPDO5 = (0x1400, 1), (0x1800, 1), (0x1801, 1), (0x1804, 1)
REQUESTS, ANSWERS, SYNC = (0x1200, 1), (0x1200, 2), (0x1005, 0)

# An object, its value in node 5, and what node 6 gets.
FOLLOWS = [
    (EMCY, 0x85, 0x86),
    (RPDO1, 0x205, 0x206),
    (RPDO1, 0x80000205, 0x80000206),  # switched off
    (TPDO1, 0x40000185, 0x40000186),
    (TPDO1, 0x185, 0x186),  # remote frames allowed: a bit besides the identifier
    (TPDO2, 0x285, 0x286),  # the file has no default with $NODEID, the pre-defined connection set has
    (REQUESTS, 0x605, 0x606),
    (ANSWERS, 0x585, 0x586),
    (BASE, 0x15, 0x16),  # no COB-ID, but its default follows
    (NODE_ID, 5, 6),  # the device's own setting
    (BASE, 0x17, 0x17),  # a value that somebody chose, of no service
    (SPEED, 0x185, 0x185),  # a number that only looks like one
    (SYNC, 0x85, 0x85),  # what all nodes share
    (TPDO5, 0x391, 0x391),  # as in all devices of the kind
    (TPDO1, 0x80000391, 0x80000391),  # switched off: nobody is in its way
]


@pytest.mark.parametrize(("address", "value", "moved"), FOLLOWS)
def test_values_that_depend_on_the_node_id_are_renumbered(address: Address, value: int, moved: int) -> None:
    found = renumbered(of_node({address: value}), 6)
    assert (found.default(address), found.node_id, found.device.commissioned_node_id) == (moved, 6, 6)
    assert chosen_cob_ids(of_node({address: value}).device, 5) == []


# A COB-ID of node 5 that somebody chose, and what node 6 gets if it moves.
CHOSEN = [(EMCY, 0x123, 0x124), (TPDO1, 0x391, 0x392), (RPDO1, 0x181, 0x182), (REQUESTS, 0x640, 0x641)]


@pytest.mark.parametrize(("address", "value", "moved"), CHOSEN)
def test_a_cob_id_that_somebody_chose_needs_a_decision(address: Address, value: int, moved: int) -> None:
    given = of_node({address: value})
    with pytest.raises(DictionaryError, match=f"^five.dcf: is of node 5; .* 0x{address[0]:04X}:{address[1]} .* 0x"):
        renumbered(given, 6)
    assert renumbered(given, 6, ChosenCobIds.KEEP).default(address) == value
    assert renumbered(given, 6, ChosenCobIds.MOVE).default(address) == moved


def test_all_cob_ids_that_need_a_decision_are_named_together() -> None:
    with pytest.raises(DictionaryError) as asked:
        renumbered(of_node({EMCY: 0x123, TPDO1: 0x391}), 7)
    assert "0x1014:0 EMCY 0x123, 0x1800:1 TPDO1 0x391; for node 7 keep" in str(asked.value)
    assert "move them by 2 (--move-cob-ids)" in str(asked.value)


def test_a_cob_id_that_would_be_none_is_not_moved() -> None:
    with pytest.raises(DictionaryError, match="0x1014:0: 0x7FF cannot be moved by 1"):
        renumbered(of_node({EMCY: 0x7FF}), 6, ChosenCobIds.MOVE)


@pytest.mark.parametrize("node_id", [5, None])
def test_a_nodes_own_dcf_and_an_eds_stay_as_they_are(node_id: int | None) -> None:
    given = of_node({TPDO1: 0x391}) if node_id else Dictionary.read(EDS.encode(), Path("a.eds"), 5)
    assert renumbered(given, node_id or 6) is given


def test_values_of_a_written_dcf_follow_the_node_id() -> None:
    eds = Dictionary.read(EDS.encode(), Path("a.eds"), 5)
    contents = {EMCY: 0x85, TPDO1: 0x391, TPDO2: 0x285, NODE_ID: 5, SPEED: 9}
    text = dcf.with_values(eds.device, dict(contents), 5, "five", 500)
    said = [line.partition("=")[2] for line in text.splitlines() if line.startswith("ParameterValue")]
    assert said == ["$NODEID+0x80", "$NODEID+0x0", "9", "0x00000391", "$NODEID+0x280"]
    read = Dictionary.read(text.encode(), Path("a.dcf"))
    assert {address: read.default(address) for address in contents} == contents
