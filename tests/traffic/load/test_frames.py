"""The longest frames."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.bus.simulated.bits import frame_bits
from eurobot_od.frame import Frame
from eurobot_od.traffic.load.frames import longest_frame


@pytest.mark.parametrize(("length", "bits"), [(0, 55), (8, 135)])  # 55 + 10 s, the paper's equation 1
def test_the_papers_lengths(length: int, bits: int) -> None:
    assert longest_frame(length) == bits


@given(st.builds(Frame, st.integers(0, 0x7FF), st.binary(max_size=8)))
def test_no_frame_on_the_simulated_bus_is_longer(frame: Frame) -> None:
    assert frame_bits(frame) <= longest_frame(len(frame.data))
