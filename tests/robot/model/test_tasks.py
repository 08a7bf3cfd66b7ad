"""The game's tasks: every place is one where a robot has room, for either team, and yellow's is the mirror image."""

from __future__ import annotations

import math

import pytest

from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.world.bodies import gap, standing

FACTS = robot_file.read()

MARGIN = 20.0
"""What a robot that does not know its place exactly has to spare, mm."""


@pytest.mark.parametrize("team", TeamColour)
def test_a_robot_has_room_at_every_place(team: TeamColour) -> None:
    for task in FACTS.tasks(team).values():
        point = task.pose.point
        assert FACTS.field.contains(point, FACTS.body.radius + MARGIN), task.name
        near = {each.name: gap(point, FACTS.body.radius, each) for each in standing(FACTS.barriers)}
        assert min(near.values()) >= MARGIN, (task.name, near)


@pytest.mark.parametrize("team", TeamColour)
def test_a_fire_is_where_its_task_looks(team: TeamColour) -> None:
    bodies = {each.name: each for each in standing(FACTS.barriers)}
    for name in sorted(bodies.keys() & FACTS.tasks(team).keys()):
        task = FACTS.tasks(team)[name]
        thing = bodies[name]
        assert math.dist(task.pose.point, thing.point) < FACTS.body.radius + thing.radius + 60, name
        assert abs(task.pose.bearing(thing.point) - task.at.angle) < 3, name


def test_yellow_plays_the_mirror_image() -> None:
    red = FACTS.tasks(TeamColour.RED)
    yellow = FACTS.tasks(TeamColour.YELLOW)
    width = FACTS.field.width
    assert red.keys() == yellow.keys()
    mirrored = {(round(width - task.at.x), task.at.y, (180 - task.at.angle) % 360) for task in red.values()}
    assert {(task.at.x, task.at.y, task.at.angle) for task in yellow.values()} == mirrored
    assert (yellow["fire 2"].at.x, yellow["fire 1"].at.x) == (
        FACTS.field.width - red["fire 1"].at.x,
        FACTS.field.width - red["fire 2"].at.x,
    )


def test_shared_tasks_are_in_the_same_place_for_both_teams() -> None:
    red, yellow = FACTS.tasks(TeamColour.RED), FACTS.tasks(TeamColour.YELLOW)
    for task in FACTS.red_tasks.values():
        if task.shared:
            assert math.dist(red[task.name].pose.point, yellow[task.name].pose.point) < 600, task.name
