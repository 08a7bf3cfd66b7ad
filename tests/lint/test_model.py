"""Numbers and section names are read as CiA 306 writes them, and as nothing else."""

from __future__ import annotations

import pytest

from eurobot_od.lint.model import Number, ObjectName, parse_number, parse_object_name

NUMBERS = [
    ("0", Number(0)),
    ("12", Number(12)),
    ("-5", Number(-5)),
    ("0x1F", Number(31)),
    ("0X1f", Number(31)),
    ("-0x10", Number(-16)),
    ("010", Number(8)),  # octal
    ("00", Number(0)),
    ("$NODEID", Number(0, relative=True)),
    ("$NODEID+0x180", Number(0x180, relative=True)),
    ("$nodeid + 384", Number(384, relative=True)),
]
NO_NUMBERS = [
    *["", " ", "-", "0x", "x10", "1.5", "1e3", "five", "0b1", "0o7"],
    *["018", "09"],  # octal digits end at 7
    *["1_000", "+5", "1 000", "--5"],  # what int() would take, or nearly
    *["0x80+$NODEID", "$NODEID-1", "$NODEID+", "$NODEID+-1", "$NODEIDX", "$NODEID 5"],
]


@pytest.mark.parametrize(("text", "number"), NUMBERS)
def test_a_number_is_read(text: str, number: Number) -> None:
    assert parse_number(text) == number


@pytest.mark.parametrize("text", NO_NUMBERS)
def test_what_is_no_number_is_none(text: str) -> None:
    assert parse_number(text) is None


NAMES = [
    ("1018", ObjectName(0x1018)),
    ("1a00", ObjectName(0x1A00)),
    ("1018sub0", ObjectName(0x1018, 0)),
    ("1018SUBfe", ObjectName(0x1018, 0xFE)),
    ("2000Name", ObjectName(0x2000, list="name")),
    ("2000VALUE", ObjectName(0x2000, list="value")),
]
NO_NAMES = ["", "101", "01018", "0x1018", "10 8", "1018 sub1", "1018sub", "1018sub01", "1018sub100", "1018subG", "1_18"]


@pytest.mark.parametrize(("text", "name"), NAMES)
def test_a_section_name_is_read(text: str, name: ObjectName) -> None:
    assert parse_object_name(text) == name


@pytest.mark.parametrize("text", NO_NAMES)
def test_other_names_are_none(text: str) -> None:
    assert parse_object_name(text) is None
