"""The other robots: their rounds, on the field for either team."""

from __future__ import annotations

import random

import pytest

from eurobot_od.robot.field import HEIGHT, WIDTH, Point, Pose
from eurobot_od.robot.values import Source, TeamColour
from eurobot_od.robot.world.patrols import ROUNDS, Patrol


def test_a_patrol_goes_round_at_its_speed() -> None:
    patrol = Patrol((Point(0, 0), Point(300, 0), Point(300, 400)), speed=100)
    assert patrol.at(0.0) == Pose(0, 0, 0)
    assert patrol.at(1.5) == Pose(150, 0, 0)
    assert patrol.at(5.0) == pytest.approx((300, 200, 90))
    assert patrol.at(12.0) == patrol.at(24.0) == patrol.at(0.0)


@pytest.mark.parametrize("source", list(ROUNDS))
def test_the_others_stay_on_the_field_for_either_team(source: Source) -> None:
    for team in TeamColour:
        patrol = Patrol.of(source, team, random.Random(1))
        places = [patrol.at(second) for second in range(90)]
        assert all(0 <= place.x <= WIDTH and 0 <= place.y <= HEIGHT for place in places)


def test_yellow_plays_against_the_mirror_image() -> None:
    teams = (TeamColour.RED, TeamColour.YELLOW)
    red, yellow = (Patrol.of(Source.ENEMY_1, team, random.Random(1)).points for team in teams)
    assert [WIDTH - point.x for point in red] == pytest.approx([point.x for point in yellow])
    assert [point.y for point in red] == [point.y for point in yellow]
