"""The shipped strategy: what it carries to the basket, and what is left to do."""

from __future__ import annotations

from eurobot_od.robot.match.strategy import Strategy
from eurobot_od.robot.model.messages import Enemy1PositionResponse, KalmanPositionResponse
from eurobot_od.robot.model.places import Point, Pose
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

    async def drive(self, there: Pose) -> bool:
        return True


def test_fruit_is_worth_a_way_to_the_basket_until_it_was_brought_there() -> None:
    bench = Bench("drive", "navigation")
    bench.core.actuators = Hands()
    bench.configure()
    bench.say("drive", KalmanPositionResponse(200, 1800, 0, Source.INTERNAL))
    strategy = There(bench.core)
    basket = next(each for each in strategy.todo.values() if each.worth is Worth.HARVEST)
    tree, another, *_ = (each for each in strategy.todo.values() if each.worth is Worth.FRUIT)

    async def play() -> list[float]:
        worth = [strategy.value(basket)]
        for task in (tree, another, basket):
            await strategy.attempt(task)
            worth.append(strategy.value(basket))
        return worth

    empty, some, more, empty_again = bench.play(play())
    assert 0 == empty == empty_again < some < more
    assert {tree.name, another.name, basket.name} & strategy.todo.keys() == {basket.name}, "a tree is picked once"


def test_the_drive_is_sent_round_another_robot_in_the_way() -> None:
    bench = Bench("drive", "navigation")
    bench.configure()
    bench.say("drive", KalmanPositionResponse(200, 1000, 0, Source.INTERNAL))
    strategy, there = Strategy(bench.core), Point(1400, 1000)
    assert strategy.next_point(there) == there, "the way is free"
    bench.say("navigation", Enemy1PositionResponse(800, 1000, 0, Source.ENEMY_1))
    beside = strategy.next_point(there)
    (enemy,) = strategy.others()
    assert beside not in (there, None)
    assert not enemy.meets(strategy.here, beside)
