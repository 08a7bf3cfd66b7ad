"""The game: tasks are done where the robot is, once, with their chance; fruit is worth something in the basket."""

from __future__ import annotations

import statistics

import pytest

from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.robot_file import Task
from eurobot_od.robot.model.values import Score, TeamColour
from eurobot_od.robot.world.world import REACH, REACH_ANGLE, Game

FACTS = robot_file.read()

TASKS = FACTS.tasks(TeamColour.RED)
OURS, RIVAL = "ours", "enemy 1"


def finish(game: Game, name: str, robot: str = OURS) -> int:
    """Do a task right at its place."""
    return game.finish(robot, TASKS[name], TASKS[name].pose, 1.0)


def lucky(name: str, least: int = 1) -> Game:
    """Return a game in which our robot succeeds with a task."""
    return Game(next(seed for seed in range(100) if finish(Game(seed), name) >= least))


@pytest.mark.parametrize(
    ("off", "done", "why"),
    [
        (Pose(0, 0, 0), True, "at its place"),
        (Pose(REACH - 1, 0, 0), True, "near enough"),
        (Pose(REACH + 1, 0, 0), False, "too far off"),
        (Pose(0, 0, REACH_ANGLE - 0.5), True, "nearly straight"),
        (Pose(0, 0, REACH_ANGLE + 0.5), False, "not straight enough"),
    ],
)
def test_a_task_is_done_where_the_robot_is(off: Pose, done: bool, why: str) -> None:
    task = TASKS["mammoth"]
    game = lucky("mammoth")
    pose = Pose(*(exact + by for exact, by in zip(task.pose, off)))
    assert (game.finish(OURS, task, pose, 1.0) > 0) is done, why


def test_a_task_is_done_once_by_each_robot() -> None:
    game = lucky("frescos")
    assert finish(game, "frescos") > 0
    assert finish(game, "frescos") == 0
    done_by_both = [finish(each, "frescos", RIVAL) for each in map(Game, range(20))]
    assert max(done_by_both) == 6


def test_a_shared_task_is_done_by_whoever_comes_first() -> None:
    game = lucky("fire 1")
    assert finish(game, "fire 1") == 1
    assert finish(game, "fire 1", RIVAL) == 0


def test_a_fallen_fire_cannot_be_turned_over() -> None:
    game = lucky("fire 1")
    game.fall("fire 1")
    assert finish(game, "fire 1") == 0


def test_fruit_is_worth_something_in_the_basket() -> None:
    game = lucky("tree 1", 2)
    fruit = finish(game, "tree 1")
    assert game.points(OURS) == 0
    assert finish(game, "basket", RIVAL) == 0, "it is not theirs"
    assert finish(game, "basket") == fruit == game.points(OURS)
    assert finish(game, "basket") == 0, "it has been unloaded"
    assert game.scores == [Score(1.0, OURS, "basket", fruit)]


@pytest.mark.parametrize("task", [each for each in TASKS.values() if each.name != "basket"])
def test_a_task_scores_its_stated_average(task: Task) -> None:
    came = [finish(Game(seed), task.name) for seed in range(1500)]
    assert statistics.mean(came) == pytest.approx(task.expected, rel=0.1)
    assert max(came) == task.tries * task.points
