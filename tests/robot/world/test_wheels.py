"""Wheels: they do not roll quite as they count, stall where something is in the way, and slip on a little."""

from __future__ import annotations

import random
import statistics
from dataclasses import replace

import pytest

from eurobot_od.robot.model.options import Errors
from eurobot_od.robot.nodes.motion import AT_REST, Odometry, WheelCommand
from eurobot_od.robot.world.world import SimulatedWheels
from tests.robot.world.places import STEP, Place

EXACT = Errors(wheel_scale=0, wheel_turn=0, wheel_noise=0, heading_noise=0, wheel_slip=0)
DT = STEP


def on_wheels(errors: Errors, seed: int = 1) -> tuple[Place, SimulatedWheels]:
    place = Place()
    place.clear()
    place.put(1000, 1000, 0)
    return place, SimulatedWheels(place.vehicle, errors, random.Random(seed))


def roll(wheels: SimulatedWheels, command: WheelCommand, seconds: float) -> Odometry:
    """Roll for some time; return what the wheels counted in all."""
    counted = [wheels.advance(command, DT) for _ in range(round(seconds / DT))]
    return Odometry(sum(each.distance for each in counted), sum(each.turn for each in counted))


@pytest.mark.parametrize(
    "command", [WheelCommand(400, 0), WheelCommand(-400, 0), WheelCommand(0, 90), WheelCommand(300, 30), AT_REST]
)
def test_wheels_without_errors_follow_their_command_and_report_it(command: WheelCommand) -> None:
    place, wheels = on_wheels(EXACT)
    expected = place.world.robot
    for _ in range(100):
        expected = expected.moved(command.speed * DT, command.turn * DT)
    counted = roll(wheels, command, 1.0)
    assert counted == pytest.approx((command.speed, command.turn))
    assert place.world.robot == pytest.approx(expected)


def test_the_scale_differs_from_seed_to_seed_and_stays_the_same_for_one() -> None:
    ways = []
    for seed in range(200):
        place, wheels = on_wheels(replace(EXACT, wheel_scale=0.01), seed)
        roll(wheels, WheelCommand(400, 0), 0.5)
        first = place.here.x - 1000
        roll(wheels, WheelCommand(400, 0), 0.5)
        assert place.here.x - 1000 == pytest.approx(2 * first)
        ways.append(first / 200)
    assert statistics.mean(ways) == pytest.approx(1.0, abs=0.003)
    assert statistics.stdev(ways) == pytest.approx(0.01, rel=0.2)


@pytest.mark.long
@pytest.mark.parametrize("seconds", [0.25, 1.0])
def test_random_errors_grow_with_the_root_of_the_way(seconds: float) -> None:
    ways = []
    for seed in range(300):
        place, wheels = on_wheels(replace(EXACT, wheel_noise=3.0), seed)
        roll(wheels, WheelCommand(400, 0), seconds)
        ways.append(place.here.x)
    assert statistics.stdev(ways) == pytest.approx(3.0 * (0.4 * seconds) ** 0.5, rel=0.15)


@pytest.mark.long
def test_a_turn_on_the_spot_is_off_by_its_own_error() -> None:
    angles = []
    for seed in range(300):
        place, wheels = on_wheels(replace(EXACT, heading_noise=0.3), seed)
        roll(wheels, WheelCommand(0, 90), 1.0)
        angles.append(place.world.robot.angle)
    assert statistics.stdev(angles) == pytest.approx(0.3, rel=0.15)


@pytest.mark.parametrize(("slip", "counted"), [(0.0, 0.0), (0.05, 20.0), (1.0, 400.0)])
def test_the_wheels_of_a_blocked_robot_stall_and_slip(slip: float, counted: float) -> None:
    place, wheels = on_wheels(replace(EXACT, wheel_slip=slip))
    place.put(3000 - 140, 1000, 0)
    assert roll(wheels, WheelCommand(400, 0), 1.0).distance == pytest.approx(counted)
    assert place.here.x == 3000 - 140


def test_a_blocked_robot_can_turn_and_drive_away() -> None:
    place, wheels = on_wheels(EXACT)
    place.put(3000 - 140, 1000, 0)
    roll(wheels, WheelCommand(400, 0), 0.5)
    assert roll(wheels, WheelCommand(0, 90), 1.0).turn == pytest.approx(90)
    assert roll(wheels, WheelCommand(-400, 0), 0.5).distance == pytest.approx(-200)
