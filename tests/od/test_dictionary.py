"""Dictionaries: what is read from an EDS file, and how a file that cannot be used is refused."""

from __future__ import annotations

import pickle
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import canopen
import pytest

from eurobot_od.errors import DictionaryError, MappingError
from eurobot_od.od.description import ObjectCode
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.maker import MakersWords
from eurobot_od.od.normal import normal
from eurobot_od.od.objects import data_type
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.values import UNSIGNED8, UNSIGNED16, Limits, PdoDirection, Value
from eurobot_od.pdo.protocol import Protocol
from tests.eds_text import DEVICE_TYPE, variable
from tests.kit import lift
from tests.kit.devices import DOCS

ROOT = Path(__file__).parents[2]
EDS = lift.files() / lift.DIALECT
MADE = sorted(lift.files().glob("*/*.eds"))
CABIN = Dictionary.load(EDS / "cabin.eds")
SAMPLES = ROOT / "tests" / "lint" / "samples"
CANOPEN_READS = [
    *MADE,
    *sorted(DOCS.glob("*.eds")),
    *(SAMPLES / name for name in ("clean.eds", "configured.dcf", "crlf_io_module.eds", "generated.eds", "old.eds")),
]


def pdo(dictionary: Dictionary, index: int) -> Pdo:
    return next(each for each in dictionary.pdos if each.index == index)


# What is read


@pytest.mark.parametrize(("name", "node_id"), [("panel", 1), ("cabin", 2), ("door", 3)])
def test_has_the_files_name_and_node_id(name: str, node_id: int) -> None:
    dictionary = Dictionary.load(EDS / f"{name}.eds")
    assert (dictionary.name, dictionary.node_id, dictionary.file) == (name, node_id, EDS / f"{name}.eds")


@pytest.mark.parametrize("node_id", [1, 5, 127])
def test_another_node_id_moves_what_depends_on_it(node_id: int) -> None:
    dictionary = Dictionary.load(EDS / "cabin.eds", node_id)
    assert dictionary.node_id == node_id
    assert dictionary.default((0x1014, 0)) == 0x80 + node_id  # COB-ID EMCY, $NODEID+0x80 in the file
    assert dictionary.default((0x1403, 1)) == CABIN.default((0x1403, 1))


@pytest.mark.parametrize(("said", "node_id"), [("0xFF", None), ("127", 127), ("$NODEID", None)])
def test_a_setting_of_no_node_id_is_not_one(said: str, node_id: int | None) -> None:
    text = (DEVICE_TYPE + variable("2000", "Node-ID", "UNSIGNED8", said)).encode()
    if node_id is None:
        with pytest.raises(DictionaryError, match="the file names no node-ID"):
            Dictionary.read(text, Path("a.eds"))
    else:
        assert Dictionary.read(text, Path("a.eds")).node_id == node_id


def test_gives_objects_by_address_and_by_name() -> None:
    variable = CABIN.variable((0x2000, 1))
    assert variable is not None
    assert variable.name == "Height"
    assert CABIN.address("Motion.Control period") == (0x2101, 2)
    assert CABIN.address("Device type") == (0x1000, 0)
    assert CABIN.default((0x2101, 2)) == 10


@pytest.mark.parametrize("address", [(0x2FFF, 0), (0x2000, 99), (0x1000, 1)])
def test_has_nothing_where_the_file_has_nothing(address: tuple[int, int]) -> None:
    assert CABIN.variable(address) is None
    assert CABIN.default(address) is None


@pytest.mark.parametrize(
    ("name", "near"), [("Lamp", ""), ("Moving.Control period", "; did you mean Motion.Control period?"), ("", "")]
)
def test_tells_a_name_that_no_object_has(name: str, near: str) -> None:
    with pytest.raises(DictionaryError) as error:
        CABIN.address(name)
    assert str(error.value) == f"{CABIN.file}: no object is named {name!r}{near}"


def variables(objects: Any) -> dict[tuple[int, int], dict[str, object]]:
    """Return what canopen's variables say, by address."""
    found = (v for entry in objects.values() for v in getattr(entry, "subindices", {0: entry}).values())
    return {(v.index, v.subindex): {name: getattr(v, name, None) for name in ASPECTS} for v in found}


ASPECTS = (
    *("name", "qualname", "data_type", "access_type", "pdo_mappable", "min", "max"),
    *("default", "default_raw", "relative", "value", "value_raw"),
)


@pytest.mark.parametrize("file", CANOPEN_READS)
def test_canopens_own_reader_gives_the_same_objects(file: Path) -> None:
    ours, theirs = Dictionary.load(file, 5).objects, canopen.import_od(str(file), 5)
    assert variables(ours) == variables(theirs)
    assert {index: type(entry) for index, entry in ours.items()} == {i: type(entry) for i, entry in theirs.items()}
    assert ours.bitrate == theirs.bitrate


@pytest.mark.parametrize("file", MADE, ids=lambda file: f"{file.parent.name}-{file.name}")
def test_canopen_gets_the_very_text_of_our_files(file: Path) -> None:
    made = normal(file.read_bytes())
    assert made.text.encode() == file.read_bytes()
    assert (made.changes, made.refusals) == ([], [])


def test_a_dummy_that_is_left_out_is_not_there(tmp_path: Path) -> None:
    file = tmp_path / "cabin.eds"
    file.write_text((EDS / "cabin.eds").read_text().replace("Dummy0004=1\n", "").replace("Dummy0005=0", "Dummy0005=1"))
    assert [code for code in range(1, 8) if code in Dictionary.load(file).objects] == [5]


def test_a_dcfs_value_goes_before_the_default(tmp_path: Path) -> None:
    dcf = tmp_path / "cabin.dcf"
    eds = (EDS / "cabin.eds").read_text()
    section = eds.index("[2101sub2]")
    value = eds.index("DefaultValue=10\n", section)
    dcf.write_text(eds[:value] + "ParameterValue=7\n" + eds[value:] + "\n[DeviceComissioning]\nNodeID=9\n")
    dictionary = Dictionary.load(dcf)
    assert dictionary.default((0x2101, 2)) == 7
    assert dictionary.node_id == 9
    assert Dictionary.load(dcf, node_id=10).node_id == 10


def test_reads_a_pdo_with_its_mapping() -> None:
    move = pdo(CABIN, 0x1403)
    assert (move.name, move.direction, move.cob_id, move.valid) == ("Move To", PdoDirection.RPDO, 0x108, True)
    assert (move.transmission_type, move.mapping_index) == (254, 0x1603)
    assert [(each.address, each.bits, each.name, each.limits, each.type) for each in move.mapping] == [
        ((0x2000, 1), 12, "Height", Limits(0, 3000), UNSIGNED16),
        ((0x2000, 2), 2, "Ride", Limits(0, 2), UNSIGNED8),
        ((0x2000, 3), 7, "Speed", Limits(0, 100), UNSIGNED16),
        ((0x2000, 5), 3, "Reserved", Limits(0, 0), UNSIGNED8),
        ((0x2000, 4), 16, "Pause", Limits(0, 600), UNSIGNED16),
    ]


def test_reads_a_pdo_that_is_not_valid() -> None:
    listener = pdo(Dictionary.load(EDS / "panel.eds"), 0x1402)
    assert (listener.name, listener.cob_id, listener.valid) == ("Floor Response", 0x195, False)


def test_a_slice_has_the_limits_of_its_whole() -> None:
    cabin = Dictionary.load(EDS.parent / lift.REVERSED / "cabin.eds")
    first = pdo(cabin, 0x1403).mapping[0]
    assert (first.name, first.bits, first.limits) == ("Height (11:4)", 8, Limits(0, 3000))
    assert any(each.is_padding for each in pdo(cabin, 0x1403).mapping)


def test_a_dummy_is_padding(tmp_path: Path) -> None:
    cabin = Dictionary.load(lift.spoilt(tmp_path, ("cabin", "1603sub1", "DefaultValue", "0x00050008")) / "cabin.eds")
    assert pdo(cabin, 0x1603 - 0x200).mapping[0].is_padding


# Mappings that do not hold: entry changed in cabin.eds, its new value (None: no such line), index and reason told.
UNMAPPED = [
    ("1603sub1", "0x2FFF010C", 0x1603, "maps 0x2FFF sub 1, which is missing"),
    ("1603sub2", "0x20000902", 0x1603, "maps 0x2000 sub 9, which is missing"),
    ("1603sub3", "0x20000311", 0x1603, "maps 0x2000 sub 3 with 17 bits, its type has 16"),
    ("1603sub3", "0x20000300", 0x1603, "maps 0x2000 sub 3 with 0 bits, its type has 16"),
    ("1603sub4", None, 0x1603, "sub 4 is missing or has no number as its value"),
    ("1603sub4", "speed", 0x1603, "sub 4 is missing or has no number as its value"),
    ("1603sub0", None, 0x1603, "sub 0 is missing or has no number as its value"),
    ("1601sub0", "2", 0x1601, "maps 0x0000 sub 0, which is missing"),
    ("1404sub1", None, 0x1404, "sub 1 is missing or has no number as its value"),  # only the first four have a default
    ("1403sub1", "0x20000008", 0x1403, "COB-ID 0x20000008 asks for a 29-bit identifier"),
]


@pytest.mark.parametrize(("section", "value", "index", "what"), UNMAPPED)
def test_mapping_that_does_not_hold_is_told_with_file_and_index(
    section: str, value: str | None, index: int, what: str, tmp_path: Path
) -> None:
    file = lift.spoilt(tmp_path, ("cabin", section, "DefaultValue", value)) / "cabin.eds"
    with pytest.raises(MappingError) as error:
        Protocol.of(Dictionary.load(file))
    assert (error.value.file, error.value.index) == (str(file), index)
    assert str(error.value) == f"{file}: 0x{index:04X}: {what}"


def test_pdo_without_a_mapping_record_is_told(tmp_path: Path) -> None:
    file = lift.spoilt(tmp_path) / "cabin.eds"
    file.write_text(file.read_text().replace("[1603", "[1703"))
    with pytest.raises(MappingError, match="0x1603: sub 0 is missing"):
        _ = Dictionary.load(file).pdos


# Files that are no EDS

GOOD = (EDS / "cabin.eds").read_bytes()
BROKEN = [
    ("empty", b"", "not an EDS: it describes no object"),
    ("an INI file of another kind", b"[a]\nb=1\n", "not an EDS: it describes no object"),
    ("text", b"hello\n", "not an EDS: it describes no object"),
    ("binary", bytes(range(256)), "not a readable EDS: line 1: a NUL byte"),
    ("cut in a line", GOOD[: GOOD.index(b"DefaultValue=0x2000010C") + 7], "not a readable EDS: line "),
    ("cut in a section", GOOD[: GOOD.index(b"[1603sub1]") + 30], "the file names no node-ID; give one"),
    ("cut before its data", GOOD[: GOOD.index(b"[1800]")], "the file names no node-ID; give one"),
    (
        "node-ID 0",
        GOOD.replace(b"HighLimit=127\nDefaultValue=2", b"HighLimit=127\nDefaultValue=0"),
        "node-ID 0 is",
    ),
    ("node-ID 200", GOOD + b"\n[DeviceComissioning]\nNodeID=200\n", "node-ID 200 is not in 1..127"),
]


@pytest.mark.parametrize(("content", "what"), [row[1:] for row in BROKEN])
def test_file_that_is_no_eds_is_refused_in_one_line(content: bytes, what: str, tmp_path: Path) -> None:
    file = tmp_path / "cabin.eds"
    file.write_bytes(content)
    with pytest.raises(DictionaryError) as error:
        Dictionary.load(file)
    said = re.sub(r"(0x\w{4}: line) \d+", r"\1 1", str(error.value))  # the line of our files changes with each object
    assert said.startswith(f"{file}: {what}")
    assert "\n" not in said


def test_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    with pytest.raises(DictionaryError) as error:
        Dictionary.load(tmp_path / "cabin.eds")
    assert str(error.value) == f"{tmp_path / 'cabin.eds'}: No such file or directory"


@pytest.mark.parametrize("node_id", [0, 128, -1, 255])
def test_node_id_outside_its_range_is_refused(node_id: int) -> None:
    with pytest.raises(DictionaryError) as error:
        Dictionary.load(EDS / "cabin.eds", node_id)
    assert str(error.value) == f"{EDS / 'cabin.eds'}: node-ID {node_id} is not in 1..127"


def test_a_broken_file_costs_the_user_one_line(tmp_path: Path) -> None:
    folder = lift.spoilt(tmp_path)
    (folder / "cabin.eds").write_text("[a]\nb=1\n")
    command = [sys.executable, "-m", "eurobot_od", "show", "--network", str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == f"eurobot-od: {folder / 'cabin.eds'}: not an EDS: it describes no object\n"


def test_log_messages_of_canopen_are_not_printed() -> None:
    load = f"from eurobot_od.od.dictionary import Dictionary; Dictionary.load({str(EDS / 'cabin.eds')!r})"
    log = "import logging; [logging.getLogger(f'canopen.{name}').error('leak') for name in ('sdo', 'objectdictionary')]"
    done = subprocess.run([sys.executable, "-c", f"{load}; {log}"], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")


# Values


def described(**entries: str) -> bytes:
    """Describe 0x2000 by entries added to a mandatory few, of which they replace some."""
    lines = {"ParameterName": "Value", "DataType": "0x0003", "AccessType": "rw"} | entries
    return "\n".join(["[2000]", *(f"{key}={value}" for key, value in lines.items())]).encode()


VALUES: list[tuple[bytes, Value]] = [
    # INTEGER16
    (described(DefaultValue="-5"), -5),
    (described(DefaultValue="0xFFFB"), -5),  # its bits, as many editors write it
    (described(DefaultValue="010"), 8),  # octal
    (described(DefaultValue="0x10 ; sixteen"), 16),
    (described(defaultvalue="3"), 3),  # any letter case
    (described(DefaultValue="3", ParameterValue="4"), 4),
    (described(DefaultValue="3", ParameterValue=""), 3),
    (described(DefaultValue="three"), None),
    (described(), None),
    (described(DataType="0x07", DefaultValue="$NODEID+0x180"), 0x185),
    (described(DataType="0x07", DefaultValue="0x180+$NODEID"), 0x185),
    (described(DataType="0x07", DefaultValue="$nodeid"), 5),
    (described(DataType="0x08", DefaultValue="1.5"), 1.5),
    (described(DataType="0x09", DefaultValue="a = b"), "a = b"),
    (described(DataType="0x0A", DefaultValue="01 AB"), b"\x01\xab"),
    (described(DataType="0x0A", DefaultValue="words"), None),
    (described(ObjectType="2", DataType=""), None),  # a DOMAIN needs no data type
    (b"\xef\xbb\xbf" + described(DefaultValue="1"), 1),  # a byte order mark
    (described(DefaultValue="1") + b"\n[2000]\nDefaultValue=2\n", 1),  # of a section given twice the first
    (described(ParameterName="M\u00f6tor", DefaultValue="1"), 1),
]


@pytest.mark.parametrize(("data", "value"), VALUES)
def test_a_value_is_read_as_it_was_meant(data: bytes, value: Value) -> None:
    assert Dictionary.read(data, Path("a.eds"), 5).default((0x2000, 0)) == value


@pytest.mark.parametrize(
    ("encoding", "name"), [("utf-8", "M\u00f6tor"), ("latin-1", "M\u00f6tor"), ("utf-16", "Motor")]
)
def test_names_are_read_in_the_encodings_of_editors(encoding: str, name: str) -> None:
    data = described(ParameterName=name).decode().encode(encoding)
    assert Dictionary.read(data, Path("a.eds"), 5).address(name) == (0x2000, 0)


def test_an_enumeration_of_canfestival_has_its_basic_type() -> None:
    data = described(DataType="0x00A0") + b"\n[A0]\n[A0sub1]\nDefaultValue=0x05\n"
    value = Dictionary.read(data, Path("a.eds"), 5).variable((0x2000, 0))
    assert value
    assert data_type(value) == UNSIGNED8


@pytest.mark.parametrize(
    ("data", "node_id"),
    [
        (described(ParameterName="Node-ID", DefaultValue="7"), 7),
        (described(ParameterName="Node-ID", DefaultValue="7") + b"\n[DeviceComissioning]\nNodeID=0x09\n", 9),
        (described() + b"\n[DeviceCommissioning]\nNodeID=9\n", 9),
    ],
)
def test_the_file_may_name_the_node_id(data: bytes, node_id: int) -> None:
    assert Dictionary.read(data, Path("a.eds")).node_id == node_id
    assert Dictionary.read(data, Path("a.eds"), 5).node_id == 5


@pytest.mark.parametrize(
    ("name", "index"),
    [
        ("Place", 0x2011),
        ("Move to", 0x2000),  # not 0x1403, the record of the PDO with that name
        ("Identity object", None),  # a communication object
        ("Nothing", None),
    ],
)
def test_data_is_found_by_its_name(name: str, index: int | None) -> None:
    assert CABIN.data_index(name) == index


def test_node_id_as_the_value_of_the_own_setting_names_none(tmp_path: Path) -> None:
    (tmp_path / "own.eds").write_bytes(described(ParameterName="Node-ID", DefaultValue="$NODEID"))
    with pytest.raises(DictionaryError, match="names no node-ID; give one"):
        Dictionary.load(tmp_path / "own.eds")
    assert Dictionary.load(tmp_path / "own.eds", 5).node_id == 5


# What canopen does not read, and is set after it

DROPPED = [
    ("the limit of a REAL", described(DataType="0x08", LowLimit="-0.5", HighLimit="1.5"), "min", -0.5),
    ("a whole limit of a REAL", described(DataType="0x11", HighLimit="2"), "max", 2.0),
    ("the limit of an INTEGER24", described(DataType="0x10", LowLimit="-5"), "min", -5),
    ("the limit of an INTEGER40 as its bits", described(DataType="0x12", LowLimit="0xFFFFFFFFFE"), "min", -2),
    ("a limit with the node-ID", described(DataType="0x07", HighLimit="$NODEID+0x580"), "max", 0x585),
    ("flags", described(ObjFlags="0x2"), "obj_flags", 2),
    ("a file to load down", described(DataType="0x0F", DownloadFile="a.bin"), "download_file", "a.bin"),
    ("a denotation", described(Denotation="Left wheel"), "denotation", "Left wheel"),
    ("a DOMAIN", described(ObjectType="2", DataType="0x0F"), "object_code", ObjectCode.DOMAIN),
    ("a value that is none of its type", described(ParameterValue="often"), "value_raw", "often"),
]


@pytest.mark.parametrize(("data", "attribute", "value"), [row[1:] for row in DROPPED])
def test_attributes_that_canopen_drops_are_set(data: bytes, attribute: str, value: object) -> None:
    assert getattr(Dictionary.read(data, Path("a.eds"), 5).variable((0x2000, 0)), attribute) == value


def test_the_node_id_is_that_of_the_device_without_a_commissioning_too() -> None:
    dictionary = Dictionary.read(described(), Path("a.eds"), 5)
    assert (dictionary.objects.node_id, dictionary.device.commissioned_node_id) == (5, None)


@pytest.mark.parametrize("made", [["from its file"], ["with its maker's words"]])
def test_a_dictionary_goes_to_another_process_with_its_pdos(made: str) -> None:
    """Workers of an archive get the dictionaries of their parent."""
    dictionary = Dictionary.load(DOCS / "servo.eds", 5)
    dictionary = dictionary.described_by(MakersWords()) if "words" in made else dictionary
    assert pickle.loads(pickle.dumps(dictionary)).pdos == dictionary.pdos
