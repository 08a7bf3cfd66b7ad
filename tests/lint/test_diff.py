"""Two dictionaries are compared by what they mean, and a file with what a node says."""

from __future__ import annotations

import re
import tracemalloc
from pathlib import Path

import pytest

from eurobot_od.client.configure import read_bytes
from eurobot_od.errors import NoAnswer
from eurobot_od.lint.diff import compare, compare_live, read_device, readable
from eurobot_od.lint.model import LintedDevice, load
from eurobot_od.sdo.wire import AbortCode
from tests.client.peers import LIFT, line, master_on, new_channel, stock_lift
from tests.lint.mutations import BASES, CLEAN


def device(text: str, name: str = "a.eds") -> LintedDevice:
    return load(text.encode(), name)


SAME = [
    # (what is written differently, pattern, replacement)
    ("number base", r"DefaultValue=0x00000080", "DefaultValue=128"),
    ("octal", r"DefaultValue=500\b", "DefaultValue=0764"),
    ("case of keys", r"AccessType=", "ACCESSTYPE="),
    ("case of values", r"AccessType=rw\n", "AccessType=RW\n"),
    ("line ends", r"\n", "\r\n"),
    ("comments", r"\[2008\]", "; a comment\n[2008]"),
    ("names", r"ParameterName=Unit", "ParameterName=Einheit"),
    ("file information", r"FileVersion=1", "FileVersion=7"),
    (
        "limits that are the type's",
        r"DefaultValue=0\nPDOMapping=1",
        "HighLimit=0xFFFFFFFF\nDefaultValue=0\nPDOMapping=1",
    ),
]


@pytest.mark.parametrize(("what", "pattern", "replacement"), SAME)
def test_notation_makes_no_difference(what: str, pattern: str, replacement: str) -> None:
    count = 1 if what.startswith("limits") else 0
    changed = re.sub(pattern, lambda _: replacement, CLEAN, count=count)
    assert changed != CLEAN
    assert compare(device(CLEAN), device(changed)) == []


DIFFERENT = [
    # (section, old, new, the differences as text)
    ("2000", "DataType=0x0007", "DataType=0x0004", ["type: UNSIGNED32 -> INTEGER32", "limit"]),
    ("2000", "AccessType=ro", "AccessType=rwr", ["0x2000 sub 0 Measured value: access: ro -> rwr"]),
    ("2000", "PDOMapping=1", "PDOMapping=0", ["0x2000 sub 0 Measured value: mappable: yes -> no"]),
    ("2007", "HighLimit=100", "HighLimit=0x65", ["0x2007 sub 0 Set value: high limit: 0x0064 -> 0x0065"]),
    ("1017", "AccessType=rw", "AccessType=rww", []),  # it goes in no PDO, and so in no direction
    ("2000", "DataType=0x0007", "DataType=0x40", ["0x2000 sub 0 Measured value: type: UNSIGNED32 -> 0x0040"]),
    ("1017", "DefaultValue=500", "DefaultValue=600", ["0x1017 sub 0 Producer heartbeat time: value: 500 -> 600"]),
    ("2008", "DefaultValue=mm", "DefaultValue=cm", ["0x2008 sub 0 Unit: value: mm -> cm"]),
    ("2002", "ObjectType=0x8", "ObjectType=0x9", ["0x2002 Channels: object: ARRAY -> RECORD"]),
    ("1400sub1", "+0x200", "+0x80000200", ["COB-ID: $NODEID+0x200 -> $NODEID+0x200, not valid"]),
    ("1A00sub2", "0x20010310", "0x20020110", ["32..47 0x2001 sub 3 -> 0..31 0x2000 sub 0; 32..47 0x2002 sub 1"]),
    ("1A00sub0", "DefaultValue=2", "DefaultValue=0", ["-> no data"]),
    ("1A00sub4", "0x00000000", "0x20020110", []),  # behind the mapped ones: means nothing
    ("DeviceInfo", "BaudRate_50=1", "BaudRate_50=0", ["device: bit rates: 50, 125, 250, 500, 1000 -> 125, 250"]),
    ("2002sub3", "[2002sub3]", "[2002sub4]", ["3 Channels.Channel 3: sub-index: there", "4 Channels.Channel 3: "]),
    ("2008", "[2008]", "[2F08]", ["0x2008 Unit: object: VAR -> -", "0x2F08 Unit: object: - -> VAR"]),
]  # fmt: skip


@pytest.mark.parametrize(("section", "old", "new", "expected"), DIFFERENT)
def test_a_changed_meaning_is_a_difference(section: str, old: str, new: str, expected: list[str]) -> None:
    start = CLEAN.index(f"[{section}]")
    changed = CLEAN[:start] + CLEAN[start:].replace(old, new, 1)
    found = [str(each) for each in compare(device(CLEAN), device(changed))]
    assert bool(found) == bool(expected)
    assert all(any(text in each for each in found) for text in expected), found


def test_names_are_compared_on_request() -> None:
    changed = CLEAN.replace("ParameterName=Unit", "ParameterName=Einheit")
    found = compare(device(CLEAN), device(changed), with_names=True)
    assert [str(each) for each in found] == ["0x2008 sub 0 Unit: name: Unit -> Einheit"]


def test_an_eds_equals_its_dcf_for_the_dcfs_node_id() -> None:
    dcf = BASES["dcf"][1].replace("DefaultValue=$NODEID+0x200", "DefaultValue=$NODEID+0x200\nParameterValue=0x205")
    assert compare(device(CLEAN), device(dcf, "a.dcf")) == []
    assert compare(device(CLEAN), device(dcf, "a.dcf"), 6) == []  # it follows the node-ID


def test_values_that_follow_the_node_id_are_equal_for_two_nodes() -> None:
    five = BASES["dcf"][1].replace("DefaultValue=$NODEID+0x200", "DefaultValue=$NODEID+0x200\nParameterValue=0x205")
    six = five.replace("NodeID=5", "NodeID=6").replace("0x205", "0x206")
    assert compare(device(five, "a.dcf"), device(six, "b.dcf")) == []
    chosen = six.replace("=0x206", "=0x205")  # that of the other node: now it is in the way
    assert [(each.left, each.right) for each in compare(device(five, "a.dcf"), device(chosen, "b.dcf"))] == [
        ("$NODEID+0x200", "0x205")
    ]


def test_a_compact_array_equals_the_expanded_array() -> None:
    compact = BASES["compact"][1]
    subs = [
        ("Highest sub-index", 5, "ro", 8),
        *(("Calibration", 6, "rw", 12 if sub == 2 else 10) for sub in range(1, 9)),
    ]
    sections = "".join(
        f"[2009sub{sub}]\nParameterName={name}\nDataType={type_}\nAccessType={access}\nDefaultValue={value}\n\n"
        for sub, (name, type_, access, value) in enumerate(subs)
    )
    head = "[2009]\nParameterName=Calibration\nObjectType=8\nSubNumber=9\n\n"
    written_out = compact[: compact.index("[2009]")] + head + sections
    assert compare(device(compact), device(written_out)) == []


LIVE: list[tuple[dict[tuple[int, int], bytes | int], list[str]]] = [
    # (what the node says, the differences)
    ({}, []),
    ({(0x1017, 0): b"\xf4\x01"}, []),
    ({(0x1017, 0): b"\xf5\x01"}, ["0x1017 sub 0 Producer heartbeat time: value: 500 -> 501"]),
    ({(0x1017, 0): b"\xf4\x01\x00"}, ["0x1017 sub 0 Producer heartbeat time: bytes: 2 -> 3"]),
    ({(0x1017, 0): AbortCode.NO_OBJECT}, ["0x1017 sub 0 Producer heartbeat time: on the node: there -> -"]),
    (
        {(0x1017, 0): 0x08000000},
        ["0x1017 sub 0 Producer heartbeat time: on the node: there -> abort 0x08000000 General error"],
    ),
    ({(0x1017, 0): AbortCode.NO_DATA}, []),  # nothing to tell, as an error field without errors
    ({(0x2000, 0): b"\x01\x02\x03\x04"}, []),  # process data
    ({(0x1001, 0): b"\x01"}, []),  # a state
    ({(0x2007, 0): b"\xfb\xff"}, []),  # -5
    ({(0x2008, 0): b"mm"}, []),
    ({(0x2005, 0): b"\x00\xff\x11"}, ["0x2005 sub 0 Key: value: 00ff10 -> 00ff11"]),
    ({(0x2005, 0): b"\x00\xff\x10"}, []),
    ({(0x2004, 0): b"\x00\x00\x80\x3f"}, ["0x2004 sub 0 Factor: value: 0.0 -> 1.0"]),
    ({(0x1014, 0): b"\x85\x00\x00\x00"}, []),  # $NODEID+0x80 of node 5
    (
        {(0x1400, 1): b"\x05\x02\x00\x80"},
        ["0x1400 sub 1 RPDO 1 communication.COB-ID: RPDO 1 COB-ID: 0x205 -> 0x205, not valid"],
    ),
    (
        {(0x1A00, 0): b"\x01"},
        ["0x1A00 TPDO 1 mapping: TPDO 1 mapping: 0..31 0x2000 sub 0; 32..47 0x2001 sub 3 -> 0..31 0x2000 sub 0"],
    ),
]


@pytest.mark.parametrize(("readings", "expected"), LIVE)
def test_a_nodes_answers_are_compared_with_its_file(
    readings: dict[tuple[int, int], bytes | int], expected: list[str]
) -> None:
    assert [str(each) for each in compare_live(device(CLEAN), readings, 5)] == expected


COMMISSIONED = "[DeviceComissioning]\nNodeID=5\n"
OF_A_DCF: list[tuple[str, dict[tuple[int, int], bytes | int], list[str]]] = [
    # (what is configured, what the node says, the differences)
    ("", {(0x1017, 0): AbortCode.NO_OBJECT}, []),
    (
        "1017",
        {(0x1017, 0): AbortCode.NO_OBJECT},
        ["0x1017 sub 0 Producer heartbeat time: on the node: there -> -"],
    ),
    ("1017", {(0x1017, 0): b"\xf5\x01"}, ["0x1017 sub 0 Producer heartbeat time: value: 7 -> 501"]),
    ("", {(0x1017, 0): b"\xf5\x01"}, ["0x1017 sub 0 Producer heartbeat time: value: 500 -> 501"]),
    ("", {(0x1018, 1): b"\x07\x00\x00\x00"}, []),  # nobody can write it, and the file says nothing of it
]


@pytest.mark.parametrize(("section", "readings", "expected"), OF_A_DCF)
def test_only_parameter_values_of_a_dcf_are_compared_with_a_node(
    section: str, readings: dict[tuple[int, int], bytes | int], expected: list[str]
) -> None:
    text = (CLEAN + COMMISSIONED).replace(f"[{section}]\n", f"[{section}]\nParameterValue=7\n")
    assert [str(each) for each in compare_live(device(text, "a.dcf"), readings, 5)] == expected


@pytest.mark.parametrize(
    ("encoding", "type_", "answer", "differs"),
    [
        ("utf-8", "0x0009", "Gerät".encode(), False),
        ("latin-1", "0x0009", "Gerät".encode("latin-1"), False),
        ("utf-8", "0x0009", "Gerät".encode("latin-1"), True),
        ("latin-1", "0x0009", "Gerät".encode(), True),
        ("utf-8", "0x000B", "Gerät".encode("utf-16-le"), False),
        ("utf-8", "0x0009", "Gerät\0\0".encode(), False),  # some devices fill a text up
    ],
)
def test_texts_are_compared_by_their_bytes(encoding: str, type_: str, answer: bytes, differs: bool) -> None:
    section = f"\n[2777]\nParameterName=Name\nDataType={type_}\nAccessType=rw\nDefaultValue=Gerät\n"
    file = load((CLEAN + section).encode(encoding), "a.eds")
    assert bool(compare_live(file, {(0x2777, 0): answer}, 5)) is differs


def test_a_live_node_is_compared_by_sdo() -> None:
    file = read_device(str(LIFT))
    with stock_lift() as (channel, node), master_on(channel) as master:
        same = compare_live(file, read_bytes(master.node(2), readable(file)), 2)
        node.data_store[0x1017] = {0: (123).to_bytes(2, "little")}
        node.data_store[0x1400] = {1: (0x80000001).to_bytes(4, "little")}
        changed = compare_live(file, read_bytes(master.node(2), readable(file)), 2)
    assert same == []
    assert [str(each) for each in changed] == [
        "0x1017 sub 0 Producer heartbeat time: value: 1000 -> 123",
        "0x1400 sub 1 Halt All.COB-ID used by PDO: RPDO 1 COB-ID: 0x181 -> 0x001, not valid",
    ]


def test_our_simulated_node_equals_its_eds() -> None:
    file = read_device(str(LIFT))
    with line("lift") as channel, master_on(channel) as master:
        found = compare_live(file, read_bytes(master.node(2), readable(file)), 2)
    # A node says 0 for a message that it does not map: only its file has the table's number.
    not_mapped = {"Weight Request", "Check Scale Response", "Check Scale Request"}
    assert {(each.name, each.right) for each in found} == {
        (f"Message fingerprints.{name}", "0x00000000") for name in not_mapped
    }


def test_a_missing_node_is_reported() -> None:
    with master_on(new_channel(), 0.01) as master, pytest.raises(NoAnswer, match="0x1000:0"):
        read_bytes(master.node(9), [(0x1000, 0)])


@pytest.mark.long
def test_memory_is_bounded_for_millions_of_sub_indices(tmp_path: Path) -> None:
    """A file of 4 MB may describe 12 million sub-indices."""
    file = tmp_path / "compact.eds"
    each = "[{:X}]\nParameterName=A\nObjectType=8\nDataType=7\nAccessType=rw\nCompactSubObj=254\n"
    file.write_text("".join(each.format(index) for index in range(0x2000, 0x2020)))
    device = read_device(str(file))
    tracemalloc.start()
    assert compare(device, device) == []
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert most < 2 << 20
