"""The shipped robot's facts: names and numbers of barriers, places on the field, what changes with the team."""

from __future__ import annotations

import math

import pytest

from eurobot_od.errors import UnknownName
from eurobot_od.robot import dialects
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.facts import RobotShape, Wheels
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.values import Barriers, Passage, TeamColour

FACTS = robot_file.read()


def test_the_2014_robot_is_as_its_eds_files_say() -> None:
    defaults = {"drive": ("Body.Robot radius", FACTS.body.radius), "core": ("Match.Match duration", FACTS.duration)}
    for name in dialects.names():
        for node, (setting, fact) in defaults.items():
            dictionary = dialects.load(node, name)
            assert dictionary.default(dictionary.address(setting)) == fact


def test_barriers_have_the_numbers_and_names_of_the_flags() -> None:
    names = [*(f"fire {number}" for number in range(1, 7)), "pool 1", "pool 2"]
    assert [(each.number, each.name) for each in FACTS.barriers] == [*enumerate(names, 1)]


def test_barriers_have_the_sizes_of_the_document() -> None:
    radii = {each.kind.name: each.kind.radius for each in FACTS.barriers}
    assert radii == {"fire": pytest.approx(140 / math.sqrt(3)), "pool": 150}


@pytest.mark.parametrize(("text", "number"), [("fire 1", 1), ("Fire-6", 6), (" pool_1 ", 7), ("POOL 2", 8)])
def test_barrier_is_found_by_its_name(text: str, number: int) -> None:
    assert FACTS.barrier(text).number == number


@pytest.mark.parametrize("text", ["fire 7", "pool 0", "fire", "1", "", "fire  1"])
def test_unknown_barrier_is_told(text: str) -> None:
    with pytest.raises(UnknownName, match="unknown barrier"):
        FACTS.barrier(text)


def test_flags_are_written_by_names() -> None:
    barriers = Barriers.of({2: Passage.FORCED, 7: Passage.NORMAL, 1: Passage.FREE})
    assert FACTS.words(barriers) == "fire 2:forced, pool 1:normal"
    assert FACTS.words(Barriers(0)) == "none"


def test_barriers_are_mirrored_left_to_right() -> None:
    places = {(barrier.kind, barrier.x, barrier.y) for barrier in FACTS.barriers}
    assert {(kind, FACTS.field.width - x, y) for kind, x, y in places} == places


def test_red_starts_upper_left_and_yellow_upper_right_looking_at_each_other() -> None:
    red, yellow = FACTS.start(TeamColour.RED), FACTS.start(TeamColour.YELLOW)
    assert red.x < FACTS.field.width / 4
    assert red.y > FACTS.field.height * 3 / 4
    assert (yellow.x, yellow.y) == (FACTS.field.width - red.x, red.y)
    assert (red.bearing(yellow.point), yellow.bearing(red.point)) == (red.angle, yellow.angle)


def test_a_start_place_is_in_its_zone() -> None:
    for (left, lower, right, upper), pose in FACTS.field.starts.values():
        assert left < pose.x < right
        assert lower < pose.y < upper


def test_wheels_stand_left_and_right() -> None:
    body = RobotShape(150.0, wheels=Wheels(180, 70))
    (back, front), right = body.tracks(Pose(1000, 500, 0))
    assert (back, front) == ((965, 590), (1035, 590))
    assert right == ((965, 410), (1035, 410))


def test_an_outline_turns_with_the_robot() -> None:
    body = RobotShape(150.0, (Point(100, 50), Point(-100, 0), Point(100, -50)))
    assert body.corners(Pose(1000, 500, 90)) == [
        pytest.approx(Point(950, 600)),
        pytest.approx(Point(1000, 400)),
        pytest.approx(Point(1050, 600)),
    ]
