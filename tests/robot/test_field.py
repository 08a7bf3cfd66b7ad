"""The field's geometry and tables: what counts as an angle, a barrier, a start pose."""

from __future__ import annotations

import math

import pytest

from eurobot_od.robot.field import (
    BARRIERS,
    HEIGHT,
    RADII,
    START_POSES,
    WIDTH,
    BarrierKind,
    Point,
    Pose,
    normalise,
    turn,
)
from eurobot_od.robot.values import BARRIER_NAMES, TeamColour

ANGLES = [
    (0.0, 0.0),
    (359.5, 359.5),
    (360.0, 0.0),
    (-90.0, 270.0),
    (725.0, 5.0),
    (-1e-17, 0.0),  # rounds up to a full circle, which is no angle below 360
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


def test_barriers_have_the_numbers_and_names_of_the_flags() -> None:
    assert [barrier.number for barrier in BARRIERS] == list(range(1, 9))
    assert [barrier.name for barrier in BARRIERS] == list(BARRIER_NAMES)
    assert all(barrier.name.startswith(barrier.kind.value) for barrier in BARRIERS)


def test_barriers_are_mirrored_left_to_right() -> None:
    places = {(barrier.kind, barrier.x, barrier.y) for barrier in BARRIERS}
    assert {(kind, WIDTH - x, y) for kind, x, y in places} == places


def test_every_kind_of_barrier_has_its_size_and_stands_on_the_field() -> None:
    assert set(RADII) == set(BarrierKind)
    for barrier in BARRIERS:
        radius = RADII[barrier.kind]
        assert radius <= barrier.x <= WIDTH - radius
        assert radius <= barrier.y <= HEIGHT - radius


def test_red_starts_upper_left_and_yellow_upper_right_looking_at_each_other() -> None:
    red, yellow = START_POSES[TeamColour.RED], START_POSES[TeamColour.YELLOW]
    assert red.x < WIDTH / 4
    assert red.y > HEIGHT * 3 / 4
    assert (yellow.x, yellow.y) == (WIDTH - red.x, red.y)
    assert (red.bearing(yellow.point), yellow.bearing(red.point)) == (red.angle, yellow.angle)
