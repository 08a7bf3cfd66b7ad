"""The world: what is true, what wheels, beacons and the distance sensor say of it, and that chance has one seed."""

from __future__ import annotations

import math
import statistics
from typing import Any

import pytest

from eurobot_od.robot.field import HEIGHT, START_POSES, WIDTH, Point, Pose
from eurobot_od.robot.nodes.motion import AT_REST, Command
from eurobot_od.robot.options import MatchOptions
from eurobot_od.robot.values import Obstacle, Source, TeamColour
from eurobot_od.robot.world import World
from eurobot_od.robot.world.world import DROP_SPEED, SIGHT

FORWARD = Command(400.0, 0.0)
ENEMIES = {Source.ENEMY_1, Source.ENEMY_2}


class Place:
    """A world whose clock the test sets; its beacons are exact unless told otherwise."""

    def __init__(self, seed: int = 1, deviations: tuple[float, float] = (0.0, 0.0), **who: Any) -> None:
        self.now = 0.0
        options = MatchOptions(seed=seed, **({"enemies": 0, "confederates": 0} | who))
        self.world = World(options, lambda: deviations, lambda: self.now)

    def drive(self, command: Command, seconds: float) -> None:
        for _ in range(round(seconds / 0.01)):
            self.now += 0.01
            self.world.advance(command, 0.01)

    def face(self, point: Point, distance: float) -> None:
        """Put the robot before a point, looking at it."""
        x = point.x - distance if point.x > WIDTH / 2 else point.x + distance
        here = Pose(x, point.y, 0)
        self.world.robot = here._replace(angle=here.bearing(point))


# Chance


def test_the_same_seed_is_the_same_world() -> None:
    one, other = Place(7, (5, 1), enemies=2), Place(7, (5, 1), enemies=2)
    for place in (one, other):
        place.drive(FORWARD, 1.0)
    assert one.world.robot == other.world.robot
    for source in Source:
        assert one.world.locate(source, 1.0) == other.world.locate(source, 1.0)


def test_another_seed_is_another_world() -> None:
    one, other = Place(1, enemies=2), Place(2, enemies=2)
    assert one.world.robot != other.world.robot
    assert one.world.locate(Source.ENEMY_1, 0.0) != other.world.locate(Source.ENEMY_1, 0.0)


def test_how_often_one_is_asked_for_does_not_change_what_another_says() -> None:
    one, other = Place(1, (5, 1), enemies=2), Place(1, (5, 1), enemies=2)
    for _ in range(10):
        other.world.locate(Source.INTERNAL, 0.0)
    assert one.world.locate(Source.ENEMY_1, 0.0) == other.world.locate(Source.ENEMY_1, 0.0)


# The robot


@pytest.mark.parametrize("team", TeamColour)
def test_the_robot_begins_near_its_start_place(team: TeamColour) -> None:
    starts = [Place(seed, team=team).world.robot for seed in range(50)]
    assert len(set(starts)) == 50
    assert max(start.distance(START_POSES[team].point) for start in starts) < 15


def test_wheels_slip_but_report_what_they_were_told() -> None:
    place = Place(3)
    start = place.world.robot
    odometry = place.world.advance(Command(500.0, 0.0), 0.1)
    driven = place.world.robot.distance(start.point)
    assert odometry == (50.0, 0.0)
    assert driven != 50.0
    assert driven == pytest.approx(50.0, rel=0.05)


def test_at_rest_nothing_moves() -> None:
    place = Place()
    place.drive(AT_REST, 0.01)
    start = place.world.robot
    place.drive(AT_REST, 1.0)
    assert place.world.robot == start


def test_the_borders_hold_the_robot_back() -> None:
    place = Place()
    place.drive(Command(800.0, 0.0), 10.0)
    assert place.world.robot.x == WIDTH
    place.drive(Command(-800.0, 0.0), 10.0)
    assert place.world.robot.x == 0
    assert 0 <= place.world.robot.y <= HEIGHT


def test_the_path_is_kept_with_its_times() -> None:
    place = Place()
    place.drive(FORWARD, 0.05)
    assert [round(time, 2) for time, _ in place.world.path] == [0.0, 0.01, 0.02, 0.03, 0.04, 0.05]
    assert place.world.path[-1][1] == place.world.robot


# The beacons


def test_exact_beacons_tell_the_truth() -> None:
    place = Place(enemies=1)
    assert tuple(place.world.locate(Source.INTERNAL, 0.0) or ()) == place.world.robot
    fix = place.world.locate(Source.ENEMY_1, 2.0)
    assert fix is not None
    assert (fix.x, fix.y) == place.world.others[Source.ENEMY_1].at(2.0).point
    assert fix.angle is None  # only our own heading can be measured


def test_beacons_are_off_by_their_deviation() -> None:
    world = Place(deviations=(5.0, 1.0)).world
    fixes = [fix for _ in range(2000) if (fix := world.locate(Source.INTERNAL, 0.0)) is not None]
    assert statistics.stdev(fix.x for fix in fixes) == pytest.approx(5.0, rel=0.1)
    assert statistics.stdev(fix.angle for fix in fixes if fix.angle is not None) == pytest.approx(1.0, rel=0.1)
    assert statistics.mean(fix.y for fix in fixes) == pytest.approx(world.robot.y, abs=0.5)


@pytest.mark.parametrize(
    ("enemies", "confederates", "there"),
    [
        (0, 0, set()),
        (1, 0, {Source.ENEMY_1}),
        (2, 0, ENEMIES),
        (0, 1, {Source.CONFEDERATE}),
        (2, 1, ENEMIES | {Source.CONFEDERATE}),
    ],
)
def test_only_who_is_there_is_seen(enemies: int, confederates: int, there: set[Source]) -> None:
    world = Place(enemies=enemies, confederates=confederates).world
    assert {source for source in Source if world.locate(source, 0.0)} == there | {Source.INTERNAL}


# The distance sensor


@pytest.mark.parametrize(
    ("distance", "turned", "command", "seen", "why"),
    [
        (SIGHT - 50, 0, FORWARD, Obstacle.ENEMY, "ahead and near"),
        (SIGHT + 50, 0, FORWARD, None, "too far away"),
        (SIGHT - 50, 40, FORWARD, None, "off to the side"),
        (SIGHT - 50, 180, FORWARD, None, "behind"),
        (SIGHT - 50, 0, AT_REST, None, "a robot at rest runs into nobody"),
    ],
)
def test_an_enemy_in_the_way_is_seen(
    distance: float, turned: float, command: Command, seen: Obstacle | None, why: str
) -> None:
    place = Place(enemies=1)
    place.face(place.world.others[Source.ENEMY_1].at(0.0).point, distance)
    robot = place.world.robot
    place.world.robot = robot._replace(angle=robot.angle + turned)
    place.world.advance(command, 0.0)
    assert place.world.obstacle(0.0) is seen, why


def test_a_thing_falls_over_once_lies_in_the_way_and_is_pushed_aside() -> None:
    place = Place()
    place.drive(Command(DROP_SPEED, 0.0), 0.1)
    assert place.world.obstacle(place.now) is None
    place.world.drop_thing(place.now)
    assert place.world.obstacle(place.now) is Obstacle.OBJECT
    assert place.world.obstacle(place.now + 1.1) is None
    place.world.drop_thing(place.now + 2.0)
    assert place.world.obstacle(place.now + 2.0) is None


def test_nothing_falls_before_a_slow_robot() -> None:
    place = Place()
    place.drive(Command(DROP_SPEED - 1, 0.0), 0.1)
    place.world.drop_thing(place.now)
    assert place.world.thing is None


def test_a_turn_is_off_by_the_drift_of_the_wheels() -> None:
    place = Place(5)
    before = place.world.robot.angle
    place.drive(Command(0.0, 90.0), 1.0)
    turned = (place.world.robot.angle - before) % 360
    assert turned != 90.0
    assert math.isclose(turned, 90.0, rel_tol=0.03)
