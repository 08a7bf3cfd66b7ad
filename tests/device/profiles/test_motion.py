"""The units that a drive's objects say, the demand along its ramps, and the motor that follows it."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import copysign

import pytest

from eurobot_od.device.profiles.motion import STEP, TURN, Demand, Motor, Plant, Units
from eurobot_od.od.cia402 import Switch
from eurobot_od.od.values import Address
from tests.device.profiles.bench import Shelf


def _factors(**pairs: tuple[int, int]) -> Mapping[Address, int]:
    index = {"encoder": 0x608F, "gear": 0x6091, "feed": 0x6092, "velocity": 0x6096}
    return {(index[name], sub): value for name, pair in pairs.items() for sub, value in enumerate(pair, 1)}


TURNS = [
    ({}, TURN),  # nothing said
    (_factors(encoder=(2000, 1)), 2000),
    (_factors(encoder=(2000, 4)), 500),
    (_factors(encoder=(2000, 0)), TURN),  # no ratio
    (_factors(encoder=(2000, 1), gear=(10, 1)), 2000),  # without a feed constant positions are the encoder's
    (_factors(encoder=(2000, 1), feed=(1, 1)), 2000),  # a feed that nobody has set
    (_factors(encoder=(2000, 1), feed=(360, 1)), 360),
    (_factors(encoder=(2000, 1), feed=(5000, 1), gear=(10, 1)), 500),
    (_factors(encoder=(2000, 1), feed=(5000, 2), gear=(1, 2)), 5000),
]


@pytest.mark.parametrize(("objects", "turn"), TURNS)
def test_position_units_of_a_turn(objects: Mapping[Address, int], turn: float) -> None:
    assert Units.of(Shelf(objects)).turn == turn


VELOCITIES = [
    (_factors(encoder=(6000, 1)), 1.0),
    (_factors(encoder=(6000, 1), velocity=(1, 1)), 1.0),
    (_factors(encoder=(6000, 1), velocity=(60, 6000)), 100.0),  # revolutions a minute
    (_factors(encoder=(6000, 1), velocity=(1000, 1)), 0.001),
    ({**_factors(encoder=(6000, 1)), (0x60A9, 0): 0x00B44700}, 100.0),
    ({**_factors(encoder=(6000, 1)), (0x60A9, 0): 0xFDB44700}, 0.1),  # thousandths of one
    ({**_factors(encoder=(6000, 1), velocity=(7, 1)), (0x60A9, 0): 0x00B44700}, 100.0),  # the unit has the last word
]


@pytest.mark.parametrize(("objects", "velocity"), VELOCITIES)
def test_position_units_a_second_in_a_unit_of_velocity(objects: Mapping[Address, int], velocity: float) -> None:
    assert Units.of(Shelf(objects)).velocity == pytest.approx(velocity)


@pytest.mark.parametrize(
    ("index", "offset", "own"), [(0x6040, 0x800, 0x6840), (0x6040, 0x2000, 0x8040), (0x607A, 0x3800, 0x987A)]
)
def test_a_further_axis_has_its_objects_further_on(index: int, offset: int, own: int) -> None:
    values = Shelf({(own, 0): 7, (own, 1): 8}, offset)
    assert (values.has(index), values.find(index, 1), values.get(index)) == (True, 8, 7)
    values.put(index, 9)
    assert (values.get(index), values.has(index, 2), values.find(index, 2), values.get(index, 2, 5)) == (
        9,
        False,
        None,
        5,
    )


class Written(Shelf):
    """Velocities that the file gives in revolutions per minute."""

    def unit(self, index: int) -> str:
        return "RPM" if index == 0x60FF else ""


def test_a_unit_that_the_file_writes_counts_where_no_object_says_one() -> None:
    assert Units.of(Written(_factors(encoder=(6000, 1)))).velocity == 100.0


# The demand

TOP, RAMP, BRAKE = 1000.0, 10_000.0, 20_000.0
"""Velocity in position units/s; acceleration and deceleration in position units/s²."""


@pytest.mark.parametrize("target", [0.4, 1.0, 30.0, 777.7, -5000.0])
def test_a_demand_takes_the_trapezoid_to_its_target_and_stands_there(target: float) -> None:
    demand, way = Demand(), list[float]()
    while demand.position != target:
        demand.to_position(target, TOP, RAMP, BRAKE)
        way.append(demand.velocity)
        assert abs(demand.position) <= abs(target)
        assert len(way) < 10_000
    assert demand.velocity == 0.0
    changes = [abs(after) - abs(before) for before, after in pairwise([0.0, *way])]
    assert max(changes) <= RAMP * STEP + 1e-9
    assert min(changes) >= -3 * BRAKE * STEP - 1e-9  # the last step may be one that is cut short
    assert max(map(abs, way)) <= TOP


def test_a_demand_turns_round_through_a_stand() -> None:
    demand = Demand(velocity=100.0)
    for _ in range(5):
        demand.to_velocity(-100.0, RAMP, BRAKE)
    assert demand.velocity == 0.0
    demand.to_velocity(-100.0, RAMP, BRAKE)
    assert demand.velocity == -RAMP * STEP


def test_a_torque_rises_by_its_slope_and_reaches_what_is_wanted() -> None:
    demand, found = Demand(), list[float | None]()
    for _ in range(4):
        demand.to_torque(-0.0025, slope=1.0 / STEP / 1000)
        found.append(demand.torque)
    assert found == pytest.approx([-0.001, -0.002, -0.0025, -0.0025])


# The motor

WEAK = Plant(travel=(-5.0, 8.0), acceleration=10.0, friction=2.0, fastest=3.0)
LOCK = 100.0
"""Position units of a turn."""


def test_a_motor_follows_as_fast_as_its_torque_allows() -> None:
    motor = Motor(WEAK, LOCK)
    motor.follow(Demand(position=500.0, velocity=500.0), controls_position=False)
    assert motor.velocity == pytest.approx(10.0 * LOCK * STEP)
    assert motor.position == pytest.approx(motor.velocity * STEP)
    assert motor.torque == 1.0
    for _ in range(2000):
        motor.follow(Demand(velocity=500.0), controls_position=False)
    assert motor.velocity == 500.0
    assert motor.torque == pytest.approx(0.2)  # against friction alone


def test_a_motor_makes_up_for_its_lag_where_its_position_is_controlled() -> None:
    motor = Motor(WEAK, LOCK)
    for _ in range(2000):
        motor.follow(Demand(position=20.0), controls_position=True)
    assert motor.position == pytest.approx(20.0, abs=0.5)


def test_a_motor_without_torque_is_braked_by_friction_and_stands() -> None:
    motor = Motor(WEAK, LOCK, velocity=-100.0)
    motor.coast()
    assert [motor.velocity, motor.torque] == pytest.approx([-100.0 + 2.0 * LOCK * STEP, 0.0])
    for _ in range(round(0.5 / STEP)):
        motor.coast()
    assert motor.velocity == 0.0


@pytest.mark.parametrize(
    ("torque", "fastest", "velocity"),
    [(1.0, 1000.0, 300.0), (-1.0, 1000.0, -300.0), (1.0, 50.0, 50.0), (0.1, 1000.0, 0.0)],
)
def test_a_torque_turns_it_no_faster_than_it_may_and_not_at_all_below_friction(
    torque: float, fastest: float, velocity: float
) -> None:
    motor = Motor(WEAK, LOCK)
    motor.push(torque, fastest)
    assert motor.velocity == pytest.approx(
        ((abs(torque) * 10.0 - 2.0) * LOCK * STEP if velocity else 0.0) * copysign(1, torque)
    )
    for _ in range(round(2 / STEP)):
        motor.push(torque, fastest)
    assert motor.velocity == pytest.approx(velocity)
    assert motor.torque == pytest.approx(copysign(0.2, torque) if velocity else 0.1)


HOME, NEGATIVE, POSITIVE = Switch.HOME, Switch.NEGATIVE_LIMIT, Switch.POSITIVE_LIMIT


@pytest.mark.parametrize(
    ("plant", "turns", "active"),
    [
        (WEAK, 0.0, 0),
        (WEAK, 1.99, 0),
        (WEAK, 2.0, HOME),
        (WEAK, 3.0, HOME),
        (WEAK, 3.01, 0),
        (WEAK, -5.0, NEGATIVE),
        (WEAK, 8.0, POSITIVE),
        (WEAK, 12.5, POSITIVE),  # not round again
        (Plant(), 12.5, HOME),
        (Plant(), -7.5, HOME),
        (Plant(), 1000.0, 0),
    ],
)
def test_the_switches_are_active_at_their_places(plant: Plant, turns: float, active: int) -> None:
    assert plant.switches(turns) == active


def test_a_place_that_is_renumbered_has_its_switches_and_its_index_pulse_where_they_were() -> None:
    motor = Motor(WEAK, LOCK, position=250.0)
    assert (motor.switches, motor.index) == (HOME, 2)
    motor.shift(-250.0)
    assert (motor.position, motor.switches, motor.index) == (0.0, HOME, 2)
