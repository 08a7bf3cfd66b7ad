"""A match as values: how its gotos ended and why, what is called wrong; EDS files read once serve every match."""

from __future__ import annotations

import pytest

from eurobot_od.robot.match import EventKind, MatchEvent, MatchOptions
from eurobot_od.robot.match.played import PlayedGoto, PlayedMatch, gotos_in, play
from eurobot_od.robot.match.stage import EdsFiles, play_simulated
from eurobot_od.robot.match.summary import Summary

SCRIPT = EdsFiles.read(None)
SHORT = MatchOptions(duration=8.0)
GOTO = MatchEvent(0.0, EventKind.GOTO, "", {"goto": {"name": "tree"}})


def given_up(outcome: str, why: str | None) -> MatchEvent:
    return MatchEvent(1.0, EventKind.GIVEN_UP, "", {"outcome": outcome, "why": why, "seconds": 1.0})


def summary(*reports: str) -> Summary:
    return Summary(10.0, 500_000, {}, {}, 0.0, [], list(reports))


def test_a_match_from_files_read_before_is_the_match_from_files_read_for_it() -> None:
    play(MatchOptions(seed=2, duration=8.0), SCRIPT)
    assert play(SHORT, SCRIPT).summary == play_simulated(SHORT, lambda _: None, lambda _time, _frame: None)[0]


def test_gotos_say_how_they_ended_and_how_near_the_robot_came() -> None:
    match = play(SHORT, SCRIPT)
    assert [drive.end for drive in match.gotos] == ["stopped: object ahead", "arrived", "stopped: the match is over"]
    assert [drive.task for drive in match.gotos] == ["tree", "fire 1", "fresco"]
    (arrival,) = match.arrivals
    assert arrival.seconds == pytest.approx(3.4, abs=0.2)
    assert 0 < (arrival.distance or 0) < 30
    assert match.wrong == []


def test_a_goto_that_the_mushroom_ended_says_so() -> None:
    match = play(MatchOptions(duration=8.0, emergency_at=5.5), SCRIPT)
    assert match.gotos[-1].end == "stopped: the mushroom was hit"


@pytest.mark.parametrize(
    ("events", "ends"),
    [
        ([], []),
        ([GOTO], []),  # no end was told
        ([GOTO, given_up("not possible", None)], ["not possible"]),
        ([GOTO, given_up("blocked", None), GOTO], ["blocked"]),
        ([GOTO, given_up("stopped", "enemy ahead")], ["stopped: enemy ahead"]),
    ],
)
def test_drives_of_a_timeline(events: list[MatchEvent], ends: list[str]) -> None:
    assert [drive.end for drive in gotos_in(events)] == ends


@pytest.mark.parametrize(
    ("match", "wrong"),
    [
        (PlayedMatch(1, [PlayedGoto("tree", "stopped: enemy ahead", 1.0)], 0.0, summary()), []),  # that is the game
        (PlayedMatch(1, [PlayedGoto("tree", "not possible", 1.0)], 0.0, summary()), ["goto tree: not possible"]),
        (PlayedMatch(1, [PlayedGoto("tree", "blocked", 1.0)], 0.0, summary()), ["goto tree: blocked"]),
        (PlayedMatch(1, [PlayedGoto("tree", "replaced", 1.0)], 0.0, summary()), ["goto tree: replaced"]),
        (PlayedMatch(1, [], 0.25, summary()), ["moved 0.25 mm after it had stopped"]),
        (PlayedMatch(1, [], 0.0, summary("dropped")), ["gatekeeper: dropped"]),
        (PlayedMatch(1, [], failure="no answer"), ["no answer"]),
    ],
)
def test_what_is_wrong(match: PlayedMatch, wrong: list[str]) -> None:
    assert match.wrong == wrong
    assert match.as_data()["wrong"] == wrong
