"""The drive's pose estimate: what it begins with, what it refuses, how it finds back, and that it is worth having."""

from __future__ import annotations

import math
import random

import pytest

from eurobot_od.robot.model.messages import Enemy1PositionResponse
from eurobot_od.robot.model.places import Pose, turn
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.nodes.estimate import (
    AGREEING,
    BUMPS,
    LONGEST_LATENCY,
    SPREAD,
    TOP_SPEED,
    Estimate,
    Sighting,
    Track,
)
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.nodes.navigation import Fix
from tests.robot.nodes.harness import TUNING

START = Pose(1000.0, 500.0, 350.0)
ELSEWHERE = Fix(2000.0, 500.0, 90.0)
TIMES = (0.0, 0.6, 1.2)
"""When the core asks for positions, s."""


def seen(pose: Pose) -> Fix:
    """Return the position of exact beacons."""
    return Fix(*pose)


def settled(pose: Pose = START) -> Estimate:
    """Return an estimate that beacons have confirmed."""
    estimate = Estimate(TUNING, pose)
    assert all(estimate.corrected(seen(pose), 0.0) for _ in range(3))
    return estimate


# What it begins with


def test_the_place_is_unknown_at_first() -> None:
    estimate = Estimate(TUNING)
    estimate.moved(Odometry(100.0, 10.0), 0.0)
    assert (estimate.pose, estimate.scale, estimate.deviations) == (None, None, None)


def test_the_first_position_is_taken_whole() -> None:
    estimate = Estimate(TUNING)
    assert estimate.corrected(Fix(700.0, 300.0, 370.0), 0.0)
    assert estimate.pose == Pose(700.0, 300.0, 10.0)
    assert estimate.deviations is not None
    assert estimate.deviations[:3] == pytest.approx((5.0, 5.0, 1.0), rel=0.05)


def test_positions_without_heading_make_no_pose() -> None:
    estimate = Estimate(TUNING)
    assert not any(estimate.corrected(Fix(700.0, 300.0), 0.0) for _ in range(2 * AGREEING))
    assert estimate.pose is None


def test_dead_reckoning_follows_the_wheels() -> None:
    estimate = Estimate(TUNING, Pose(0.0, 0.0, 90.0))
    for number in range(90):
        estimate.moved(Odometry(1.0, -1.0), number / 100)
    assert estimate.pose == pytest.approx(Pose(0.0, 0.0, 90.0).moved(90.0, -90.0))


TURNED = Fix(1000.0, 500.0, 90.0)
ASSUMED = [
    ([ELSEWHERE], START, "one that lies outside its gate may be wrong"),
    ([ELSEWHERE, ELSEWHERE], ELSEWHERE, "nothing has measured the start place: two take its place"),
    ([TURNED, TURNED], TURNED, "so does another heading"),
    ([ELSEWHERE, TURNED], START, "if they agree"),
    ([Fix(2000.0, 500.0)] * 2, Fix(2000.0, 500.0, START.angle), "without a heading that of the start place is kept"),
]


@pytest.mark.parametrize(("fixes", "expected", "why"), ASSUMED)
def test_an_assumed_pose_is_the_estimate(fixes: list[Fix], expected: Fix | Pose, why: str) -> None:
    estimate = Estimate(TUNING, START)
    for number, fix in enumerate(fixes):
        estimate.corrected(fix, 0.1 * number)
    assert estimate.pose == pytest.approx(tuple(expected)), why


def test_an_assumed_pose_is_corrected_within_its_gate() -> None:
    estimate = Estimate(TUNING, START)
    assert estimate.corrected(Fix(1010.0, 500.0, 350.0), 0.0)
    assert estimate.pose is not None
    assert 1005.0 < estimate.pose.x < 1010.0


# What it refuses


def test_an_outlier_is_refused() -> None:
    estimate = settled()
    assert not estimate.corrected(ELSEWHERE, 0.0)
    assert estimate.pose == pytest.approx(START)


@pytest.mark.parametrize("seed", range(10))
def test_random_outliers_never_move_the_estimate(seed: int) -> None:
    chance = random.Random(seed)
    estimate = settled()
    for number in range(1000):
        fix = Fix(chance.uniform(0, 3000), chance.uniform(0, 2000), chance.uniform(0, 360))
        estimate.corrected(fix, 0.6 * number)
    assert estimate.pose is not None
    assert estimate.pose.distance(START.point) < 50.0


@pytest.mark.parametrize("age", [0.5, 1.0, 2.0])
def test_a_position_that_is_late_is_refused_at_speed(age: float) -> None:
    """Issue 16: a navigation position 2 s late misled the drive."""
    estimate = settled()
    way = [START]
    for number in range(300):
        way.append(way[-1].moved(8.0, 0.0))
        estimate.moved(Odometry(8.0, 0.0), number / 100)
        if number % 60 == 0:
            assert estimate.corrected(seen(way[-1]), number / 100)
    assert not estimate.corrected(seen(way[-1 - round(100 * age)]), 3.0)
    assert estimate.pose == pytest.approx(way[-1], abs=0.1)


def test_a_robot_that_is_not_seen_any_more_knows_its_place_worse_than_its_wheels_say() -> None:
    def after_a_metre(begin: float) -> float:
        estimate = settled()
        for number in range(100):
            estimate.moved(Odometry(10.0, 0.0), begin + number / 100)
        return estimate.spread

    assert after_a_metre(10.0) ** 2 - after_a_metre(0.0) ** 2 == pytest.approx(2 * BUMPS**2, rel=0.01)


# How it finds back


@pytest.mark.parametrize("heading", [True, False])
@pytest.mark.parametrize("speed", [0.0, 4.0, 8.0])
def test_the_estimate_recovers_from_a_displacement_of_a_metre_within_two_seconds(speed: float, heading: bool) -> None:
    estimate = settled()
    truth = START._replace(x=2000.0, angle=START.angle - 40.0 * heading)
    for number in range(200):
        truth = truth.moved(speed, 0.3)
        estimate.moved(Odometry(speed, 0.3), number / 100)
        if number % 60 == 50:  # a position every 600 ms
            estimate.corrected(seen(truth) if heading else Fix(*truth.point), number / 100)
    assert estimate.pose is not None
    assert estimate.pose.distance(truth.point) < 10.0
    assert turn(estimate.pose.angle, truth.angle) == pytest.approx(0.0, abs=1.0)


def test_refused_positions_are_believed_when_enough_agree() -> None:
    estimate = settled()
    assert [estimate.corrected(ELSEWHERE, time) for time in TIMES] == [False, False, True]
    assert estimate.pose == pytest.approx(tuple(ELSEWHERE))


def test_positions_agree_only_when_a_robot_could_have_got_there_meanwhile() -> None:
    estimate = settled()
    assert [estimate.corrected(ELSEWHERE, 0.02 * number) for number in range(50)] == [False] * 50
    assert estimate.pose == pytest.approx(START)
    assert estimate.corrected(ELSEWHERE, 1.0)


def test_a_position_that_came_twice_is_one() -> None:
    estimate = Estimate(TUNING, START)
    assert [estimate.corrected(ELSEWHERE, time) for time in (0.0, 0.001, 0.1)] == [False, False, True]


def test_a_place_that_is_repeated_while_the_wheels_move_is_not_believed() -> None:
    estimate = settled()
    way = START
    for number in range(400):
        odometry = Odometry(8.0 if number < 100 else 0.0, 0.0)
        way = way.moved(*odometry)
        estimate.moved(odometry, number / 100)
        if number % 60 == 59:
            assert not estimate.corrected(seen(START), number / 100)
    assert estimate.pose == pytest.approx(way)


@pytest.mark.parametrize("speed", [50.0, 100.0])
def test_a_robot_that_is_pushed_on_and_on_is_followed(speed: float) -> None:
    estimate = settled()
    off = []
    for number in range(1, 21):
        place = Fix(START.x + speed * 0.6 * number, START.y, START.angle)
        estimate.corrected(place, 0.6 * number)
        assert estimate.pose is not None
        off.append(place.x - estimate.pose.x)
    assert max(off[3:]) <= speed * 0.6 * (AGREEING - 1) + 1, "as far as two positions are apart"


INTERRUPTIONS = [(seen(START), True, "a good one"), (Fix(500.0, 1500.0, 0.0), False, "another outlier")]


@pytest.mark.parametrize(("other", "believed", "what"), INTERRUPTIONS)
def test_a_position_that_does_not_agree_begins_the_count_anew(other: Fix, believed: bool, what: str) -> None:
    estimate = settled()
    for time in TIMES[:2]:
        assert not estimate.corrected(ELSEWHERE, time)
    assert estimate.corrected(other, 1.2) is believed, what
    assert [estimate.corrected(ELSEWHERE, 1.8 + time) for time in TIMES] == [False, False, True]


# Latency


@pytest.mark.parametrize(("told", "off"), [(0.3, (0.0, 0.5)), (0.15, (10.0, 60.0)), (0.0, (20.0, 150.0))])
def test_positions_of_a_known_latency_do_not_pull_a_moving_robot_back(told: float, off: tuple[float, float]) -> None:
    estimate = settled()
    way = [START]
    estimate.tuning = TUNING._replace(latency=told, gate=1.0)
    for number in range(400):
        way.append(way[-1].moved(3.0, 0.5))
        estimate.moved(Odometry(3.0, 0.5), number / 100)
        if number % 60 == 59:
            assert estimate.corrected(seen(way[-31]), number / 100)
    assert estimate.pose is not None
    assert off[0] <= estimate.pose.distance(way[-1].point) <= off[1]


def test_a_first_position_of_a_known_latency_is_moved_along() -> None:
    estimate = Estimate(TUNING._replace(latency=0.3))
    way = [START]
    for number in range(100):
        way.append(way[-1].moved(3.0, 0.5))
        estimate.moved(Odometry(3.0, 0.5), number / 100)
    assert estimate.corrected(seen(way[-31]), 0.99)
    assert estimate.pose == pytest.approx(way[-1])


def test_a_position_from_before_the_wheels_moved_needs_no_history() -> None:
    estimate = Estimate(TUNING._replace(latency=LONGEST_LATENCY), START)
    assert estimate.corrected(seen(START), 0.0)
    assert estimate.pose == pytest.approx(START)


# That it is worth having

DT = 0.01


class Squares:
    """Squared errors of the place, mm2, by who was off."""

    def __init__(self) -> None:
        self.filter = self.beacons = self.wheels = 0.0

    def add(self, estimate: Estimate, fix: Fix, reckoned: Pose, truth: Pose) -> None:
        assert estimate.pose is not None
        self.filter += estimate.pose.distance(truth.point) ** 2
        self.beacons += truth.distance(Pose(*fix[:2], 0.0).point) ** 2
        self.wheels += reckoned.distance(truth.point) ** 2


def tour(seed: int, noise: float, squares: Squares) -> None:
    """Drive up and down for 45 s, with wheels and beacons that are off, a position every 600 ms."""
    chance = random.Random(seed)
    scale, bias = chance.gauss(1.0, 0.01), chance.gauss(1.0, 0.004)
    begin = Pose(1500.0, 1000.0, 0.0)
    truth = Pose(chance.gauss(begin.x, 3.0), chance.gauss(begin.y, 3.0), chance.gauss(begin.angle, 0.5))
    estimate = Estimate(TUNING._replace(navigation=noise), begin)
    reckoned = begin
    for number in range(1, 4501):
        odometry = Odometry(6.0, 0.0) if number % 150 < 100 else Odometry(0.0, 2.7)
        truth = truth.moved(scale * odometry.distance, bias * odometry.turn)
        reckoned = reckoned.moved(*odometry)
        estimate.moved(odometry, number * DT)
        if number % 60 == 0:
            x, y = round(chance.gauss(truth.x, noise)), round(chance.gauss(truth.y, noise))
            fix = Fix(x, y, round(chance.gauss(truth.angle, 1.0)))
            estimate.corrected(fix, number * DT)
            squares.add(estimate, fix, reckoned, truth)


@pytest.mark.long
@pytest.mark.parametrize("noise", [0.0, 5.0, 30.0, 60.0])
def test_the_estimate_is_better_than_beacons_alone_and_than_wheels_alone(noise: float) -> None:
    squares = Squares()
    for seed in range(10):
        tour(seed, noise, squares)
    assert math.sqrt(squares.filter) < 0.95 * math.sqrt(min(squares.beacons, squares.wheels))


Place = tuple[int | None, int | None]
UNKNOWN: Place = (None, None)
HERE, NEAR, FAR, FAR_TOO = (1000, 1000), (1000 + int(SPREAD), 1000), (2500, 300), (2510, 300)
DRIVEN = (1000 + int(SPREAD + 0.5 * TOP_SPEED), 1000)

CASES: list[tuple[list[Place], Place | None, float, str]] = [
    ([], None, 0.0, "never seen"),
    ([UNKNOWN], None, 0.0, "not seen"),
    ([FAR], FAR, 0.0, "the first place: there is none to doubt it by"),
    ([HERE, UNKNOWN], HERE, 0.0, "not seen now, but a moment ago"),
    ([HERE, DRIVEN], DRIVEN, 0.5, "as far as a robot can have driven"),
    ([HERE, (DRIVEN[0] + 1, 1000)], HERE, 0.0, "further than that"),
    ([HERE, FAR, NEAR], NEAR, 1.0, "an outlier, and it is seen again"),
    ([HERE, FAR, FAR_TOO], FAR_TOO, 1.0, "two that agree: it was put there"),
    ([HERE, FAR, UNKNOWN, FAR_TOO], FAR_TOO, 1.5, "unknown between them"),
    ([HERE, FAR, HERE, FAR], HERE, 1.0, "a good one between two outliers: the doubt has ended"),
]


@pytest.mark.parametrize(("places", "expected", "time", "why"), CASES)
def test_where_a_robot_is_believed_to_be(places: list[Place], expected: Place | None, time: float, why: str) -> None:
    track = Track()
    for number, (x, y) in enumerate(places):
        track.saw(Sighting(Enemy1PositionResponse(x, y, None, Source.ENEMY_1), 0.5 * number))
    assert track.last == (None if expected is None else (expected, time)), why
