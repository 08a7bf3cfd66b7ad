"""What is reported of a core's gotos and tasks, however they end."""

from __future__ import annotations

from math import nan
from typing import Any

import pytest

from eurobot_od.device.timers import Call
from eurobot_od.errors import StateError
from eurobot_od.robot import dialects
from eurobot_od.robot.match.referee import Observer
from eurobot_od.robot.model.messages import GotoXY
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import Outcome
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.nodes.core.flows import GotoReport
from eurobot_od.robot.world.world import EventKind, MatchEvent, Timeline
from tests.robot.nodes.harness import Bench

GOTO = GotoXY(1500, 1000, 90, 80)
DICTIONARY = dialects.load("core")


def told(what: GotoXY | str, end: object, *, is_wanted: bool = True) -> list[MatchEvent]:
    """Return what is reported of something from 1 s to 3 s: a result, an exception, or None if it was cancelled."""
    events: list[MatchEvent] = []
    now, call = [1.0], Call[Any]()
    core = Core(DICTIONARY)
    Observer(core, Timeline(lambda: now[0], events.append), lambda: Pose(0, 0, 0))
    core.observe(what, call)
    call.is_wanted = is_wanted
    now[0] = 3.0
    if end is None:
        call.cancel()
    elif isinstance(end, Exception):
        call.set_exception(end)
    else:
        call.set_result(end)
    return events


def given_up(text: str, outcome: str, why: str | None, seconds: float) -> MatchEvent:
    return MatchEvent(3.0, EventKind.GIVEN_UP, text, {"outcome": outcome, "why": why, "seconds": seconds})


ENEMY = GotoReport(GOTO, Outcome.STOPPED, 0.1, 1.5, "enemy ahead")
BLOCKED = GotoReport(GOTO, Outcome.BLOCKED, 0.1, 1.5)

ENDS = [
    (BLOCKED, [given_up("blocked after 1.50 s", "blocked", None, 1.5)]),
    (
        ENEMY,
        [
            MatchEvent(3.0, EventKind.STOP, "emergency stop: enemy ahead", {"obstacle": "enemy"}),
            given_up("stopped after 1.50 s: enemy ahead", "stopped", "enemy ahead", 1.5),
        ],
    ),
    (StateError("no way"), [given_up("failed after 2.00 s: no way", "failed", "no way", 2.0)]),
    (None, [given_up("cancelled after 2.00 s", "cancelled", None, 2.0)]),
]


@pytest.mark.parametrize(("what", "name"), [(GOTO, "goto"), ("fire 1", "act")])
def test_a_call_that_nobody_awaits_is_told(what: GotoXY | str, name: str) -> None:
    (warning,) = (event for event in told(what, StateError("no"), is_wanted=False) if event.kind is EventKind.WARNING)
    assert warning.text.endswith(f": nobody awaits this {name}; write `await core.{name}(...)`")
    assert "test_observer.py:" in warning.text


@pytest.mark.parametrize(("end", "events"), ENDS)
def test_a_goto_is_reported_with_its_outcome(end: object, events: list[MatchEvent]) -> None:
    begun, *ended = told(GOTO, end)
    assert (begun.time, begun.kind, begun.text) == (1.0, EventKind.GOTO, "(1500, 1000) 90 deg, 80 %")
    assert ended == events


@pytest.mark.parametrize(
    ("end", "texts"), [(3, ["fire 1: 3"]), (0, ["fire 1: nothing"]), (StateError("no arm"), []), (None, [])]
)
def test_a_task_is_reported_with_its_points(end: object, texts: list[str]) -> None:
    assert [event.text for event in told("fire 1", end)] == texts


AWAY = "fire 1: nothing; its place is (900, 1670) 270 deg, the robot is at (600, 1800) 90 deg"


@pytest.mark.parametrize(
    ("truth", "gain", "text"),
    [
        (Pose(600, 1800, 90), 0, AWAY),
        (Pose(900, 1670, 259), 0, AWAY.replace("(600, 1800) 90", "(900, 1670) 259")),
        (Pose(861, 1670, 263), 0, "fire 1: nothing"),
        (Pose(nan, nan, nan), 0, "fire 1: nothing"),
        (Pose(600, 1800, 90), 2, "fire 1: 2"),
    ],
    ids=["elsewhere", "looks elsewhere", "there", "nobody knows where it is", "done all the same"],
)
def test_a_task_at_the_wrong_place_comes_to_nothing_and_is_told_the_right_one(
    truth: Pose, gain: int, text: str
) -> None:
    events: list[MatchEvent] = []
    bench = Bench("drive", "navigation")
    bench.configure()
    Observer(bench.core, Timeline(lambda: 1.0, events.append), lambda: truth)
    call = Call[Any]()
    bench.core.observe("fire 1", call)
    call.set_result(gain)
    assert [event.text for event in events if event.kind is EventKind.TASK] == [text]
