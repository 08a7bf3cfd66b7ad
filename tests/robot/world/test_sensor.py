"""The distance sensor: what it sees, how far off, and what it sees wrongly at which rate."""

from __future__ import annotations

import random
import statistics
from dataclasses import replace

import pytest

from eurobot_od.robot.model.options import Errors
from eurobot_od.robot.model.values import Obstacle
from eurobot_od.robot.nodes.node import Detection
from eurobot_od.robot.world.world import RIVAL, Sensor
from tests.robot.world.places import Place

EXACT = Errors(sensor_noise=0, sensor_false=0, sensor_missed=0)
MANY = 3000


def looking(errors: Errors, gap: float = 300.0, bearing: float = 0.0) -> Sensor:
    """Put another robot at an angle before ours."""
    place = Place(enemies=1, rival=True)
    place.put(1500, 1000, bearing)
    place.put(1500 + 280 + gap, 1000, 0, RIVAL)
    return Sensor(place.vehicle, errors, random.Random(1))


def looks(sensor: Sensor) -> list[Detection | None]:
    return [sensor.look(0.0) for _ in range(MANY)]


@pytest.mark.parametrize(
    ("gap", "bearing", "seen", "why"),
    [
        (300.0, 0.0, True, "ahead"),
        (300.0, 30.0, True, "to the right, within the angle"),
        (300.0, 80.0, False, "to the side"),
        (690.0, 0.0, True, "as far as it sees"),
        (710.0, 0.0, False, "farther"),
    ],
)
def test_the_sensor_sees_bodies_within_its_range_and_angle(gap: float, bearing: float, seen: bool, why: str) -> None:
    found = looking(EXACT, gap, bearing).look(0.0)
    assert (found is not None) is seen, why
    if found is not None:
        assert found == pytest.approx((Obstacle.ENEMY, gap, -bearing))


def test_noise_has_its_deviation() -> None:
    distances = [each.distance for each in looks(looking(replace(EXACT, sensor_noise=3.0))) if each is not None]
    assert statistics.stdev(distances) == pytest.approx(3.0, rel=0.1)
    assert statistics.mean(distances) == pytest.approx(300.0, abs=0.3)


def test_obstacles_are_missed_at_the_given_rate() -> None:
    assert looks(looking(replace(EXACT, sensor_missed=0.1))).count(None) / MANY == pytest.approx(0.1, abs=0.02)


def test_false_obstacles_come_at_the_given_rate() -> None:
    seen = [each for each in looks(looking(replace(EXACT, sensor_false=0.1), gap=900.0)) if each is not None]
    assert len(seen) / MANY == pytest.approx(0.1, abs=0.02)
    assert {each.obstacle for each in seen} == {Obstacle.OBJECT}
