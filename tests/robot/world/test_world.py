"""The world: what robots run into, who drove into whom, what is pushed, who is where; all chance has one seed."""

from __future__ import annotations

import math
from itertools import groupby, pairwise

import pytest

from eurobot_od.errors import UnknownName
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.values import OURS, Source, TeamColour
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.world import world as world_module
from eurobot_od.robot.world.bodies import BORDER, SHOVE, Touch, gap
from eurobot_od.robot.world.world import RIVAL, EventKind, MatchEvent, Timeline
from tests.robot.world.places import Place

FACTS = robot_file.read()

POOL_EDGE = 150 + FACTS.body.radius
"""How near our centre comes to that of a pool, mm."""

BEFORE_POOL = Pose(1300, 900, 180)
"""Before pool 1, looking at it, with nothing in between."""


# Chance


def test_the_same_seed_is_the_same_world() -> None:
    one, other = Place(7, enemies=2), Place(7, enemies=2)
    for place in (one, other):
        place.drive(400, 1.0)
    assert [body.pose for body in one.world.robots.values()] == [body.pose for body in other.world.robots.values()]


def test_another_seed_is_another_world() -> None:
    one, other = Place(1, enemies=2), Place(2, enemies=2)
    for name in ("ours", "enemy 1", "enemy 2"):
        assert one.world.robots[name].pose != other.world.robots[name].pose


def test_the_number_of_readings_does_not_change_the_patrols() -> None:
    one, other = Place(enemies=2), Place(enemies=2)
    for _ in range(100):
        one.now += 0.1
        one.vehicle.pose(Source.ENEMY_1)
    other.now = one.now
    assert one.vehicle.pose(Source.ENEMY_1) == other.vehicle.pose(Source.ENEMY_1)


def test_the_number_of_requests_does_not_change_the_courses_of_the_others() -> None:
    one, other = Place(enemies=2), Place(enemies=2)
    for _ in range(100):
        one.now += 0.1
        one.vehicle.pose(Source.ENEMY_1)
    other.now = one.now
    assert one.vehicle.pose(Source.ENEMY_1, 0.25) == other.vehicle.pose(Source.ENEMY_1, 0.25)
    assert one.vehicle.pose(Source.ENEMY_1, 0.25) != one.vehicle.pose(Source.ENEMY_1)


def test_a_robot_that_cannot_pass_waits_and_turns_round(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(world_module, "STRAY", 0)
    rounds = ("robots.enemy 1.rounds", "[[1500, 900], [500, 900]]")
    place = Place(enemies=1, settings=(rounds,))
    way = []
    for _ in range(300):
        place.now += 0.1
        way.append(place.world.robots["enemy 1"].pose.x)
        place.world.pose("enemy 1", 0.0)
    nearest = min(way)
    pool = FACTS.barrier("pool 1")
    enemy = FACTS.others[Source.ENEMY_1]
    assert nearest == pytest.approx(pool.x + pool.kind.radius + enemy.radius, abs=1), "it came as far as the pool"
    waits = [len(list(times)) * 0.1 for x, times in groupby(way) if x == nearest]
    assert waits[0] == pytest.approx(world_module.PATROL_WAIT, abs=0.2)
    assert max(way[way.index(nearest) :]) > 1400, "and went back"


# Our robot


@pytest.mark.parametrize("team", TeamColour)
def test_the_robot_begins_near_its_start_place(team: TeamColour) -> None:
    starts = [Place(seed, team=team).world.robot for seed in range(50)]
    assert len(set(starts)) == 50
    assert max(start.distance(FACTS.start(team).point) for start in starts) < 15


def test_the_robot_moves_as_its_wheels_roll() -> None:
    place = Place()
    place.clear()
    place.put(1000, 1000, 30)
    assert place.world.move(OURS, Odometry(50.0, 10.0), 0.1) == pytest.approx(50.0, rel=0.001)
    assert place.world.robot == Pose(1000, 1000, 30).moved(50.0, 10.0)


def test_the_trace_has_its_times() -> None:
    place = Place()
    place.drive(400, 0.05)
    times = [time for time, _ in place.world.path]
    assert times == pytest.approx([0.0, 0.01, 0.02, 0.03, 0.04, 0.05])
    assert place.world.path[-1][1] == place.world.robot


# Contact


def test_a_pool_stops_the_robot_that_drives_at_it() -> None:
    place = Place()
    place.put(*BEFORE_POOL)
    came = place.drive(400, 1.0)
    assert place.here == pytest.approx((900 + POOL_EDGE, 900))
    assert came == pytest.approx(BEFORE_POOL.x - 900 - POOL_EDGE)
    assert place.touched() == [(OURS, "pool 1")]


def test_the_robot_slides_along_an_obstacle_met_at_an_angle() -> None:
    place = Place()
    place.put(1300, 1100, 180)  # 200 mm off the pool's centre line
    came = place.drive(400, 2.0)
    assert place.here.x < 800, "it came past"
    assert gap(place.here, FACTS.body.radius, place.world.things[6]) >= -1e-6
    assert 0 < came < 800
    assert place.touched()[0] == (OURS, "pool 1")


@pytest.mark.parametrize(
    ("pose", "edge"),
    [
        (Pose(1500, 300, 270), Point(1500, FACTS.body.radius)),
        (Pose(1500, 1700, 90), Point(1500, FACTS.field.height - FACTS.body.radius)),
        (Pose(300, 1500, 180), Point(FACTS.body.radius, 1500)),
        (Pose(2700, 1500, 0), Point(FACTS.field.width - FACTS.body.radius, 1500)),
    ],
)
def test_the_border_holds_the_robot(pose: Pose, edge: Point) -> None:
    place = Place()
    place.put(*pose)
    place.drive(800, 1.0)
    assert place.here == pytest.approx(edge)
    assert place.touched() == [(OURS, BORDER)]


def test_a_fire_is_pushed_along_and_cannot_be_turned_over_any_more() -> None:
    place = Place()
    place.put(600, 1400, 0)
    came = place.drive(400, 1.0)
    assert came == pytest.approx(400), "it hardly weighs anything"
    fire = place.world.things[0]
    assert fire.point.x == pytest.approx(1000 + FACTS.body.radius + fire.radius)
    assert place.touched() == [(OURS, "fire 1")]
    place.put(900, 1670, 270)
    assert place.vehicle.finish("fire 1") == 0


def test_a_pushed_fire_blocks_another_robot() -> None:
    place = Place(enemies=1, rival=True)
    fire = place.world.things[0]
    place.clear()
    place.world.things.append(fire)
    place.put(1500, 1400, 180, RIVAL)
    place.drive(10, 0.1, name=RIVAL)  # it has looked around, and nothing was near
    fire.point = Point(900, 1400)
    place.put(600, 1400, 0)
    place.drive(400, 1.0)
    place.put(300, 300, 0)  # we are gone, and the fire lies nearer to it
    place.drive(400, 0.75, name=RIVAL)
    assert (RIVAL, "fire 1") in place.touched()


def test_a_contact_is_counted_once_until_it_has_ended() -> None:
    place = Place()
    place.put(*BEFORE_POOL)
    place.drive(400, 1.0)
    place.drive(0, 0.5)
    place.drive(400, 0.5)
    assert len(place.world.touches) == 1
    place.drive(-400, 0.5)
    place.drive(400, 1.0)
    assert len(place.world.touches) == 2


def test_watchers_are_told_of_each_touch() -> None:
    place = Place()
    told = list[Touch]()
    place.world.watchers.append(told.append)
    place.put(*BEFORE_POOL)
    place.drive(400, 1.0)
    assert told == place.world.touches
    assert str(told[0]) == "ours at 400 mm/s touched pool 1"


def test_a_robot_between_two_things_stays_where_it_is() -> None:
    place = Place(enemies=1, rival=True)
    place.put(1500, 700, 270)
    place.put(1500, 420, 90, RIVAL)  # rival stands below, overlapping by 0
    one, other = place.world.things[6], place.world.things[7]
    one.point, other.point = Point(1400, 350), Point(1600, 350)
    before = place.here
    place.drive(300, 0.5)
    assert math.dist(before, place.here) < 120
    assert all(gap(place.here, FACTS.body.radius, each) > -1.5 for each in (one, other))


# Other robots


def test_a_robot_that_stands_yields_a_little_to_one_that_drives_into_it() -> None:
    place = Place(enemies=1, rival=True)
    place.clear()
    place.put(1000, 1000, 0)
    place.put(1280, 1000, 0, RIVAL)
    place.drive(400, 0.5)
    moved = place.world.robots[RIVAL].point.x - 1280
    assert moved == pytest.approx(SHOVE * 200, abs=10), "a share of what it was driven at"
    assert place.here.x == pytest.approx(1000 + moved, abs=3), "and it comes no farther"


@pytest.mark.parametrize(
    ("ours", "theirs", "at_fault", "why"),
    [
        (300.0, 0.0, OURS, "we drove into one that stood"),
        (0.0, 300.0, RIVAL, "it drove into us"),
        (300.0, -100.0, OURS, "we were faster"),
        (200.0, 300.0, RIVAL, "both came, it was faster"),
    ],
)
def test_a_touch_says_which_robot_drove_into_the_other(ours: float, theirs: float, at_fault: str, why: str) -> None:
    place = Place(enemies=1, rival=True)
    place.clear()
    place.put(1000, 1000, 0)
    place.put(1400, 1000, 180, RIVAL)
    for _ in range(200):
        place.drive(ours, 0.01)
        place.drive(theirs, 0.01, name=RIVAL)
    touch = place.world.touches[0]
    assert {touch.robot, touch.thing} == {OURS, RIVAL}
    assert [name for name in (OURS, RIVAL) if touch.is_fault_of(name)] == [at_fault], why


def test_patrols_move_at_their_speed_without_commands() -> None:
    place = Place(enemies=2, confederates=1)
    place.clear()
    before = {name: body.point for name, body in place.world.robots.items()}
    place.now = 2.05  # they move every 0.1 s
    place.vehicle.pose(Source.ENEMY_1)
    speeds = {name: body.speed for name, body in place.world.robots.items()}
    assert speeds.pop(OURS) == 0
    assert all(world_module.PATROL_SPEEDS[0] <= speed <= world_module.PATROL_SPEEDS[1] for speed in speeds.values())
    ways = {name: math.dist(body.point, before[name]) for name, body in place.world.robots.items()}
    assert ways == pytest.approx({OURS: 0} | {name: 2.0 * speed for name, speed in speeds.items()})


def test_a_careful_patrol_stops_before_our_robot_and_turns_round() -> None:
    for seed in range(1, 30):
        place = Place(seed, confederates=1)
        body = place.world.robots["confederate"]
        ahead = body.pose.moved(500, 0)
        place.put(*ahead)
        place.now = 6.0
        place.vehicle.pose(Source.CONFEDERATE)
        assert [touch for touch in place.world.touches if touch.is_fault_of("confederate")] == []
        assert math.dist(body.point, ahead.point) > 350, "it did not stay before us"


def test_a_waiting_patrol_stands() -> None:
    place = Place(confederates=1)
    body = place.world.robots["confederate"]
    place.put(*body.pose.moved(2 * FACTS.body.radius + 50, 0))
    place.now = 0.5
    place.vehicle.pose(Source.CONFEDERATE)
    assert body.speed == 0


def test_a_careless_patrol_touches_our_robot_once_without_pushing_it() -> None:
    met = 0
    for seed in range(1, 30):
        place = Place(seed, enemies=1)
        ahead = place.world.robots["enemy 1"].pose.moved(500, 0)
        place.put(*ahead)
        place.now = 6.0
        place.vehicle.pose(Source.ENEMY_1)
        met += sum(touch.is_fault_of("enemy 1") for touch in place.world.touches)
        assert math.dist(place.here[:2], ahead.point) < SHOVE * 50, "it stops when it has driven into somebody"
    assert met > 3


@pytest.mark.parametrize(
    ("enemies", "confederates", "there"),
    [
        (0, 0, set()),
        (1, 0, {Source.ENEMY_1}),
        (2, 0, {Source.ENEMY_1, Source.ENEMY_2}),
        (0, 1, {Source.CONFEDERATE}),
        (2, 1, {Source.ENEMY_1, Source.ENEMY_2, Source.CONFEDERATE}),
    ],
)
def test_only_robots_in_the_match_have_a_place(enemies: int, confederates: int, there: set[Source]) -> None:
    vehicle = Place(enemies=enemies, confederates=confederates).vehicle
    assert {source for source in Source if vehicle.pose(source)} == there | {Source.INTERNAL}


def test_the_rival_sees_us_as_its_enemy() -> None:
    place = Place(enemies=2, confederates=1, rival=True)
    rival = place.world.vehicle(RIVAL)
    assert rival.pose(Source.INTERNAL) == place.vehicle.pose(Source.ENEMY_1)
    assert rival.pose(Source.ENEMY_1) == place.vehicle.pose(Source.INTERNAL)
    assert rival.pose(Source.ENEMY_2) == place.vehicle.pose(Source.CONFEDERATE)
    assert rival.pose(Source.CONFEDERATE) == place.vehicle.pose(Source.ENEMY_2)


def test_the_rival_starts_on_the_other_side() -> None:
    place = Place(enemies=1, rival=True, team=TeamColour.YELLOW)
    assert place.world.robots[RIVAL].pose.distance(FACTS.start(TeamColour.RED).point) < 20


# What was


def test_an_earlier_place() -> None:
    place = Place()
    place.clear()
    place.put(500, 1000, 0)
    place.drive(500, 1.0)
    ages = (0.0, 0.1, 0.5, 1.0, 60.0)
    poses = [place.vehicle.pose(Source.INTERNAL, age) for age in ages]
    ways = [pose.x for pose in poses if pose is not None]
    assert ways[:3] == pytest.approx([1000, 950, 750], abs=6)
    assert all(later >= earlier for later, earlier in pairwise(ways))


# Tasks


def test_a_task_takes_its_time_and_scores_where_the_robot_truly_is() -> None:
    place = Place(3)
    assert place.vehicle.begin("frescos") == 2.0
    assert place.vehicle.finish("frescos") == 0, "not there"
    place.put(1400, 1800, 90)
    gain = place.vehicle.finish("frescos")
    assert gain in (0, 3, 6)
    assert place.world.game.points(OURS) == gain


def test_an_unknown_task_is_named() -> None:
    with pytest.raises(UnknownName, match="unknown task 'fire 11'"):
        Place().vehicle.begin("fire 11")


# A test bench


def test_a_bench_has_no_obstacle_but_the_border() -> None:
    place = Place(solid=False)
    place.put(*BEFORE_POOL)
    assert place.drive(400, 3.0) == pytest.approx(1200)
    assert place.here == pytest.approx((100, 900))
    assert place.drive(400, 1.0) == pytest.approx(400), "wheels that hang free do not stall"
    assert place.here.x == 0
    assert place.touched() == []


def test_each_event_is_printed_at_once() -> None:
    shown: list[MatchEvent] = []
    clock = iter([0.5, 1.25])
    timeline = Timeline(lambda: next(clock), shown.append)
    timeline.tell(EventKind.GOTO, "tree", speed=80)
    timeline.tell(EventKind.ARRIVED, "after 1 s")
    assert shown == [
        MatchEvent(0.5, EventKind.GOTO, "tree", {"speed": 80}),
        MatchEvent(1.25, EventKind.ARRIVED, "after 1 s"),
    ]


@pytest.mark.parametrize("kind", EventKind)
def test_lines_are_aligned(kind: EventKind) -> None:
    line = str(MatchEvent(12.3456, kind, "text"))
    assert line.startswith("   12.346 s  " + kind.value)
    assert line.index("text") == 24


def test_an_event_as_data_has_time_kind_and_details() -> None:
    event = MatchEvent(0.12345678, EventKind.GIVEN_UP, "text", {"seconds": 2})
    assert event.as_data() == {"time": 0.123457, "kind": "given up", "text": "text", "seconds": 2}
