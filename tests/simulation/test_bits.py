"""Bits of a frame on the wire, against a reference that writes them out another way."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.frame import Frame
from eurobot_od.simulation.bits import frame_bits

GENERATOR = 0b1100010110011001
"""x15 + x14 + x10 + x8 + x7 + x4 + x3 + 1 (ISO 11898-1)."""

frames = st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8))


def remainder(dividend: int) -> int:
    """Divide by the generator, as polynomials."""
    while dividend.bit_length() >= GENERATOR.bit_length():
        dividend ^= GENERATOR << (dividend.bit_length() - GENERATOR.bit_length())
    return dividend


def reference(frame: Frame) -> int:
    """Write all bits of a frame out and count them."""
    control = f"{0:03b}{len(frame.data):04b}"
    plain = f"0{frame.cob_id:011b}{control}" + "".join(f"{byte:08b}" for byte in frame.data)
    checked = plain + f"{remainder(int(plain, 2) << 15):015b}"
    wire = ""
    for bit in checked:
        wire += bit
        wire += {"00000": "1", "11111": "0"}.get(wire[-5:], "")
    acknowledged = wire + "1" + "01" + "1" * 7  # CRC delimiter, acknowledge slot and delimiter, end of frame
    return len(acknowledged + "1" * 3)  # intermission


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
def test_the_reference_agrees(frame: Frame) -> None:
    assert frame_bits(frame) == reference(frame)


@given(frames)
def test_a_frame_is_never_shorter_than_unstuffed_and_never_longer_than_the_worst_case(frame: Frame) -> None:
    stuffable = 34 + 8 * len(frame.data)
    assert stuffable + 13 <= frame_bits(frame) <= stuffable + 13 + (stuffable - 1) // 4


@given(st.builds(Frame, st.integers(0, 0x7FF), st.binary(min_size=8, max_size=8)))
def test_eight_bytes_take_at_most_135_bits(frame: Frame) -> None:
    assert 111 <= frame_bits(frame) <= 135
