"""Numbers are read as CiA 306 writes them, bytes as CiA 301 does; identifiers have the owners of CiA 301."""

from __future__ import annotations

import re

import pytest

from eurobot_od.od.values import (
    DATA_TYPES,
    PREDEFINED,
    REAL32,
    RESERVED,
    RESTRICTED,
    UNICODE_STRING,
    VISIBLE_STRING,
    DataType,
    Number,
    Value,
    is_standard_number,
    label,
    owner,
    parse_number,
    typed_number,
    typed_real,
)

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
    # as CiA 306 does not write them
    ("0x10LL", Number(16)),
    ("-10u", Number(-10)),
    ("0FFh", Number(255)),
    ("0x80 + $NodeID", Number(0x80, relative=True)),
    ("(0x40+$NODEID+64)", Number(0x80, relative=True)),
]
NO_NUMBERS = [
    *["", " ", "-", "0x", "x10", "1.5", "1e3", "five", "0b1", "0o7"],
    *["018", "09"],  # octal digits end at 7
    *["1_000", "+5", "1 000", "--5", "FFh", "0x10LLLL", "L"],  # what int() would take, or nearly
    *["0x80-$NODEID", "$NODEID+$NODEID", "$NODEID-1", "$NODEID+", "$NODEID+-1", "$NODEIDX", "$NODEID 5"],
]


@pytest.mark.parametrize(("text", "number"), NUMBERS)
def test_a_number_is_read(text: str, number: Number) -> None:
    assert parse_number(text) == number


@pytest.mark.parametrize(("text", "number"), NUMBERS)
def test_the_standard_has_one_way_to_write_a_number(text: str, number: Number) -> None:
    is_standard = text.isalnum() or text[1:].isalnum() or text.startswith("$NODEID")
    is_standard &= text[-1] not in "LuhH"
    assert is_standard_number(text) is is_standard, number


@pytest.mark.parametrize("text", NO_NUMBERS)
def test_text_that_is_no_number_is_none(text: str) -> None:
    assert parse_number(text) is None


BYTES: list[tuple[DataType, str, Value]] = [
    (DATA_TYPES[0x01], "01", True),
    (DATA_TYPES[0x05], "ff", 255),
    (DATA_TYPES[0x02], "ff", -1),
    (DATA_TYPES[0x16], "01 02 03", 0x030201),  # UNSIGNED24
    (DATA_TYPES[0x10], "ff ff 7f", 0x7FFFFF),  # INTEGER24
    (REAL32, "00 00 c0 3f", 1.5),
    (VISIBLE_STRING, "61 62 00 00", "ab\0\0"),  # every byte is kept
    (VISIBLE_STRING, "61 e4", b"a\xe4"),  # no ASCII: bytes, not a shorter text
    (UNICODE_STRING, "61 00 62 00", "ab"),
    (UNICODE_STRING, "61 00 62", b"a\0b"),
    (UNICODE_STRING, "00 d8", b"\0\xd8"),  # half of a surrogate pair
    (DATA_TYPES[0x0F], "00 01", b"\0\1"),
]


TABLE_44 = {
    0x01: "BOOLEAN",
    0x08: "REAL32",
    0x11: "REAL64",
    0x09: "VISIBLE_STRING",
    0x0A: "OCTET_STRING",
    0x0B: "UNICODE_STRING",
    0x0C: "TIME_OF_DAY",
    0x0D: "TIME_DIFFERENCE",
    0x0F: "DOMAIN",
    0x02: "INTEGER8",
    0x03: "INTEGER16",
    0x10: "INTEGER24",
    0x04: "INTEGER32",
    0x12: "INTEGER40",
    0x13: "INTEGER48",
    0x14: "INTEGER56",
    0x15: "INTEGER64",
    0x05: "UNSIGNED8",
    0x06: "UNSIGNED16",
    0x16: "UNSIGNED24",
    0x07: "UNSIGNED32",
    0x18: "UNSIGNED40",
    0x19: "UNSIGNED48",
    0x1A: "UNSIGNED56",
    0x1B: "UNSIGNED64",
}
"""The basic data types of CiA 301."""


def test_the_types_have_the_codes_of_cia_301() -> None:
    assert {code: each.name for code, each in DATA_TYPES.items()} == TABLE_44
    for each in DATA_TYPES.values():
        if number := re.fullmatch("(?:INTEGER|UNSIGNED)([0-9]+)", each.name):
            assert each.bits == int(number[1])


@pytest.mark.parametrize(("type_", "data", "value"), BYTES)
def test_bytes_are_read_by_their_type(type_: DataType, data: str, value: Value) -> None:
    assert type_.read(bytes.fromhex(data)) == value


@pytest.mark.parametrize(("type_", "data", "value"), BYTES)
def test_values_are_written_by_their_type(type_: DataType, data: str, value: Value) -> None:
    written = type_.write(value)
    assert written == bytes.fromhex(data)[: len(written)]
    assert type_.read(written) == value


@pytest.mark.parametrize(
    ("type_", "value"),
    [
        (DATA_TYPES[0x05], 256),
        (DATA_TYPES[0x02], -129),
        (DATA_TYPES[0x01], 2),
        (DATA_TYPES[0x07], "5"),
        (DATA_TYPES[0x07], 1.5),
        (DATA_TYPES[0x07], None),
        (DATA_TYPES[0x0C], "noon"),
        (DATA_TYPES[0x0C], "1983-12-31 00:00"),  # CANopen's time begins in 1984
        (DATA_TYPES[0x0D], "25:00:00"),
        (REAL32, "fast"),
        (REAL32, 1e99),
        (VISIBLE_STRING, "Küche"),
        (VISIBLE_STRING, 5),
    ],
)
def test_a_value_of_another_type_is_not_written(type_: DataType, value: Value) -> None:
    with pytest.raises((ValueError, OverflowError)):
        type_.write(value)


@pytest.mark.parametrize(("type_", "data"), [(DATA_TYPES[0x05], b"12"), (DATA_TYPES[0x07], b"123"), (REAL32, b"")])
def test_bytes_of_another_length_are_refused(type_: DataType, data: bytes) -> None:
    with pytest.raises(ValueError, match=type_.name):
        type_.read(data)


@pytest.mark.parametrize(
    ("identifier", "whose"),
    [
        (0x000, "NMT"),
        (0x001, "safety (GFC) and flying NMT masters"),
        (0x07F, "safety (GFC) and flying NMT masters"),
        (0x080, "SYNC"),
        (0x0C0, "EMCY of node 64"),
        (0x100, "TIME"),
        (0x101, "safety (SRDO)"),
        (0x180, "safety (SRDO)"),
        (0x181, "TPDO 1 of node 1"),
        (0x57F, "RPDO 4 of node 127"),
        (0x581, "the SDO answer of node 1"),
        (0x67F, "the SDO request of node 127"),
        (0x6E0, "extensions of CiA"),
        (0x6FF, "extensions of CiA"),
        (0x77F, "the heartbeat of node 127"),
        (0x780, "LSS and further services"),
        (0x7FF, "LSS and further services"),
    ],
)
def test_an_identifier_has_an_owner(identifier: int, whose: str) -> None:
    found = owner(identifier, RESTRICTED + PREDEFINED + RESERVED)
    assert found is not None
    assert found.whose(identifier) == whose


@pytest.mark.parametrize("identifier", [0x580, 0x600, 0x680, 0x6DF, 0x700])
def test_an_identifier_between_the_ranges_has_none(identifier: int) -> None:
    assert owner(identifier, RESTRICTED + PREDEFINED + RESERVED) is None


def test_an_address_for_a_person() -> None:
    assert label((0x1017, 0), "Producer heartbeat time") == "0x1017:0 Producer heartbeat time"
    assert label((0x1017, 0)) == "0x1017:0"


@pytest.mark.parametrize("text", ["1_000", "\u0663", "0x1_0", "\u00b2", "", "1" * 101])
def test_python_only_number_forms_are_none(text: str) -> None:
    for read in (typed_number, typed_real):
        with pytest.raises(ValueError):  # noqa: PT011 (int and float say it in their own words)
            read(text)
    assert (typed_number("-0x10"), typed_real("1e3")) == (-16, 1000.0)
