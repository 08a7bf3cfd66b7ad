"""Decides whether the times of frames form one periodic series, or two."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from itertools import pairwise
from statistics import median

WINDOW = 16
"""Number of frames examined together."""

LEAST = 4
"""Minimum number of frames of a series."""

SAME = 0.1
"""Maximum relative difference of equal periods."""

OFF, STAMP = 0.04, 0.001
"""Maximum deviation of a frame from its series: a share of the period plus a time in s."""


def is_even(times: Sequence[float], ratio: float) -> bool:
    """Return whether the longest interval exceeds the shortest by at most a ratio."""
    intervals = [two - one for one, two in pairwise(times)]
    return max(intervals) <= ratio * min(intervals)


def two_series(times: Sequence[float], ratio: float) -> tuple[float, float] | None:
    """Return the periods of the two series in uneven times in s, None if there are not two.

    Intervals that differ by less than `ratio` are the jitter of one series.
    """
    if len(times) < 2 * LEAST or is_even(times, ratio):
        return None
    for place in range(2, len(times) - LEAST + 2):
        one = _series(times, times[place - 1] - times[0])
        rest = [each for each in times if each not in one] if len(one) >= LEAST else []
        if len(rest) < LEAST or len(_series(rest, rest[1] - rest[0])) < len(rest):
            continue
        period = _period(rest)
        is_whole = rest[0] - times[0] < 1.5 * period and times[-1] - rest[-1] < 1.5 * period  # else a new period
        first = _period(sorted(one))
        if is_whole and (abs(first / period - 1) > SAME or _alternates(times, ratio)):
            return first, period
    return None


def _alternates(times: Sequence[float], ratio: float) -> bool:
    """Return whether every second interval is longer, not just a single one."""
    intervals = [two - one for one, two in pairwise(times)]
    short, long = sorted((median(intervals[::2]), median(intervals[1::2])))
    return long > ratio * short


def _series(times: Sequence[float], period: float) -> set[float]:
    """Return the times that follow the first one periodically; none if one is missing."""
    found = {times[0]}
    last = times[0]
    off = OFF * period + STAMP
    while period > off and last + period + off <= times[-1]:
        place = bisect_left(times, last + period - off)
        near = [each for each in times[place : place + 3] if each <= last + period + off]
        if not near:
            return set()
        last = min(near, key=lambda each: abs(each - last - period))
        found.add(last)
    if period > off and abs(times[-1] - last - period) <= off:
        found.add(times[-1])
    return found


def _period(times: Sequence[float]) -> float:
    return (times[-1] - times[0]) / (len(times) - 1)
