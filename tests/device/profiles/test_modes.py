"""The modes of operation: their ways over time against the arithmetic of ramps, and their bits of the statusword."""

from __future__ import annotations

from math import sqrt

import pytest

from eurobot_od.device.profiles.motion import Plant
from eurobot_od.od.cia402 import METHODS, State
from tests.device.profiles.bench import TURN, Bench

ACKNOWLEDGED = HOMED = STANDS = 12
REACHED, LIMITED, ERROR = 10, 11, 13

# Profile position


def duration(way: float, top: float, acceleration: float) -> float:
    """Return the seconds of a trapezoid, or of a triangle if the way is too short for the top."""
    if way * acceleration < top * top:
        return 2 * sqrt(way / acceleration)
    return way / top + top / acceleration


@pytest.mark.parametrize("way", [1, 7, 50, 99, 100, 101, 1000, 12_345])
@pytest.mark.parametrize("sign", [1, -1])
def test_a_move_takes_the_time_of_its_trapezoid(way: int, sign: int) -> None:
    bench = Bench().enable()
    bench.write(0x607A, sign * way)
    bench.command(0x1F)
    wanted = duration(way, 1000, 10_000)
    bench.run(max(wanted - 0.02, 0))
    assert abs(bench.position) < way or way < 10
    bench.run(0.1)
    assert bench.position == sign * way
    assert bench.is_set(REACHED)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_target_is_not_reached_before_the_axis_is_there(sign: int) -> None:
    bench = Bench().enable()
    bench.write(0x607A, sign * 500)
    bench.command(0x1F)
    bench.run(0.1)
    assert not bench.is_set(REACHED)
    bench.rest()
    assert bench.is_set(REACHED)


def test_a_halted_axis_has_reached_its_target_when_it_stands_and_not_before() -> None:
    bench = Bench({(0x60FF, 0): 1000}).enable(3)
    bench.run(1)
    assert bench.is_set(REACHED)
    bench.command(0x10F)
    bench.run(0.05)
    assert bench[0x606C] > 100
    assert not bench.is_set(REACHED)
    bench.rest()
    assert (bench[0x606C], bench.is_set(REACHED)) == (0, True)


def test_a_move_never_goes_beyond_its_target_nor_its_velocity() -> None:
    bench = Bench().enable()
    bench.write(0x607A, 3333)
    bench.command(0x1F)
    for _ in range(4000):
        bench.run(0.001)
        assert bench.position <= 3334
        assert abs(bench[0x606C]) <= 1001


def test_set_points_one_after_the_other() -> None:
    bench = Bench().enable()
    bench.write(0x607A, 1000)
    bench.command(0x1F)
    assert bench.is_set(ACKNOWLEDGED)
    bench.command(0x0F)
    assert not bench.is_set(ACKNOWLEDGED)
    bench.write(0x607A, 500)
    bench.command(0x1F, 0x0F)
    assert bench.is_set(ACKNOWLEDGED)  # it waits for its turn: there is no room for a third one
    bench.run(1.05)
    assert bench.position > 900
    bench.run(0.2)
    assert not bench.is_set(ACKNOWLEDGED)
    bench.run(1)
    assert (bench.position, bench.is_set(REACHED)) == (500, True)


def test_a_set_point_at_once_takes_the_place_of_the_first() -> None:
    bench = Bench().enable()
    bench.write(0x607A, 5000)
    bench.command(0x1F, 0x0F)
    bench.run(1)
    bench.write(0x607A, 0)
    bench.command(0x3F, 0x2F)
    bench.run(0.3)
    assert bench[0x606C] < 0
    bench.run(1.5)
    assert bench.position == 0


def test_relative_set_points_add_up() -> None:
    bench = Bench().enable()
    bench.write(0x607A, 400)
    for wanted in (400, 800, 1200):
        bench.command(0x5F, 0x4F)
        bench.run(1)
        assert bench.position == wanted


def test_a_move_is_halted_and_goes_on() -> None:
    bench = Bench().enable()
    bench.write(0x607A, 2000)
    bench.command(0x1F)
    bench.run(0.5)
    bench.command(0x11F)
    bench.run(0.5)
    stood = bench.position
    assert stood < 700
    assert bench.is_set(REACHED)
    bench.command(0x1F)
    assert not bench.is_set(REACHED)
    bench.run(2.5)
    assert bench.position == 2000


def test_a_target_beyond_the_software_limit_ends_there() -> None:
    bench = Bench({(0x607D, 1): -100, (0x607D, 2): 300}).enable()
    bench.write(0x607A, 5000)
    bench.command(0x1F)
    bench.run(2)
    assert (bench.position, bench.is_set(LIMITED)) == (300, True)


@pytest.mark.parametrize("limit", [0x607F, 0x6080])
def test_no_move_is_faster_than_the_drive_may_be(limit: int) -> None:
    bench = Bench({(limit, 0): 250}).enable()
    bench.write(0x607A, 5000)
    bench.command(0x1F)
    bench.run(1)
    assert bench[0x606C] == 250


def test_velocity_in_revolutions_per_minute_is_that_of_the_motor() -> None:
    bench = Bench({(0x60A9, 0): 0x00B44700, (0x6081, 0): 60, (0x6083, 0): 60_000, (0x6084, 0): 60_000}).enable()
    bench.write(0x607A, 10 * TURN)
    bench.command(0x1F)
    bench.run(5)
    assert bench[0x606C] == 60  # a turn each second
    assert bench.position == pytest.approx(5 * TURN, abs=5)


def test_before_the_first_set_point_the_axis_holds() -> None:
    bench = Bench({(0x607A, 0): 5000}).enable()
    bench.run(1)
    assert (bench.position, bench.is_set(REACHED)) == (0, True)


# Profile velocity


def test_profile_velocity_goes_by_its_ramps() -> None:
    bench = Bench({(0x6083, 0): 2000, (0x6084, 0): 4000}).enable(3)
    assert bench.is_set(STANDS)
    bench.write(0x60FF, 1000)
    assert not bench.is_set(REACHED)
    bench.run(0.25)
    assert bench[0x606C] == pytest.approx(500, abs=5)
    assert not bench.is_set(STANDS)
    bench.run(0.26)
    assert (bench[0x606C], bench.is_set(REACHED)) == (1000, True)
    bench.write(0x60FF, -1000)
    bench.run(0.25)
    assert bench[0x606C] == pytest.approx(0, abs=5)


def test_profile_velocity_stops_before_a_software_limit() -> None:
    bench = Bench({(0x607D, 1): -100, (0x607D, 2): 3000, (0x60FF, 0): 1000}).enable(3)
    bench.run(5)
    assert bench.position == pytest.approx(3000, abs=2)
    assert bench.is_set(LIMITED)
    bench.write(0x60FF, -500)  # and away again
    bench.run(1)
    assert bench.position < 2900


# Cyclic synchronous modes


def test_cyclic_position_follows_each_target_in_its_time() -> None:
    bench = Bench().enable(8)
    for target in range(20, 2001, 20):  # 2000 units/s
        bench.write(0x607A, target)
        bench.run(0.01)
        assert abs(bench[0x60F4]) <= 20
    assert bench[0x606C] == pytest.approx(2000, rel=0.01)
    bench.run(0.2)
    assert (bench.position, bench[0x606C]) == (2000, 0)


def test_cyclic_position_does_not_move_before_its_first_target() -> None:
    bench = Bench({(0x607A, 0): 5000}).enable(8)
    bench.run(1)
    assert bench.position == 0


def test_cyclic_velocity_is_the_target_and_its_offset() -> None:
    bench = Bench({(0x60B1, 0): 50}).enable(9)
    bench.write(0x60FF, 500)
    bench.run(0.1)
    assert bench[0x606C] == 550
    assert bench.is_set(12)


# Limit switches

ENDS = Plant(travel=(-5.0, 5.0))


def test_a_limit_switch_stops_the_motion_and_lets_it_away() -> None:
    bench = Bench({(0x60FF, 0): 2000}, plant=ENDS).enable(3)
    bench.run(5)
    assert 5 * TURN <= bench.position < 5.1 * TURN
    assert (bench[0x60FD], bench[0x606C], bench.is_set(LIMITED)) == (0b010, 0, True)
    bench.write(0x60FF, -2000)
    bench.run(1)
    assert bench.position < 4 * TURN


# Homing: where the motor ends, in turns from where it was switched on. The home switch is at 2 to 3 turns, the limit
# switches at -5 and 5, an index pulse at each whole turn.

HOMES = {
    1: -4,  # off the negative limit switch, on to the next index pulse
    2: 4,
    3: 1,
    4: 3,
    7: 1,
    12: 2,  # inside the edge at 3, on to the next index pulse
    17: -5,
    18: 5,
    19: 2,
    20: 2,
    21: 3,
    22: 3,
    23: 2,
    24: 2,
    25: 3,
    26: 3,
    27: 3,
    28: 3,
    29: 2,
    30: 2,
    33: 0,
    34: 1,
    35: 0,
    37: 0,
}


def homing(method: int, start: float = 0.0, plant: Plant = ENDS) -> Bench:
    bench = Bench({(0x6098, 0): method}, plant=plant)
    bench.axis.motor.position = start * TURN
    bench.enable(6)
    bench.command(0x1F)
    bench.rest()
    return bench


@pytest.mark.parametrize(("method", "place"), HOMES.items())
def test_each_method_finds_its_place(method: int, place: float) -> None:
    bench = homing(method)
    assert bench[0x6041] & 0x3400 == 0x1400
    assert -bench.axis.motor.plant.home[0] * TURN < bench.position < TURN
    # The zero position is home, seen from where the motor was switched on.
    assert bench.axis.motor.origin == pytest.approx(-place * TURN, abs=2 if method not in (33, 34) else 3)


@pytest.mark.parametrize("start", [-4.5, 2.5, 4.5])
@pytest.mark.parametrize("method", range(19, 31))
def test_home_is_the_same_place_from_everywhere(method: int, start: float) -> None:
    assert homing(method, start).axis.motor.origin == pytest.approx(-HOMES[method] * TURN, abs=2)


def test_an_axis_that_is_too_fast_for_the_switch_comes_back() -> None:
    slow_to_brake = {(0x6098, 0): 24, (0x6099, 1): 10_000, (0x609A, 0): 20_000}
    bench = Bench(slow_to_brake, plant=ENDS).enable(6)
    bench.command(0x1F)
    bench.rest()
    assert bench.axis.motor.origin == pytest.approx(-2 * TURN, abs=2)


def test_the_home_offset_is_from_home_to_zero() -> None:
    bench = Bench({(0x6098, 0): 37, (0x607C, 0): 250}).enable(6)
    bench.command(0x1F)
    bench.run(0.1)
    assert bench.position == -250


@pytest.mark.parametrize("method", [0, 15, 31, 36, 99])
def test_an_unknown_homing_method_is_a_homing_error(method: int) -> None:
    assert homing(method)[0x6041] & 0x3400 == 0x2400


def test_a_switch_that_is_nowhere_is_a_homing_error() -> None:
    nowhere = Plant(travel=(-5.0, 5.0), home=(8.0, 9.0))
    assert homing(19, plant=nowhere)[0x6041] & 0x3400 == 0x2400
    assert homing(17, plant=Plant())[0x6041] & 0x3400 == 0x2400


def test_a_home_that_was_found_is_known_in_every_mode_until_homing_begins_again() -> None:
    bench = homing(17)
    bench.write(0x6060, 1)
    assert not bench.is_set(12)  # there it is the set-point's
    bench.write(0x6060, 6)
    assert bench[0x6041] & 0x3400 == 0x1400
    bench.command(0x0F, 0x1F)
    assert bench[0x6041] & 0x3400 == 0


def test_a_set_point_s_bit_starts_homing_with_the_next_controlword_not_with_the_mode() -> None:
    bench = Bench({(0x6098, 0): 17}, plant=ENDS).enable(1)
    bench.command(0x1F)
    bench.write(0x6060, 6)
    assert bench[0x6041] & 0x3400 == 0x0400  # not started
    bench.command(0x1F)
    assert bench[0x6041] & 0x3400 == 0
    bench.rest()
    bench.command(0x1F)  # "continue", which is nothing any more
    assert bench[0x6041] & 0x3400 == 0x1400


def test_homing_is_interrupted_when_its_bit_is_taken_back() -> None:
    bench = Bench({(0x6098, 0): 17}, plant=ENDS).enable(6)
    assert bench[0x6041] & 0x3400 == 0x0400  # not started
    bench.command(0x1F)
    bench.run(1)
    assert bench[0x6041] & 0x3400 == 0
    bench.command(0x0F)
    bench.run(0.5)
    assert bench[0x6041] & 0x3400 == 0x0400
    assert (bench[0x606C], bench.state) == (0, State.ENABLED)


def test_every_method_of_the_standard_is_there() -> None:
    assert [*METHODS] == sorted(METHODS)
    assert {*METHODS} == {*range(1, 15), *range(17, 31), 33, 34, 35, 37}


# Torque

PUSHED = Plant(acceleration=100.0, friction=10.0, fastest=5.0)
"""100 turns/s² with all its torque, of which friction takes a tenth."""


def test_torque_rises_along_its_slope_and_is_reached() -> None:
    bench = Bench({(0x6087, 0): 500}, plant=PUSHED).enable(4)
    bench.write(0x6071, 50)
    bench.run(0.05)
    assert bench[0x6074] == pytest.approx(25, abs=1)
    assert not bench.is_set(REACHED)
    bench.run(0.06)
    assert (bench[0x6074], bench[0x6077], bench.is_set(REACHED)) == (50, 50, True)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_torque_accelerates_by_what_friction_leaves_of_it(sign: int) -> None:
    bench = Bench({(0x6087, 0): 0}, plant=PUSHED).enable(4)
    bench.write(0x6071, sign * 200)
    bench.run(0.1)
    # 20 turns/s² less 10: 1 turn/s after 0.1 s
    assert bench[0x606C] == pytest.approx(sign * TURN, rel=0.01)


def test_a_torque_against_the_motion_turns_it_round() -> None:
    bench = Bench({(0x6087, 0): 0}, plant=PUSHED).enable(4)
    bench.write(0x6071, 200)
    bench.run(0.2)
    bench.write(0x6071, -150)
    bench.run(0.5)
    assert bench[0x606C] < -TURN


@pytest.mark.parametrize("mode", [1, 3, 9])
def test_torque_is_shown_while_it_turns_and_not_when_it_stands(mode: int) -> None:
    bench = Bench({(0x60FF, 0): 1000}, plant=PUSHED._replace(fastest=50)).enable(mode)
    bench.write(0x607A, 5000)
    bench.command(0x1F)
    bench.run(1)
    assert bench[0x6077] == 100  # at a steady velocity it is friction's
    bench.command(0x10F)
    bench.rest()
    assert (bench[0x606C], bench[0x6077]) == (0, 0)


def test_a_torque_below_friction_turns_nothing() -> None:
    bench = Bench({(0x6087, 0): 0}, plant=PUSHED).enable(10)
    bench.write(0x6071, 99)
    bench.run(0.5)
    assert (bench[0x606C], bench[0x6077], bench.is_set(STANDS)) == (0, 99, True)
    assert not bench.axis.busy


@pytest.mark.parametrize(("objects", "fastest"), [({}, 5 * TURN), ({(0x6080, 0): 2 * TURN}, 2 * TURN)])
def test_a_torque_turns_no_faster_than_the_motor_may(objects: dict[tuple[int, int], int], fastest: int) -> None:
    bench = Bench({(0x6087, 0): 0, **objects}, plant=PUSHED).enable(10)
    bench.write(0x6071, 1000)
    bench.run(0.3)
    assert (bench[0x606C], bench[0x6077]) == (fastest, 100)  # and then it needs what friction takes


TORQUES = [
    # target, offset, most: the torque demand
    (300, 0, 1000, 300),
    (300, 100, 1000, 400),
    (-300, -100, 250, -250),
    (900, 900, 5000, 1000),  # no more than it has
]


@pytest.mark.parametrize(("target", "offset", "most", "demand"), TORQUES)
def test_a_cyclic_torque_counts_at_once_with_its_offset_and_within_its_limit(
    target: int, offset: int, most: int, demand: int
) -> None:
    bench = Bench({(0x60B2, 0): offset, (0x6072, 0): most}).enable(10)
    bench.write(0x6071, target)
    bench.run(0.001)
    assert bench[0x6074] == demand


@pytest.mark.parametrize(("word", "after"), [(0x10F, State.ENABLED), (0x02, State.DISABLED), (0x07, State.SWITCHED_ON)])
def test_a_motor_that_is_led_by_its_torque_stops_on_a_ramp(word: int, after: State) -> None:
    bench = Bench({(0x6087, 0): 0}, plant=PUSHED).enable(4)
    bench.write(0x6071, 200)
    bench.run(0.2)
    assert bench[0x606C] > TURN
    bench.command(word)
    bench.run(0.5)
    assert (bench[0x606C], bench.state) == (0, after)


def test_after_a_halt_the_torque_is_there_again() -> None:
    bench = Bench({(0x6087, 0): 0}, plant=PUSHED).enable(4)
    bench.write(0x6071, 200)
    bench.command(0x10F)
    bench.run(0.2)
    assert bench[0x606C] == 0
    bench.command(0x0F)
    bench.run(0.2)
    assert bench[0x606C] > TURN


def test_a_limit_switch_stops_a_torque_and_lets_it_go_back() -> None:
    bench = Bench({(0x6087, 0): 0}, plant=PUSHED._replace(travel=(-1.0, 1.0))).enable(4)
    bench.write(0x6071, 200)
    bench.run(2)
    assert (bench[0x606C], bench.is_set(LIMITED)) == (0, True)
    stood = bench.position
    assert stood >= TURN
    bench.run(0.5)
    assert bench.position == stood
    bench.write(0x6071, -200)
    bench.run(0.5)
    assert bench.position < stood


def test_another_mode_after_torque_leads_the_motor_again() -> None:
    bench = Bench({(0x6087, 0): 0}, plant=PUSHED).enable(4)
    bench.write(0x6071, 200)
    bench.run(0.2)
    bench.write(0x60FF, 500)
    bench.write(0x6060, 3)
    bench.run(1)
    assert bench[0x606C] == 500
