"""Timers: what is due when, in which order, and what cancelling does."""

from __future__ import annotations

from math import inf

import pytest

from eurobot_od.device.timers import Timers


def due(timers: Timers, now: float) -> list[float]:
    """Call what is due and return the times the actions got."""
    times = []
    for action, time in timers.due(now):
        action(time)
        times.append(time)
    return times


@pytest.mark.parametrize(
    ("set_for", "now", "expected"),
    [
        ([], 1.0, []),
        ([1.0], 0.999, []),  # not yet
        ([1.0], 1.0, [1.0]),  # on the dot
        ([1.0], 2.0, [1.0]),  # late: it still gets the time it was set for
        ([1.0], 5.0, [5.0]),  # missed: what repeats itself goes on from here
        ([3.0, 1.0, 2.0], 2.0, [1.0, 2.0]),  # soonest first, the rest stays
    ],
)
def test_what_is_due_comes_soonest_first(set_for: list[float], now: float, expected: list[float]) -> None:
    timers = Timers()
    for time in set_for:
        timers.at(time, lambda _: None)
    assert due(timers, now) == expected
    assert timers.next == min((time for time in set_for if time > now), default=inf)


def test_equal_times_keep_their_order() -> None:
    timers, called = Timers(), list[int]()
    for number in range(5):
        timers.at(1.0, lambda _, number=number: called.append(number))  # type: ignore[misc]
    due(timers, 1.0)
    assert called == [0, 1, 2, 3, 4]


def test_what_becomes_due_meanwhile_is_due_too() -> None:
    timers, called = Timers(), list[float]()

    def again(time: float) -> None:
        called.append(time)
        timers.at(time + 0.25, again)

    timers.at(1.0, again)
    due(timers, 1.6)
    assert called == [1.0, 1.25, 1.5]
    assert timers.next == 1.75


def test_a_cancelled_timer_is_never_called_and_wakes_nobody() -> None:
    timers = Timers()
    timers.at(1.0, lambda _: pytest.fail("cancelled")).cancel()
    assert timers.next == inf
    assert due(timers, 2.0) == []


def test_a_timer_cancelled_by_the_one_before_is_not_called() -> None:
    timers = Timers()
    timers.at(1.0, lambda _: second.cancel())
    second = timers.at(1.0, lambda _: pytest.fail("cancelled"))
    assert due(timers, 1.0) == [1.0]


def test_clear_forgets_all() -> None:
    timers = Timers()
    timers.at(1.0, lambda _: pytest.fail("cleared"))
    timers.clear()
    assert timers.next == inf
    assert due(timers, 2.0) == []


def test_each_new_timer_is_told() -> None:
    told: list[float] = []
    timers = Timers(told.append)
    for time in (2.0, 3.0, 1.0):
        timers.at(time, lambda _: None)
    assert told == [2.0, 3.0, 1.0]
