"""The game: what can be done where, the same for both teams, and where nothing stands in the way."""

from __future__ import annotations

import math

import pytest

from eurobot_od.robot.field import HEIGHT, WIDTH
from eurobot_od.robot.tasks import MIRRORED, RED_TASKS, Task, Worth, tasks
from eurobot_od.robot.values import TeamColour
from eurobot_od.robot.world.bodies import ROBOT_RADIUS, gap, inside, things


@pytest.mark.parametrize("task", RED_TASKS, ids=lambda task: task.name)
def test_a_mirror_image_of_a_mirror_image_is_the_task(task: Task) -> None:
    assert task.seen_by(TeamColour.YELLOW).seen_by(TeamColour.YELLOW) == task._replace(angle=task.angle % 360)


def test_yellow_has_the_mirror_image_and_what_stands_there_keeps_its_name() -> None:
    red, yellow = tasks(TeamColour.RED), tasks(TeamColour.YELLOW)
    assert red.keys() == yellow.keys()
    for name, task in red.items():
        other = yellow[MIRRORED.get(name, name)]
        assert (other.x, other.y, other.angle) == (WIDTH - task.x, task.y, (180 - task.angle) % 360)


@pytest.mark.parametrize("name", [name for name, task in tasks(TeamColour.RED).items() if task.shared])
def test_what_is_shared_stands_at_one_place_for_both_teams(name: str) -> None:
    def thing(team: TeamColour) -> tuple[float, float]:
        task = tasks(team)[name]
        ahead = task.pose.moved(200, 0)
        return ahead.x, ahead.y

    # Fires are turned over from either side; what stands at the border has one side.
    apart = math.dist(thing(TeamColour.RED), thing(TeamColour.YELLOW))
    assert apart < (200 if name.startswith("fire") else 20)


@pytest.mark.parametrize("team", TeamColour)
@pytest.mark.parametrize("name", tasks(TeamColour.RED))
def test_a_robot_has_room_where_a_task_is_done(team: TeamColour, name: str) -> None:
    point = tasks(team)[name].pose.point
    assert inside(point, ROBOT_RADIUS) == point
    assert [each.name for each in things() if gap(point, ROBOT_RADIUS, each) < 0] == []
    assert 0 < point.y < HEIGHT


@pytest.mark.parametrize(
    ("name", "expected"),
    [("mammoth", 6 * 0.6 * 2), ("fire 1", 0.9), ("tree 1", 3 * 0.8), ("basket", 1.0)],
)
def test_what_a_task_brings_on_average(name: str, expected: float) -> None:
    assert tasks(TeamColour.RED)[name].expected == pytest.approx(expected)


def test_fruit_counts_in_the_basket_only() -> None:
    worths = {name.partition(" ")[0]: task.worth for name, task in tasks(TeamColour.RED).items()}
    assert (worths["tree"], worths["basket"], worths["mammoth"]) == (Worth.FRUIT, Worth.HARVEST, Worth.POINTS)
