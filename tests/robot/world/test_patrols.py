"""The other robots on their rounds: where they go, for either team, and what they do when they are held up."""

from __future__ import annotations

import random

import pytest

from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.values import Source, TeamColour
from eurobot_od.robot.world.bodies import inside
from eurobot_od.robot.world.world import PATROL_WAIT, Patrol

FACTS = robot_file.read()

TRIANGLE = (Point(100, 100), Point(400, 100), Point(400, 500))


def walk(patrol: Patrol, seconds: float) -> Pose:
    """Move a patrol without obstacles."""
    for _ in range(round(seconds / 0.01)):
        patrol.advance(patrol.pose.point, 0.01)
        patrol.gone_on()
    return patrol.pose


@pytest.mark.parametrize(
    ("seconds", "expected"),
    [(0.0, (100, 100, 0)), (1.5, (250, 100, 0)), (5.0, (400, 300, 90)), (11.9, (106, 108, None))],
)
def test_a_patrol_goes_round_at_its_speed(seconds: float, expected: tuple[float, float, float | None]) -> None:
    pose = walk(Patrol(TRIANGLE, speed=100), seconds)
    assert pose[:2] == pytest.approx(expected[:2], abs=4)
    assert expected[2] is None or pose.angle == pytest.approx(expected[2], abs=1)


def test_a_blocked_patrol_turns_round_after_a_while() -> None:
    patrol = Patrol(TRIANGLE, speed=100)
    walk(patrol, 4.0)
    here = patrol.pose.point
    assert patrol.held_up(here, PATROL_WAIT / 2).angle == pytest.approx(90, abs=1)
    assert walk(patrol, 0.1).angle == pytest.approx(90, abs=1)
    assert patrol.held_up(here, PATROL_WAIT).angle == pytest.approx(270, abs=1)  # it turns, and so sees another way
    assert walk(patrol, 0.1).angle == pytest.approx(270, abs=1)


@pytest.mark.long
@pytest.mark.parametrize("source", list(FACTS.others))
@pytest.mark.parametrize("team", TeamColour)
def test_patrols_stay_on_the_field_and_off_the_pools(source: Source, team: TeamColour) -> None:
    pools = [each for each in FACTS.barriers if each.kind.name == "pool"]
    for seed in range(20):
        patrol = Patrol.of(source, FACTS, team, random.Random(seed))
        for _ in range(90):
            point = walk(patrol, 1.0).point
            assert inside(point, 0, FACTS.field) == point
            reach = FACTS.body.radius
            assert all(patrol.pose.distance(each.point) > each.kind.radius + reach for each in pools)


def test_yellow_plays_against_the_mirror_image() -> None:
    red, yellow = (
        Patrol.of(Source.ENEMY_1, FACTS, team, random.Random(1)) for team in (TeamColour.RED, TeamColour.YELLOW)
    )
    assert FACTS.field.width - red.pose.x == pytest.approx(yellow.pose.x)
    assert red.pose.y == yellow.pose.y


def test_a_confederate_is_never_careless() -> None:
    patrols = [
        Patrol.of(source, FACTS, TeamColour.RED, random.Random(seed)) for source in FACTS.others for seed in range(100)
    ]
    careless = [patrol.careless for patrol in patrols]
    assert any(careless[:200])
    assert not any(careless[200:])
