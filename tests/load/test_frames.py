"""The longest frames, and the order of urgency."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.frame import Frame
from eurobot_od.load.frames import longest_frame, urgency
from eurobot_od.simulation.bits import frame_bits

LONGEST = [
    (0, False, 55),  # 47 bits, and 8 stuff bits after the 34 from start of frame to CRC
    (8, False, 135),  # 55 + 10 s, the paper's equation 1
    (0, True, 80),
    (8, True, 160),  # 80 + 10 s, the paper's equation 2
]


@pytest.mark.parametrize(("length", "extended", "bits"), LONGEST)
def test_the_papers_lengths(length: int, extended: bool, bits: int) -> None:
    assert longest_frame(length, extended) == bits


@given(st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8)))
def test_no_frame_on_the_simulated_bus_is_longer(frame: Frame) -> None:
    assert frame_bits(frame) <= longest_frame(len(frame.data))


MORE_URGENT = [
    ((0x000, False), (0x001, False)),
    ((0x100, False), (0x100 << 18, True)),  # the base frame's RTR bit is dominant where the other has SRR
    ((0x0FF << 18 | 0x3FFFF, True), (0x100, False)),  # the first 11 bits are compared before that
    ((0x100 << 18, True), (0x100 << 18 | 1, True)),
]


@pytest.mark.parametrize(("more", "less"), MORE_URGENT)
def test_urgency_is_what_arbitration_says(more: tuple[int, bool], less: tuple[int, bool]) -> None:
    assert urgency(*more) < urgency(*less)
