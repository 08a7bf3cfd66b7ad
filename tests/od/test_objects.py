"""Objects as a person names and writes them: numbers, names, values of each type, and what is refused."""

from __future__ import annotations

import pytest
from canopen.objectdictionary import ODVariable, datatypes

from eurobot_od.errors import FieldError, LocalError
from eurobot_od.od.objects import address_of, decode, encode, find, find_one, limits, parse, undescribed, written
from eurobot_od.od.values import Value
from tests.kit import lift

CABIN = lift.dictionary("cabin").objects


def typed(data_type: int, low: int | None = None, high: int | None = None) -> ODVariable:
    variable = ODVariable("Thing", 0x2000, 1)
    variable.data_type, variable.min, variable.max = data_type, low, high
    return variable


# Names


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("0x1017", (0x1017, 0)),  # hexadecimal
        ("1017", (0x1017, 0)),  # an index is always hexadecimal
        ("1017h", (0x1017, 0)),
        ("0X101a:0x0A", (0x101A, 10)),  # any letter case
        ("0x1018:2", (0x1018, 2)),  # a decimal sub-index
        ("0x5000", (0x5000, 0)),  # unknown to the EDS, perhaps not to the node
        ("Producer heartbeat time", (0x1017, 0)),  # by name
        ("motion.maximum SPEED", (0x2101, 1)),  # in any letter case
        ("Move to.Height", (0x2000, 1)),  # two records have the name, one has the member
        ("Move To.COB-ID used by PDO", (0x1403, 1)),
    ],
)
def test_one_object_by_number_or_name(text: str, address: tuple[int, int]) -> None:
    assert address_of(find_one(text, CABIN)) == address


@pytest.mark.parametrize("text", ["0x1018", "identity object"])
def test_an_index_is_all_its_members(text: str) -> None:
    assert [address_of(thing) for thing in find(text, CABIN)] == [(0x1018, subindex) for subindex in range(5)]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("Move To", "0x1403, 0x2000"),  # two objects of that name
        ("Motion.Maximum sped", "Motion.Maximum speed"),  # a slip: what is similar
        ("nothing like it", "nothing like it"),
        ("0x10177", "0x10177"),  # five digits are no index
        ("0x1018:2x", "0x1018:2x"),
    ],
)
def test_a_name_of_none_or_several_is_refused(text: str, named: str) -> None:
    with pytest.raises(LocalError, match=named):
        find(text, CABIN)


def test_a_record_is_no_single_object() -> None:
    with pytest.raises(LocalError, match="0x1018:4 Identity object"):
        find_one("0x1018", CABIN)


def test_without_an_eds_there_are_numbers_and_no_names() -> None:
    assert [address_of(each) for each in find("0x1018:1", None)] == [(0x1018, 1)]
    with pytest.raises(LocalError, match="without an EDS"):
        find("Motion", None)


# Values


@pytest.mark.parametrize(
    ("data_type", "text", "data", "shown"),
    [
        (datatypes.UNSIGNED8, "0x10", "10", "16"),
        (datatypes.UNSIGNED16, "500", "f401", "500"),
        (datatypes.UNSIGNED24, "66051", "030201", "66051"),
        (datatypes.UNSIGNED32, "4294967295", "ffffffff", "4294967295"),
        (datatypes.UNSIGNED64, "1", "0100000000000000", "1"),
        (datatypes.INTEGER8, "-1", "ff", "-1"),
        (datatypes.INTEGER16, "-2", "feff", "-2"),
        (datatypes.BOOLEAN, "1", "01", "1"),
        (datatypes.REAL32, "1.5", "0000c03f", "1.5"),
        (datatypes.VISIBLE_STRING, "Drive", "4472697665", "Drive"),
        (datatypes.OCTET_STRING, "01 ab", "01ab", "01 AB"),
        (datatypes.DOMAIN, "", "", ""),
    ],
)
def test_a_value_of_each_type_there_and_back(data_type: int, text: str, data: str, shown: str) -> None:
    thing = typed(data_type)
    value = parse(thing, text)
    assert encode(thing, value).hex() == data
    assert written(thing, decode(thing, bytes.fromhex(data))) == shown


@pytest.mark.parametrize(
    ("thing", "text", "allowed"),
    [
        (typed(datatypes.UNSIGNED8), "256", "0..255"),  # more than the type has
        (typed(datatypes.UNSIGNED8), "-1", "0..255"),
        (typed(datatypes.INTEGER8), "128", "-128..127"),
        (typed(datatypes.BOOLEAN), "2", "0..1"),
        (typed(datatypes.UNSIGNED16, 5, 10), "4", "5..10"),  # below LowLimit
        (typed(datatypes.UNSIGNED16, 5, 10), "11", "5..10"),  # above HighLimit
        (typed(datatypes.UNSIGNED8), "fast", "an integer"),
        (typed(datatypes.UNSIGNED8), "1.5", "an integer"),
        (typed(datatypes.UNSIGNED8), "1 s", "an integer without a unit"),  # the file says none
        (typed(datatypes.UNSIGNED8), "010", "an integer"),  # neither octal nor decimal for sure
        (typed(datatypes.REAL32), "fast", "a number"),
        (typed(datatypes.REAL32), "1e99", "a number"),  # too large for 32 bits
        (typed(datatypes.VISIBLE_STRING), "Küche", "ASCII text"),
        (typed(datatypes.OCTET_STRING), "0x1", "bytes in hexadecimal digits"),
    ],
)
def test_a_value_that_does_not_fit_is_refused(thing: ODVariable, text: str, allowed: str) -> None:
    with pytest.raises(FieldError) as refused:
        encode(thing, parse(thing, text))
    assert refused.value.allowed == allowed


@pytest.mark.parametrize(
    ("data_type", "data", "value"),
    [
        (datatypes.UNSIGNED8, b"\x05\0\0\0", 5),  # some devices send 4 bytes of everything
        (datatypes.UNSIGNED32, b"\x05", b"\x05"),  # too few bytes are no number
        (datatypes.VISIBLE_STRING, b"Drive\0\0", "Drive"),  # filled up by a C program
    ],
)
def test_bytes_of_another_length(data_type: int, data: bytes, value: Value) -> None:
    assert decode(typed(data_type), data) == value


@pytest.mark.parametrize(
    ("data", "value", "shown"),
    [
        (b"\x05", 5, "0x05"),
        (b"\0\1\2\3", 0x03020100, "0x3020100"),
        (b"\0\1\2", b"\0\1\2", "00 01 02"),
        (b"\1\0\0\0\0\0\0\0", 1, "0x01"),
        (bytes(9), bytes(9), "00 00 00 00 00 00 00 00 00"),
        (b"", b"", ""),
    ],
)
def test_without_a_type_bytes_are_shown_as_they_are(data: bytes, value: Value, shown: str) -> None:
    thing = undescribed((0x5000, 0))
    assert decode(thing, data) == value
    assert written(thing, value) == shown


def test_mapping_entries_are_written_in_hexadecimal_whatever_their_default() -> None:
    thing, size = typed(datatypes.UNSIGNED32), typed(datatypes.UNSIGNED8)
    thing.index = size.index = 0x1A00
    assert (written(thing, 0x60770010), written(thing, 0), written(size, 3)) == ("0x60770010", "0x00000000", "3")


def test_without_a_type_a_number_is_written_with_the_length_that_is_there() -> None:
    assert encode(undescribed((0x5000, 0)), 5, 2) == b"\5\0"
    with pytest.raises(FieldError, match="allowed: 0 bytes"):
        encode(undescribed((0x5000, 0)), 5)
    with pytest.raises(FieldError, match="2 bytes"):
        encode(undescribed((0x5000, 0)), 65536, 2)


def test_limits_lie_inside_the_type() -> None:
    assert limits(typed(datatypes.UNSIGNED8, -5, 300)) == (0, 255)
