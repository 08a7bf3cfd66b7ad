"""The robot's tasks as either team sees them."""

from __future__ import annotations

import pytest

from eurobot_od.robot.field import BARRIERS, HEIGHT, WIDTH, Barrier, Point
from eurobot_od.robot.match.tasks import MIRRORED, TASKS, Task
from eurobot_od.robot.nodes.route import Clearances, find_route
from eurobot_od.robot.values import Barriers, Passage, TeamColour, barrier_number

TASK = Task("there", 700, 1150, 225, 60, {"fire 1": Passage.NORMAL, "pool 2": Passage.FORCED})


def test_red_takes_a_task_as_it_is_written() -> None:
    assert TASK.seen_by(TeamColour.RED) == TASK


def test_yellow_takes_its_mirror_image() -> None:
    mirrored = {"fire 2": Passage.NORMAL, "pool 1": Passage.FORCED}
    assert TASK.seen_by(TeamColour.YELLOW) == Task("there", 2300, 1150, 315, 60, mirrored)


@pytest.mark.parametrize("task", TASKS, ids=lambda task: task.name)
def test_a_mirror_image_of_a_mirror_image_is_the_task(task: Task) -> None:
    assert task.seen_by(TeamColour.YELLOW).seen_by(TeamColour.YELLOW) == task._replace(angle=task.angle % 360)


@pytest.mark.parametrize("barrier", BARRIERS, ids=lambda barrier: barrier.name)
def test_a_mirrored_barrier_stands_on_the_other_half(barrier: Barrier) -> None:
    other = BARRIERS[barrier_number(MIRRORED[barrier.name]) - 1]
    assert (other.x, other.y, other.kind) == (WIDTH - barrier.x, barrier.y, barrier.kind)


def test_flags_are_those_of_goto_xy() -> None:
    assert TASK.flags() == Barriers.of({1: Passage.NORMAL, 8: Passage.FORCED})


@pytest.mark.parametrize("team", TeamColour)
def test_every_task_can_be_driven_to_from_every_other(team: TeamColour) -> None:
    tasks = [task.seen_by(team) for task in TASKS]
    for start, goal in zip(tasks, [*tasks[1:], tasks[0]]):
        assert 0 <= goal.x <= WIDTH
        assert 0 <= goal.y <= HEIGHT
        here, there = Point(start.x, start.y), Point(goal.x, goal.y)
        assert find_route(here, there, goal.flags(), Clearances(200, 240, 100)), goal.name


def test_a_task_reads_as_a_person_would_say_it() -> None:
    assert str(TASK) == "there (700, 1150) 225 deg, 60 %"
