"""The tally: every goto is counted once, extremes have the first seed that shows them, and the bad seeds are named."""

from __future__ import annotations

import pytest

from eurobot_od.robot.match.played import PlayedGoto, PlayedMatch
from eurobot_od.robot.match.statistics import ALL_ARRIVED, FIGURES, EndingCount, Figure, Spread, endings, report, spread
from eurobot_od.robot.match.summary import Summary

ENDED = PlayedGoto("centre", "stopped: the match is over", 3.0)


def arrived(distance: float) -> PlayedGoto:
    return PlayedGoto("tree", "arrived", 2.0, distance, 1.0)


def match(seed: int, *drives: PlayedGoto, load: float = 0.005) -> PlayedMatch:
    return PlayedMatch(seed, list(drives), 0.0, Summary(93.3, 500_000, {"Goto XY": 1}, {}, load, [], []))


FINE = match(1, arrived(4.0), arrived(6.0), ENDED)
STOPPED = match(2, PlayedGoto("tree", "stopped: enemy ahead", 1.0), arrived(1.0), ENDED, load=0.006)
BLOCKED = match(3, arrived(9.0), PlayedGoto("tree", "blocked", 1.0))
FAILED = PlayedMatch(4, [], failure="no answer")
DISTANCE = next(figure for figure in FIGURES if figure.name.startswith("distance"))


@pytest.mark.parametrize(
    ("matches", "rows"),
    [
        ([FINE], {ALL_ARRIVED: (1, 3), "arrived": (1, 2), "stopped: the match is over": (1, 1)}),
        ([FINE, STOPPED], {ALL_ARRIVED: (1, 3), "arrived": (2, 3), "stopped: enemy ahead": (1, 1)}),
        ([BLOCKED], {ALL_ARRIVED: (0, 0), "arrived": (1, 1), "blocked": (1, 1), "not possible": (0, 0)}),
        ([FAILED], {ALL_ARRIVED: (0, 0), "arrived": (0, 0)}),
    ],
)
def test_endings(matches: list[PlayedMatch], rows: dict[str, tuple[int, int]]) -> None:
    counted = {name: (in_matches, gotos) for name, in_matches, gotos in endings(matches)}
    assert counted.items() >= rows.items()


def test_what_is_wrong_is_a_row_even_if_it_never_was() -> None:
    names = ["not possible", "blocked", "replaced"]
    assert endings([FINE])[2:5] == [EndingCount(name, 0, 0) for name in names]


@pytest.mark.parametrize(
    ("matches", "expected"),
    [
        ([FINE, STOPPED, BLOCKED], Spread(1.0, 2, 5.0, 9.0, 3)),
        ([match(8, arrived(5.0)), match(9, arrived(5.0))], Spread(5.0, 8, 5.0, 5.0, 8)),  # the first seed of equals
        ([FAILED], None),
        ([FAILED, FINE], Spread(4.0, 1, 5.0, 6.0, 1)),
    ],
)
def test_spread_of_the_distances(matches: list[PlayedMatch], expected: Spread | None) -> None:
    assert spread(DISTANCE, matches) == expected


@pytest.mark.parametrize("figure", FIGURES, ids=lambda figure: figure.name)
def test_a_match_that_failed_has_no_figures(figure: Figure) -> None:
    assert spread(figure, [FAILED]) is None
    assert spread(figure, [FINE]) is not None


def test_the_report_ends_with_the_seeds_that_went_wrong() -> None:
    assert list(report([FINE, BLOCKED, FAILED]))[-3:] == [
        "seed 3: goto tree: blocked",
        "seed 4: no answer",
        "3 matches, seeds 1 to 4: something went wrong in 2",
    ]
    assert list(report([FINE, STOPPED]))[-1] == "2 matches, seeds 1 to 2: nothing went wrong"


def test_columns_stand_below_each_other() -> None:
    lines = list(report([FINE, STOPPED]))
    first, second = lines[: lines.index("")], lines[lines.index("") + 1 : -2]
    assert {len(line) for line in first} == {48}
    assert {len(line) for line in second} == {63}
