"""Laws of routes and motions: forced barriers are never crossed, gotos arrive, the remaining time falls."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.places import Point, Pose, normalise, turn
from eurobot_od.robot.model.robot_file import Barrier
from eurobot_od.robot.model.values import Barriers, Passage
from eurobot_od.robot.nodes.motion import (
    AT_REST,
    Clearances,
    IdealChassis,
    Motion,
    MotionLimits,
    WheelCommand,
    find_route,
)

FACTS = robot_file.read()

CLEARANCES = Clearances(FACTS, {"fire": 200.0, "pool": 240.0}, edge=100.0)
LIMITS = MotionLimits(800.0, 1200.0, 2400.0, 240.0, 720.0, 5.0, 1.0)
DT = 0.01
REQUESTED = 10
"""Steps between two state requests: 100 ms."""
SLOWEST = 30_000
"""Steps after which a motion has failed to arrive."""

angles = st.floats(-720.0, 720.0)
points = st.builds(Point, st.floats(0.0, FACTS.field.width), st.floats(0.0, FACTS.field.height))
poses = st.builds(Pose, st.floats(0.0, FACTS.field.width), st.floats(0.0, FACTS.field.height), st.floats(0.0, 359.0))
flags = st.builds(Barriers, st.integers(0, 0xFFFF))
ways = st.lists(points, min_size=1, max_size=3)
speeds = st.integers(20, 100)
rollings = st.one_of(
    st.just(AT_REST),
    st.builds(WheelCommand, st.floats(-800.0, 800.0), st.just(0.0)),
    st.builds(WheelCommand, st.just(0.0), st.floats(-240.0, 240.0)),
)
"""What the wheels were told before: a robot that drives straight or turns."""


def distances(start: Point, end: Point, barrier: Barrier) -> Iterator[float]:
    """Yield the distance of places on the leg from the barrier's centre, one every 2 mm at most."""
    steps = max(1, math.ceil(math.dist(start, end) / 2.0))
    for step in range(steps + 1):
        share = step / steps
        place = (start.x + share * (end.x - start.x), start.y + share * (end.y - start.y))
        yield math.dist(place, (barrier.x, barrier.y))


def length(start: Point, route: tuple[Point, ...]) -> float:
    return sum(math.dist(*leg) for leg in itertools.pairwise((start, *route)))


@given(points, points, flags)
def test_a_route_never_crosses_a_forced_barrier(start: Point, goal: Point, barriers: Barriers) -> None:
    route = find_route(start, goal, barriers, CLEARANCES)
    assume(route is not None)
    assert route is not None
    for barrier in (barrier for barrier in FACTS.barriers if barriers.passage(barrier.number) is Passage.FORCED):
        allowed = min(CLEARANCES.around(barrier), math.dist(start, (barrier.x, barrier.y)))
        for leg in itertools.pairwise((start, *route)):
            assert min(distances(*leg, barrier)) >= allowed - 1e-3


@given(points, points, flags)
def test_there_is_a_way_unless_the_goal_is_in_a_forced_barrier(start: Point, goal: Point, barriers: Barriers) -> None:
    """With these clearances the barriers never close the field."""
    forced = [barrier for barrier in FACTS.barriers if barriers.passage(barrier.number) is Passage.FORCED]
    blocked = any(math.dist(goal, (barrier.x, barrier.y)) < CLEARANCES.around(barrier) - 1e-3 for barrier in forced)
    assume(blocked or all(math.dist(goal, (barrier.x, barrier.y)) > CLEARANCES.around(barrier) for barrier in forced))
    assert (find_route(start, goal, barriers, CLEARANCES) is None) == blocked


@given(points, points, flags)
def test_a_route_ends_at_the_goal_and_bends_inside_the_field(start: Point, goal: Point, barriers: Barriers) -> None:
    route = find_route(start, goal, barriers, CLEARANCES)
    assume(route is not None)
    assert route is not None
    assert route[-1] == goal
    for point in route[:-1]:
        assert CLEARANCES.edge <= point.x <= FACTS.field.width - CLEARANCES.edge
        assert CLEARANCES.edge <= point.y <= FACTS.field.height - CLEARANCES.edge


@given(points, points, flags)
def test_no_route_is_shorter_than_the_straight_line(start: Point, goal: Point, barriers: Barriers) -> None:
    route = find_route(start, goal, barriers, CLEARANCES)
    assume(route is not None)
    assert route is not None
    assert length(start, route) >= math.dist(start, goal) - 1e-6


@given(points, points, flags)
def test_there_and_back_are_equally_long(start: Point, goal: Point, barriers: Barriers) -> None:
    """Outside all discs; from inside one there is a way, into a forced one there is none."""
    for barrier in FACTS.barriers:
        assume(min(math.dist(end, (barrier.x, barrier.y)) for end in (start, goal)) > CLEARANCES.around(barrier))
    there, back = (find_route(*ends, barriers, CLEARANCES) for ends in ((start, goal), (goal, start)))
    assert there is not None
    assert back is not None
    assert length(start, there) == pytest.approx(length(goal, back), abs=0.01)


def estimates_until_arrival(motion: Motion, pose: Pose) -> tuple[Pose, list[float]]:
    """Drive without disturbance; return where the robot ends and the remaining times before each step and after."""
    chassis = IdealChassis()
    estimates = [motion.remaining(pose)]
    while not motion.arrived and len(estimates) < SLOWEST:
        pose = pose.moved(*chassis.advance(motion.step(pose, DT), DT))
        estimates.append(motion.remaining(pose))
    return pose, estimates


@given(poses, ways, angles, speeds, st.booleans())
def test_a_goto_arrives(start: Pose, way_points: list[Point], angle: float, speed: int, backward: bool) -> None:
    pose, estimates = estimates_until_arrival(Motion(LIMITS, way_points, angle, speed, backward), start)
    assert pose.distance(way_points[-1]) <= LIMITS.position_tolerance
    assert abs(turn(pose.angle, angle)) <= LIMITS.angle_tolerance
    assert estimates[-1] == 0.0


@given(poses, ways, angles, speeds, st.booleans(), rollings)
def test_the_remaining_time_is_honest_and_falls(
    start: Pose, way_points: list[Point], angle: float, speed: int, backward: bool, rolling: WheelCommand
) -> None:
    """At every state request within 10 % of the truth, or 100 ms.

    Legs of a few millimetres are left out: whether they are driven or count as passed hangs on a hair.
    """
    standing = LIMITS.standing(start, rolling).point
    assume(all(math.dist(*leg) > 100.0 for leg in itertools.pairwise((standing, *way_points))))
    motion = Motion(LIMITS, way_points, angle, speed, backward, rolling)
    _, estimates = estimates_until_arrival(motion, start)
    told = estimates[::REQUESTED]
    for number, seconds in enumerate(told):
        truth = DT * (len(estimates) - 1 - number * REQUESTED)
        assert seconds == pytest.approx(truth, rel=0.1, abs=0.1)
    assert all(later <= earlier + 0.05 for earlier, later in itertools.pairwise(told))


@given(angles, angles)
def test_turning_by_the_shortest_turn_arrives(start: float, end: float) -> None:
    assert -180.0 < turn(start, end) <= 180.0
    assert 0.0 <= normalise(start) < 360.0
    assert turn(start + turn(start, end), end) == pytest.approx(0.0, abs=1e-9)
