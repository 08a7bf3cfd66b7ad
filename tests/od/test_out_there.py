"""EDS and DCF files as they are written out there: loaded as they are meant, and in their normal form for all tools."""

from __future__ import annotations

import logging
import re
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import canopen
import pytest

from eurobot_od.errors import DictionaryError
from eurobot_od.export.xdd import xdd_text
from eurobot_od.lint.rules import lint
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.normal import in_normal_form
from eurobot_od.od.objects import data_type
from eurobot_od.od.values import DATA_TYPES, Address, Value
from eurobot_od.pdo.protocol import Protocol
from tests.eds_text import pdo, variable
from tests.rows import rows

NODE_ID = 5

BASE = """\
[FileInfo]
FileName=a.eds
EDSVersion=4.0

[DeviceInfo]
VendorName=V
VendorNumber=1
ProductNumber=2

[DummyUsage]
Dummy0001=0
Dummy0002=0
Dummy0003=0
Dummy0004=0
Dummy0005=1
Dummy0006=0
Dummy0007=0

[Comments]
Lines=1
Line1=one

[MandatoryObjects]
SupportedObjects=1
1=0x1000

[OptionalObjects]
SupportedObjects=1
1=0x1014

[ManufacturerObjects]
SupportedObjects=2
1=0x2000
2=0x2001

[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x10

[1014]
ParameterName=COB-ID EMCY
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=$NODEID+0x80

[2000]
ParameterName=Speeds
ObjectType=0x8
SubNumber=3

[2000sub0]
ParameterName=Highest sub-index
ObjectType=0x7
DataType=0x0005
AccessType=ro
DefaultValue=2

[2000sub1]
ParameterName=First
ObjectType=0x7
DataType=0x0003
AccessType=rw
DefaultValue=-5

[2000sub2]
ParameterName=Second
ObjectType=0x7
DataType=0x0003
AccessType=rw
DefaultValue=7

[2001]
ParameterName=Label
ObjectType=0x7
DataType=0x0009
AccessType=rw
DefaultValue=arm
"""

DEFAULTS: dict[Address, Value] = {
    (0x1000, 0): 0x10,
    (0x1014, 0): 0x85,
    (0x2000, 0): 2,
    (0x2000, 1): -5,
    (0x2000, 2): 7,
    (0x2001, 0): "arm",
}


class Variation(NamedTuple):
    """What is written otherwise, how, which values that gives beyond those of the base, and whether it needs repair."""

    reason: str
    old: str
    new: str
    values: dict[Address, Value] = {}  # noqa: RUF012  # never changed
    needs_repair: bool = True


def without(section: str) -> tuple[str, str]:
    """Take a section with all its entries out."""
    start = BASE.index(f"[{section}]")
    end = BASE.find("\n\n", start) + 2
    return BASE[start:end], ""


def typed(code: int, default: str) -> str:
    """A variable's type, access and value."""
    return f"DataType=0x{code:04X}\nAccessType=rw\nDefaultValue={default}"


ADDRESS_1, ADDRESS_2, LABEL = (0x2000, 1), (0x2000, 2), (0x2001, 0)
FIRST, SECOND, COB_ID = "DefaultValue=-5", typed(0x03, "7"), "DefaultValue=$NODEID+0x80"
NO_TYPE = "AccessType=ro\nDefaultValue=0x10"
VAR_SUB = "[1014sub0]\nParameterName=Odd\nDataType=5\nAccessType=ro\n"
COMPACT_ARRAY = """\
[2002]
ParameterName=Gain
ObjectType=8
DataType=4
AccessType=rw
DefaultValue=1
CompactSubObj=2
[2002Name]
NrOfEntries=1
2=Last
[2002Value]
NrOfEntries=1
2=9
"""
COMPACT_HEARTBEATS = """\
[1016]
ParameterName=Consumer heartbeat time
ObjectType=8
AccessType=rw
DefaultValue=7
CompactSubObj=2
"""
COMPACT_RECORD = """\
[2002]
ParameterName=Gain
ObjectType=9
DataType=7
AccessType=rw
CompactSubObj=0x2
[2002Value]
NrOfEntries=1
1=0xA
"""

VARIATIONS = [
    Variation("the base itself", "", "", needs_repair=False),
    # How it is written
    Variation("a comment after a value", FIRST, "DefaultValue=-5 ; slow"),
    Variation("a comment with #", FIRST, f"# slow\n{FIRST}"),
    Variation("an indented line", FIRST, f"  {FIRST}"),
    Variation("blanks around the equals sign", FIRST, "DefaultValue = -5", needs_repair=False),
    Variation("a section twice, the second as a left-over", "[2001]", "[2000sub1]\nDefaultValue=9\n[2001]"),
    Variation("a section twice in another case", "[2001]", "[2000SUB1]\nDefaultValue=9\n[2001]"),
    Variation("a key twice", FIRST, f"{FIRST}\nDefaultValue=9"),
    Variation("a key twice in another case", FIRST, f"{FIRST}\ndefaultvalue=9"),
    Variation("a section in another case", "[FileInfo]", "[FILEINFO]"),
    Variation("a sub-index in capitals", "[2000sub1]", "[2000SUB1]"),
    Variation("keys in another case", "ParameterName=First", "PARAMETERNAME=First"),
    Variation("a list in another case", "[OptionalObjects]\nSupportedObjects", "[optionalobjects]\nsupportedobjects"),
    Variation("line5", "Line1=one", "line1=one"),
    Variation("0x in a section's name", "[2000sub1]", "[0x2000sub1]"),
    Variation("a leading zero in a section's name", "[2000sub1]", "[2000sub01]"),
    Variation("a blank in a section's name", "[2000sub1]", "[2000 sub1]"),
    # Lines that are none of an EDS
    Variation("a stray line of text", FIRST, f"see the manual\n{FIRST}"),
    Variation("a line of text before the first section", "[FileInfo]", "Made by hand\n[FileInfo]"),
    Variation("an entry before the first section", "[FileInfo]", "Tool=x\n[FileInfo]"),
    Variation("an entry without a key", FIRST, f"=9\n{FIRST}"),
    Variation("a stray line of text at the end", "DefaultValue=arm\n", "DefaultValue=arm\nthat is all\n"),
    # What is missing
    Variation("no [FileInfo]", *without("FileInfo"), needs_repair=False),
    Variation("no [DeviceInfo]", *without("DeviceInfo"), needs_repair=False),
    Variation("no [DummyUsage]", *without("DummyUsage"), needs_repair=False),
    Variation("no [Comments]", *without("Comments"), needs_repair=False),
    Variation("dummies that are not there", "Dummy0006=0\nDummy0007=0\n", ""),
    Variation("no lists of objects", BASE[BASE.index("[Mandatory") : BASE.index("[1000]")], ""),
    Variation("a list with a wrong count", "SupportedObjects=2", "SupportedObjects=9"),
    Variation("no SubNumber", "SubNumber=3\n", ""),
    Variation("a wrong SubNumber", "SubNumber=3", "SubNumber=2"),
    Variation("no ObjectType of a VAR", "ObjectType=0x7\nDataType=0x0009", "DataType=0x0009", needs_repair=False),
    Variation("no ObjectType of a record", "ObjectType=0x8\nSubNumber=3\n", ""),
    Variation("no DataType of sub-index 0", "DataType=0x0005\n", ""),
    Variation("no DataType where the standard has it", "DataType=0x0007\nAccessType=ro\nDefaultValue=0x10", NO_TYPE),
    Variation("no DataType in an array", SECOND, "AccessType=rw\nDefaultValue=7"),
    Variation("no Lines", "Lines=1\n", ""),
    Variation("no ParameterName", "ParameterName=First\n", "", needs_repair=False),
    # Empty values
    Variation("an empty VendorNumber", "VendorNumber=1", "VendorNumber="),
    Variation("an empty default", FIRST, "DefaultValue=", {ADDRESS_1: None}),
    Variation("an empty limit", FIRST, f"LowLimit=\nHighLimit=\n{FIRST}"),
    Variation("an empty ParameterValue", FIRST, f"{FIRST}\nParameterValue="),
    Variation("an empty ObjFlags", FIRST, f"{FIRST}\nObjFlags="),
    # Numbers
    Variation("C's suffix", FIRST, "DefaultValue=0x10LL", {ADDRESS_1: 16}),
    Variation("C's other suffix", FIRST, "DefaultValue=10u", {ADDRESS_1: 10}),
    Variation("hexadecimal with h", FIRST, "DefaultValue=0FFh", {ADDRESS_1: 255}),
    Variation("capital X", FIRST, "DefaultValue=0XfF", {ADDRESS_1: 255}, needs_repair=False),
    Variation("a negative number as its bits", FIRST, "DefaultValue=0xFFFB", needs_repair=False),
    Variation("the lowest number as its bits", FIRST, "DefaultValue=0x8000", {ADDRESS_1: -0x8000}, needs_repair=False),
    Variation("octal", FIRST, "DefaultValue=010", {ADDRESS_1: 8}, needs_repair=False),
    Variation("a type with a suffix", "DataType=0x0009", "DataType=0x9L"),
    Variation("a type without leading zeros", "DataType=0x0009", "DataType=9", needs_repair=False),
    # $NODEID
    Variation("$NODEID in another case", COB_ID, "DefaultValue=$NodeID+0x80"),
    Variation("$NODEID in lower case", COB_ID, "DefaultValue=$nodeid+128"),
    Variation("$NODEID last", COB_ID, "DefaultValue=0x80+$NODEID"),
    Variation("$NODEID last, with blanks and in another case", COB_ID, "DefaultValue=0x80 + $NodeId"),
    Variation("$NODEID in brackets", COB_ID, "DefaultValue=($NODEID+0x80)"),
    Variation("$NODEID between", COB_ID, "DefaultValue=0x40+$NODEID+0x40"),
    Variation("$NODEID with a suffix", COB_ID, "DefaultValue=$NODEID+0x80UL"),
    Variation("$NODEID alone", COB_ID, "DefaultValue=$NODEID", {(0x1014, 0): 5}, needs_repair=False),
    Variation("$NODEID with all bits", COB_ID, "DefaultValue=0x80000080+$NODEID", {(0x1014, 0): 0x80000085}),
    Variation("$NODEID with a word", COB_ID, "DefaultValue=$NODEID+high", {(0x1014, 0): None}),
    Variation("$NODEID less a number", COB_ID, "DefaultValue=$NODEID-0x80", {(0x1014, 0): None}),
    # Types
    Variation("INTEGER64", SECOND, typed(0x15, "-0x7FFFFFFFFFFFFFFF"), {ADDRESS_2: -(2**63) + 1}, needs_repair=False),
    Variation("UNSIGNED64", SECOND, typed(0x1B, "0xFFFFFFFFFFFFFFFF"), {ADDRESS_2: 2**64 - 1}, needs_repair=False),
    Variation("REAL32 as its bits", SECOND, typed(0x08, "0x3FC00000"), {ADDRESS_2: 1.5}, needs_repair=False),
    Variation("REAL32 with C's suffix", SECOND, typed(0x08, "0.0f"), {ADDRESS_2: 0.0}),
    Variation("REAL32 with a comma", SECOND, typed(0x08, "1,5"), {ADDRESS_2: 1.5}),
    Variation("REAL64 with a comma in its limit", SECOND, f"HighLimit=2,5\n{typed(0x11, '1')}", {ADDRESS_2: 1.0}),
    Variation("a DOMAIN in hexadecimal", SECOND, typed(0x0F, "0x0000"), {ADDRESS_2: b"\0\0"}, needs_repair=False),
    Variation("a DOMAIN by its type", SECOND, typed(0x0F, "0102"), {ADDRESS_2: b"\1\2"}, needs_repair=False),
    Variation("a DOMAIN without a type", "ObjectType=0x7\nDataType=0x0009", "ObjectType=0x2", {LABEL: None}),
    # Kinds
    Variation("a VAR with sub-indices", "[2001]", f"{VAR_SUB}\n[2001]", needs_repair=False),
    Variation("DeviceCommissioning", "[1000]", "[DeviceCommissioning]\nNodeID=5\n\n[1000]"),
    # Compact
    Variation("a compact array", "[2001]", f"{COMPACT_ARRAY}\n[2001]",
              {(0x2002, 0): 2, (0x2002, 1): 1, (0x2002, 2): 9}),
    Variation("a compact record", "[2001]", f"{COMPACT_RECORD}\n[2001]",
              {(0x2002, 0): 2, (0x2002, 1): 10, (0x2002, 2): None}),
    Variation("a compact array without a type", "[2001]", COMPACT_ARRAY.replace("DataType=4\n", "") + "\n[2001]",
              {(0x2002, 0): 2, (0x2002, 1): b"\x01", (0x2002, 2): b"\x09"}),
    Variation("a compact array of the standard without a type", "[2001]", f"{COMPACT_HEARTBEATS}\n[2001]",
              {(0x1016, 0): 2, (0x1016, 1): 7, (0x1016, 2): 7}),
]  # fmt: skip


def text_of(variation: Variation) -> str:
    assert variation.old in BASE
    return BASE.replace(variation.old, variation.new, 1)


def load(data: bytes) -> Dictionary:
    return Dictionary.read(data, Path("a.eds"), NODE_ID)


def defaults(data: bytes) -> dict[Address, Value]:
    loaded = load(data)
    return {address: loaded.default(address) for address in loaded.addresses()}


@rows("variation", VARIATIONS)
def test_a_file_is_loaded_as_it_is_meant_and_what_was_looked_over_is_listed(variation: Variation) -> None:
    data = text_of(variation).encode()
    assert defaults(data) == DEFAULTS | variation.values
    assert bool(load(data).normal.deviations) is variation.needs_repair


@rows("variation", VARIATIONS)
def test_the_normal_form_says_the_same_is_its_own_and_is_read_by_canopen_alone(
    tmp_path: Path, variation: Variation, caplog: pytest.LogCaptureFixture
) -> None:
    data, _ = in_normal_form(text_of(variation).encode())
    assert defaults(data) == DEFAULTS | variation.values
    assert in_normal_form(data) == (data, [])
    file = tmp_path / "a.eds"
    file.write_bytes(data)
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        objects = canopen.import_od(str(file), node_id=NODE_ID)
    assert not caplog.records
    found = {
        (each.index, each.subindex): each.default if each.value is None else each.value
        for entry in objects.values()
        if entry.index >= 0x1000
        for each in getattr(entry, "subindices", {0: entry}).values()
    }
    assert found == DEFAULTS | variation.values


# What stays

KEPT = [
    ("a comment above an entry", FIRST, f"; slow\n{FIRST}", f"; slow\n{FIRST}"),
    ("a comment after a value", FIRST, f"{FIRST} ; slow", f"; slow\n{FIRST}"),
    ("a comment above a section", "[2001]", "# the end\n[2001]", "\n; the end\n[2001]"),
    ("a comment at the end", BASE[-20:], f"{BASE[-20:]}; the end", "; the end\n"),
    ("the second of two entries", FIRST, f"{FIRST}\nDefaultValue=9", ";DefaultValue=9\n"),
    ("the second of two sections", "[2001]", "[2000sub1]\nDefaultValue=9\n[2001]", ";[2000sub1]\n;DefaultValue=9\n"),
    ("a default that is none", FIRST, "DefaultValue=slow", "\n;DefaultValue=slow\n"),
    ("a key of the maker", FIRST, f"{FIRST}\nMaker=x", "\nMaker=x\n"),
    ("a section of the maker", "[2001]", "[Maker]\nKey=1\n\n[2001]", "\n[Maker]\nKey=1\n"),
    ("a stray line of text", FIRST, f"{FIRST}\nsee the manual", "\n;see the manual\n"),
    ("a $NODEID that is none", COB_ID, "DefaultValue=$NODEID+high", "\n;DefaultValue=$NODEID+high\n"),
    ("sub-indices of a variable", "[2001]", f"{VAR_SUB}\n[2001]", "\n;[1014sub0]\n;ParameterName=Odd\n"),
]


@pytest.mark.parametrize(("old", "new", "kept"), [row[1:] for row in KEPT])
def test_normal_form_keeps_every_value(old: str, new: str, kept: str) -> None:
    data, _ = in_normal_form(BASE.replace(old, new, 1).encode())
    assert kept in data.decode()
    assert in_normal_form(data)[0] == data


# Bytes

END_MARK = "Ctrl-Z or NUL at the end taken off"
BYTES = [
    ("a byte order mark", b"\xef\xbb\xbf" + BASE.encode(), "byte order mark taken off"),
    ("UTF-16", BASE.encode("utf-16"), "UTF-16 written as UTF-8"),
    ("Latin-1 in a name", BASE.replace("Label", "L\xe4bel").encode("latin-1"), "Latin-1 written as UTF-8"),
    ("mixed line ends", BASE.replace("\n", "\r\n", 9).encode(), "line ends made alike"),
    ("Ctrl-Z at the end", BASE.encode() + b"\x1a", END_MARK),
    ("Ctrl-Z and empty lines at the end", BASE.encode() + b"\x1a\n\n", END_MARK),
    ("Ctrl-Z after line ends of DOS", BASE.replace("\n", "\r\n").encode() + b"\x1a", END_MARK),
    ("NULs up to a full block", BASE.encode() + bytes(7), END_MARK),
    ("NULs after a line without an end", BASE.encode().rstrip() + bytes(7), END_MARK),
]


@pytest.mark.parametrize(("data", "what"), [row[1:] for row in BYTES])
def test_bytes_of_any_editor_are_read(data: bytes, what: str) -> None:
    assert defaults(data) == DEFAULTS
    fixed, changes = in_normal_form(data, "a.eds")
    assert [each.what for each in changes] == [what]
    assert fixed.replace(b"\r\n", b"\n").decode().replace("L\xe4bel", "Label") == BASE


@pytest.mark.parametrize(
    "data",
    [
        BASE.replace("\n", "\r\n").encode(),
        BASE.replace("Label", "L\xe4bel").encode(),
        BASE.replace("arm", "\xe4rm").encode("latin-1"),  # the bytes that the device serves
    ],
    ids=["line ends of DOS", "UTF-8", "Latin-1 in a value"],
)
def test_bytes_that_need_no_repair_are_kept(data: bytes) -> None:
    assert in_normal_form(data, "a.eds") == (data, [])


def test_a_truncated_file_has_no_normal_form() -> None:
    with pytest.raises(DictionaryError, match=r"^a\.eds: not a readable EDS: line 82: neither section nor entry"):
        in_normal_form((BASE + "Def").encode(), "a.eds")


def test_a_missing_value_is_not_guessed() -> None:
    text = BASE.replace("AccessType=rw\nDefaultValue=-5", "DefaultValue=-5")
    assert in_normal_form(text.encode(), "a.eds") == (text.encode(), [])


# What cannot be used: how it comes about, what is left out, and the words about it

LEFT_OUT: list[tuple[str, str, str, list[Address], list[str]]] = [
    ("a sub-index without access", f"AccessType=rw\n{FIRST}", FIRST, [ADDRESS_1],
     ["line 62: 0x2000: sub 1 has no AccessType"]),
    ("all sub-indices without access", "AccessType=rw\n", "", [ADDRESS_1, ADDRESS_2, LABEL],
     ["line 62: 0x2000: sub 1 has no AccessType", "line 68: 0x2000: sub 2 has no AccessType",
      "line 74: 0x2001: sub 0 has no AccessType"]),
    ("a compact array without type and access", "[2001]",
     "[2002]\nParameterName=Gain\nObjectType=8\nDefaultValue=1\nCompactSubObj=2\n[2001]", [],
     ["line 76: 0x2002: sub 1 has no AccessType", "line 76: 0x2002: sub 2 has no AccessType"]),
    ("a type in words", "DataType=0x0009", "DataType=text", [LABEL],
     ["line 79: 0x2001: sub 0: DataType 'text' is not a number"]),
    ("an unknown kind of object", "ObjectType=0x8", "ObjectType=0x1", [(0x2000, 0), ADDRESS_1, ADDRESS_2],
     ["line 52: 0x2000: ObjectType '0x1' is not one of CiA 301"]),
]  # fmt: skip


@pytest.mark.parametrize(
    ("old", "new", "addresses", "words"), [row[1:] for row in LEFT_OUT], ids=[row[0] for row in LEFT_OUT]
)
def test_unusable_objects_are_left_out_with_their_line(
    old: str, new: str, addresses: list[Address], words: list[str]
) -> None:
    data = BASE.replace(old, new).encode()
    found = {address: value for address, value in defaults(data).items() if address[0] not in (0x2002, 0x2003)}
    assert found == {address: value for address, value in DEFAULTS.items() if address not in addresses}
    assert [str(each) for each in load(data).normal.refusals] == words


def test_flags_of_what_is_left_out_are_left_out_as_well() -> None:
    text = BASE.replace(f"AccessType=rw\n{FIRST}", f"ObjFlags=1\nDenotation=x\n{FIRST}")
    assert ADDRESS_1 not in defaults(text.encode())


def test_a_file_of_which_nothing_can_be_used_is_refused() -> None:
    with pytest.raises(DictionaryError, match=r"^a\.eds: line 1: 0x2000: sub 0 has no AccessType$"):
        load(b"[2000]\nParameterName=Lone\nDataType=5\n")


def test_all_variations_together_have_a_normal_form() -> None:
    text = BASE
    for variation in VARIATIONS:
        if variation.old and variation.old in text and not variation.values:
            text = text.replace(variation.old, variation.new, 1)
    data, changes = in_normal_form(text.encode(), "a.eds")
    assert len(changes) > 20
    assert in_normal_form(data, "a.eds") == (data, [])
    assert defaults(data) == defaults(text.encode()) == DEFAULTS


# CompactPDO

COMPACT_PDO = "[DeviceInfo]\nCompactPDO=0x13\nNrOfRXPDO=5\nNrOfTXPDO=1\n"


def test_compact_pdos_are_there_as_if_they_were_written_out() -> None:
    loaded = Dictionary.read(BASE.replace("[DeviceInfo]\n", COMPACT_PDO, 1).encode(), Path("a.eds"), NODE_ID)
    assert [(each.direction.name, each.number, each.cob_id, each.valid, each.mapping) for each in loaded.pdos] == [
        *(("RPDO", number, 0x105 + number * 0x100, True, ()) for number in range(1, 5)),
        ("RPDO", 5, 0, False, ()),
        ("TPDO", 1, 0x185, True, ()),
    ]
    assert [sub for index, sub in loaded.addresses() if index == 0x1400] == [0, 1, 2, 5]
    timer = loaded.variable((0x1400, 5))
    assert timer
    assert data_type(timer) == DATA_TYPES[0x06]


def test_compact_pdos_are_one_repair_in_the_line_that_asks_for_them() -> None:
    text = BASE.replace("[DeviceInfo]\n", COMPACT_PDO, 1)
    _, changes = in_normal_form(text.encode(), "a.eds")
    line = text.splitlines().index("CompactPDO=0x13") + 1
    assert [each for each in changes if each.line in (line, line - 1)] == [
        (line, "CompactPDO written out", True, False)
    ]


@pytest.mark.parametrize("mask", ["0", "-1", "", "x"])
def test_without_a_mask_no_compact_pdo_is_there(mask: str) -> None:
    said = COMPACT_PDO.replace("CompactPDO=0x13", f"CompactPDO={mask}")
    loaded = Dictionary.read(BASE.replace("[DeviceInfo]\n", said, 1).encode(), Path("a.eds"), NODE_ID)
    assert not loaded.pdos


def test_compact_pdos_are_those_that_are_not_described() -> None:
    own = variable("2003", "Value", "UNSIGNED16") + pdo(0x1400, "0x20030010", cob_id="0x300", name="Own")
    text = BASE.replace("[DeviceInfo]\n", COMPACT_PDO.replace("NrOfRXPDO=5", "NrOfRXPDO=2"), 1) + own
    loaded = Dictionary.read(text.encode(), Path("a.eds"), NODE_ID)
    made = Protocol([(loaded, loaded.pdos)])
    assert [(each.name, each.cob_id) for each in made.bindings] == [
        ("a.TPDO1", 0x185),
        ("Own", 0x300),
        ("a.RPDO2", 0x305),
    ]


# A type that nobody knows, large files, and numbers without end


@pytest.mark.parametrize("type_", ["DataType=0x0099\n", ""])
@pytest.mark.parametrize(
    ("text", "kept"),
    [
        ("5", b"\x05"),
        ("12", b"\x0c"),
        ("0x12345", b"\x45\x23\x01"),
        ("0", b"\0"),
        ("0102", b"\x01\x02"),  # not how a number is written
        ("hello", None),
    ],
)
def test_a_number_of_an_unknown_type_is_kept_as_its_bytes(type_: str, text: str, kept: bytes | None) -> None:
    eds = f"[2000]\nParameterName=Any\n{type_}AccessType=rw\nDefaultValue={text}\n".encode()
    fixed, changes = in_normal_form(eds)
    for each in (eds, fixed):
        assert Dictionary.read(each, Path("a.eds"), NODE_ID).default((0x2000, 0)) == kept
    assert any(text in each.what for each in changes) is (kept is None or text != kept.hex())


def calls_to_read(data: bytes) -> int:
    """Return how many functions are called to read a file: a measure of time that does not vary."""
    calls = 0

    def count(*_: object) -> None:
        nonlocal calls
        calls += 1

    sys.setprofile(count)
    try:
        Dictionary.read(data, Path("a.eds"), NODE_ID)
    finally:
        sys.setprofile(None)
    return calls


def large_eds(count: int) -> bytes:
    """An EDS of many records with twenty sub-indices."""
    heads = (f"[{0x2000 + n:X}]\nParameterName=R\nObjectType=9\nSubNumber=20\n" for n in range(count))
    subs = "".join(f"[{{0:X}}sub{sub:X}]\nParameterName=V{sub}\nDataType=6\nAccessType=rw\n" for sub in range(20))
    return "".join(head + subs.format(0x2000 + n) for n, head in enumerate(heads)).encode()


def large_modules(count: int) -> bytes:
    """A modular device with a kind of module for each place."""
    kinds = (
        f"[M{n}ModuleInfo]\nProductName=K{n}\n[M{n}FixedObjects]\nNrOfEntries=1\n1=0x{0x2000 + n:X}\n"
        f"[M{n}Fixed{0x2000 + n:X}]\nParameterName=F\nDataType=6\nAccessType=rw\n"
        for n in range(1, count + 1)
    )
    places = "".join(f"{n}={n}\n" for n in range(1, count + 1))
    return f"{BASE}\n[SupportedModules]\nNrOfEntries={count}\n[ConnectedModules]\n{places}{''.join(kinds)}".encode()


def large_xdd(count: int) -> bytes:
    """The EDS as an XDD."""
    return xdd_text(Dictionary.read(large_eds(count), Path("a.eds"), NODE_ID)).encode()


@pytest.mark.parametrize("made", [large_eds, large_modules, large_xdd])
def test_time_grows_with_size(made: Callable[[int], bytes]) -> None:
    calls_to_read(made(1))
    few, many = (calls_to_read(made(count)) for count in (8, 32))
    assert few < many < few * 4.2


DIGITS = "9" * 5000
NUMBER = re.compile(r"(\w+)=\"?((?:0x)?[0-9A-Fa-f]+)\b")


@pytest.mark.parametrize("digits", [DIGITS, f"0x{DIGITS}", f"$NODEID+{DIGITS}"])
@pytest.mark.parametrize("file", [large_modules(1).decode(), large_xdd(1).decode()])
def test_a_number_without_end_is_a_finding(file: str, digits: str) -> None:
    places = {each[1].strip("0123456789"): each for each in NUMBER.finditer(file)}
    assert len(places) > 5
    for each in places.values():
        with suppress(DictionaryError):
            text = f"{file[: each.start(2)]}{digits}{file[each.end(2) :]}"
            dictionary = Dictionary.read(text.encode(), Path("a.eds"), NODE_ID)
            dictionary.read_pdos(dictionary.default, str)
    assert lint(NUMBER.sub(lambda each: each[0].replace(each[2], digits), file).encode(), "a.eds")
