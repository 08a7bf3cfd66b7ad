"""An outline says what the dictionary says, without canopen; what is common practice is read as it was meant."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from eurobot_od.errors import DictionaryError, MappingError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.outline import Described, Outline
from eurobot_od.od.values import DATA_TYPES, UNSIGNED32, VISIBLE_STRING, Value

ROOT = Path(__file__).parents[2]
OWN = sorted(ROOT.glob("eds/*/*.eds"))
SAMPLES = sorted((ROOT / "tests" / "lint" / "samples").iterdir())
DRIVE = ROOT / "eds" / "canopen" / "drive.eds"
BROKEN = {"broken_by_hand.eds"}
"""Samples that nobody can load."""

UNMAPPED = {"compact_drive.eds": 0x1600}
"""Samples with a mapping that does not hold, and its index."""


@pytest.mark.parametrize("file", OWN + SAMPLES, ids=lambda file: f"{file.parent.name}-{file.name}")
def test_outline_and_dictionary_agree(file: Path) -> None:
    if file.name in BROKEN:
        with pytest.raises(DictionaryError, match="not a readable EDS: line 25"):
            Outline.load(file, 5)
        return
    outline, dictionary = Outline.load(file, 5), Dictionary.load(file, 5)
    assert (outline.file, outline.name, outline.node_id) == (file, dictionary.name, dictionary.node_id)
    assert set(outline.addresses()) == {a for a in dictionary.addresses() if dictionary.variable(a)}
    for address in outline.addresses():
        variable, described = dictionary.variable(address), outline.described(address)
        assert variable is not None
        assert described is not None
        assert (described.name, described.type.code) == (variable.qualname, variable.data_type)
        assert outline.default(address) == (variable.default if variable.value is None else variable.value)
    if file.name in UNMAPPED:
        for each in (outline, dictionary):
            with pytest.raises(MappingError, match=f"0x{UNMAPPED[file.name]:04X}"):
                _ = each.pdos
    else:
        assert outline.pdos == dictionary.pdos


@pytest.mark.parametrize(
    ("address", "expected"),
    [
        ((0x1018, 1), Described("Identity object.Vendor-ID", UNSIGNED32)),
        ((0x1008, 0), Described("Manufacturer device name", VISIBLE_STRING)),
        ((0x2000, 99), None),
        ((0x5FFF, 0), None),
    ],
)
def test_objects_are_described(address: tuple[int, int], expected: Described | None) -> None:
    assert Outline.load(DRIVE).described(address) == expected


@pytest.mark.parametrize(
    ("name", "index"),
    [
        ("Kalman position", 0x2011),
        ("Goto XY", 0x2000),  # not 0x1403, the record of the PDO with that name
        ("Identity object", None),  # a communication object
        ("Nothing", None),
    ],
)
def test_data_is_found_by_its_name(name: str, index: int | None) -> None:
    assert Outline.load(DRIVE).data_index(name) == index


def test_node_id_as_the_value_of_the_own_setting_names_none(tmp_path: Path) -> None:
    (tmp_path / "own.eds").write_bytes(variable(ParameterName="Node-ID", DefaultValue="$NODEID"))
    with pytest.raises(DictionaryError, match="names no node-ID; give one"):
        Outline.load(tmp_path / "own.eds")
    assert Outline.load(tmp_path / "own.eds", 5).node_id == 5


def test_an_outline_does_without_canopen() -> None:
    code = (
        f"import sys; from eurobot_od.od.outline import Outline; Outline.load({str(DRIVE)!r}).pdos; print(*sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert {"canopen", "can", "yaml", "logging"} & set(done.stdout.split()) == set()


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(DictionaryError, match="No such file"):
        Outline.load(tmp_path / "missing.eds")
    (tmp_path / "empty.eds").touch()
    with pytest.raises(DictionaryError, match="it describes no object"):
        Outline.load(tmp_path / "empty.eds")


def test_a_mapping_that_does_not_hold_is_told(spoil_eds: Callable[..., Path]) -> None:
    broken = spoil_eds(("drive", "1600sub0", "DefaultValue", None)) / "drive.eds"
    with pytest.raises(MappingError):
        _ = Outline.load(broken).pdos


def variable(**entries: str) -> bytes:
    """Describe 0x2000 by entries added to a mandatory few, of which they replace some."""
    lines = {"ParameterName": "Value", "DataType": "0x0003", "AccessType": "rw"} | entries
    return "\n".join(["[2000]", *(f"{key}={value}" for key, value in lines.items())]).encode()


VALUES: list[tuple[bytes, Value]] = [
    # INTEGER16
    (variable(DefaultValue="-5"), -5),
    (variable(DefaultValue="0xFFFB"), -5),  # its bits, as many editors write it
    (variable(DefaultValue="010"), 8),  # octal
    (variable(DefaultValue="0x10 ; sixteen"), 16),
    (variable(defaultvalue="3"), 3),  # any letter case
    (variable(DefaultValue="3", ParameterValue="4"), 4),
    (variable(DefaultValue="3", ParameterValue=""), 3),
    (variable(DefaultValue="three"), None),
    (variable(), None),
    (variable(DataType="0x07", DefaultValue="$NODEID+0x180"), 0x185),
    (variable(DataType="0x07", DefaultValue="0x180+$NODEID"), 0x185),
    (variable(DataType="0x07", DefaultValue="$nodeid"), 5),
    (variable(DataType="0x08", DefaultValue="1.5"), 1.5),
    (variable(DataType="0x09", DefaultValue="a = b"), "a = b"),
    (variable(DataType="0x0A", DefaultValue="01 AB"), b"\x01\xab"),
    (variable(DataType="0x0A", DefaultValue="words"), None),
    (variable(ObjectType="2", DataType=""), None),  # a DOMAIN needs no data type
    (b"\xef\xbb\xbf" + variable(DefaultValue="1"), 1),  # a byte order mark
    (variable(DefaultValue="1") + b"\n[2000]\nDefaultValue=2\n", 1),  # of a section given twice the first
    (variable(ParameterName="M\u00f6tor", DefaultValue="1"), 1),
]


@pytest.mark.parametrize(("data", "value"), VALUES)
def test_a_value_is_read_as_it_was_meant(data: bytes, value: Value) -> None:
    for kind in (Outline, Dictionary):
        assert kind.read(data, Path("a.eds"), 5).default((0x2000, 0)) == value


@pytest.mark.parametrize(
    ("encoding", "name"), [("utf-8", "M\u00f6tor"), ("latin-1", "M\u00f6tor"), ("utf-16", "Motor")]
)
def test_names_are_read_in_the_encodings_of_editors(encoding: str, name: str) -> None:
    data = variable(ParameterName=name).decode().encode(encoding)
    assert Outline.read(data, Path("a.eds"), 5).address(name) == (0x2000, 0)


def test_an_enumeration_of_canfestival_has_its_basic_type() -> None:
    data = variable(DataType="0x00A0") + b"\n[A0]\n[A0sub1]\nDefaultValue=0x05\n"
    described = Outline.read(data, Path("a.eds"), 5).described((0x2000, 0))
    assert described == Described("Value", DATA_TYPES[0x05])


@pytest.mark.parametrize(
    ("data", "node_id"),
    [
        (variable(ParameterName="Node-ID", DefaultValue="7"), 7),
        (variable(ParameterName="Node-ID", DefaultValue="7") + b"\n[DeviceComissioning]\nNodeID=0x09\n", 9),
        (variable() + b"\n[DeviceCommissioning]\nNodeID=9\n", 9),
    ],
)
def test_the_file_may_name_the_node_id(data: bytes, node_id: int) -> None:
    assert Outline.read(data, Path("a.eds")).node_id == node_id
    assert Outline.read(data, Path("a.eds"), 5).node_id == 5
