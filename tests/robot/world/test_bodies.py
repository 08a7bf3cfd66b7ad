"""Solid bodies: gaps between them, and where one is that is pushed out of another, or held by the border."""

from __future__ import annotations

import math

import pytest

from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.world.bodies import Body, RobotBody, Weight, gap, inside, standing

FACTS = robot_file.read()

POOL = Body("pool", Point(1000, 1000), 150.0, Weight.FIXED)


@pytest.mark.parametrize(
    ("point", "radius", "expected", "why"),
    [
        (Point(1300, 1000), 100.0, 50.0, "apart"),
        (Point(1250, 1000), 100.0, 0.0, "edge to edge"),
        (Point(1200, 1000), 100.0, -50.0, "in each other"),
        (Point(1000, 1000), 100.0, -250.0, "centre on centre"),
    ],
)
def test_gap(point: Point, radius: float, expected: float, why: str) -> None:
    assert gap(point, radius, POOL) == pytest.approx(expected), why


@pytest.mark.parametrize("point", [Point(1200, 1000), Point(1000, 810), Point(900, 1100), Point(1000, 1000)])
def test_a_pushed_body_ends_in_contact(point: Point) -> None:
    out = RobotBody("ours", point, 100.0, Weight.ROBOT).out_of(Pose(*point, 0), POOL)
    assert gap(out, 100.0, POOL) == pytest.approx(0.0, abs=1e-9)
    if point != POOL.point:  # along the line of the centres
        before, after = (math.atan2(each.y - 1000, each.x - 1000) for each in (point, out))
        assert before == pytest.approx(after)


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        (Point(1500, 1000), Point(1500, 1000)),
        (Point(50, 1000), Point(140, 1000)),
        (Point(FACTS.field.width, 1000), Point(FACTS.field.width - 140, 1000)),
        (Point(1500, -30), Point(1500, 140)),
        (Point(0, FACTS.field.height), Point(140, FACTS.field.height - 140)),
    ],
)
def test_the_border_holds_a_robot_inside(point: Point, expected: Point) -> None:
    assert inside(point, 140.0, FACTS.field) == expected


def test_the_documents_barriers_stand_on_the_field_with_their_sizes() -> None:
    bodies = {each.name: each for each in standing(FACTS.barriers)}
    for barrier in FACTS.barriers:
        body = bodies[barrier.name]
        assert (body.point, body.radius) == (Point(barrier.x, barrier.y), barrier.kind.radius)
    assert {each.weight for name, each in bodies.items() if name.startswith("fire")} == {Weight.LIGHT}
    assert {each.weight for name, each in bodies.items() if not name.startswith("fire")} == {Weight.FIXED}


@pytest.mark.parametrize(
    ("angle", "speed", "expected", "why"),
    [
        (0.0, 200.0, 200.0, "straight at it"),
        (180.0, 200.0, -200.0, "straight away from it"),
        (180.0, -200.0, 200.0, "tail first at it"),
        (90.0, 200.0, 0.0, "past it"),
        (60.0, 200.0, 100.0, "at an angle"),
        (0.0, 0.0, 0.0, "at rest"),
    ],
)
def test_approach_speed_of_two_robots(angle: float, speed: float, expected: float, why: str) -> None:
    robot = RobotBody("ours", Point(0, 0), 140.0, Weight.ROBOT)
    robot.place(Pose(500, 1000, angle))
    robot.speed = speed
    assert robot.approach(POOL) == pytest.approx(expected, abs=1e-9), why
