"""Patches: what they put in place of a file's words, and what they may not say."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from eurobot_od.errors import DictionaryError, FileError
from eurobot_od.od import objects as od
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.normal import normal
from eurobot_od.od.values import Address
from tests.eds_text import DEVICE_TYPE, record, variable

BASE = (
    DEVICE_TYPE
    + "; how it moves\n"
    + record(0x2000, "Motion", (0, "UNSIGNED8", "1"), (1, "INTEGER16", "5"))
    + variable("2001", "Title", "VISIBLE_STRING", "abc")
    + "[2002]\nParameterName=Levels\nObjectType=8\nDataType=6\nAccessType=rw\nCompactSubObj=3\nDefaultValue=7\n\n"
    + "[2003]\nParameterName=Lost\nDataType=5\n\n"
    + variable("2004", "Identifier", "UNSIGNED32", "$NODEID+0x200", "LowLimit=1\nHighLimit=0x7FF\n")
    + record(0x1A00, "TPDO mapping", (0, "UNSIGNED8", "0"), (1, "UNSIGNED32", "0x20010010"))
)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a device's file."""
    (tmp_path / "base.eds").write_text(BASE)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def patched(*patches: str) -> Dictionary:
    files = [Path(f"patch{number}.yaml") for number in range(len(patches))]
    for file, text in zip(files, patches):
        file.write_text(text)
    return Dictionary.load("base.eds", 5, patch=files)


# A patch, and an attribute that one variable has by it.
SAID: list[tuple[str, Address, str, Any]] = [
    ("0x2000:1: {ParameterValue: -7}", (0x2000, 1), "value", -7),
    ("0x2000:1: {ParameterValue: 0xFFF9}", (0x2000, 1), "value", -7),  # its bits, as editors write them
    ("2000sub1: {DefaultValue: 6}", (0x2000, 1), "default", 6),
    ("Motion.Entry 1: {defaultvalue: 6}", (0x2000, 1), "default", 6),  # keys and names in any letter case
    ("motion.entry 1: {AccessType: CONST}", (0x2000, 1), "access_type", "const"),
    ("0x2001: {ParameterName: Headline}", (0x2001, 0), "name", "Headline"),
    ("0x2001:0: {DefaultValue: off}", (0x2001, 0), "default", "off"),  # a text, whatever YAML makes of it
    ("0x2001: {PDOMapping: 0}", (0x2001, 0), "pdo_mappable", False),
    ("0x2002:2: {DefaultValue: 9}", (0x2002, 2), "default", 9),  # one of a compact array
    ("0x2003: {AccessType: ro}", (0x2003, 0), "access_type", "ro"),  # what could not be used, mended
    ("0x2004: {HighLimit: 0x300}", (0x2004, 0), "max", 0x300),
    ("0x2004: {HighLimit: }", (0x2004, 0), "max", None),  # nothing takes away
    ("0x2004: {DefaultValue: $NODEID+0x300}", (0x2004, 0), "default", 0x305),
    ("0x2004: {DefaultValue: -1, LowLimit: -1, DataType: INTEGER32}", (0x2004, 0), "default", -1),  # by the new type
    (
        "0x2100: {ParameterName: Fan, DataType: REAL32, AccessType: rw, DefaultValue: '1,5'}",
        (0x2100, 0),
        "default",
        1.5,
    ),
]


@pytest.mark.parametrize(("patch", "address", "attribute", "value"), SAID)
def test_a_patch_counts_more_than_the_file(patch: str, address: Address, attribute: str, value: object) -> None:
    loaded = patched(patch)
    found = loaded.variable(address)
    assert found is not None
    assert getattr(found, attribute) == value
    assert not [
        change for change in loaded.normal.deviations if change not in Dictionary.load("base.eds", 5).normal.deviations
    ]


def test_a_patch_changes_nothing_else() -> None:
    before, after = Dictionary.load("base.eds", 5), patched("0x2000:1: {ParameterValue: 7}")
    assert after.content == normal(after.content).text.encode()
    lines = after.content.decode().splitlines()
    assert [each for each in lines if each not in normal(before.content).text.splitlines()] == ["ParameterValue=7"]
    assert lines.count("; how it moves") == 1


def test_a_later_patch_counts_more_than_an_earlier_one() -> None:
    loaded = patched("0x2000:1: {ParameterValue: 1, LowLimit: 0}", "0x2000:1: {ParameterValue: 2}")
    found = loaded.variable((0x2000, 1))
    assert found is not None
    assert (found.value, found.min) == (2, 0)


@pytest.mark.parametrize(("key", "other"), [("DownloadFile", "ParameterValue"), ("ParameterValue", "DownloadFile")])
def test_a_value_and_a_file_take_each_other_away(key: str, other: str) -> None:
    words = patched(f"0x2001: {{{other}: old}}", f"0x2001: {{{key}: new}}").content.decode()
    assert (f"{key}=new" in words, f"{other}=" in words) == (True, False)


NEW = """0x2200: {ParameterName: Lamps, ObjectType: RECORD}
0x2200:1: {ParameterName: Left, DataType: BOOLEAN, AccessType: rw}
0x2200:3: {ParameterName: Right, DataType: 0x0001, AccessType: rw}
0x2200:255: {ParameterName: Structure, DataType: UNSIGNED32, AccessType: const}
0x2201: {ParameterName: Fans, ObjectType: 0x8}
0x2201:0: {ParameterName: Number, DataType: UNSIGNED8, AccessType: ro, DefaultValue: 0}
0x2201:1: {ParameterName: Fan, DataType: BOOLEAN, AccessType: rw}
0x2000:2: {ParameterName: Ramp, DataType: UNSIGNED16, AccessType: rw}
0x1A00:2: {ParameterName: Second, DataType: UNSIGNED32, AccessType: rw}
"""


def test_new_sub_indices_are_counted_where_sub_index_0_is_the_highest() -> None:
    loaded = patched(NEW)
    assert [od.label(each) for each in od.members(loaded.objects, 0x2200)] == [
        "0x2200:0 Lamps.Highest sub-index supported",
        "0x2200:1 Lamps.Left",
        "0x2200:3 Lamps.Right",
        "0x2200:255 Lamps.Structure",
    ]
    assert [loaded.number(each) for each in ((0x2200, 0), (0x2000, 0), (0x2201, 0))] == [3, 2, 1]
    assert set(loaded.normal.deviations) == set(
        Dictionary.load("base.eds", 5).normal.deviations
    )  # SubNumber is right without a change
    assert loaded.number((0x1A00, 0)) == 0  # so many objects are mapped, which is for the patch to say


# A patch, and the words about its line.
WRONG = [
    ("0x2000:1: 5", "1:11: expected a mapping, `key: value`, found '5'"),
    ("0x2001: {}\n0x2000:1: {DefaultValue: 40000}", "2: DefaultValue '40000': expected INTEGER16, -32768..32767"),
    ("0x2000:1: {LowLimit: -32769}", "1: LowLimit '-32769': expected INTEGER16, -32768..32767"),
    ("0x2000:1:\n  DefaultValue: fast", "2: DefaultValue 'fast': expected INTEGER16, -32768..32767"),
    ("0x2000:1: {AccessType: wr}", "1: AccessType 'wr': expected ro, wo, rw, rwr, rww, const"),
    ("0x2000:1: {AccessType: }", "1: AccessType '': expected ro, wo, rw, rwr, rww, const"),
    ("0x2000:1: {PDOMapping: yes}", "1: PDOMapping 'yes': expected 0 or 1"),
    ("0x2000:1: {DataType: INT}", "1: DataType 'INT': expected a basic data type, such as UNSIGNED16 or 0x0006"),
    ("0x2000:1: {Default: 1}", "1: unknown key 'Default'; did you mean DefaultValue?"),
    ("0x2000:1: {LowLimit: 1, lowlimit: 2}", "1: key 'lowlimit' is given twice"),
    ("0x2000: {DefaultValue: 1}", "1: DefaultValue: 0x2000 has sub-indices, which are named as 0x2000:1"),
    (
        "0x2000: {ObjectType: ARRAY}",
        "1: 0x2000 exists already, with an ObjectType: `set` changes it; a new one takes a free index",
    ),
    ("Motion.Sped: {LowLimit: 1}", "1: unknown object 'Motion.Sped'"),
    ("Levels.Levels: {LowLimit: 1}", "1: 'Levels.Levels' may be 0x2002:1, 0x2002:2, 0x2002:3; write which"),
    ("0x2000:256: {LowLimit: 1}", "1: '0x2000:256': sub-index 256 is not in 0..255"),
    ("0x0005: {ParameterName: x}", "1: index 0x0005 is not in 0x1000..0xFFFF"),
    ('0x2001: {ParameterName: "a\\nb"}', "1: ParameterName: a line of an EDS cannot hold 'a\\nb'"),
    ("0x2300: {DataType: BOOLEAN}", "1: the file has no 0x2300, and a new one needs ParameterName and AccessType"),
    (
        "0x2300:1: {ParameterName: x, DataType: BOOLEAN, AccessType: rw}",
        "1: there is no 0x2300: name it above, with `ObjectType: RECORD`",
    ),
    (
        "0x2001:1: {ParameterName: x, DataType: BOOLEAN, AccessType: rw}",
        "1: 0x2001 is a variable: it has no sub-indices",
    ),
    ("0x2300: {ParameterName: x, ObjectType: NULL}", "1: the file has no 0x2300, and a new one needs"),
]


@pytest.mark.parametrize(("patch", "words"), WRONG)
def test_a_patch_that_does_not_fit_is_refused_with_its_line(patch: str, words: str) -> None:
    with pytest.raises(FileError) as error:
        patched(patch)
    assert str(error.value).startswith(f"patch0.yaml:{words}")
    assert "\n" not in str(error.value)


DCF = (
    BASE.replace("DefaultValue=abc", "DefaultValue=abc\nParameterValue=xyz").replace("DefaultValue=5", "DefaultValue=1")
    + "[2002Value]\nNrOfEntries=1\n2=11\n\n"
    + "[DeviceComissioning]\nNodeID=9\nBaudrate=250\nNodeName=pump\n"
)


def test_a_dcf_over_a_file_gives_its_values_and_says_which_node_it_is() -> None:
    Path("own.dcf").write_text(DCF)
    loaded = Dictionary.load("base.eds", patch=["own.dcf"])
    assert (loaded.node_id, loaded.device.commissioned_node_id) == (9, 9)
    assert [loaded.default(each) for each in ((0x2001, 0), (0x2002, 2), (0x2000, 1))] == ["xyz", 11, 5]
    assert Dictionary.read(loaded.content, Path("again.dcf")).default((0x2002, 2)) == 11


def test_a_file_beside_the_dcf_is_found_there(folder: Path) -> None:
    from eurobot_od.od import dcf

    (folder / "own").mkdir()
    (folder / "own" / "title.bin").write_bytes(b"\x00\x01")
    Path("own/own.dcf").write_text(BASE.replace("DefaultValue=abc", "DownloadFile=title.bin"))
    assert dcf.content(Dictionary.load("base.eds", 5, patch=["own/own.dcf"]), (0x2001, 0)) == b"\x00\x01"


# Text in the base's place, and the words about the DCF over it.
WRONG_DCF = [
    (DCF.replace("[2001]", "[2009]"), "the file has no 0x2009:0, and a new one needs"),
    (DCF.replace("2=11", "2=many"), "ParameterValue 'many': expected UNSIGNED16, 0..65535"),
    (DCF.replace("ParameterValue=xyz", "ParameterValue=x\ty"), "ParameterValue: a line of an EDS cannot hold"),
    ("[1000\n", "1: a malformed section header"),
]


@pytest.mark.parametrize(("text", "words"), WRONG_DCF, ids=lambda each: str(each)[-40:])
def test_a_dcf_that_does_not_fit_is_refused(text: str, words: str) -> None:
    Path("own.dcf").write_text(text)
    with pytest.raises(DictionaryError) as error:
        Dictionary.load("base.eds", patch=["own.dcf"])
    assert words in str(error.value)
    assert str(error.value).startswith("own.dcf:")


COUPLER = Path(__file__).parent / "samples" / "coupler.eds"


def test_objects_of_modules_can_be_patched_and_a_dcf_connects_them() -> None:
    Path("own.dcf").write_text("[ConnectedModules]\nNrOfEntries=1\n1=1\n")
    names = [each.qualname for each in od.all_objects(Dictionary.load(COUPLER, 5, modules=["1"]).objects)]
    brought = [each for each in names if each not in _names(Dictionary.load(COUPLER, 5))]
    Path("own.yaml").write_text(f"'{brought[-1]}': {{ParameterName: Mine}}\n")
    loaded = Dictionary.load(COUPLER, 5, patch=["own.dcf", "own.yaml"])
    assert len(_names(loaded)) == len(names)
    assert any("Mine" in each for each in _names(loaded))


def test_a_module_that_a_dcf_connects_and_the_file_does_not_have_is_refused() -> None:
    Path("own.dcf").write_text("[ConnectedModules]\nNrOfEntries=1\n1=77\n")
    with pytest.raises(DictionaryError, match="module 77 is not supported"):
        Dictionary.load(COUPLER, 5, patch=["own.dcf"])


def _names(dictionary: Dictionary) -> list[str]:
    return [each.qualname for each in od.all_objects(dictionary.objects)]
