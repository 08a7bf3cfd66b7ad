"""The game as the world referees it: who has done which task, with what success, and who has how many points."""

from __future__ import annotations

import random
from typing import NamedTuple

from eurobot_od.errors import UnknownName
from eurobot_od.robot.model.facts import Task, Worth
from eurobot_od.robot.model.places import Pose, is_near

REACH = 40.0
REACH_ANGLE = 8.0
"""How far from its place a robot can still do a task: mm and degrees."""


class Score(NamedTuple):
    """Points that a robot made with a task, and when, in s."""

    time: float
    robot: str
    task: str
    points: int


class Game:
    """What has been done on the field. Chance comes from one seed, with a stream for each task."""

    def __init__(self, seed: int) -> None:
        self.scores: list[Score] = []
        self._seed = seed
        self._done: set[tuple[str, str]] = set()
        self._fruit: dict[str, int] = {}

    def points(self, robot: str) -> int:
        """Tell how many points a robot has."""
        return sum(score.points for score in self.scores if score.robot == robot)

    def fall(self, task: str) -> None:
        """Have something fallen over that cannot be turned over any more."""
        self._done.add(("", task))

    def finish(self, robot: str, task: Task, pose: Pose, now: float) -> int:
        """Judge what a robot has done at its true pose: points or fruit, 0 if it was done already or out of reach."""
        # By the true pose, not the believed one: a robot that is wrong about its place misses.
        if not is_near(pose, task.pose, REACH, REACH_ANGLE):
            return 0
        if task.worth is Worth.HARVEST:
            return self._score(now, robot, task, self._fruit.pop(robot, 0))
        # Under "", whoever comes second finds it done.
        key = ("" if task.shared else robot, task.name)
        if key in self._done:
            return 0
        self._done.add(key)
        # A random stream for each task: whether the mammoth is hit does not depend on what was done before.
        chance = random.Random(f"{self._seed} {robot} {task.name}")
        came = task.points * sum(chance.random() < task.chance for _ in range(task.tries))
        if task.worth is Worth.FRUIT:
            self._fruit[robot] = self._fruit.get(robot, 0) + came
            return came
        return self._score(now, robot, task, came)

    def _score(self, now: float, robot: str, task: Task, points: int) -> int:
        if points:
            self.scores.append(Score(now, robot, task.name, points))
        return points


def find(tasks: dict[str, Task], name: str) -> Task:
    """Return a task by its name; raises UnknownName."""
    if name not in tasks:
        raise UnknownName("task", name, tasks)
    return tasks[name]
