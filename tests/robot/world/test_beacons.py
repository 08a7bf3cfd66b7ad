"""Beacons: noise, age, drop-outs, outliers and swapped robots at their rates; chance has a stream for each question."""

from __future__ import annotations

import statistics
from dataclasses import replace

import pytest

from eurobot_od.robot.model.options import NOISE_ONLY, Errors
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.nodes.navigation import Fix
from eurobot_od.robot.world.world import SimulatedBeacons
from tests.robot.world.places import Place

MANY = 3000


def beacons(
    place: Place, errors: Errors = NOISE_ONLY, deviations: tuple[float, float] = (0.0, 0.0)
) -> SimulatedBeacons:
    return SimulatedBeacons(place.vehicle, place.world.facts.field, errors, lambda: deviations, "1")


def ours(seen_by: SimulatedBeacons, times: int = MANY) -> list[Fix | None]:
    return [seen_by.locate(Source.INTERNAL, 0.0) for _ in range(times)]


def test_exact_beacons_give_true_places_and_only_our_heading() -> None:
    place = Place(enemies=1)
    seen = beacons(place)
    assert tuple(seen.locate(Source.INTERNAL, 0.0) or ()) == place.world.robot
    enemy = seen.locate(Source.ENEMY_1, 0.0)
    assert enemy == Fix(*place.world.robots["enemy 1"].point, None)
    assert seen.locate(Source.ENEMY_2, 0.0) is None, "not there"


def test_noise_has_its_deviation() -> None:
    place = Place()
    fixes = [fix for fix in ours(beacons(place, deviations=(5.0, 1.0))) if fix is not None]
    assert statistics.stdev(fix.x for fix in fixes) == pytest.approx(5.0, rel=0.1)
    assert statistics.stdev(fix.angle or 0.0 for fix in fixes) == pytest.approx(1.0, rel=0.1)
    assert statistics.mean(fix.y for fix in fixes) == pytest.approx(place.world.robot.y, abs=0.5)


def test_a_position_is_as_old_as_the_latency() -> None:
    place = Place()
    place.clear()
    place.put(500, 1000, 0)
    place.drive(400, 1.0)
    fix = beacons(place, replace(NOISE_ONLY, beacon_latency=0.25)).locate(Source.INTERNAL, place.now)
    assert fix is not None
    assert place.here.x - fix.x == pytest.approx(100, abs=5)


def test_dropouts_come_at_their_rate() -> None:
    fixes = ours(beacons(Place(), replace(NOISE_ONLY, beacon_dropouts=0.2)))
    assert fixes.count(None) / MANY == pytest.approx(0.2, abs=0.03)


def test_outliers_are_somewhere_on_the_field_at_their_rate() -> None:
    place = Place()
    fixes = [fix for fix in ours(beacons(place, replace(NOISE_ONLY, beacon_outliers=0.1))) if fix is not None]
    off = [fix for fix in fixes if place.world.robot != Pose(fix.x, fix.y, fix.angle or 0.0)]
    assert len(off) / MANY == pytest.approx(0.1, abs=0.02)
    assert max(fix.x for fix in off) > 2500
    assert all(0 <= fix.x <= 3000 and 0 <= fix.y <= 2000 for fix in off)


def test_swapped_robots_come_at_their_rate() -> None:
    place = Place(enemies=2)
    fixes = ours(beacons(place, replace(NOISE_ONLY, beacon_swaps=0.1)))
    others = [place.world.robots[name].point for name in ("enemy 1", "enemy 2")]
    swapped = [fix for fix in fixes if fix is not None and (fix.x, fix.y) in others]
    assert len(swapped) / MANY == pytest.approx(0.1, abs=0.02)
    assert {(fix.x, fix.y) for fix in swapped} == set(others)


def test_a_robot_alone_is_never_swapped() -> None:
    place = Place()
    fixes = ours(beacons(place, replace(NOISE_ONLY, beacon_swaps=1.0)), 10)
    assert {fix and fix[:2] for fix in fixes} == {place.here}


def test_the_number_of_readings_of_one_robot_does_not_change_those_of_another() -> None:
    one, other = (beacons(Place(enemies=1), Errors(), (5.0, 1.0)) for _ in range(2))
    ours(one, 10)
    assert one.locate(Source.ENEMY_1, 0.0) == other.locate(Source.ENEMY_1, 0.0)
