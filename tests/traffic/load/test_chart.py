"""The chart's scale: decades of time from below the shortest one, so that it is to be seen, to the longest."""

from __future__ import annotations

import pytest

from eurobot_od.traffic.load.chart import decades
from eurobot_od.traffic.load.message_set import MessageSet, PeriodicMessage
from eurobot_od.traffic.load.report import load_report


@pytest.mark.parametrize(
    ("rate", "deadline", "lines"),
    [
        (500_000, 1_000, [100, 1_000]),  # the frame takes 270 us
        (500_000, 1_001, [100, 1_000, 10_000]),
        (1_000_000, 1_000, [10, 100, 1_000]),  # 135 us: at 100 its bar would be too short
        (1_000_000, 100, [10, 100, 1_000]),
        (1_000_000, 300_000, [10, 100, 1_000, 10_000, 100_000, 1_000_000]),
    ],
)
def test_decades_are_as_many_as_the_times_need(rate: int, deadline: int, lines: list[int]) -> None:
    message = PeriodicMessage("Quick", 0x010, 8, 500_000, deadline, "a")
    assert [10**power for power in decades(load_report(MessageSet((message,)), rate))] == lines
