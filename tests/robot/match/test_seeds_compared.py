"""Strategies side by side: means, intervals, differences at the same seeds, and the seed to be drawn."""

from __future__ import annotations

from dataclasses import replace

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.robot.match.seeds import PlayedMatch, compared, farthest_apart, interval, touch_counts
from eurobot_od.robot.match.summary import RobotTouch, Summary
from eurobot_od.robot.model.values import OURS


def matches(*points: int) -> list[PlayedMatch]:
    """Return matches of the seeds from 1 on, with so many points."""
    summaries = [Summary(90.0, 500_000, {}, {}, 0.0, points={OURS: each}) for each in points]
    return [PlayedMatch(seed, summary=summary, driven=10.0) for seed, summary in enumerate(summaries, 1)]


PLAYED = {"slow": matches(5, 10, 15, 20), "quick": matches(8, 13, 18, 24), "same": matches(6, 9, 16, 19)}


@pytest.mark.parametrize(
    ("values", "expected"), [([7], (7.0, 0.0)), ([4, 4], (4.0, 0.0)), ([1, 3], (2.0, 1.96)), ([0, 2, 4], (2.0, 2.263))]
)
def test_a_mean_and_its_interval(values: list[float], expected: tuple[float, float]) -> None:
    assert interval(values) == pytest.approx(expected, abs=0.001)


def test_a_line_for_each_seed_and_the_differences_at_the_same_seeds() -> None:
    lines = [*compared(PLAYED)]
    assert lines[0].split() == ["points", "touches", "our", "fault", "driven,", "m"]
    assert lines[2].split()[:4] == ["1", "5", "8", "6"]
    assert {each.partition(".")[2] for each in lines[2].split()[-3:]} == {"00"}  # the metres have as many digits each
    assert "quick against slow: points +3.25 ± 0.49; more at 4 seeds, fewer at 0" in lines
    assert "same against slow: points +0.00 ± 1.13, which may be chance; more at 2 seeds, fewer at 2" in lines
    assert "same against slow: touches +0.00 ± 0.00, the same at each seed; more at 0 seeds, fewer at 0" in lines


def test_our_fault_is_what_a_single_match_and_a_table_of_seeds_call_so() -> None:
    touches = [RobotTouch(1.0, "fire 1", at_fault=True, driven_into=False), RobotTouch(2.0, "enemy 1", True, True)]
    after = [replace(each, touches=touches) for each in matches(5, 10)]
    lines = [*compared({"one": matches(5, 10), "other": after})]
    assert "other against one: our fault +2.00 ± 0.00; more at 2 seeds, fewer at 0" in lines
    assert sum(at_fault for _, _, _, at_fault, _ in touch_counts(after)) == 4


def test_the_seed_to_be_drawn_is_the_first_of_those_whose_points_differ_most() -> None:
    assert farthest_apart(PLAYED) == 4
    assert farthest_apart({"one": matches(1, 2, 5), "other": matches(4, 2, 8)}) == 1


def test_a_seed_that_was_not_played_to_its_end_is_not_drawn() -> None:
    one = [PlayedMatch(1, failure="no answer"), *matches(0, 3)[1:]]
    assert farthest_apart({"one": one, "other": matches(50, 3)}) == 2
    with pytest.raises(LocalError, match="no seed was played to its end with each strategy"):
        farthest_apart({"one": one[:1], "other": matches(50)})
