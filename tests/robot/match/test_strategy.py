"""The shipped strategy: what it carries to the basket, what is left to do, and whom it waits for."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import pytest

from eurobot_od.robot.match import MatchOptions
from eurobot_od.robot.match.seeds import play
from eurobot_od.robot.match.stage import EdsFiles
from eurobot_od.robot.match.strategy import PACE, STUCK, Strategy
from eurobot_od.robot.model.messages import Enemy1PositionResponse, KalmanPositionResponse
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.robot_file import Worth
from eurobot_od.robot.model.values import Source
from tests.robot.nodes.harness import Bench


class Hands:
    """Do every task at once, and always bring three."""

    def begin(self, _task: str) -> float:
        return 0.0

    def finish(self, _task: str) -> int:
        return 3


class There(Strategy):
    """Is wherever it wants to be."""

    async def drive(self, way: Sequence[Point], angle: float) -> bool:
        return True


def started(kind: type[Strategy] = Strategy) -> tuple[Bench, Strategy]:
    """Return a strategy at its start, on a bench with stand-ins for the other nodes."""
    bench = Bench("drive", "navigation")
    bench.core.actuators = Hands()
    bench.configure()
    bench.say("drive", KalmanPositionResponse(200, 1800, 0, Source.INTERNAL))
    return bench, kind(bench.core)


def test_fruit_is_worth_a_way_to_the_basket_until_it_was_brought_there() -> None:
    bench, strategy = started(There)
    basket = next(each for each in strategy.todo.values() if each.worth is Worth.HARVEST)
    tree, another, *_ = (each for each in strategy.todo.values() if each.worth is Worth.FRUIT)

    async def play_on() -> list[float]:
        worth = [strategy.value(basket, 1.0)]
        for task in (tree, another, basket):
            await strategy.do(task, ())
            worth.append(strategy.value(basket, 1.0))
        return worth

    empty, some, more, empty_again = bench.play(play_on())
    assert 0 == empty == empty_again < some < more
    assert {tree.name, another.name, basket.name} & strategy.todo.keys() == {basket.name}, "a tree is picked once"


def test_the_robot_does_not_drive_where_another_robot_will_be() -> None:
    bench, strategy = started()
    (way, poses), *_ = strategy.ways_to(strategy.todo["frescos"])
    assert way == (Point(1400, 1800),)
    assert strategy.is_free(poses)
    for x in (1700, 1500, 1300):
        bench.say("navigation", Enemy1PositionResponse(x, 1800, 0, Source.ENEMY_1))
        bench.run(0.6)
    assert not strategy.is_free(poses), "it comes along the same line"


def test_far_tasks_wait_until_the_forecast_knows_which_fires_were_pushed() -> None:
    _, strategy = started()
    strategy.todo = {name: task for name, task in strategy.todo.items() if name in ("torch 2", "fire 1")}
    plan = strategy.best()
    assert plan is not None
    assert plan.task.name == "fire 1"
    del strategy.todo["fire 1"]
    assert strategy.best() is None
    strategy.forecast.is_blind = False
    assert strategy.best() is not None


def test_a_task_takes_its_way_the_beginning_of_a_goto_and_its_work() -> None:
    _, strategy = started()
    task = strategy.todo["fire 3"]
    here = strategy.estimate(task.pose, task)
    assert here > task.seconds
    assert strategy.estimate(task.pose.moved(900.0, 0.0), task) - here == pytest.approx(900.0 / PACE)


def test_a_robot_that_has_not_moved_for_long_plans_a_way_round_the_others() -> None:
    bench, strategy = started()
    bench.say("navigation", Enemy1PositionResponse(150, 1500, 0, Source.ENEMY_1))
    task = strategy.todo["fire 3"]
    (way, _), *_ = strategy.ways_to(task)
    assert way == (task.pose.point,), "straight on: it may be gone by then"
    strategy.moved -= 2 * STUCK
    *_, (round_it, _) = strategy.ways_to(task)
    (enemy,) = strategy.forecast.others(margin=0.0)
    assert not any(enemy.meets(*leg) for leg in pairwise((strategy.here.point, *round_it)))


def test_two_that_give_way_to_each_other_do_not_stand_for_ever() -> None:
    bench, strategy = started()
    (_, poses), *_ = strategy.ways_to(strategy.todo["frescos"])
    for _ in range(3):
        bench.say("navigation", Enemy1PositionResponse(900, 1475, 0, Source.ENEMY_1))
        bench.run(0.6)
    is_free = []
    for stood in (0.0, 15.0, 30.0):
        strategy.moved = bench.core.now - stood
        is_free.append(strategy.is_free(poses))
    assert is_free == [False, False, True], "we wait long before we pass closely, but not for ever"


def test_a_task_that_leaves_no_time_for_the_way_home_is_given_up() -> None:
    _, strategy = started()
    tree, torch = strategy.todo["tree 4"], strategy.todo["torch 4"]
    assert strategy.time_after(torch) == 0.0 < strategy.time_after(tree), "nothing to bring home"
    strategy.fruit = 1
    assert strategy.time_after(torch) > 0.0


def test_a_match_without_touches_by_our_fault_in_which_few_gotos_are_stopped() -> None:
    match = play(MatchOptions(seed=9, duration=45.0), EdsFiles.read(MatchOptions()))
    assert not [touch for touch in match.touches if touch.at_fault]
    assert len(match.arrivals) >= 0.8 * len(match.gotos)
    assert match.points >= 12
