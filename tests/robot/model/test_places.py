"""Angles, headings and ways: what counts as an angle, where an arc leads."""

from __future__ import annotations

import math

import pytest

from eurobot_od.robot.model.places import Point, Pose, normalise, turn

ANGLES = [
    (0.0, 0.0),
    (359.5, 359.5),
    (360.0, 0.0),
    (-90.0, 270.0),
    (725.0, 5.0),
    (-1e-17, 0.0),  # rounds up to a full circle, which is not an angle below 360
]

TURNS = [
    (0.0, 90.0, 90.0),
    (90.0, 0.0, -90.0),
    (350.0, 10.0, 20.0),  # through zero, left
    (10.0, 350.0, -20.0),  # through zero, right
    (0.0, 180.0, 180.0),  # half a circle is always to the left
    (180.0, 0.0, 180.0),
    (45.0, 405.0, 0.0),  # the same angle, a circle later
]

BEARINGS = [
    (Point(200.0, 100.0), 0.0),
    (Point(100.0, 200.0), 90.0),
    (Point(0.0, 100.0), 180.0),
    (Point(100.0, 0.0), 270.0),
    (Point(0.0, 0.0), 225.0),
]

ARCS = [
    (0.0, 0.0, Pose(0.0, 0.0, 90.0)),
    (100.0, 0.0, Pose(0.0, 100.0, 90.0)),
    (-100.0, 0.0, Pose(0.0, -100.0, 90.0)),  # tail first
    (0.0, -100.0, Pose(0.0, 0.0, 350.0)),  # on the spot
    (50.0 * math.pi, 90.0, Pose(-100.0, 100.0, 180.0)),  # a quarter circle of radius 100 to the left
    (50.0 * math.pi, -90.0, Pose(100.0, 100.0, 0.0)),  # and to the right
    (200.0 * math.pi, 360.0, Pose(0.0, 0.0, 90.0)),  # once round
]


@pytest.mark.parametrize(("angle", "expected"), ANGLES)
def test_normalise(angle: float, expected: float) -> None:
    assert normalise(angle) == expected


@pytest.mark.parametrize(("start", "end", "expected"), TURNS)
def test_turn_is_the_shortest_way(start: float, end: float, expected: float) -> None:
    assert turn(start, end) == pytest.approx(expected)


@pytest.mark.parametrize(("point", "expected"), BEARINGS)
def test_bearing(point: Point, expected: float) -> None:
    assert Pose(100.0, 100.0, 33.0).bearing(point) == pytest.approx(expected)


def test_distance() -> None:
    assert Pose(100.0, 100.0, 33.0).distance(Point(400.0, 500.0)) == 500.0


@pytest.mark.parametrize(("distance", "turned", "expected"), ARCS)
def test_pose_moves_along_an_arc(distance: float, turned: float, expected: Pose) -> None:
    assert Pose(0.0, 0.0, 90.0).moved(distance, turned) == pytest.approx(expected)


def test_a_long_way_in_small_arcs_is_the_way_in_one() -> None:
    pose = Pose(1000.0, 500.0, 10.0)
    for _ in range(100):
        pose = pose.moved(3.0, 1.2)
    assert pose == pytest.approx(Pose(1000.0, 500.0, 10.0).moved(300.0, 120.0))
