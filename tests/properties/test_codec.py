"""Laws of the codec: any mapping packs and unpacks as one would do it bit by bit."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.frame import Frame
from eurobot_od.od.values import MAX_BITS
from eurobot_od.pdo.codec import Column, Layout, Slot, reader, unpacker, writer

COB_ID = 0x123


def whole_fields(widths: list[int]) -> list[Slot]:
    """Fields one behind the other, as many as a PDO can carry; every fifth is padding, every third has a sign."""
    slots: list[Slot] = []
    for number, bits in enumerate(widths):
        if sum(slot.bits for slot in slots) + bits <= MAX_BITS:
            is_padding = number % 5 == 4
            slots.append(Slot(None if is_padding else f"f{number}", 0, bits, number % 3 == 2 and not is_padding))
    return slots


@st.composite
def sliced_fields(draw: st.DrawFn) -> list[Slot]:
    """The same cut into slices and shuffled, as a robot with another bit order may have them."""
    slots: list[Slot] = []
    for field, shift, bits, signed in draw(WHOLE):
        cuts = sorted(draw(st.sets(st.integers(1, bits - 1), max_size=4))) if field and bits > 1 else []
        edges = [shift, *cuts, bits]
        slots += [Slot(field, low, high - low, signed) for low, high in pairwise(edges)]
    return draw(st.permutations(slots))


@st.composite
def most_significant_first(draw: st.DrawFn) -> list[Slot]:
    """Fields whose bits lie in the bytes from the most significant on, mapped in CiA 301's order."""
    fields = draw(WHOLE)
    bits = [(field, bit, signed) for field, _, width, signed in fields for bit in reversed(range(width))]
    bits += [(None, 0, False)] * (-len(bits) % 8)
    by_byte = [bits[start : start + 8][::-1] for start in range(0, len(bits), 8)]
    return [Slot(field, bit if field else 0, 1, signed) for byte in by_byte for field, bit, signed in byte]


WHOLE = st.lists(st.integers(1, MAX_BITS), min_size=1, max_size=12).map(whole_fields)
LAYOUTS = st.one_of(WHOLE, sliced_fields(), most_significant_first()).map(Layout)


@st.composite
def filled(draw: st.DrawFn) -> tuple[Layout, dict[str, int]]:
    """A layout and a value for each of its fields."""
    layout = draw(LAYOUTS)
    return layout, {field: draw(_raws(layout, field)) for field in layout.fields}


def _raws(layout: Layout, field: str) -> st.SearchStrategy[int]:
    raws = layout.raws[field]
    return st.integers(raws[0], raws[-1])


def bit_by_bit(layout: Layout, values: dict[str, int]) -> bytes:
    """Pack as CiA 301, 7.4.8.2 says it, one bit after the other."""
    data, place = bytearray(layout.length), 0
    for field, shift, bits, _ in layout.slots:
        for bit in range(shift, shift + bits):
            if field is not None and values[field] >> bit & 1:
                data[place // 8] |= 1 << place % 8
            place += 1
    return bytes(data)


def pack(layout: Layout, values: dict[str, int]) -> bytes:
    word = sum(layout.place(field, value) for field, value in values.items())
    return word.to_bytes(layout.length, layout.byte_order)


@given(filled())
def test_packs_as_bit_by_bit(case: tuple[Layout, dict[str, int]]) -> None:
    layout, values = case
    assert pack(layout, values) == bit_by_bit(layout, values)


@given(filled())
def test_unpacks_what_was_packed(case: tuple[Layout, dict[str, int]]) -> None:
    layout, values = case
    assert dict(zip(layout.fields, unpacker(layout)(bit_by_bit(layout, values)))) == values


def column(layout: Layout, field: str) -> Column:
    """A column of plain numbers, about half of which mean themselves and the others are asked for."""
    bits = layout.widths[field]
    own = range(bits, layout.raws[field].stop // 2)
    return Column(field, lambda raw: raw, lambda value: value, numbers=own, sendable=own)


@given(filled())
def test_generated_reader_and_writer_agree_with_the_raw_codec(case: tuple[Layout, dict[str, int]]) -> None:
    layout, values = case

    def never(what: object) -> Frame:
        raise AssertionError(what)

    message = tuple(values.values())
    frame = Frame(COB_ID, bit_by_bit(layout, values))
    columns = [column(layout, field) for field in layout.widths]
    write = writer(layout, columns, COB_ID, never, None)
    read = reader(layout, columns, tuple, never, None)
    assert write(message) == frame
    assert read(frame.data) == message


@given(LAYOUTS)
def test_places_say_where_each_bit_of_a_field_is(layout: Layout) -> None:
    for field in layout.fields:
        for bit, place in enumerate(layout.places(field)):
            data = bytearray(layout.length)
            data[place // 8] |= 1 << place % 8
            assert dict(zip(layout.fields, unpacker(layout)(bytes(data))))[field] == weight(layout, field, bit)


def weight(layout: Layout, field: str, bit: int) -> int:
    """What a bit of a value counts: that of the sign is negative (two's complement)."""
    is_sign = field in layout.signed and bit == layout.widths[field] - 1
    return -(1 << bit) if is_sign else 1 << bit


@given(LAYOUTS)
def test_runs_cover_every_mapped_bit_once(layout: Layout) -> None:
    covered = [run.offset + bit for runs in layout.runs.values() for run in runs for bit in range(run.bits)]
    assert len(covered) == len(set(covered)) == sum(layout.widths.values())
