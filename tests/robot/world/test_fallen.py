"""A thing that falls over: once, before a fast robot, on the field; then it is taken away."""

from __future__ import annotations

from eurobot_od.robot.model.values import Obstacle
from eurobot_od.robot.world.bodies import FAST, REMOVED_AFTER
from tests.robot.world.places import Place


def falling() -> Place:
    place = Place(falling=True)
    place.clear()
    place.put(500, 1000, 0)
    return place


def test_a_fallen_object_appears_once_in_front_of_a_fast_robot() -> None:
    place = falling()
    place.drive(FAST, 0.1)
    seen = place.vehicle.ahead(700, 30)
    assert seen is not None
    assert seen.obstacle is Obstacle.OBJECT
    place.drive(0, REMOVED_AFTER + 0.1)
    assert place.vehicle.ahead(700, 30) is None
    place.drive(FAST, 0.5)
    assert place.vehicle.ahead(700, 30) is None


def test_no_object_falls_in_front_of_a_slow_robot() -> None:
    place = falling()
    place.drive(FAST - 1, 0.1)
    assert place.vehicle.ahead(700, 30) is None


def test_nothing_falls_on_the_border() -> None:
    place = falling()
    place.put(500, 300, 270)
    place.drive(FAST, 0.1)
    assert place.vehicle.ahead(700, 30) is None


def test_a_robot_that_does_not_stop_pushes_the_fallen_object() -> None:
    place = falling()
    place.drive(500, 0.8)
    assert ("ours", "fallen thing") in place.touched()
