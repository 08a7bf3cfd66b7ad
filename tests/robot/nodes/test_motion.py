"""The drive's motion: where it arrives, what the wheels are told on the way, how honest the remaining time is."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Callable, Iterator

import pytest

from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.places import Point, Pose, normalise, turn
from eurobot_od.robot.model.values import Barriers, Passage
from eurobot_od.robot.nodes.estimate import Estimate
from eurobot_od.robot.nodes.motion import (
    AT_REST,
    Braking,
    Clearances,
    Disc,
    IdealChassis,
    Motion,
    MotionLimits,
    Odometry,
    Profile,
    WheelCommand,
    find_route,
    with_fewer_stops,
)
from eurobot_od.robot.nodes.navigation import Fix
from tests.robot.nodes.harness import TUNING

LIMITS = MotionLimits(
    maximum_speed=800.0,
    acceleration=1200.0,
    braking=2400.0,
    turn_rate=240.0,
    turn_acceleration=720.0,
    position_tolerance=5.0,
    angle_tolerance=1.0,
)
DT = 0.01
START = Pose(1000.0, 1000.0, 0.0)
PATIENCE = 20_000
"""Steps, more than three minutes of driving: whoever takes longer does not arrive."""


def undisturbed(pose: Pose) -> Pose:
    return pose


def drive(
    motion: Motion, start: Pose, disturb: Callable[[Pose], Pose] = undisturbed
) -> Iterator[tuple[Pose, WheelCommand]]:
    """Yield the pose after each step and the command that led there, until the motion has arrived."""
    pose = start
    chassis = IdealChassis()
    for _ in range(PATIENCE):
        command = motion.step(pose, DT)
        pose = pose.moved(*chassis.advance(command, DT))
        yield pose, command
        if motion.arrived:
            return
        pose = disturb(pose)
    pytest.fail(f"still at {pose}")


def jumps(generator: random.Random, size: float, count: int) -> Callable[[Pose], Pose]:
    """Return a disturbance: up to `count` times, now and then, the pose is corrected by up to `size` mm."""
    pending = list(range(count))

    def disturb(pose: Pose) -> Pose:
        if generator.random() > 0.05 or not pending:
            return pose
        pending.pop()
        direction, distance = generator.uniform(0.0, math.tau), generator.uniform(0.0, size)
        x, y = pose.x + distance * math.cos(direction), pose.y + distance * math.sin(direction)
        return Pose(x, y, normalise(pose.angle + generator.uniform(-2.0, 2.0)))

    return disturb


# Arrival

GOTOS = [
    ([Point(2000.0, 1000.0)], 0.0, 100),  # straight on
    ([Point(0.0, 1000.0)], 0.0, 100),  # behind
    ([Point(1000.0, 1900.0)], 180.0, 60),
    ([Point(2000.0, 1000.0), Point(2000.0, 1500.0), Point(500.0, 1500.0)], 270.0, 80),  # round two corners
    ([Point(1030.0, 1010.0)], 90.0, 100),  # near
    ([Point(1000.0, 1006.0)], 0.0, 100),  # just outside the tolerance, and aside
    ([START.point], 123.0, 100),  # only a turn
    ([START.point], 0.0, 100),  # nothing to do
    ([Point(1010.0, 1010.0), Point(1060.0, 1000.0), Point(1040.0, 990.0)], 45.0, 100),  # way points close together
    ([Point(1100.0, 1000.0)], 359.0, 1),  # slowly
]


@pytest.mark.parametrize("backward", [False, True])
@pytest.mark.parametrize(("way_points", "angle", "speed"), GOTOS)
def test_arrives_within_the_tolerances_after_the_time_that_it_says(
    way_points: list[Point], angle: float, speed: int, backward: bool
) -> None:
    motion = Motion(LIMITS, way_points, angle, speed, backward)
    first = motion.remaining(START)
    steps = [(pose, command, motion.remaining(pose)) for pose, command in drive(motion, START)]
    pose, command, _ = steps[-1]
    assert pose.distance(way_points[-1]) <= LIMITS.position_tolerance
    assert abs(turn(pose.angle, angle)) <= LIMITS.angle_tolerance
    assert command == motion.command == AT_REST
    assert first == pytest.approx(DT * len(steps), rel=0.05, abs=0.1)
    remaining = [first, *(left for _, _, left in steps)]
    assert all(later <= earlier for earlier, later in itertools.pairwise(remaining))
    assert remaining[-1] == 0.0


def test_after_arrival_nothing_moves_any_more() -> None:
    motion = Motion(LIMITS, [START.point], 0.0, 100)
    list(drive(motion, START))
    assert motion.step(Pose(0.0, 0.0, 90.0), DT) == AT_REST
    assert motion.arrived


@pytest.mark.parametrize(("backward", "sign"), [(False, 1), (True, -1)])
def test_drives_nose_or_tail_first_as_told(backward: bool, sign: int) -> None:
    motion = Motion(LIMITS, [Point(2000.0, 1300.0)], 0.0, 100, backward)
    assert all(command.speed * sign >= 0.0 for _, command in drive(motion, START))


@pytest.mark.parametrize(("x", "sign"), [(1030.0, 1), (970.0, -1)])
def test_a_correction_is_driven_without_turning_round(x: float, sign: int) -> None:
    motion = Motion(LIMITS, [Point(x, 1000.0)], 0.0, 100)
    commands = [command for _, command in drive(motion, START)]
    assert all(command.speed * sign >= 0.0 for command in commands)
    assert all(command.turn == pytest.approx(0.0, abs=1e-6) for command in commands)


def test_way_points_are_driven_straight_and_not_cut() -> None:
    corner = Point(2000.0, 1000.0)
    motion = Motion(LIMITS, [corner, Point(2000.0, 1800.0)], 90.0, 100)
    poses = [pose for pose, _ in drive(motion, START)]
    assert min(pose.distance(corner) for pose in poses) < 1.0
    assert all(abs(pose.y - 1000.0) < 1.0 or abs(pose.x - 2000.0) < 1.0 for pose in poses)


# Limits


@pytest.mark.parametrize("speed", [10, 50, 100])
def test_rates_and_accelerations_stay_within_the_limits(speed: int) -> None:
    motion = Motion(LIMITS, [Point(2000.0, 1300.0), Point(300.0, 300.0)], 45.0, speed)
    before = AT_REST
    for _, command in drive(motion, START):
        faster = abs(command.speed) - abs(before.speed)
        assert abs(command.speed) <= LIMITS.maximum_speed * speed / 100 + 1e-6
        assert abs(command.turn) <= LIMITS.turn_rate * speed / 100 + 1e-6
        assert -LIMITS.braking * DT - 1e-6 <= faster <= LIMITS.acceleration * DT + 1e-6
        assert abs(command.turn - before.turn) <= LIMITS.turn_acceleration * DT + 1e-6
        before = command


def test_speed_zero_does_not_move_and_never_arrives() -> None:
    motion = Motion(LIMITS, [Point(2000.0, 1300.0)], 45.0, 0)
    assert {motion.step(START, DT) for _ in range(100)} == {AT_REST}
    assert motion.remaining(START) == math.inf
    assert not motion.arrived


# A moving robot is taken over by a new goto

TAKEOVERS = [
    ([Point(2000.0, 1000.0)], False, WheelCommand(800.0, 0.0)),  # straight on
    ([Point(2000.0, 1000.0)], False, WheelCommand(-800.0, 0.0)),  # comes back
    ([Point(0.0, 1000.0)], False, WheelCommand(800.0, 0.0)),  # has to turn round
    ([Point(0.0, 1000.0)], True, WheelCommand(800.0, 0.0)),  # changes over to tail first
    ([Point(1020.0, 1000.0)], False, WheelCommand(800.0, 0.0)),  # cannot stop in time
    ([Point(1500.0, 1500.0)], False, WheelCommand(0.0, -240.0)),  # is turning the other way
    ([Point(1500.0, 1500.0)], False, WheelCommand(400.0, 120.0)),  # is in a curve
    (
        [Point(200.0, 1070.0)],
        False,
        WheelCommand(0.0, -200.0),
    ),  # is turning the other way, which becomes the shorter one
]


@pytest.mark.parametrize(("way_points", "backward", "rolling"), TAKEOVERS)
def test_a_new_goto_takes_over_without_a_jerk(way_points: list[Point], backward: bool, rolling: WheelCommand) -> None:
    motion = Motion(LIMITS, way_points, 90.0, 100, backward, rolling)
    remaining = motion.remaining(START)
    steps = list(drive(motion, START))
    first = steps[0][1]
    assert abs(first.speed - rolling.speed) <= LIMITS.braking * DT + 1e-6
    assert abs(first.turn - rolling.turn) <= LIMITS.turn_acceleration * DT + 1e-6
    assert steps[-1][0].distance(way_points[-1]) <= LIMITS.position_tolerance
    assert remaining == pytest.approx(DT * len(steps), rel=0.1, abs=0.1), "what is rolling counts"


def test_a_robot_that_rolls_away_comes_back_from_where_it_stops() -> None:
    behind, stopping = [Point(0.0, 1000.0)], 800.0 / LIMITS.braking
    there = START.moved(800.0 * stopping / 2, 0.0)
    left = Motion(LIMITS, behind, 90.0, 100, False, WheelCommand(800.0, 0.0)).remaining(START)
    assert left == pytest.approx(stopping + Motion(LIMITS, behind, 90.0, 100).remaining(there), abs=0.01)


def test_a_goto_repeated_on_the_way_does_not_stop_the_robot() -> None:
    motion = Motion(LIMITS, [Point(2000.0, 1020.0)], 0.0, 100, rolling=WheelCommand(800.0, 0.0))
    poses_and_commands = list(drive(motion, START))
    fast = [command.speed for pose, command in poses_and_commands if pose.x < 1800.0]
    assert min(fast) == pytest.approx(800.0)


# Corrections of the pose on the way


@pytest.mark.parametrize("seed", range(20))
def test_arrives_although_the_pose_jumps(seed: int) -> None:
    generator = random.Random(seed)
    goal = Point(generator.uniform(100.0, 2900.0), generator.uniform(100.0, 1900.0))
    motion = Motion(LIMITS, [Point(1500.0, 200.0), goal], 30.0, 100, backward=seed % 2 == 0)
    pose, _ = list(drive(motion, START, jumps(generator, size=30.0, count=20)))[-1]
    assert pose.distance(goal) <= LIMITS.deviation
    assert abs(turn(pose.angle, 30.0)) <= LIMITS.angle_tolerance


@pytest.mark.parametrize("aside", [-30.0, -12.0, 12.0, 30.0])
@pytest.mark.parametrize("left", [20.0, 100.0, 400.0])
def test_one_jump_aside_shortly_before_the_goal_is_driven_again(left: float, aside: float) -> None:
    goal = Point(2000.0, 1000.0)
    pending = [Pose(0.0, aside, 0.0)]

    def once(pose: Pose) -> Pose:
        if goal.x - pose.x > left or not pending:
            return pose
        return pose._replace(y=pose.y + pending.pop().y)

    pose, _ = list(drive(Motion(LIMITS, [goal], 0.0, 100), START, once))[-1]
    assert not pending
    assert pose.distance(goal) <= LIMITS.deviation


def test_a_jump_during_the_final_turn_is_driven_again() -> None:
    pending = [30.0]

    def once(pose: Pose) -> Pose:
        return pose.moved(pending.pop(), 0.0) if pending and pose.angle > 45.0 else pose

    pose, _ = list(drive(Motion(LIMITS, [START.point], 90.0, 100), START, once))[-1]
    assert not pending
    assert pose.distance(START.point) <= LIMITS.deviation


@pytest.mark.parametrize("seed", range(5))
def test_arrives_with_slipping_wheels_and_noisy_navigation(seed: int) -> None:
    """Wheels 2 % short, navigation off by 5 mm and 1 degree as in document Table 2, every 100 ms."""
    generator = random.Random(seed)
    estimate = Estimate(TUNING, START)
    truth = START
    goal = Point(2500.0, 400.0)
    motion = Motion(LIMITS, [goal], 180.0, 100)
    for number in range(PATIENCE):
        assert estimate.pose is not None
        speed, rate = motion.step(estimate.pose, DT)
        truth = truth.moved(0.98 * speed * DT, 0.98 * rate * DT)
        estimate.moved(Odometry(speed * DT, rate * DT), number * DT)
        if motion.arrived:
            break
        if number % 10 == 0:
            x, y, angle = (generator.gauss(value, sigma) for value, sigma in zip(truth, (5.0, 5.0, 1.0)))
            estimate.corrected(Fix(x, y, angle), number * DT)
    assert motion.arrived
    assert truth.distance(goal) <= 25.0


# Remaining time


def test_remaining_time_rises_when_the_robot_is_set_back() -> None:
    motion = Motion(LIMITS, [Point(2000.0, 1000.0)], 0.0, 100)
    steps = drive(motion, START)
    pose = next(pose for pose, _ in steps if pose.x > 1800.0)
    assert motion.remaining(pose._replace(x=1000.0)) > motion.remaining(pose) + 0.5


PROFILE = Profile(top=800.0, rise=1200.0, fall=2400.0, tolerance=5.0)
SECONDS = [
    (0.0, 0.0, 0.0),  # there
    (100.0, 0.0, 0.5),  # up to 400 in 1/3 s, down in 1/6 s
    (-100.0, 0.0, 0.5),  # the same to the other side
    (800.0, 0.0, 1.5),  # 400 mm of ramps in 1 s, 400 mm at 800
    (400.0 / 3.0, 800.0, 1.0 / 3.0),  # just enough to stop
    (0.0, 400.0, 1.0 / 6.0 + 0.5 / math.sqrt(3.0)),  # stop 33 mm too late, come back
    (400.0 / 3.0, -800.0, 1.0 / 3.0 + math.sqrt(2.0 / 3.0)),  # stop, then 267 mm
    (1700.0 / 3.0, 1200.0, 1.0 / 6.0 + (1700.0 / 3.0 - 500.0 / 3.0 - 400.0 / 3.0) / 800.0 + 1.0 / 3.0),  # too fast
]


@pytest.mark.parametrize(("left", "rate", "expected"), SECONDS)
def test_seconds_of_a_trapezoidal_movement(left: float, rate: float, expected: float) -> None:
    assert PROFILE.seconds(left, rate) == pytest.approx(expected)


# Braking

ROLLING = [
    (AT_REST, 0),
    (WheelCommand(800.0, 0.0), 34),  # 1/3 s
    (WheelCommand(-800.0, 0.0), 34),
    (WheelCommand(0.0, 240.0), 34),  # 1/3 s
    (WheelCommand(240.0, -7.2), 10),
]


@pytest.mark.parametrize(("rolling", "steps"), ROLLING)
def test_braking_ends_at_rest_after_the_shortest_time(rolling: WheelCommand, steps: int) -> None:
    braking = Braking(LIMITS, rolling)
    commands = [rolling]
    while braking.command != AT_REST:
        commands.append(braking.step(START, DT))
    assert len(commands) - 1 == pytest.approx(steps, abs=1)
    assert commands[-1] == AT_REST
    for before, after in itertools.pairwise(commands):
        assert abs(before.speed) - LIMITS.braking * DT - 1e-6 <= abs(after.speed) <= abs(before.speed)


def test_braking_starts_from_what_a_motion_told_last() -> None:
    motion = Motion(LIMITS, [Point(2500.0, 1000.0)], 0.0, 100)
    pose = next(pose for pose, command in drive(motion, START) if command.speed == LIMITS.maximum_speed)
    command = Braking(LIMITS, motion.command).step(pose, DT)
    assert command.speed == pytest.approx(LIMITS.maximum_speed - LIMITS.braking * DT)


FACTS = robot_file.read()

USUAL = Clearances(FACTS, {"fire": 200.0, "pool": 240.0}, edge=100.0)
WIDE = Clearances(FACTS, {"fire": 420.0, "pool": 420.0}, edge=200.0)
"""So wide that fires 1 and 5 and the pool between them close the field from edge to edge."""

LEFT, RIGHT = Point(200.0, 900.0), Point(1500.0, 900.0)
ALL = range(1, 9)


def flags(passage: Passage, *barriers: int | str) -> Barriers:
    return Barriers.of({each if isinstance(each, int) else FACTS.barrier(each).number: passage for each in barriers})


def length(start: Point, route: tuple[Point, ...] | None) -> float:
    assert route is not None
    return sum(math.dist(*leg) for leg in itertools.pairwise((start, *route)))


STRAIGHT = [
    (LEFT, RIGHT, Barriers(0)),  # nothing set
    (Point(200.0, 1850.0), Point(2800.0, 1850.0), flags(Passage.FORCED, *ALL)),  # along the upper edge, all set
    (Point(1500.0, 50.0), Point(1500.0, 1950.0), flags(Passage.FORCED, *ALL)),  # up the middle
    (Point(0.0, 0.0), Point(3000.0, 0.0), flags(Passage.FORCED, *ALL)),  # start and goal may be on the edge itself
    (LEFT, LEFT, flags(Passage.NORMAL, *ALL)),  # only to turn
    (LEFT, Point(900.0, 900.0), flags(Passage.NORMAL, "pool 1")),  # into a normal disc
    (Point(400.0, 850.0), Point(400.0, 300.0), flags(Passage.FORCED, "fire 3")),  # out of a forced one
    (Point(400.0, 900.0), Point(400.0, 300.0), flags(Passage.FORCED, "fire 3")),  # from its very centre
    (Point(699.9, 400.0), Point(699.9, 1400.0), flags(Passage.FORCED, "fire 1", "fire 5")),  # past discs, touching
]

BENT = [
    (Point(500.0, 400.0), Point(1300.0, 400.0), flags(Passage.NORMAL, "fire 5")),
    (Point(500.0, 400.0), Point(1300.0, 400.0), flags(Passage.FORCED, "fire 5")),
    (LEFT, RIGHT, flags(Passage.NORMAL, "fire 3", "pool 1")),
    (LEFT, RIGHT, flags(Passage.FORCED, *ALL)),
    (Point(380.0, 900.0), Point(600.0, 900.0), flags(Passage.FORCED, "fire 3")),  # leaves on the wrong side first
    (Point(0.0, 900.0), Point(800.0, 900.0), flags(Passage.FORCED, "fire 3")),  # from the edge
]

IMPOSSIBLE = [
    (LEFT, Point(900.0, 900.0), flags(Passage.FORCED, "pool 1"), USUAL),  # the goal is the pool
    (LEFT, Point(700.0, 900.0), flags(Passage.FORCED, "pool 1"), USUAL),  # or too near to it
    (Point(850.0, 900.0), Point(860.0, 900.0), flags(Passage.FORCED, "pool 1"), USUAL),  # even coming from inside
    (LEFT, RIGHT, flags(Passage.FORCED, "fire 1", "fire 5", "pool 1"), WIDE),  # the field is closed
]


@pytest.mark.parametrize(("start", "goal", "barriers"), STRAIGHT)
def test_a_clear_line_is_driven_straight(start: Point, goal: Point, barriers: Barriers) -> None:
    assert find_route(start, goal, barriers, USUAL) == (goal,)


@pytest.mark.parametrize(("start", "goal", "barriers"), BENT)
def test_a_barrier_in_the_way_is_driven_round(start: Point, goal: Point, barriers: Barriers) -> None:
    route = find_route(start, goal, barriers, USUAL)
    assert route is not None
    assert len(route) > 1
    assert route[-1] == goal
    assert start not in route


FITTING = Clearances.of(FACTS, radius=140.0, margin=20.0)
PLACES = [
    (Point(140.0, 1860.0), Barriers(0), True),  # it just fits between two edges: goals have no margin there
    (Point(139.0, 1000.0), Barriers(0), False),
    (Point(1000.0, 139.0), Barriers(0), False),
    (Point(2861.0, 1000.0), Barriers(0), False),
    (Point(1000.0, 1861.0), Barriers(0), False),
    (Point(900.0, 900.0 - 310.0), flags(Passage.FORCED, "pool 1"), True),  # off a pool of 150 mm by radius and margin
    (Point(900.0, 900.0 - 309.0), flags(Passage.FORCED, "pool 1"), False),
    (Point(900.0, 900.0 - 309.0), flags(Passage.NORMAL, "pool 1"), True),  # into a normal one
    (Point(900.0, 1400.0 + 241.0), flags(Passage.FORCED, "fire 1"), True),  # a fire's circle has 81 mm
    (Point(900.0, 1400.0 + 240.0), flags(Passage.FORCED, "fire 1"), False),
]


@pytest.mark.parametrize(("goal", "barriers", "fits"), PLACES)
def test_a_goal_is_where_the_robot_fits(goal: Point, barriers: Barriers, fits: bool) -> None:
    assert (find_route(Point(1500.0, 1000.0), goal, barriers, FITTING) is not None) is fits


def test_a_robot_that_stands_where_it_does_not_fit_may_leave() -> None:
    assert find_route(Point(50.0, 50.0), Point(1500.0, 1000.0), Barriers(0), FITTING) == (Point(1500.0, 1000.0),)


@pytest.mark.parametrize(("start", "goal", "barriers", "clearances"), IMPOSSIBLE)
def test_a_goal_without_a_way_is_not_possible(
    start: Point, goal: Point, barriers: Barriers, clearances: Clearances
) -> None:
    assert find_route(start, goal, barriers, clearances) is None


CORNER = Disc(Point(1500.0, 1000.0), 300.0, math.inf)
FROM, TO = Point(1000.0, 1150.0), Point(2000.0, 1150.0)
MEETING = Point(1500.0, 1350.0)


@pytest.mark.parametrize(
    ("discs", "edge", "stops"),
    [
        ([CORNER], 100.0, 2),
        ([CORNER, Disc(MEETING, 5.0, math.inf)], 100.0, 3),
        ([CORNER], FACTS.field.height - MEETING.y + 20.0, 3),
    ],
    ids=["round a corner", "something stands where the legs meet", "too near the border"],
)
def test_two_way_points_round_a_corner_become_one_where_that_is_free(
    discs: list[Disc], edge: float, stops: int
) -> None:
    clearances = Clearances(FACTS, {}, edge=edge)
    way = find_route(FROM, TO, Barriers(0), Clearances(FACTS, {}, edge=0.0), [CORNER])
    assert way is not None
    assert len(way) == 3
    fewer = with_fewer_stops((FROM, *way), discs, clearances)
    assert len(fewer) == stops
    assert fewer[-1] == TO
    assert not any(CORNER.meets(*leg) for leg in itertools.pairwise((FROM, *fewer)))


@pytest.mark.parametrize(
    "way",
    [
        [],
        [Point(500.0, 0.0)],
        [Point(500.0, 0.0), Point(600.0, 30.0), Point(800.0, 60.0)],
        [Point(100.0 * number, 0.0) for number in range(1, 9)],
    ],
    ids=len,
)
def test_legs_that_are_nearly_in_line_stay_as_they_are(way: list[Point]) -> None:
    assert with_fewer_stops((Point(0.0, 0.0), *way), [], Clearances(FACTS, {}, edge=0.0)) == tuple(way)


@pytest.mark.parametrize("y", [500.0, -50.0])
def test_a_leg_meets_a_disc_if_any_of_its_points_is_inside(y: float) -> None:
    disc = Disc(Point(0.0, y), 100.0, toll=0.0)
    generator = random.Random(1)
    met = []
    for _ in range(300):
        start, end = (Point(generator.uniform(-300.0, 300.0), y + generator.uniform(-300.0, 300.0)) for _ in range(2))
        shares = [number / 200 for number in range(201)]
        points = [Point(start.x + share * (end.x - start.x), start.y + share * (end.y - start.y)) for share in shares]
        if abs(min(math.dist(disc.centre, each) for each in points) - disc.radius) > 1.0:  # too near to sample
            met.append(disc.meets(start, end))
            assert met[-1] is any(map(disc.contains, points)), (start, end)
    assert 50 < sum(met) < len(met) - 50


@pytest.mark.parametrize(("speed", "x"), [(480.0, 1048.0), (0.0, 1000.0), (-480.0, 952.0)])
def test_the_braking_distance_is_that_of_the_braking_motion(speed: float, x: float) -> None:
    assert LIMITS.standing(START, WheelCommand(speed, 0.0)) == Pose(x, 1000.0, 0.0)


def test_normal_barriers_without_a_way_round_are_crossed() -> None:
    closed = flags(Passage.NORMAL, "fire 1", "fire 5", "pool 1")
    assert find_route(LEFT, RIGHT, closed, WIDE) is not None


def test_a_normal_barrier_is_crossed_rather_than_a_forced_one() -> None:
    forced = {FACTS.barrier(name).number: Passage.FORCED for name in ("fire 1", "pool 1")}
    closed = Barriers.of({**forced, FACTS.barrier("fire 5").number: Passage.NORMAL})
    route = find_route(LEFT, RIGHT, closed, WIDE)
    assert route is not None
    assert min(point.y for point in route) < 900.0 - WIDE.kinds["pool"]  # below the pool, where fire 5 stands
    assert max(point.y for point in route) <= 900.0


def test_both_bits_of_a_barrier_are_forced_too() -> None:
    assert find_route(LEFT, Point(900.0, 900.0), Barriers(0b11 << 12), USUAL) is None


def test_way_points_stay_off_the_edge() -> None:
    fire = FACTS.barrier("fire 3")
    narrow = Clearances(
        FACTS, {"fire": 310.0, "pool": 240.0}, edge=100.0
    )  # 90 mm are left between the disc and the edge
    route = find_route(Point(300.0, 300.0), Point(300.0, 1500.0), flags(Passage.FORCED, "fire 3"), narrow)
    assert route is not None
    assert all(point.x > fire.x for point in route[:-1])


def test_the_way_round_one_disc_is_hardly_longer_than_the_tangents() -> None:
    start, goal = Point(400.0, 400.0), Point(1400.0, 400.0)
    radius = USUAL.kinds["fire"]
    half = 500.0
    tangents = 2 * math.sqrt(half**2 - radius**2)
    arc = 2 * radius * math.asin(radius / half)
    found = length(start, find_route(start, goal, flags(Passage.FORCED, "fire 5"), USUAL))
    assert tangents + arc <= found <= 1.02 * (tangents + arc)


def test_the_gap_between_neighbours_is_used() -> None:
    """Between fire 5 and pool 1 60 mm remain for the robot's centre; the way through is the short one."""
    start, goal = Point(650.0, 630.0), Point(1150.0, 630.0)
    assert find_route(start, goal, flags(Passage.FORCED, *ALL), USUAL) == (goal,)
