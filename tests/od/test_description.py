"""Section names are read as CiA 306 writes them, and as nothing else; compact objects have all they stand for."""

from __future__ import annotations

import pytest

from eurobot_od.od.description import DescribedDevice, SectionName, parse_section_name
from eurobot_od.od.document import parse

NAMES = [
    ("1018", SectionName(0x1018)),
    ("1a00", SectionName(0x1A00)),
    ("1018sub0", SectionName(0x1018, 0)),
    ("1018SUBfe", SectionName(0x1018, 0xFE)),
    ("2000Name", SectionName(0x2000, list="name")),
    ("2000VALUE", SectionName(0x2000, list="value")),
]
NO_NAMES = ["", "101", "01018", "0x1018", "10 8", "1018 sub1", "1018sub", "1018sub01", "1018sub100", "1018subG", "1_18"]


@pytest.mark.parametrize(("text", "name"), NAMES)
def test_a_section_name_is_read(text: str, name: SectionName) -> None:
    assert parse_section_name(text) == name


@pytest.mark.parametrize("text", NO_NAMES)
def test_other_names_are_none(text: str) -> None:
    assert parse_section_name(text) is None


COMPACT = """
[2100]
ParameterName=Set values
ObjectType=0x8
DataType=0x0004
AccessType=rw
LowLimit=-5
DefaultValue=7
CompactSubObj=3
[2100Name]
NrOfEntries=1
2=Second
[2100Value]
NrOfEntries=1
3=9
"""


def test_a_compact_object_has_the_sub_indices_it_stands_for() -> None:
    whole = DescribedDevice(parse(COMPACT)).objects[0x2100]
    found = [(each.sub, each.name, each.type and each.type.name, each.access) for each in whole.variables()]
    assert found == [
        (0, "NrOfObjects", "UNSIGNED8", "ro"),
        (1, "Set values", "INTEGER32", "rw"),
        (2, "Second", "INTEGER32", "rw"),
        (3, "Set values", "INTEGER32", "rw"),
    ]
    assert [each.value and each.value.value for each in whole.variables()] == [3, 7, 7, 9]


def test_an_object_of_sub_indices_alone_has_no_name_of_its_own() -> None:
    alone = DescribedDevice(parse("[2100sub1]\nParameterName=First\nDataType=0x0005\n")).objects[0x2100]
    assert alone.name == ""
    assert [(each.sub, each.name) for each in alone.variables()] == [(1, "First")]


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("[2100]\nParameterName=Node-ID\n", (0x2100, 0)),
        ("[2F00]\nObjectType=9\n[2F00sub3]\nParameterName=node id\n", (0x2F00, 3)),
        ("[1000]\nParameterName=Node-ID\n", None),  # not a setting of the manufacturer's
        ("[2100]\nParameterName=Node-ID of the master\n", None),
    ],
)
def test_the_own_node_id_is_found_by_its_name(text: str, address: tuple[int, int] | None) -> None:
    own = DescribedDevice(parse(text)).own_node_id
    assert (own and (own.index, own.sub)) == address
