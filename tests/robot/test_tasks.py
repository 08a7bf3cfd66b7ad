"""The game's tasks: every place is one where a robot has room, for either team, and yellow's is the mirror image."""

from __future__ import annotations

import math

import pytest

from eurobot_od.robot.field import WIDTH
from eurobot_od.robot.tasks import RED_TASKS, tasks
from eurobot_od.robot.values import TeamColour
from eurobot_od.robot.world.bodies import ROBOT_RADIUS, gap, inside, things

MARGIN = 20.0
"""What a robot that does not know its place exactly has to spare, mm."""


@pytest.mark.parametrize("team", TeamColour)
def test_a_robot_has_room_at_every_place(team: TeamColour) -> None:
    for task in tasks(team).values():
        point = task.pose.point
        assert inside(point, ROBOT_RADIUS + MARGIN) == point, task.name
        near = {each.name: gap(point, ROBOT_RADIUS, each) for each in things()}
        assert min(near.values()) >= MARGIN, (task.name, near)


@pytest.mark.parametrize("team", TeamColour)
def test_a_fire_or_tree_is_where_its_task_looks(team: TeamColour) -> None:
    standing = {each.name: each for each in things()}
    for name in sorted(standing.keys() & tasks(team).keys()):
        task, thing = tasks(team)[name], standing[name]
        assert math.dist(task.pose.point, thing.point) < ROBOT_RADIUS + thing.radius + 60, name
        assert abs(task.pose.bearing(thing.point) - task.angle) < 3, name


def test_yellow_plays_the_mirror_image() -> None:
    red, yellow = tasks(TeamColour.RED), tasks(TeamColour.YELLOW)
    assert red.keys() == yellow.keys()
    mirrored = {(round(WIDTH - task.x), task.y, (180 - task.angle) % 360) for task in red.values()}
    assert {(task.x, task.y, task.angle) for task in yellow.values()} == mirrored
    assert (yellow["fire 2"].x, yellow["fire 1"].x) == (WIDTH - red["fire 1"].x, WIDTH - red["fire 2"].x)


def test_what_is_shared_stands_in_the_same_place_for_both() -> None:
    red, yellow = tasks(TeamColour.RED), tasks(TeamColour.YELLOW)
    for task in RED_TASKS:
        if task.shared:
            assert math.dist(red[task.name].pose.point, yellow[task.name].pose.point) < 600, task.name
