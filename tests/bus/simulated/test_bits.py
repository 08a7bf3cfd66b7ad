"""Bits of a frame on the wire and back, against an encoder that writes them out another way."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.bus.simulated.bits import BitReading, frame_bits, on_wire
from eurobot_od.frame import Frame

GENERATOR = 0b1100010110011001
"""x15 + x14 + x10 + x8 + x7 + x4 + x3 + 1 (ISO 11898-1)."""

frames = st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8))


def remainder(dividend: int) -> int:
    """Divide by the generator, as polynomials."""
    while dividend.bit_length() >= GENERATOR.bit_length():
        dividend ^= GENERATOR << (dividend.bit_length() - GENERATOR.bit_length())
    return dividend


def encoded(frame: Frame) -> tuple[str, list[int]]:
    """Write the bits of a frame out up to the end of its CRC, and the places of the stuff bits among them."""
    control = f"{0:03b}{len(frame.data):04b}"
    plain = f"0{frame.cob_id:011b}{control}" + "".join(f"{byte:08b}" for byte in frame.data)
    checked = plain + f"{remainder(int(plain, 2) << 15):015b}"
    return stuffed(checked)


def stuffed(bits: str) -> tuple[str, list[int]]:
    """Put a bit after every five equal ones; return where they stand, too."""
    wire, places = "", list[int]()
    for bit in bits:
        wire += bit
        stuff_bit = {"00000": "1", "11111": "0"}.get(wire[-5:], "")
        places += [len(wire)] * len(stuff_bit)
        wire += stuff_bit
    return wire, places


def read(bits: str) -> BitReading:
    """Read bits until a stuff error."""
    reading = BitReading()
    assert all(reading.take(int(bit)) for bit in bits)
    return reading


@pytest.mark.parametrize(
    ("frame", "stuffed"),
    [
        (Frame(0x555), 1),  # seven zeros from RTR to DLC, and a CRC that needs none
        (Frame(0x000), 6),  # 34 zeros, as the CRC of zeros is zero: a stuff bit after every five
    ],
)
def test_known_frames(frame: Frame, stuffed: int) -> None:
    assert frame_bits(frame) == 47 + 8 * len(frame.data) + stuffed


@given(frames)
def test_the_bits_and_the_places_of_the_stuff_bits_are_those_of_an_independent_encoder(frame: Frame) -> None:
    bits, places = encoded(frame)
    wire = on_wire(frame)
    assert "".join(map(str, wire.bits)) == bits
    assert sorted(wire.stuffed) == places


@given(frames)
def test_the_length_is_that_of_an_independent_encoder(frame: Frame) -> None:
    bits, _ = encoded(frame)
    acknowledged = bits + "1" + "01" + "1" * 7  # CRC delimiter, acknowledge slot and delimiter, end of frame
    assert on_wire(frame).end == len(acknowledged)
    assert frame_bits(frame) == len(acknowledged + "1" * 3)  # intermission


@given(frames)
def test_the_arbitration_ends_with_the_rtr_bit_and_its_stuff_bit(frame: Frame) -> None:
    bits, places = encoded(frame)
    field = bits[: on_wire(frame).arbitration]
    assert len(field) - sum(place < len(field) for place in places) == 13


@given(frames)
def test_a_frame_is_read_as_it_was_written(frame: Frame) -> None:
    reading = read(encoded(frame)[0])
    assert reading.complete
    assert reading.intact
    assert reading.frame == frame


@given(frames, st.data())
def test_a_frame_is_complete_no_sooner_than_with_its_last_bit(frame: Frame, data: st.DataObject) -> None:
    bits = encoded(frame)[0]
    assert not read(bits[: data.draw(st.integers(0, len(bits) - 1))]).complete


@given(frames, st.data())
def test_one_wrong_bit_is_always_noticed(frame: Frame, data: st.DataObject) -> None:
    bits = [int(bit) for bit in encoded(frame)[0]]
    bits[data.draw(st.integers(0, len(bits) - 1))] ^= 1
    reading = BitReading()
    fits = all(reading.take(bit) for bit in bits)
    assert not (fits and reading.complete and reading.intact and reading.frame == frame)


ODD = {
    "a remote frame has no data, whatever its length says": ("0" + "10101010101" + "1" + "0" + "0" + "1000", 19),
    "29 bits": ("0" + "10101010101" + "11" + "010101010101010101" + "0" + "00" + "0001", 39 + 8),
    "29 bits, remote": ("0" + "10101010101" + "11" + "010101010101010101" + "1" + "00" + "0001", 39),
    "a length above 8 is 8": ("0" + "10101010101" + "0" + "0" + "0" + "1010", 19 + 64),
}
"""Unstuffed heads of what a bit error can make of a frame, and the bits up to the CRC; why they are as long."""


@pytest.mark.parametrize(("head", "length"), ODD.values(), ids=ODD)
def test_frames_that_nobody_sends_are_read_to_their_end(head: str, length: int) -> None:
    plain = head + ("01" * 32)[: length - len(head)]
    reading = BitReading()
    for bit in stuffed(plain + f"{remainder(int(plain, 2) << 15):015b}")[0]:
        assert not reading.complete
        assert reading.take(int(bit))
    assert reading.complete
    assert reading.intact


@given(frames)
def test_a_frame_is_never_shorter_than_unstuffed_and_never_longer_than_the_worst_case(frame: Frame) -> None:
    stuffable = 34 + 8 * len(frame.data)
    assert stuffable + 13 <= frame_bits(frame) <= stuffable + 13 + (stuffable - 1) // 4


@given(st.builds(Frame, st.integers(0, 0x7FF), st.binary(min_size=8, max_size=8)))
def test_eight_bytes_take_at_most_135_bits(frame: Frame) -> None:
    assert 111 <= frame_bits(frame) <= 135
