"""The way round barriers: when it is straight, when it bends, when there is none."""

from __future__ import annotations

import itertools
import math

import pytest

from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import Barriers, Passage
from eurobot_od.robot.nodes.route import Clearances, find_route
from tests.rows import rows

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


@rows("start, goal, barriers", STRAIGHT)
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


@rows("goal, barriers, fits", PLACES)
def test_a_goal_is_where_the_robot_fits(goal: Point, barriers: Barriers, fits: bool) -> None:
    assert (find_route(Point(1500.0, 1000.0), goal, barriers, FITTING) is not None) is fits


def test_a_robot_that_stands_where_it_does_not_fit_may_leave() -> None:
    assert find_route(Point(50.0, 50.0), Point(1500.0, 1000.0), Barriers(0), FITTING) == (Point(1500.0, 1000.0),)


@pytest.mark.parametrize(("start", "goal", "barriers", "clearances"), IMPOSSIBLE)
def test_no_way(start: Point, goal: Point, barriers: Barriers, clearances: Clearances) -> None:
    assert find_route(start, goal, barriers, clearances) is None


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
    radius, half = USUAL.kinds["fire"], 500.0
    tangents = 2 * math.sqrt(half**2 - radius**2)
    arc = 2 * radius * math.asin(radius / half)
    found = length(start, find_route(start, goal, flags(Passage.FORCED, "fire 5"), USUAL))
    assert tangents + arc <= found <= 1.02 * (tangents + arc)


def test_the_gap_between_neighbours_is_used() -> None:
    """Between fire 5 and pool 1 60 mm remain for the robot's centre; the way through is the short one."""
    start, goal = Point(650.0, 630.0), Point(1150.0, 630.0)
    assert find_route(start, goal, flags(Passage.FORCED, *ALL), USUAL) == (goal,)
