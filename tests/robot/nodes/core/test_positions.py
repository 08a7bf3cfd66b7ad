"""Positions are asked for at their times and kept; two drives that differ are told (document 4.2.2, 5.2)."""

from __future__ import annotations

import pytest

from eurobot_od.errors import UnknownName
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model.messages import (
    ConfederatePositionRequest,
    Enemy1PositionRequest,
    Enemy1PositionResponse,
    Enemy2PositionRequest,
    KalmanPositionRequest,
    KalmanPositionResponse,
    NaviPositionRequest,
    StartConfigurationConfirm,
)
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import Source, TeamColour
from eurobot_od.robot.nodes import Drive
from eurobot_od.robot.nodes.estimate import Estimate
from tests.robot.nodes.driving import (
    FAR,
    ON_THE_WIRE,
    gaps,
    true_robot,
)
from tests.robot.nodes.harness import DICTIONARIES, TUNING, Bench

# Position polling (document 4.2.2, 5.2; periods and offsets of the 2014 robot)

OFFSETS: dict[type[Message], float] = {
    NaviPositionRequest: 0.1,
    KalmanPositionRequest: 0.1,
    ConfederatePositionRequest: 0.3,
    Enemy1PositionRequest: 0.5,
    Enemy2PositionRequest: 0.5,
}


def test_positions_are_asked_for_every_600_ms_at_their_offsets_over_a_whole_match() -> None:
    bench = Bench()
    bench.configure()
    start = bench.times(StartConfigurationConfirm)[0] + 2.0
    bench.run(92.0)
    for request_type, offset in OFFSETS.items():
        expected = [start + offset + 0.6 * number for number in range(150)]
        assert bench.times(request_type) == pytest.approx(expected, abs=0.001), request_type.__name__


@pytest.mark.parametrize(
    ("enemies", "confederates", "asked"),
    [
        (0, 0, {NaviPositionRequest, KalmanPositionRequest}),
        (1, 0, {NaviPositionRequest, KalmanPositionRequest, Enemy1PositionRequest}),
        (2, 0, {NaviPositionRequest, KalmanPositionRequest, Enemy1PositionRequest, Enemy2PositionRequest}),
        (0, 1, {NaviPositionRequest, KalmanPositionRequest, ConfederatePositionRequest}),
        (2, 1, set(OFFSETS)),
    ],
)
def test_only_robots_that_take_part_are_asked_for(
    alone: Bench, enemies: int, confederates: int, asked: set[type[Message]]
) -> None:
    alone.core.configure_start(TeamColour.RED, enemies, confederates)
    alone.run(0.01)
    alone.say("drive", StartConfigurationConfirm())
    alone.check()
    started = len(alone.messages())
    alone.run(4.0)
    assert {type(message) for message in alone.messages()[started:]} == asked


def test_a_new_start_configuration_begins_a_new_series(alone: Bench) -> None:
    alone.configure()
    alone.run(5.0)
    alone.core.configure_start(TeamColour.YELLOW)
    alone.run(0.01)
    alone.say("drive", StartConfigurationConfirm())
    alone.check()
    confirmed = alone.times(StartConfigurationConfirm)[-1]
    asked = len(alone.times(*OFFSETS))
    alone.run(4.0)
    new = alone.times(*OFFSETS)[asked:]
    assert new[0] - confirmed == pytest.approx(2.1, abs=0.001)
    assert {type(sent.message) for sent in alone.log if sent.time >= new[0]} == {
        NaviPositionRequest,
        KalmanPositionRequest,
    }


def test_positions_are_kept_with_the_time_they_came(alone: Bench) -> None:
    position = KalmanPositionResponse(1, 2, 3, Source.INTERNAL)
    for each in (position, position._replace(x=5)):
        alone.say("drive", each)
    sighting = alone.core.positions[KalmanPositionResponse]
    assert sighting.position == position._replace(x=5)
    assert sighting.time == pytest.approx(alone.log[-1].time)


def test_where_a_robot_was_seen_last_is_kept_while_it_is_not_seen(alone: Bench) -> None:
    assert alone.core.last_seen(Source.ENEMY_1) is None
    with pytest.raises(UnknownName, match=r"^unknown robot 'enemy 1'; did you mean Source\.ENEMY_1"):
        alone.core.last_seen("enemy 1")  # type: ignore[arg-type]
    for x, y in ((700, 800), (None, None)):
        alone.say("navigation", Enemy1PositionResponse(x, y, None, Source.ENEMY_1))
    seen = alone.core.last_seen(Source.ENEMY_1)
    assert seen is not None
    assert seen.point == (700, 800)
    assert seen.time < alone.core.positions[Enemy1PositionResponse].time


def test_positions_are_polled_on_after_a_shutdown(alone: Bench) -> None:
    alone.configure()
    alone.core.emergency_shutdown()
    alone.run(4.0)
    assert len(alone.times(NaviPositionRequest)) == 4


# Positions on demand


def test_a_position_is_asked_for_and_returned(alone: Bench) -> None:
    call = alone.core.position()
    alone.run(0.7)
    answer = KalmanPositionResponse(None, None, None, Source.INTERNAL)
    alone.say("drive", answer)
    assert call.result(0) == answer
    assert gaps(alone.times(KalmanPositionRequest)) == pytest.approx([0.5], abs=ON_THE_WIRE)


# A second drive


@pytest.mark.parametrize("processing", [0.0, 1e-4])  # they answer at once, or one by one
def test_two_drives_that_differ_are_told_once(processing: float) -> None:
    bench = Bench()
    second = Drive(DICTIONARIES["drive"])
    bench.network.attach(second, bench.now, processing)
    bench.run(0.1)
    bench.configure()
    true_robot(bench)
    second.estimate = Estimate(TUNING, Pose(1000.0, 1000.0, 0.0))
    bench.core.goto(*FAR)
    bench.run(3.0)
    (told,) = [text for text in map(str, bench.network.reports) if "two drives answer" in text]
    assert "switch one of them off" in told
