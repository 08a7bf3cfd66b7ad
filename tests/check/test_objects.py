"""Objects by their names and addresses; their values as SDO carries them, with the limits of their types."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from eurobot_od.check.objects import ObjectType, find_address, object_type, services
from eurobot_od.check.values import ValueProblem
from eurobot_od.errors import UnknownName
from eurobot_od.od.dictionary import Dictionary
from tests.eds_text import DEVICE_TYPE, record, variable

TEXT = (
    DEVICE_TYPE
    + variable("2000", "Offset", "INTEGER16")
    + variable("2001", "Trim", "INTEGER8", more="LowLimit=-10\nHighLimit=-1\n")
    + variable("2002", "Label", "VISIBLE_STRING")
    + variable("2003", "Key", "OCTET_STRING")
    + variable("2004", "Factor", "REAL32")
    + variable("2005", "Count", "UNSIGNED24", more="HighLimit=9\n")
    + record(0x2006, "Motion", (0, "UNSIGNED8", "1"), (1, "UNSIGNED8", "0"))
)


def dictionary(tmp_path: Path, more: str = "", node_id: int = 5) -> Dictionary:
    file = tmp_path / "arm.eds"
    file.write_text(TEXT + more)
    return Dictionary.load(file, node_id)


@pytest.mark.parametrize(
    ("index", "low", "high"),
    [
        (0x2000, -32768, 32767),  # of its type
        (0x2001, -10, -1),
        (0x2005, 0, 9),
        (0x1000, 0, 0xFFFFFFFF),
    ],
)
def test_a_numbers_limits_are_those_of_the_file_or_the_type(tmp_path: Path, index: int, low: int, high: int) -> None:
    found = object_type(dictionary(tmp_path), (index, 0))
    assert found
    assert found.limits == (low, high)


def type_of(tmp_path: Path, index: int) -> ObjectType:
    found = object_type(dictionary(tmp_path), (index, 0))
    assert found
    return found


@pytest.mark.parametrize(
    ("index", "value", "data"),
    [
        (0x2000, -2, "FEFF"),
        (0x2000, -32768, "0080"),
        (0x2000, 32767, "FF7F"),
        (0x2001, -10, "F6"),
        (0x2005, 0x123456, "563412"),
        (0x1000, 0xFFFFFFFE, "FEFFFFFF"),
        (0x2002, "Arm", "41726D"),
        (0x2002, "", ""),
        (0x2003, "\udcff\udc80A", "FF8041"),  # bytes that are no text, kept in one
    ],
)
def test_a_value_has_its_types_bytes_and_comes_back(tmp_path: Path, index: int, value: Any, data: str) -> None:
    found = type_of(tmp_path, index)
    assert found.encode(value) == bytes.fromhex(data)
    assert found.decode(bytes.fromhex(data)) == value


@pytest.mark.parametrize(("index", "data", "needs"), [(0x2000, "FE", 2), (0x2000, "FEFFFF", 2), (0x2005, "", 3)])
def test_a_number_of_another_length_is_told(tmp_path: Path, index: int, data: str, needs: int) -> None:
    with pytest.raises(ValueProblem, match=f"^{len(data) // 2} bytes? came, the object has {needs}$"):
        type_of(tmp_path, index).decode(bytes.fromhex(data))


@pytest.mark.parametrize("address", [(0x2004, 0), (0x3000, 0), (0x2006, 7)])
def test_what_is_no_number_and_no_text_or_is_not_there_has_no_type(tmp_path: Path, address: tuple[int, int]) -> None:
    assert object_type(dictionary(tmp_path), address) is None


def test_a_text_is_written_with_its_quotes(tmp_path: Path) -> None:
    kind = type_of(tmp_path, 0x2002).kind
    assert (kind.parse("as it is"), kind.text("as it is")) == ("as it is", "'as it is'")


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("0x2000", (0x2000, 0)),
        ("0X5", (0x0005, 0)),
        ("0x3000:255", (0x3000, 255)),  # whatever the file has
        ("0x2006:0x1A", (0x2006, 26)),
        ("Offset", (0x2000, 0)),
        ("Motion.Entry 1", (0x2006, 1)),
    ],
)
def test_an_object_is_found_by_address_and_by_name(tmp_path: Path, text: str, address: tuple[int, int]) -> None:
    assert find_address(dictionary(tmp_path), text) == address


@pytest.mark.parametrize(("text", "near"), [("Ofset", "Offset"), ("Motion.Entry 2", "Motion.Entry 1")])
def test_an_unknown_object_is_told_with_those_near(tmp_path: Path, text: str, near: str) -> None:
    with pytest.raises(UnknownName) as told:
        find_address(dictionary(tmp_path), text)
    assert str(told.value).startswith(f"unknown object of arm '{text}'")
    assert near in str(told.value)


def server(request: str, answer: str) -> str:
    return record(0x1200, "SDO", (0, "UNSIGNED8", "2"), (1, "UNSIGNED32", request), (2, "UNSIGNED32", answer))


@pytest.mark.parametrize(
    ("more", "request_id", "answer_id"),
    [
        ("", 0x605, 0x585),
        (server("0x640", "0x5C0"), 0x640, 0x5C0),
        (server("$NODEID+0x600", "$NODEID+0x580"), 0x605, 0x585),
        (server("0x80000640", "0x800005C0"), 0x605, 0x585),  # the default server is there whatever is said
    ],
)
def test_a_nodes_sdo_is_where_the_file_says(tmp_path: Path, more: str, request_id: int, answer_id: int) -> None:
    assert services(dictionary(tmp_path, more)) == ("arm", 5, request_id, answer_id)
