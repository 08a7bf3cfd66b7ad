"""How long a frame is on the wire, against an encoder that writes its bits out one after the other."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.bus import bits_together, frame_bits, longest_frame
from eurobot_od.frame import EXTENDED, Frame

GENERATOR = 0b1100010110011001
"""x15 + x14 + x10 + x8 + x7 + x4 + x3 + 1 (ISO 11898-1)."""

frames = st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8))


def remainder(dividend: int) -> int:
    """Divide by the generator, as polynomials."""
    while dividend.bit_length() >= GENERATOR.bit_length():
        dividend ^= GENERATOR << (dividend.bit_length() - GENERATOR.bit_length())
    return dividend


def encoded(head: str, data: bytes) -> str:
    """Write the bits of a frame out up to the end of its CRC."""
    plain = head + f"{len(data):04b}" + "".join(f"{byte:08b}" for byte in data)
    wire = ""
    for bit in plain + f"{remainder(int(plain, 2) << 15):015b}":
        wire += bit
        wire += {"00000": "1", "11111": "0"}.get(wire[-5:], "")
    return wire


TAIL = len("1" + "01" + "1" * 7 + "1" * 3)
"""CRC delimiter, acknowledge slot and delimiter, end of frame, intermission."""


@pytest.mark.parametrize(
    ("frame", "stuffed"),
    [
        (Frame(0x555), 1),  # seven zeros from RTR to DLC, and a CRC that needs none
        (Frame(0x000), 6),  # 34 zeros, as the CRC of zeros is zero: a stuff bit after every five
    ],
)
def test_lengths_of_known_frames(frame: Frame, stuffed: int) -> None:
    assert frame_bits(frame) == 47 + 8 * len(frame.data) + stuffed


@given(frames)
def test_the_length_is_that_of_an_independent_encoder(frame: Frame) -> None:
    assert frame_bits(frame) == len(encoded(f"0{frame.cob_id:011b}000", frame.data)) + TAIL


@given(st.integers(0, 0x1FFF_FFFF), st.binary(max_size=8))
def test_length_of_frames_with_29_bit_identifiers(cob_id: int, data: bytes) -> None:
    high, low = f"{cob_id:029b}"[:11], f"{cob_id:029b}"[11:]
    assert frame_bits(Frame(cob_id | EXTENDED, data)) == len(encoded(f"0{high}11{low}000", data)) + TAIL


@given(st.integers(0, 0x7FF) | st.integers(EXTENDED, EXTENDED | 0x1FFF_FFFF), st.lists(st.binary(max_size=8)))
def test_frames_counted_together_have_the_bits_of_each(cob_id: int, data: list[bytes]) -> None:
    assert bits_together(cob_id, data) == sum(frame_bits(Frame(cob_id, each)) for each in data)


# The longest


@pytest.mark.parametrize(("length", "bits"), [(0, 55), (8, 135)])  # 55 + 10 s, the paper's equation 1
def test_the_papers_lengths(length: int, bits: int) -> None:
    assert longest_frame(length) == bits


@given(frames)
def test_no_frame_is_shorter_than_unstuffed_or_longer_than_the_longest(frame: Frame) -> None:
    assert 47 + 8 * len(frame.data) <= frame_bits(frame) <= longest_frame(len(frame.data))
