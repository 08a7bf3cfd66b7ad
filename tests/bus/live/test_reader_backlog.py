"""Frames that came while the process stood still."""

from __future__ import annotations

import pytest

from eurobot_od.bus.live.reader import OLD, Backlog

STAMPS = 1_000_000.0
"""The driver's clock is ahead of ours by that."""

STALLED = 5.0


def backlog() -> tuple[Backlog, list[int]]:
    """Read once at 1 s, in the usual time; the next read is at 6 s."""
    ended: list[int] = []
    made = Backlog(0.1 + OLD, ended.append)
    assert not made.is_old(1.0, STAMPS + 1.0)
    return made, ended


def test_frames_from_a_standstill_are_old_until_one_is_fresh() -> None:
    made, ended = backlog()
    now = 1.0 + STALLED
    assert [made.is_old(now, STAMPS + came) for came in (1.5, 3.0, 4.99, 5.5, 3.0)] == [True, True, True, False, False]
    assert ended == [3]


def test_frames_are_old_until_the_queue_is_empty() -> None:
    made, ended = backlog()
    assert made.is_old(6.0, STAMPS + 1.5)
    made.is_empty(6.1)
    assert ended == [1]
    assert not made.is_old(6.2, STAMPS + 1.5)


def test_a_wait_that_ran_out_meanwhile_does_not_mean_that_nothing_waits() -> None:
    made, ended = backlog()
    made.is_empty(6.0)
    assert made.is_old(6.0, STAMPS + 1.5)
    made.is_empty(6.1)
    assert ended == [1]


FRESH = {
    "a clock that is set back": (1.5, STAMPS - 3600),
    "one that is set forward": (1.5, STAMPS + 3600),
    "a bus that was quiet": (1.5, STAMPS + 1.5),
    "no time stamps": (6.0, 0.0),
}


@pytest.mark.parametrize(("now", "stamp"), FRESH.values(), ids=FRESH)
def test_frames_outside_a_standstill_are_not_old(now: float, stamp: float) -> None:
    made, ended = backlog()
    assert not made.is_old(now, stamp)
    assert ended == []


def test_before_the_first_frame_nobody_knows_the_drivers_clock() -> None:
    ended: list[int] = []
    made = Backlog(0.1, ended.append)
    made.is_empty(1.0)
    assert not made.is_old(10.0, STAMPS + 2.0)
