"""The tally: gotos and touches are counted once, extremes have the first seed that shows them, bad seeds are named."""

from __future__ import annotations

from dataclasses import replace

import pytest

from eurobot_od.robot.match.played import PlayedGoto, PlayedMatch, PlayedTask
from eurobot_od.robot.match.statistics import (
    ASCII,
    FIGURES,
    FORCED,
    MOST_LISTED,
    EndingCount,
    Figure,
    Spread,
    TouchCount,
    endings,
    report,
    spread,
    touch_counts,
)
from eurobot_od.robot.match.summary import RobotTouch, Summary
from tests.rows import rows


def goto(end: str, *figures: float) -> PlayedGoto:
    return PlayedGoto(700, 1150, 225, end, 2.0, *figures)


ENDED = goto("stopped: the match is over")


def arrived(distance: float) -> PlayedGoto:
    return goto("arrived", distance, distance / 2)


def match(seed: int, *gotos: PlayedGoto, points: int = 10, touches: tuple[RobotTouch, ...] = ()) -> PlayedMatch:
    summary = Summary(93.3, 500_000, {"Goto XY": 1}, {}, 0.005, points={"ours": points})
    return PlayedMatch(seed, list(gotos), touches=list(touches), summary=summary)


POOL, FIRE = RobotTouch(1.0, "pool 1", True, False), RobotTouch(1.0, "fire 1", True, False)
FINE = match(1, arrived(4.0), arrived(6.0), ENDED, points=20)
STOPPED = match(2, goto("stopped: enemy ahead"), arrived(1.0), ENDED, touches=(FIRE,))
LOST = match(3, arrived(9.0), goto("lost"), points=4, touches=(POOL, FIRE))
FAILED = PlayedMatch(4, failure="no answer")
DISTANCE = next(figure for figure in FIGURES if figure.name.startswith("distance"))
POINTS = FIGURES[0]


@pytest.mark.parametrize(
    ("matches", "rows"),
    [
        ([FINE], {"arrived": (1, 2), "stopped: the match is over": (1, 1)}),
        ([FINE, STOPPED], {"arrived": (2, 3), "stopped: enemy ahead": (1, 1)}),
        ([LOST], {"arrived": (1, 1), "lost": (1, 1), "not possible": (0, 0)}),
        ([FAILED], {"arrived": (0, 0)}),
    ],
)
def test_endings(matches: list[PlayedMatch], rows: dict[str, tuple[int, int]]) -> None:
    counted = {name: (in_matches, gotos) for name, in_matches, gotos in endings(matches)}
    assert counted.items() >= rows.items()


def test_what_is_wrong_is_a_row_even_if_it_never_was() -> None:
    names = ["not possible", "replaced", "lost"]
    assert endings([FINE])[1:4] == [EndingCount(name, 0, 0) for name in names]


def test_touches_are_counted_by_what_and_by_whose_fault() -> None:
    forced, rammed = POOL._replace(forced=True), RobotTouch(3.0, "enemy 1", False, True)
    counted = touch_counts([FINE, match(5, touches=(POOL, forced)), match(6, touches=(POOL, POOL, rammed))])
    assert [each for each in counted if each.touches] == [
        TouchCount(FORCED, 1, 1, 1, 0),
        TouchCount("pool", 2, 3, 3, 0),
        TouchCount("robot", 1, 1, 0, 1),
    ]


@pytest.mark.parametrize(
    ("figure", "matches", "expected"),
    [
        (DISTANCE, [FINE, STOPPED, LOST], Spread(5.0, 1.0, 2, 3.25, 5.0, 6.75, 9.0, 3)),
        (POINTS, [FINE, STOPPED, LOST], Spread(34 / 3, 4, 3, 7, 10, 15, 20, 1)),
        (DISTANCE, [match(8, arrived(5.0)), match(9, arrived(5.0))], Spread(5, 5, 8, 5, 5, 5, 5, 8)),  # the first seed
        (POINTS, [LOST], Spread(4, 4, 3, 4, 4, 4, 4, 3)),
        (DISTANCE, [FAILED], None),
        (DISTANCE, [FAILED, FINE], Spread(5.0, 4.0, 1, 4.5, 5.0, 5.5, 6.0, 1)),
    ],
)
def test_spread(figure: Figure, matches: list[PlayedMatch], expected: Spread | None) -> None:
    assert spread(figure, matches) == expected


@rows("figure", FIGURES)
def test_a_match_that_failed_has_no_figures(figure: Figure) -> None:
    assert spread(figure, [FAILED]) is None
    assert spread(figure, [FINE]) is not None


def test_a_task_that_came_to_nothing_is_not_done() -> None:
    (tasks_done,) = (figure for figure in FIGURES if figure.name == "tasks done")
    played = replace(
        FINE, tasks=[PlayedTask(2.0, "fire 1", 0), PlayedTask(4.0, "fire 2", 1), PlayedTask(9.0, "net", 6)]
    )
    assert list(tasks_done.of(played)) == [2]


def test_the_position_error_is_that_of_all_arrivals() -> None:
    errors = [2.0, 3.0, 0.5, 4.5]
    assert sum(errors) / 4 == 2.5
    rms = (sum(error**2 for error in errors) / 4) ** 0.5
    line = f"position error at 4 arrivals: mean 2.5 mm, RMS {rms:.1f} mm, 95 % up to 4.5 mm"
    assert line in list(report([FINE, STOPPED, LOST]))


def test_the_histogram_has_a_line_for_each_step_of_points() -> None:
    lines = list(report([FINE, STOPPED, match(7)], ASCII))
    begin = lines.index("matches by points")
    assert [lines[begin + 1].split()[0], lines[begin + 1].split()[-1], lines[begin + 11].split()[-1]] == [
        "10",
        "2",
        "1",
    ]


def test_the_report_ends_with_the_seeds_to_look_at() -> None:
    assert list(report([FINE, STOPPED, LOST, FAILED]))[-4:] == [
        "seed 3: goto (700, 1150): lost, and 1 more",
        "seed 4: no answer",
        "fewest points: seed 3 with 4, seed 2 with 10, seed 1 with 20",
        "4 matches, seeds 1 to 4: something went wrong in 2",
    ]
    assert list(report([FINE, STOPPED]))[-1] == "2 matches, seeds 1 to 2: nothing went wrong"
    assert list(report([FAILED]))[-2:] == ["seed 4: no answer", "1 match, seeds 4 to 4: something went wrong in 1"]


def test_the_report_counts_touches_by_what_was_touched() -> None:
    lines = [line.split() for line in report([STOPPED, LOST])]
    heading = lines.index(["touched", "matches", "touches", "our", "fault", "driven", "into"])
    assert lines[heading + 1 : lines.index([], heading)] == [
        [*each.name.split(), *(str(number) for number in each[1:])] for each in touch_counts([STOPPED, LOST])
    ]


def test_of_very_many_seeds_the_first_are_listed() -> None:
    lines = list(report([match(seed, goto("lost")) for seed in range(1, MOST_LISTED + 8)]))
    assert sum(line.startswith("seed ") for line in lines) == MOST_LISTED
    assert "and 7 more seeds" in lines


def test_columns_stand_below_each_other() -> None:
    lines = list(report([FINE, STOPPED]))
    first = lines.index("")
    second = lines.index("", first + 1)
    tables = lines[:first], lines[first + 1 : second], lines[second + 1 : second + 2 + len(FIGURES)]
    assert [{len(line) for line in table} for table in tables] == [{48}, {63}, {90}]
