"""The core's equipment: a distance sensor that it stops for, and actuators for tasks."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Any

import pytest

from eurobot_od.device.timers import Call
from eurobot_od.errors import StateError, UnknownName
from eurobot_od.robot.model.messages import (
    EmergencyShutdown,
    EmergencyStop,
    GotoConfirm,
    GotoXY,
    StopDrive,
)
from eurobot_od.robot.model.values import (
    Obstacle,
    Outcome,
)
from eurobot_od.robot.nodes.node import Approach, Detection
from tests.robot.nodes.harness import Bench

GOTO = GotoXY(1500, 1000, 90, 80)


def ahead(distance: float, obstacle: Obstacle = Obstacle.ENEMY) -> Detection:
    return Detection(obstacle, distance, 0.0)


class Readings:
    """A distance sensor that gives the distances it was made with, one a reading; then the last one again and again."""

    def __init__(self, *distances: float | None) -> None:
        self.distances = list(distances)
        self.times: list[float] = []

    def look(self, now: float) -> Detection | None:
        self.times.append(now)
        distance = self.distances.pop(0) if len(self.distances) > 1 else self.distances[0]
        return None if distance is None else ahead(distance)


class Arm:
    """Actuators that know one task, of 2 s."""

    def __init__(self) -> None:
        self.finished: list[str] = []

    def begin(self, task: str) -> float:
        if task != "fire 1":
            raise UnknownName("task", task, ["fire 1"])
        return 2.0

    def finish(self, task: str) -> int:
        self.finished.append(task)
        return 1


@pytest.fixture
def bench() -> Bench:
    """The core with a sensor that sees nothing and an arm, and stand-ins for the others, configured."""
    bench = Bench("drive", "navigation")
    bench.configure()
    bench.core.sensor = Readings(None)
    bench.core.actuators = Arm()
    return bench


def drive_with(bench: Bench, *distances: float | None) -> Call[Any]:
    """Begin with a goto that is confirmed, with these readings of the sensor."""
    bench.core.sensor = Readings(*distances)
    call = bench.core.goto(*GOTO)
    bench.run(0.002)
    bench.say("drive", GotoConfirm())
    return call


# What is driven into


@pytest.mark.parametrize(
    ("distances", "meets", "why"),
    [
        ((), False, "nothing was seen"),
        ((300, 260, 220), True, "near, and nearer each time"),
        ((300, 240), True, "two readings are enough"),
        ((240,), False, "one reading does not tell whether it comes nearer"),
        ((200, 200, 200), False, "near, but it stays so: the robot turns on the spot"),
        ((200, 220, 240), False, "it goes away"),
        ((600, 560, 520), False, "still far away"),
        ((203, 198, 201, 197), False, "noise"),
        ((260, None, 220), True, "one that missed it does not hide it"),
        ((260, None, None, 220), False, "two that missed it do"),
        ((300, 260, 220, None), False, "what is not seen any more is not stopped for"),
    ],
)
def test_an_approaching_thing_is_met_at_the_stop_distance(
    distances: Sequence[float | None], meets: bool, why: str
) -> None:
    approach = Approach()
    last = False
    for distance in distances:
        last = approach.meets(None if distance is None else ahead(distance), 250.0)
    assert last is meets, why


# A goto with something in the way


def test_the_core_stops_for_what_it_drives_into(bench: Bench) -> None:
    call = drive_with(bench, 500, 400, 300, 200, 150)
    bench.run(0.3)
    assert EmergencyStop(Obstacle.ENEMY) in bench.messages()
    report = call.result(0)
    assert (report.outcome, report.why) == (Outcome.STOPPED, "enemy ahead")
    assert 0.14 < report.ended < 0.2, "at the reading at which it was near"


@pytest.mark.parametrize("distances", [(None,), (200,), (600, 550, 500, 450, 400)])
def test_the_robot_drives_on_past_things_that_are_not_in_the_way(bench: Bench, distances: tuple[float, ...]) -> None:
    call = drive_with(bench, *distances)
    bench.run(0.4)
    assert not call.done()
    assert not any(isinstance(message, EmergencyStop) for message in bench.messages())


def test_the_sensor_is_read_in_its_period_and_only_while_a_goto_is_under_way(bench: Bench) -> None:
    bench.run(1.0)
    drive_with(bench, None)
    bench.run(0.5)
    sensor = bench.core.sensor
    assert isinstance(sensor, Readings)
    assert len(sensor.times) == 11
    bench.core.stop()
    bench.run(1.0)
    assert len(sensor.times) == 11


def test_the_core_can_be_told_not_to_stop_by_itself(bench: Bench) -> None:
    bench.core.device.objects.put(bench.core.device.dictionary.address("Obstacle.Stop distance"), 0)
    call = drive_with(bench, 500, 400, 300, 200, 100, 0)
    bench.run(0.4)
    assert not call.done()


# Reading it


@pytest.mark.parametrize("sensor", [Readings(120.0), Readings(None), None])
def test_the_sensor_can_be_read_at_any_time(bench: Bench, sensor: Readings | None) -> None:
    bench.core.sensor = sensor
    call = bench.core.obstacle()
    bench.run(0.001)
    assert call.result(0) == (ahead(120.0) if sensor and sensor.distances[0] else None)


# Tasks


def test_a_task_takes_its_time_and_has_its_result(bench: Bench) -> None:
    call = bench.core.act("fire 1")
    bench.run(1.99)
    assert not call.done()
    bench.run(0.02)
    assert call.result(0) == 1


@pytest.mark.parametrize(
    ("end", "why"),
    [
        (lambda core: core.emergency_shutdown(), "emergency shutdown"),
        (lambda core: core.act("fire 1"), "replaced by a newer task"),
        (lambda core: core.start_match(0.1), "the match is over"),
        (lambda core: core.reset(), "the core was reset"),
    ],
)
def test_a_task_that_is_ended_is_never_finished(bench: Bench, end: Any, why: str) -> None:
    call = bench.core.act("fire 1")
    bench.run(0.5)
    end(bench.core)
    bench.run(0.2)
    with pytest.raises(StateError, match=why):
        call.result(0)


def test_a_task_after_the_match_is_refused(bench: Bench) -> None:
    bench.core.start_match(0.1)
    bench.run(0.2)
    call = bench.core.act("fire 1")
    bench.run(0.01)
    with pytest.raises(StateError, match="the match is over"):
        call.result(0)


def test_a_robot_without_actuators_says_so(bench: Bench) -> None:
    bench.core.actuators = None
    call = bench.core.act("fire 1")
    bench.run(0.01)
    with pytest.raises(StateError, match="the robot has nothing to do fire 1 with"):
        call.result(0)


def test_an_unknown_task_is_the_callers_error(bench: Bench) -> None:
    call = bench.core.act("fire 11")
    bench.run(0.01)
    with pytest.raises(UnknownName, match="fire 1"):
        call.result(0)


# The match's time, and who watches


def test_the_time_left_runs_out_with_the_match(bench: Bench) -> None:
    assert bench.core.time_left == inf
    bench.core.start_match(2.0)
    bench.run(0.5)
    assert bench.core.time_left == pytest.approx(1.5, abs=0.3)  # as of the core's last tick
    bench.run(2.0)
    assert bench.core.time_left == 0


def test_gotos_and_tasks_are_observed_when_they_begin(bench: Bench) -> None:
    seen: list[Any] = []
    bench.core.observe = lambda what, call: seen.append((what, call))
    goto = bench.core.goto(*GOTO)
    task = bench.core.act("fire 1")
    assert seen == [(GOTO, goto), ("fire 1", task)]
    bench.core.stop()
    bench.run(0.01)
    assert StopDrive() in bench.messages()
    assert EmergencyShutdown() not in bench.messages()
