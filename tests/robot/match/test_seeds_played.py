"""A match as values: how its gotos ended and why, what it touched, what is called wrong."""

from __future__ import annotations

from typing import Any

import pytest

from eurobot_od.robot.match import EventKind, MatchEvent, MatchOptions
from eurobot_od.robot.match.referee import Players
from eurobot_od.robot.match.seeds import PlayedGoto, PlayedMatch, gotos_in, play, touches_in
from eurobot_od.robot.match.stage import EdsFiles, play_simulated
from eurobot_od.robot.match.summary import RobotTouch, Summary
from eurobot_od.robot.model.values import OURS
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.world.bodies import Touch

FILES = EdsFiles.read(MatchOptions())
SHORT = MatchOptions(duration=8.0)
GOTO = MatchEvent(
    0.0, EventKind.GOTO, "", {"goto": {"x": 1, "y": 2, "angle": 3, "barriers": "fire 2:normal, pool 1:forced"}}
)


def given_up(outcome: str, why: str | None) -> MatchEvent:
    return MatchEvent(1.0, EventKind.GIVEN_UP, "", {"outcome": outcome, "why": why, "seconds": 1.0})


def touched(thing: str) -> MatchEvent:
    return MatchEvent(1.0, EventKind.TOUCH, "", Touch(1.0, OURS, thing, 300.0, 0.0, 500.0, 600.0)._asdict())


def summary(**played: Any) -> Summary:
    return Summary(10.0, 500_000, {}, {}, 0.0, **played)


async def drive(core: Core) -> None:
    await core.goto(900, 1670, 270, 80)
    await core.act("fire 1")
    await core.goto(200, 1800, 0, 80)


async def creep(core: Core) -> None:
    await core.goto(1400, 1800, 0, 10)


async def say(_: Core) -> None:
    print("done")


async def fail(_: Core) -> None:
    raise ValueError("no plan")


def test_a_match_from_files_read_before_is_the_match_from_files_read_for_it() -> None:
    play(MatchOptions(seed=2, duration=8.0), FILES)
    assert play(SHORT, FILES).summary == play_simulated(SHORT, lambda _: None, lambda _time, _frame: None)[0]


def test_a_match_has_gotos_tasks_touches_stops_and_points() -> None:
    events: list[MatchEvent] = []
    played, world = play_simulated(SHORT, events.append, lambda _time, _frame: None, FILES, drive)
    match = play(SHORT, FILES, Players(drive))
    assert match.gotos[0][:3] == (900, 1670, 270)
    assert [task.task for task in match.tasks] == [
        event.data["task"] for event in events if event.kind is EventKind.TASK
    ]
    assert match.points == world.game.points(OURS)
    assert len(match.touches) == sum(OURS in (each.robot, each.thing) for each in world.touches)
    assert match.stops == sum(event.text.startswith("emergency stop") for event in events)
    assert match.summary == played


def test_a_strategy_that_raises_is_a_result() -> None:
    match = play(SHORT, FILES, Players(fail))
    line = fail.__code__.co_firstlineno + 1
    assert match.wrong == [f"the strategy raised ValueError: no plan ({__file__}:{line})"]
    assert (match.points, match.failure) == (0, None)


def test_prints_of_a_strategy_stay_out_of_the_output(capsys: pytest.CaptureFixture[str]) -> None:
    play(MatchOptions(duration=0.5), FILES, Players(say))
    assert capsys.readouterr() == ("", "seed 1: done\n")


def test_a_goto_that_the_mushroom_ended_was_stopped() -> None:
    match = play(MatchOptions(enemies=0, duration=8.0, emergency_at=3.0), FILES, Players(creep))
    assert [goto.end for goto in match.gotos] == ["stopped"]


@pytest.mark.parametrize(
    ("events", "ends"),
    [
        ([], []),
        ([GOTO], []),  # no end was reported
        ([GOTO, given_up("not possible", None)], ["not possible"]),
        ([GOTO, given_up("blocked", None), GOTO], ["blocked"]),
        ([GOTO, given_up("stopped", "enemy ahead")], ["stopped: enemy ahead"]),
    ],
)
def test_gotos_of_a_timeline(events: list[MatchEvent], ends: list[str]) -> None:
    assert gotos_in(events) == [PlayedGoto(1, 2, 3, end, 1.0) for end in ends]


@pytest.mark.parametrize(
    ("events", "touches"),
    [
        ([touched("pool 1")], [("pool 1", False)]),
        ([GOTO, touched("pool 1"), touched("fire 2")], [("pool 1", True), ("fire 2", False)]),
        ([GOTO, given_up("stopped", None), touched("pool 1")], [("pool 1", True)]),  # it still rolls
    ],
)
def test_touches_of_a_timeline(events: list[MatchEvent], touches: list[tuple[str, bool]]) -> None:
    assert [(touch.thing, touch.forced) for touch in touches_in(events)] == touches


def ended(end: str) -> PlayedMatch:
    return PlayedMatch(1, [PlayedGoto(700, 1150, 225, end, 1.0)], summary=summary())


@pytest.mark.parametrize(
    ("match", "wrong"),
    [
        (ended("stopped: enemy ahead"), []),  # that is the game
        (ended("blocked"), []),  # as the touch that did it is counted
        (ended("not possible"), ["goto (700, 1150): not possible"]),
        (ended("replaced"), ["goto (700, 1150): replaced"]),
        (ended("lost"), ["goto (700, 1150): lost"]),
        (PlayedMatch(1, touches=[RobotTouch(2.5, "pool 1", True, False)]), ["touched pool 1 at 2.5 s"]),
        (PlayedMatch(1, touches=[RobotTouch(2.5, "fire 1", True, False)]), []),
        (PlayedMatch(1, moved=0.25, summary=summary()), ["moved 0.25 mm after it had stopped"]),
        (PlayedMatch(1, moved=9.0, touches=[RobotTouch(80.0, "enemy 1", False, True)]), []),  # it was pushed
        (PlayedMatch(1, summary=summary(reports=["dropped"])), ["gatekeeper: dropped"]),
        (PlayedMatch(1, failure="no answer"), ["no answer"]),
    ],
)
def test_problems_of_a_match(match: PlayedMatch, wrong: list[str]) -> None:
    assert match.wrong == wrong
    assert match.as_data()["wrong"] == wrong


def test_as_data_has_the_rows_with_their_names() -> None:
    match = PlayedMatch(
        1, [PlayedGoto(700, 1150, 225, "arrived", 1.0)], touches=[RobotTouch(2.5, "tree 1", True, False)]
    )
    data = match.as_data()
    assert data["gotos"][0]["x"] == 700
    assert data["touches"][0]["thing"] == "tree 1"
    assert (data["points"], data["stops"], data["tasks"], data["summary"]) == (0, 0, [], None)
