"""Where other robots will be, and where the fires are that they push."""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import islice

import pytest

from eurobot_od.robot.match.forecast import BEFORE, GUESSES, STEP, Course, Fires, Forecast
from eurobot_od.robot.model.places import Point, Pose
from eurobot_od.robot.model.robot_file import read
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.nodes.estimate import Seen

FACTS = read()
WHO = Source.ENEMY_2
ROUNDS = (Point(300, 300), Point(1200, 300), Point(1200, 500), Point(300, 500))


def on_rounds(speed: float = 300.0) -> Iterator[Point]:
    """Yield where a robot is on its rounds, a place for each step."""
    way = speed * STEP
    while True:
        for start, end in zip(ROUNDS, (*ROUNDS[1:], ROUNDS[0])):
            for step in range(round(math.dist(start, end) / way)):
                share = step * way / math.dist(start, end)
                yield Point(start.x + (end.x - start.x) * share, start.y + (end.y - start.y) * share)


PLACES = [*islice(on_rounds(), 300)]


def seen_from(first: int, steps: int) -> Course:
    """Return the course of a robot that was seen in each second step."""
    course = Course(150.0)
    for step in range(first, first + steps, 2):
        course.saw(Seen(PLACES[step], step * STEP))
    return course


@pytest.mark.parametrize(("steps", "off"), [(90, 20.0), (150, 20.0)], ids=["a lap and a bit", "two laps"])
def test_a_robot_on_its_second_lap_is_predicted_by_its_first(steps: int, off: float) -> None:
    course = seen_from(0, steps)
    last = steps - 2
    ahead = course.ahead(last * STEP, 0)
    assert course.has_lap
    assert max(math.dist(there, PLACES[last + 1 + step]) for step, there in enumerate(ahead[:60])) <= off + 40


def test_before_its_first_lap_a_robot_is_predicted_straight_on() -> None:
    course = seen_from(0, 20)
    assert course.ahead(18 * STEP, 0)[:2] == [pytest.approx(PLACES[19]), pytest.approx(PLACES[20])]
    assert course.ahead(18 * STEP, 5)[0] == pytest.approx(PLACES[24])
    assert not course.has_lap


def test_a_sighting_from_which_the_robot_cannot_have_come_is_dropped() -> None:
    course = Course(150.0)
    assert course.saw(Seen(Point(2500, 1500), 0.0)) == 0
    assert course.saw(Seen(PLACES[2], 2 * STEP)) == 0, "it did not drive through all that stands between"
    assert course.track == [PLACES[2]]
    assert course.saw(Seen(PLACES[4], 4 * STEP)) == 2


def test_a_place_before_the_first_sighting_is_that_of_a_lap_later() -> None:
    first = 35  # just before a corner: straight back from there would be elsewhere
    course = seen_from(first, 90)
    for step in range(1, BEFORE):
        assert math.dist(course.at(-step), PLACES[first - step]) < 45


def test_a_fire_is_pushed_out_of_a_robots_way() -> None:
    fires = Fires(FACTS)
    fire = FACTS.barrier("fire 5")
    before = len([*fires.discs(0.0)])
    for x in range(600, 1500, 60):
        fires.meet(WHO, Point(x, fire.y - 120), 2, 150.0)
    assert fires.pushed == {fire}
    assert fires.version > 0
    (disc,) = (each for each in fires.discs(0.0) if math.dist(each.centre, fire.point) < 400 and each.centre.y > fire.y)
    assert disc.radius > fire.kind.radius
    assert disc.centre.y > fire.y - 120 + 150 + 0.8 * fire.kind.radius
    assert len([*fires.discs(0.0)]) == before


def test_where_a_fire_that_was_hit_head_on_lies_is_not_known_and_all_places_are_kept_off() -> None:
    fires = Fires(FACTS)
    fire = FACTS.barrier("fire 5")
    known = len([*fires.discs(0.0)])
    for x in range(600, 1400, 60):
        fires.meet(WHO, Point(x, fire.y), 2, 150.0)
    assert fires.pushed == {fire}
    assert len([*fires.discs(0.0)]) > known, "one disc is not enough"
    assert len([*fires.discs(0.0, GUESSES + 1)]) == 0, "no place has more guesses than there are"


def forecast(places: list[Point]) -> Forecast:
    found = Forecast(FACTS, {WHO: 150.0})
    for step, place in enumerate(places):
        found.saw(WHO, Seen(place, step * 2 * STEP))
    return found


def east(first: float, step: float = 60.0) -> list[Point]:
    return [Point(first + step * number, 1000) for number in range(6)]


@pytest.mark.parametrize(
    ("places", "is_free"),
    [
        (east(2000, -60.0), False),
        (east(1000), True),
        (east(1500, 0.0), False),
        (east(2800, -60.0), True),
        ([], True),
    ],
    ids=["comes", "drives ahead", "stands in the way", "is far away", "was not seen"],
)
def test_a_way_is_free_if_nobody_will_be_too_near(places: list[Point], is_free: bool) -> None:
    poses = [Pose(600 + 30 * step, 1000, 0) for step in range(15)]
    assert forecast(places).is_free(poses, now=1.0) is is_free


@pytest.mark.parametrize(("share", "is_free"), [(1.0, False), (0.4, True), (0.0, True)])
def test_who_has_waited_keeps_a_share_of_the_distances(share: float, is_free: bool) -> None:
    poses = [Pose(600 + 30 * step, 1000, 0) for step in range(15)]
    assert forecast(east(1500, 0.0)).is_free(poses, now=1.0, share=share) is is_free


def test_a_robot_that_is_too_near_may_stand_or_drive_away() -> None:
    found = forecast(east(710, -50.0))  # it has come to 460, and drives on by what is said of it
    beside = Pose(760, 1000, 0)
    assert found.is_free([beside.moved(30 * step, 0) for step in range(10)], now=1.0), "away from it"
    assert not found.is_free([Pose(760 - 30 * step, 1000, 180) for step in range(10)], now=1.0), "into it"


def test_the_course_of_another_robot_tells_which_points_it_passes() -> None:
    found = forecast(east(1000))
    assert found.passes(Point(1200, 1100))
    assert not found.passes(Point(1200, 1300))
