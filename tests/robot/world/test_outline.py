"""A robot with an outline: it touches by its true shape, and not by the circle around it."""

from __future__ import annotations

import math

import pytest

from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.values import OURS
from eurobot_od.robot.world.bodies import Body, Contact, Weight, contains, nearest_on
from tests.robot.world.places import Place

SQUARE = [Point(0, 0), Point(100, 0), Point(100, 100), Point(0, 100)]

LONG = (("body.radius", "180"), ("body.outline", "[[150, 80], [-150, 80], [-150, -80], [150, -80]]"))
"""A robot of 300 x 160 mm."""

NEAREST = [
    (Point(150, 50), Point(100, 50), False),
    (Point(150, 150), Point(100, 100), False),  # beyond a corner
    (Point(50, 90), Point(50, 100), True),
    (Point(-30, 20), Point(0, 20), False),
]


@pytest.mark.parametrize(("point", "nearest", "inside"), NEAREST)
def test_nearest_point_of_an_outline_and_its_distance(point: Point, nearest: Point, inside: bool) -> None:
    assert nearest_on(SQUARE, point) == nearest
    assert contains(SQUARE, point) is inside
    apart = math.dist(point, nearest)
    assert Contact.of(SQUARE, point, 10.0).gap == pytest.approx((-apart if inside else apart) - 10.0)


def place(settings: tuple[tuple[str, str], ...] = LONG) -> Place:
    return Place(settings=settings)


def test_an_outline_passes_where_its_circle_would_not() -> None:
    long, turned = place(), place()
    for each, angle in ((long, 0.0), (turned, 90.0)):
        each.put(900, 900 + 150 + 100, angle)  # beside pool 1: 100 mm from its edge to our centre
        each.drive(1, 0.01)
    assert (OURS, "pool 1") not in long.touched(), "80 mm to the side"
    assert (OURS, "pool 1") in turned.touched(), "150 mm ahead"


def test_the_front_of_an_outline_stops_at_a_pool() -> None:
    here = place()
    here.put(1300, 900, 180)
    here.drive(400, 2.0)
    assert here.here.x == pytest.approx(900 + 150 + 150, abs=0.5)
    assert here.touched() == [(OURS, "pool 1")]


@pytest.mark.parametrize(("angle", "reach"), [(270.0, 150), (0.0, 80)])
def test_the_border_stops_the_corners_of_an_outline(angle: float, reach: float) -> None:
    here = place()
    body = here.world.robots[OURS]
    assert body.inside(Pose(1500, 20, angle), here.world.facts.field) == pytest.approx((1500, reach))


def test_the_front_of_an_outline_pushes_a_fire() -> None:
    here = place()
    here.put(600, 1400, 0)
    here.drive(400, 1.0)
    fire = here.world.things[0]
    assert fire.point.x == pytest.approx(1000 + 150 + fire.radius)


def test_another_robot_touches_the_outline() -> None:
    here = Place(enemies=1, settings=LONG)
    ours, enemy = here.world.robots[OURS], here.world.robots["enemy 1"]
    ours.place(Pose(1500, 1000, 0))
    assert enemy.gap(Pose(1500, 1300, 0), ours) == pytest.approx(300 - 80 - enemy.radius)
    assert enemy.out_of(Pose(1500, 1200, 0), ours) == pytest.approx((1500, 1000 + 80 + enemy.radius))


def test_the_gap_to_a_round_robot() -> None:
    thing = Body("thing", Point(1100, 1000), 30, Weight.FIXED)
    round_one = Place().world.robots[OURS]
    assert round_one.gap(Pose(1000, 1000, 0), thing) == pytest.approx(100 - 140 - 30)
