"""The drive's pose estimate: dead reckoning, blending, outliers."""

from __future__ import annotations

import pytest

from eurobot_od.robot.field import Pose
from eurobot_od.robot.nodes.estimate import OUTLIERS_REFUSED, Estimate
from eurobot_od.robot.nodes.motion import Odometry

START = Pose(1000.0, 500.0, 350.0)

BLENDS = [
    (0.0, (1100.0, 600.0, 10.0), START),  # no weight, no change
    (1.0, (1100.0, 600.0, 10.0), Pose(1100.0, 600.0, 10.0)),  # all weight, taken whole
    (0.5, (1100.0, 600.0, 10.0), Pose(1050.0, 550.0, 0.0)),  # half way, the heading through zero
    (0.5, (1100.0, 600.0, None), Pose(1050.0, 550.0, 350.0)),  # no heading, heading kept
    (0.25, (1000.0, 500.0, 310.0), Pose(1000.0, 500.0, 340.0)),  # the other way round
]


@pytest.mark.parametrize(("weight", "position", "expected"), BLENDS)
def test_blend(weight: float, position: tuple[float, float, float | None], expected: Pose) -> None:
    estimate = Estimate(START)
    assert estimate.corrected(*position, weight=weight, outlier=300.0)
    assert estimate.pose == pytest.approx(expected)


def test_nothing_is_known_at_first() -> None:
    estimate = Estimate()
    estimate.moved(Odometry(100.0, 10.0))
    assert estimate.pose is None


def test_the_first_position_is_taken_whole() -> None:
    estimate = Estimate()
    assert estimate.corrected(700.0, 300.0, 370.0, weight=0.3, outlier=300.0)
    assert estimate.pose is not None
    assert estimate.pose == Pose(700.0, 300.0, 10.0)


def test_a_first_position_without_heading_is_refused() -> None:
    estimate = Estimate()
    assert not estimate.corrected(700.0, 300.0, None, weight=0.3, outlier=300.0)
    assert estimate.pose is None


def test_dead_reckoning_follows_the_wheels() -> None:
    estimate = Estimate(Pose(0.0, 0.0, 90.0))
    for _ in range(90):
        estimate.moved(Odometry(1.0, -1.0))
    assert estimate.pose == pytest.approx(Pose(0.0, 0.0, 90.0).moved(90.0, -90.0))


def test_a_position_at_the_outlier_distance_is_still_believed() -> None:
    assert Estimate(START).corrected(1300.0, 500.0, None, weight=0.3, outlier=300.0)


def test_outliers_are_refused_until_there_are_too_many() -> None:
    estimate = Estimate(START)
    answers = [estimate.corrected(2000.0, 500.0, 90.0, weight=0.3, outlier=300.0) for _ in range(OUTLIERS_REFUSED + 1)]
    assert answers == [False] * OUTLIERS_REFUSED + [True]
    assert estimate.pose == Pose(2000.0, 500.0, 90.0)


def test_a_good_position_ends_the_count_of_outliers_and_is_only_blended() -> None:
    estimate = Estimate(START)
    for _ in range(OUTLIERS_REFUSED):
        estimate.corrected(2000.0, 500.0, 90.0, weight=0.3, outlier=300.0)
    assert estimate.corrected(1100.0, 500.0, None, weight=0.5, outlier=300.0)
    assert estimate.pose == pytest.approx(Pose(1050.0, 500.0, 350.0))
    assert not estimate.corrected(2000.0, 500.0, 90.0, weight=0.3, outlier=300.0)
