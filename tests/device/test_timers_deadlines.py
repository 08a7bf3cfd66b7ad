"""Deadlines: a thing is missed from its first coming on, once, until it is back."""

from __future__ import annotations

from math import inf

import pytest

from eurobot_od.device.timers import Deadlines

TIMES = {"goto": 1.0, "stop": 2.0}


@pytest.fixture
def deadlines() -> Deadlines[str]:
    made: Deadlines[str] = Deadlines()
    made.restart(TIMES)
    return made


def test_a_message_that_never_came_is_not_missed(deadlines: Deadlines[str]) -> None:
    assert deadlines.next == inf
    assert deadlines.overdue(100.0) == []


def test_a_message_without_a_deadline_is_not_awaited(deadlines: Deadlines[str]) -> None:
    assert deadlines.heard("position", 0.0) is False
    assert deadlines.next == inf


def test_a_missed_message_is_reported_once_and_back_once(deadlines: Deadlines[str]) -> None:
    deadlines.heard("goto", 0.0)
    assert (deadlines.next, deadlines.awaits("goto")) == (1.0, True)
    assert deadlines.overdue(0.999) == []
    assert deadlines.overdue(1.0) == ["goto"]
    assert (deadlines.overdue(5.0), deadlines.missed, deadlines.awaits("goto")) == ([], {"goto"}, False)
    assert deadlines.heard("goto", 6.0) is True
    assert (deadlines.heard("goto", 6.5), deadlines.next) == (False, 7.5)


def test_a_returned_message_without_a_deadline_is_not_awaited(deadlines: Deadlines[str]) -> None:
    deadlines.heard("goto", 0.0)
    deadlines.overdue(1.0)
    assert deadlines.back("goto") is True
    assert (deadlines.missed, deadlines.next) == (set(), inf)


@pytest.mark.parametrize(
    ("times", "next_", "missed"),
    [
        (TIMES, 2.5, {"goto"}),  # nothing has changed
        ({"goto": 1.0, "stop": 9.0}, inf, {"goto"}),  # the other one begins anew
        ({"goto": 3.0, "stop": 2.0}, 2.5, set()),  # nobody misses what has another time now
        ({"stop": 2.0}, 2.5, set()),
        ({}, inf, set()),
    ],
)
def test_a_change_leaves_alone_what_it_is_not_about(
    deadlines: Deadlines[str], times: dict[str, float], next_: float, missed: set[str]
) -> None:
    deadlines.heard("goto", 0.0)
    deadlines.heard("stop", 0.5)
    deadlines.overdue(1.0)
    deadlines.change(times)
    assert (deadlines.next, deadlines.missed) == (next_, missed)


def test_a_restart_forgets_all(deadlines: Deadlines[str]) -> None:
    deadlines.heard("goto", 0.0)
    deadlines.heard("stop", 0.0)
    deadlines.overdue(1.0)
    deadlines.restart(TIMES)
    assert (deadlines.next, deadlines.missed) == (inf, set())
