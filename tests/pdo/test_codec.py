"""The codec: CiA 301's bit order, slices, and the mappings that make no layout."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from eurobot_od.frame import Frame
from eurobot_od.pdo.codec import Column, Layout, LayoutError, Slot, Unknown, reader, slot, unpacker, writer
from eurobot_od.pdo.kinds import field_name


def whole(**bits: int) -> Layout:
    """A layout of whole fields, one behind the other."""
    return Layout(Slot(field, 0, count) for field, count in bits.items())


def pack(layout: Layout, **values: int) -> bytes:
    word = sum(layout.place(field, value) for field, value in values.items())
    return word.to_bytes(layout.length, layout.byte_order)


# Bytes on which three CANopen stacks agree (CiA 301, 7.4.8.2: the first object has the least significant bits).
CIA_301 = [
    (
        whole(x=12, y=12, angle=10, speed=8, barriers=16),
        {"x": 1234, "y": 567, "angle": 89, "speed": 75, "barriers": 0xA5C3},
        "D27423592C0D9702",
    ),
    (
        whole(colour=1, enemies=2, confederates=1, one=6, two=6),
        {"colour": 1, "enemies": 2, "confederates": 1, "one": 45, "two": 33},
        "DD86",
    ),
    (whole(time=24), {"time": 0x123456}, "563412"),
    (whole(flag=1), {"flag": 1}, "01"),
    (whole(), {}, ""),
    # 8 bits at bit 34 and 16 bits at bit 42, where a codec by bytes goes wrong
    (whole(before=34, field=8), {"before": 0, "field": 0xFF}, "00000000FC03"),
    (whole(before=42, field=16), {"before": 0, "field": 0xFFFF}, "0000000000FCFF03"),
    (whole(long=64), {"long": 0x0123456789ABCDEF}, "EFCDAB8967452301"),
]


@pytest.mark.parametrize(("layout", "values", "data"), CIA_301)
def test_bits_are_placed_as_in_cia_301(layout: Layout, values: dict[str, int], data: str) -> None:
    assert pack(layout, **values).hex().upper() == data
    assert unpacker(layout)(bytes.fromhex(data)) == tuple(values.values())


def test_padding_is_written_as_zeros_and_not_read() -> None:
    layout = Layout([Slot("a", 0, 3), Slot(None, 0, 5), Slot("b", 0, 4)])
    assert layout.fields == ("a", "b")
    assert pack(layout, a=7, b=15) == bytes([0x07, 0x0F])
    assert unpacker(layout)(bytes([0xFF, 0xFF])) == (7, 15)


# A 12-bit and a 4-bit value, the most significant bit first: AAAAAAAA AAAABBBB.
MOST_SIGNIFICANT_FIRST = Layout([Slot("a", 4, 8), Slot("b", 0, 4), Slot("a", 0, 4)])


def test_slices_are_joined_to_values() -> None:
    assert MOST_SIGNIFICANT_FIRST.fields == ("a", "b")
    assert MOST_SIGNIFICANT_FIRST.widths == {"a": 12, "b": 4}
    assert pack(MOST_SIGNIFICANT_FIRST, a=0xABC, b=0xD) == bytes([0xAB, 0xCD])
    assert unpacker(MOST_SIGNIFICANT_FIRST)(bytes([0xAB, 0xCD])) == (0xABC, 0xD)


def test_the_byte_order_with_fewest_runs_is_chosen() -> None:
    assert MOST_SIGNIFICANT_FIRST.byte_order == "big"
    assert {field: len(runs) for field, runs in MOST_SIGNIFICANT_FIRST.runs.items()} == {"a": 1, "b": 1}
    assert whole(a=12, b=4).byte_order == "little"


def test_places_are_bits_of_the_frame_in_either_order() -> None:
    assert MOST_SIGNIFICANT_FIRST.places("a") == [12, 13, 14, 15, 0, 1, 2, 3, 4, 5, 6, 7]
    assert whole(a=12, b=4).places("b") == [12, 13, 14, 15]


SHORTEST = [
    (["x"], 2),
    (["x", "y"], 3),
    (["speed"], 6),  # 42 bits: the last two of the speed are in the sixth byte
    (["barriers"], 8),
    ([], 0),
]


@pytest.mark.parametrize(("needed", "length"), SHORTEST)
def test_the_shortest_frame_contains_all_needed_fields(needed: list[str], length: int) -> None:
    assert whole(x=12, y=12, angle=10, speed=8, barriers=16).shortest(needed) == length


NO_LAYOUTS = [
    ([Slot("a", 0, 64), Slot("b", 0, 1)], "65 bits are mapped, a PDO has at most 64"),
    ([Slot(None, 0, 255)], "255 bits are mapped, a PDO has at most 64"),
    ([Slot("a", 4, 4)], "a: bit 0 is mapped nowhere"),
    ([Slot("a", 8, 4), Slot("a", 0, 4)], "a: bit 4 is mapped nowhere"),
    ([Slot("a", 0, 4), Slot("a", 0, 4)], "a: bits are mapped twice"),
    ([Slot("a", 0, 8), Slot("a", 7, 4)], "a: bits are mapped twice"),
]


@pytest.mark.parametrize(("slots", "what"), NO_LAYOUTS)
def test_gaps_overlaps_and_too_many_bits_raise_layout_error(slots: list[Slot], what: str) -> None:
    with pytest.raises(LayoutError) as error:
        Layout(slots)
    assert str(error.value) == what


SLOTS = [
    ("X position", 12, Slot("x", 0, 12)),
    ("X position (11:4)", 8, Slot("x", 4, 8)),
    ("X position [11:4]", 8, Slot("x", 4, 8)),
    ("Enemy 1 diameter [1:0]", 2, Slot("enemy_1_diameter", 0, 2)),
    ("Barriers [3:3]", 1, Slot("barriers", 3, 1)),
    ("X position[11:4]", 8, Slot("x_position_11_4", 0, 8)),  # no slice: no blank before the bracket
]


@pytest.mark.parametrize(("name", "bits", "expected"), SLOTS)
def test_a_parameter_name_gives_the_slot(name: str, bits: int, expected: Slot) -> None:
    assert slot(name, bits, field_name) == expected


@pytest.mark.parametrize(("name", "bits"), [("X position [11:4]", 7), ("X position [4:11]", 8)])
def test_a_slice_with_contradicting_name_and_length_raises(name: str, bits: int) -> None:
    with pytest.raises(LayoutError) as error:
        slot(name, bits, field_name)
    assert str(error.value) == f"{name} is mapped with {bits} bits"


# Meanings

COB_ID = 0x123
FIELD_16, FIELD_24 = Layout([Slot("a", 0, 16)]), Layout([Slot("a", 0, 24)])


def refuse(what: object) -> Any:
    raise LookupError(what)


def counting(function: Callable[[int], int], calls: list[int]) -> Callable[[int], int]:
    def counted(value: int) -> int:
        calls.append(value)
        return function(value)

    return counted


def test_the_meanings_of_a_narrow_field_are_computed_once() -> None:
    calls: list[int] = []
    read = reader(whole(a=4), [Column("a", counting(lambda raw: -raw, calls), refuse)], tuple, refuse, None)
    assert [read(bytes([raw])) for raw in range(16)] * 2 == [(-raw,) for raw in range(16)] * 2
    assert calls == list(range(16))


@pytest.mark.parametrize(("value", "asked"), [(1, False), (2, False), (0, True), (3, True)])
def test_plain_numbers_need_no_conversion(value: int, asked: bool) -> None:
    calls: list[int] = []
    counted = counting(lambda number: number, calls)
    column = Column("a", counted, counted, numbers=range(1, 3), sendable=range(1, 3))
    assert writer(FIELD_24, [column], COB_ID, refuse, None)((value,)).data == bytes([value, 0, 0])
    assert calls == [value] * asked
    calls.clear()
    assert reader(FIELD_24, [column], tuple, refuse, None)(bytes([value, 0, 0])) == (value,)
    assert calls == [value] * (value not in column.numbers)


@pytest.mark.parametrize("value", [-1, -3, -4, -6, 3, 1 << 64, -1 << 64, None, "1", [], 0.5])
def test_values_without_table_entry_use_the_careful_function(value: Any) -> None:
    layout = whole(a=2)
    write = writer(layout, [Column("a", lambda raw: raw, {0: 0, 1: 1, 2: 2}.__getitem__)], COB_ID, refuse, None)
    with pytest.raises(LookupError):
        write((value,))


@pytest.mark.parametrize("data", [b"", b"\x01", b"\x01\x02\x03"])
def test_data_of_another_length_calls_irregular(data: bytes) -> None:
    read = reader(FIELD_16, [Column("a", lambda raw: raw, refuse)], tuple, lambda data: ("irregular", data), None)
    assert read(data) == ("irregular", data)


def test_a_field_that_is_not_mapped_has_its_default() -> None:
    default = (1,)
    columns = [Column("a", lambda raw: raw, {3: 3}.__getitem__), Column("b", None, refuse, default)]
    assert reader(whole(a=8), columns, tuple, refuse, None)(b"\x03") == (3, default)
    write = writer(whole(a=8), columns, COB_ID, refuse, None)
    assert write((3, default)) == Frame(COB_ID, b"\x03")
    with pytest.raises(LookupError):
        write((3, (2,)))


def test_codes_mean_unknown_only_together() -> None:
    layout, both = whole(a=8, b=8), {0x10: 0x10, 0x11: 0x11}
    unknown = Unknown(0xFFFF, 0x1110, {"a": 0x10, "b": 0x11})
    columns = [Column(field, lambda raw: raw, both.__getitem__) for field in ("a", "b")]
    read = reader(layout, columns, tuple, refuse, unknown)
    assert [read(bytes(pair)) for pair in ((0x10, 0x11), (0x10, 0x10))] == [(None, None), (0x10, 0x10)]
    write = writer(layout, columns, COB_ID, refuse, unknown)
    assert write((0x10, 0x10)).data == b"\x10\x10"
    with pytest.raises(LookupError):
        write((0x10, 0x11))
