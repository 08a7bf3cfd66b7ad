"""Whether times are one series or two."""

from __future__ import annotations

import pytest

from eurobot_od.traffic.diagnosis.nodes import Beats
from eurobot_od.traffic.diagnosis.series import two_series


def series(period: float, start: float = 0.0, number: int = 8) -> list[float]:
    """Return the times of one series."""
    return [start + n * period for n in range(number)]


TWO = {
    "of one period": (series(0.5) + series(0.5, 0.17), 1.25),
    "of two periods": (series(0.5, number=9) + series(0.73, 0.12, 6), 1.25),
    "one that begins with the other": (series(0.1) + series(0.1, 0.037), 1.55),
}

ONE = {
    "no jitter": (series(0.1, number=16), 1.25),
    "jitter": ([each + 0.004 * (n % 3) for n, each in enumerate(series(0.1, number=16))], 1.25),
    "a timer of 20 ms on a clock of 8 ms": ([0.02 * n + 0.004 * (n % 2) for n in range(16)], 1.55),
    "a frame that is missing": ([each for n, each in enumerate(series(0.1, number=16)) if n != 7], 1.25),
    "a new period": (series(0.1) + series(0.2, 0.8), 1.25),
    "one that is late": ([each + 0.016 * (n == 12) for n, each in enumerate(series(0.1, number=16))], 1.25),
    "the last one late": ([each + 0.016 * (n == 15) for n, each in enumerate(series(0.1, number=16))], 1.25),
    "the first one late": ([each + 0.016 * (n == 0) for n, each in enumerate(series(0.1, number=16))], 1.25),
    "too few": (series(0.5, number=3) + series(0.5, 0.17, 3), 1.25),
}


@pytest.mark.parametrize(("times", "ratio"), TWO.values())
def test_two_series_are_found(times: list[float], ratio: float) -> None:
    assert two_series(sorted(times), ratio) is not None


@pytest.mark.parametrize(("times", "ratio"), ONE.values())
def test_one_series_is_not_two(times: list[float], ratio: float) -> None:
    assert two_series(sorted(times), ratio) is None


def test_the_periods_are_returned() -> None:
    assert two_series(sorted(TWO["of two periods"][0]), 1.25) == pytest.approx((0.5, 0.73))


@pytest.mark.parametrize(("intervals", "is_next"), [(2, False), (3, True), (4, True)])
def test_a_frame_in_phase_continues_a_series_once_that_is_sure(intervals: int, is_next: bool) -> None:
    beats = Beats(0.1)
    beats.last = 0.4
    for _ in range(intervals):
        beats.add(0.1)
    assert beats.is_next(0.5) is is_next
