"""The Kalman filter: against a filter of numerical Jacobians, whether it is as sure as it may be, its gate."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Sequence
from typing import TypeAlias

import pytest

from eurobot_od.robot.model.places import Pose, turn
from eurobot_od.robot.nodes.estimate import Belief, Travel, Tuning, Variances, chance_up_to
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.nodes.navigation import Fix
from tests.robot.nodes.harness import TUNING

Vector: TypeAlias = list[float]
Matrix: TypeAlias = list[Vector]

START = Pose(1000.0, 700.0, 350.0)
STILL = Travel(0.0, 0.0, 0.0)


def near(pose: Pose, variances: Variances, chance: random.Random) -> Pose:
    place, angle = map(math.sqrt, variances)
    return Pose(chance.gauss(pose.x, place), chance.gauss(pose.y, place), chance.gauss(pose.angle, angle))


def begun(pose: Pose = START, tuning: Tuning = TUNING) -> Belief:
    return Belief.at(pose, tuning.placement_variances, tuning.scale)


# A filter as textbooks have it: numerical Jacobians, one inverse matrix, no thought of what is zero


def product(first: Matrix, second: Matrix) -> Matrix:
    return [[sum(a * b for a, b in zip(row, column)) for column in zip(*second)] for row in first]


def transposed(matrix: Matrix) -> Matrix:
    return [list(column) for column in zip(*matrix)]


def total(first: Matrix, second: Matrix, sign: int = 1) -> Matrix:
    return [[a + sign * b for a, b in zip(*rows)] for rows in zip(first, second)]


def diagonal(values: Sequence[float]) -> Matrix:
    return [[value if i == j else 0.0 for j in range(len(values))] for i, value in enumerate(values)]


def inverse(matrix: Matrix) -> Matrix:
    size = len(matrix)
    rows = [row + unit for row, unit in zip([list(row) for row in matrix], diagonal([1.0] * size))]
    for i in range(size):
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for j in set(range(size)) - {i}:
            rows[j] = [value - rows[j][i] * pivot for value, pivot in zip(rows[j], rows[i])]
    return [row[size:] for row in rows]


def jacobian(function: Callable[[Vector], Vector], at: Vector) -> Matrix:
    columns = []
    for i, step in enumerate((1e-3, 1e-3, 1e-4, 1e-6)):
        there, back = ([value + sign * step * (i == j) for j, value in enumerate(at)] for sign in (1, -1))
        columns.append([(a - b) / (2 * step) for a, b in zip(function(there), function(back))])
    return transposed(columns)


def driven(state: Vector, odometry: Odometry) -> Vector:
    """Follow an arc with the heading of its middle."""
    x, y, heading, scale = state
    bend = math.radians(odometry.turn)
    chord = scale * odometry.distance * (math.sin(bend / 2) / (bend / 2) if bend else 1.0)
    middle = math.radians(heading) + bend / 2
    return [x + chord * math.cos(middle), y + chord * math.sin(middle), heading + odometry.turn, scale]


class Textbook:
    """An extended Kalman filter that keeps its way, so that it can look back."""

    def __init__(self, belief: Belief) -> None:
        self.state = [*belief.pose, belief.scale]
        self.covariance: Matrix = [list(row) for row in belief.covariance]

    def move(self, odometry: Odometry, tuning: Tuning) -> None:
        jacobi = jacobian(lambda state: driven(state, odometry), self.state)
        x, y, *_ = self.state
        self.state = driven(self.state, odometry)
        way = math.atan2(self.state[1] - y, self.state[0] - x)
        metres, turns = abs(odometry.distance) / 1000, abs(odometry.turn) / 360
        noises = [tuning.distance**2 * metres, tuning.drift**2 * metres + tuning.turning**2 * turns]
        ways = [[math.cos(way), 0.0], [math.sin(way), 0.0], [0.0, 1.0], [0.0, 0.0]]
        noise = product(product(ways, diagonal(noises)), transposed(ways))
        self.covariance = total(product(product(jacobi, self.covariance), transposed(jacobi)), noise)

    def correct(self, fix: Fix, since: Odometry, tuning: Tuning) -> float:
        """Take in a position from before a movement; return the square of its Mahalanobis distance."""
        parts = 2 if fix.angle is None else 3
        place, angle = tuning.fix_variances

        def seen(state: Vector) -> Vector:
            x, y, heading, scale = state
            return driven([x, y, heading, scale], Odometry(-since.distance, -since.turn))[:parts]

        jacobi = jacobian(seen, self.state)
        expected = seen(self.state)
        innovation = [fix.x - expected[0], fix.y - expected[1]]
        innovation += [] if fix.angle is None else [turn(expected[2], fix.angle)]
        across = product(self.covariance, transposed(jacobi))
        spread = total(product(jacobi, across), diagonal([place, place, angle][:parts]))
        gain = product(across, inverse(spread))
        column = [[value] for value in innovation]
        self.state = [value + change for value, (change,) in zip(self.state, product(gain, column))]
        self.covariance = total(self.covariance, product(product(gain, jacobi), self.covariance), -1)
        return product(product([innovation], inverse(spread)), column)[0][0]


@pytest.mark.parametrize("seed", range(10))
def test_the_filter_agrees_with_one_of_numerical_jacobians(seed: int) -> None:
    chance = random.Random(seed)
    tuning = TUNING._replace(navigation=chance.uniform(0.0, 60.0), navigation_angle=chance.uniform(0.0, 5.0))
    belief = begun(tuning=tuning)
    other = Textbook(begun(tuning=tuning))
    for number in range(40):
        odometry = Odometry(chance.uniform(-60.0, 60.0), chance.choice([0.0, chance.uniform(-30.0, 30.0)]))
        belief = belief.moved(odometry, tuning)
        other.move(odometry, tuning)
        if number % 4 == 3:
            before = driven([*belief.pose, belief.scale], Odometry(-odometry.distance, -odometry.turn))
            x, y, angle = (chance.gauss(value, 5.0) for value in before[:3])
            fix = Fix(x, y, chance.choice([angle, None]))
            travel = Travel.between(Pose(0.0, 0.0, 0.0), Pose(0.0, 0.0, 0.0).moved(*odometry))
            belief, distance = belief.corrected(belief.compared(fix, travel, tuning))
            assert distance == pytest.approx(other.correct(fix, odometry, tuning), rel=1e-5)
        assert (*belief.pose[:2], belief.scale) == pytest.approx((*other.state[:2], other.state[3]), rel=1e-6)
        assert turn(belief.pose.angle, other.state[2]) == pytest.approx(0.0, abs=1e-6)
        for row, others in zip(belief.covariance, other.covariance):
            assert row == pytest.approx(others, rel=1e-4, abs=1e-8)


# Whether it is as sure as it may be


def surprise(belief: Belief, truth: Pose) -> float:
    """Return how far off an estimate is, squared, in terms of its own covariance (NEES)."""
    covariance = [list(row[:3]) for row in belief.covariance[:3]]
    errors = [[truth.x - belief.pose.x, truth.y - belief.pose.y, turn(belief.pose.angle, truth.angle)]]
    return product(product(errors, inverse(covariance)), transposed(errors))[0][0]


def wandered(seed: int, tuning: Tuning, positions: int) -> float:
    """Drive with wheels and beacons that are off as the tuning says; return how surprised the filter is in the end."""
    chance = random.Random(seed)
    truth = near(START, tuning.placement_variances, chance)
    belief = begun(tuning=tuning)
    scale = chance.gauss(1.0, tuning.scale)
    for number in range(1, 20 * positions + 1):
        odometry = Odometry(chance.uniform(0.0, 20.0), chance.uniform(-6.0, 6.0))
        metres, turns = odometry.distance / 1000, abs(odometry.turn) / 360
        distance = scale * odometry.distance + chance.gauss(0.0, tuning.distance * math.sqrt(metres))
        turned = odometry.turn + chance.gauss(0.0, math.sqrt(tuning.drift**2 * metres + tuning.turning**2 * turns))
        truth, belief = truth.moved(distance, turned), belief.moved(odometry, tuning)
        if number % 20 == 0:
            x, y, heading = map(round, near(truth, Variances(tuning.navigation**2, tuning.navigation_angle**2), chance))
            belief, _ = belief.corrected(belief.compared(Fix(x, y, heading), STILL, tuning))
    return surprise(belief, truth)


@pytest.mark.parametrize("navigation", [0.0, 5.0, 30.0, 60.0])
@pytest.mark.parametrize("positions", [1, 8])
def test_the_errors_of_the_filter_match_its_variance(navigation: float, positions: int) -> None:
    """The mean of 100 runs of a chi-square of 3 degrees of freedom: 95 % of them lie within 0.48 of 3."""
    tuning = TUNING._replace(navigation=navigation)
    mean = sum(wandered(seed, tuning, positions) for seed in range(100)) / 100
    assert mean == pytest.approx(3.0, abs=0.48)


# The gate

QUANTILES = [  # of chi-square, from tables: degrees of freedom, chance, value
    (2, 0.5, 1.3863),
    (2, 0.95, 5.9915),
    (2, 0.999, 13.8155),
    (3, 0.5, 2.3660),
    (3, 0.95, 7.8147),
    (3, 0.999, 16.2662),
    (3, 0.0, 0.0),
    (2, 1.0, 1e9),
    (3, 1.0, 1e9),
]


@pytest.mark.parametrize(("values", "chance", "distance"), QUANTILES)
def test_the_chance_of_a_distance(values: int, chance: float, distance: float) -> None:
    assert chance_up_to(distance, values) == pytest.approx(chance, abs=1e-5)


@pytest.mark.parametrize("heading", [True, False])
def test_as_many_right_positions_are_refused_as_the_gate_says(heading: bool) -> None:
    chance = random.Random(1)
    gate = 0.9
    refused = 0
    for _ in range(1000):
        truth = near(START, TUNING.placement_variances, chance)
        x, y, seen = near(truth, TUNING.fix_variances, chance)
        observations = begun().compared(Fix(x, y, seen if heading else None), STILL, TUNING)
        refused += chance_up_to(begun().corrected(observations)[1], len(observations)) > gate
    assert refused / 1000 == pytest.approx(1 - gate, abs=0.03)  # three standard deviations


# Single cases

BLENDS = [
    (Variances(0.0, 0.0), Fix(1100.0, 800.0, 10.0), START, "who is sure is not corrected"),
    (Variances(1e12, 1e12), Fix(1100.0, 800.0, 10.0), Pose(1100.0, 800.0, 10.0), "who knows nothing takes it whole"),
    (TUNING.fix_variances, Fix(1100.0, 800.0, 10.0), Pose(1050.0, 750.0, 0.0), "half way, the heading through zero"),
    (TUNING.fix_variances, Fix(1100.0, 800.0), Pose(1050.0, 750.0, 350.0), "no heading, heading kept"),
    (TUNING.fix_variances, Fix(1000.0, 700.0, 310.0), Pose(1000.0, 700.0, 330.0), "the other way round"),
]


@pytest.mark.parametrize(("variances", "fix", "expected", "why"), BLENDS)
def test_a_position_weighs_by_its_variance(variances: Variances, fix: Fix, expected: Pose, why: str) -> None:
    belief = Belief.at(START, variances, 0.0)
    corrected, _ = belief.corrected(belief.compared(fix, STILL, TUNING))
    assert corrected.pose == pytest.approx(expected, abs=1e-3), why


def test_the_filter_learns_the_scale_of_the_wheels() -> None:
    belief = begun()
    truth = START
    for number in range(1, 201):
        belief = belief.moved(Odometry(50.0, 9.0), TUNING)
        truth = truth.moved(50.0 * 0.97, 9.0)
        if number % 10 == 0:
            belief, _ = belief.corrected(belief.compared(Fix(*truth), STILL, TUNING))
    assert belief.scale == pytest.approx(0.97, abs=0.005)


def test_the_least_certain_direction_is_the_one_not_measured() -> None:
    """After a long way along x nothing is known as badly as y, by the heading's error at the start."""
    deviations = begun(Pose(0.0, 0.0, 0.0)).moved(Odometry(2000.0, 0.0), TUNING).deviations
    assert deviations.y == pytest.approx(math.hypot(10.0, 2000.0 * math.radians(2.0)), rel=1e-3)
    assert deviations.x < deviations.y <= deviations.worst
    diagonal_way = begun(Pose(0.0, 0.0, 45.0)).moved(Odometry(2000.0, 0.0), TUNING).deviations
    assert diagonal_way.worst == pytest.approx(deviations.worst)
