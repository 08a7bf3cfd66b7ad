"""The three nodes together: startup (document 5.1) and the five flows of operation (document 4.2.2)."""

from __future__ import annotations

import pytest

from eurobot_od.errors import NoAnswer
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    CheckDriveResponse,
    CheckNaviRequest,
    CheckNaviResponse,
    EmergencyShutdown,
    EmergencyStop,
    GotoConfirm,
    GotoStateRequest,
    GotoStateResponse,
    GotoXY,
    KalmanPositionRequest,
    KalmanPositionResponse,
    NaviPositionRequest,
    NaviPositionResponse,
    StartConfigurationConfirm,
)
from eurobot_od.robot.model.values import Obstacle, Outcome, Source
from eurobot_od.robot.nodes.core import Core
from eurobot_od.robot.nodes.core.flows import GotoReport
from eurobot_od.robot.nodes.navigation import Fix
from tests.robot.nodes.harness import RED, Bench, Seen


@pytest.fixture
def bench() -> Bench:
    """All three nodes, configured; nothing has been on the bus since."""
    bench = Bench()
    bench.configure()
    bench.log.clear()
    return bench


def test_startup_checks_the_nodes_then_configures_then_polls() -> None:
    bench = Bench()

    async def start_up(core: Core) -> None:
        await core.check_nodes()
        await core.configure_start(*RED)

    bench.play(start_up(bench.core))
    expected = [CheckDriveRequest(), CheckDriveResponse(), CheckNaviRequest(), CheckNaviResponse()]
    assert bench.messages() == [*expected, RED, StartConfigurationConfirm(), *expected]
    assert bench.now - bench.log[0].time < 0.01
    bench.run(2.09)
    assert len(bench.log) == 10
    bench.run(0.02)
    assert bench.messages()[10:] == [
        NaviPositionRequest(),
        NaviPositionResponse(None, None, None, Source.INTERNAL),
        KalmanPositionRequest(),
        KalmanPositionResponse(200, 1800, 0, Source.INTERNAL),
    ]


@pytest.mark.parametrize("missing", ["drive", "navigation"])
def test_startup_is_blocked_by_a_node_that_is_missing(missing: str) -> None:
    bench = Bench(missing)

    async def start_up(core: Core) -> None:
        await core.check_nodes()
        await core.configure_start(*RED)

    with pytest.raises(NoAnswer):
        bench.play(start_up(bench.core))
    assert RED not in bench.messages()


def test_a_goto_to_a_position_is_confirmed_and_watched_until_arrival(bench: Bench) -> None:
    async def drive(core: Core) -> GotoReport:
        return await core.goto(700, 1700, 315, 60)

    report = bench.play(drive(bench.core))
    assert report.outcome is Outcome.ARRIVED
    flow = [message for message in bench.messages() if type(message).__name__.startswith("Goto")]
    assert flow[:2] == [GotoXY(700, 1700, 315, 60), GotoConfirm()]
    assert set(flow[2::2]) == {GotoStateRequest()}
    states = [message.time for message in flow[3::2] if isinstance(message, GotoStateResponse)]
    assert len(states) == len(flow[3::2])
    assert states[-1] == 0
    assert all(isinstance(time, int) for time in states)
    assert bench.pose().distance(bench.pose()._replace(x=700, y=1700).point) <= 5


def test_positions_are_polled_while_the_robot_drives(bench: Bench) -> None:
    bench.run(2.0)
    bench.core.goto(1500, 1000, 90, 50)
    bench.run(3.0)
    assert len(bench.times(NaviPositionRequest)) == 5
    assert len(bench.times(KalmanPositionResponse)) == 5


def test_the_emergency_mushroom_shuts_down_drive_and_core(bench: Bench) -> None:
    bench.core.goto(1500, 1000, 90, 100)
    bench.run(1.0)
    bench.log.clear()
    bench.core.emergency_shutdown()
    bench.run(0.9)
    assert bench.messages()[0] == EmergencyShutdown()
    assert (bench.core.shut_down, bench.drive.safe, bench.navigation.safe) == (True, True, True)
    assert not bench.drive.moving


@pytest.mark.parametrize("obstacle", Obstacle)
def test_an_obstacle_stops_the_goto(bench: Bench, obstacle: Obstacle) -> None:
    bench.core.goto(1500, 1000, 90, 100)
    bench.run(1.0)
    bench.log.clear()
    bench.core.emergency_stop(obstacle)
    bench.run(0.9)
    assert bench.messages()[0] == EmergencyStop(obstacle)
    assert (bench.drive.moving, bench.drive.obstacle) == (False, obstacle)


def test_navigation_raw_data_goes_to_the_drives_estimate(bench: Bench) -> None:
    bench.navigation.beacons = Seen(internal=Fix(210, 1800, 0))
    bench.run(2.11)
    assert bench.messages()[:2] == [NaviPositionRequest(), NaviPositionResponse(210, 1800, 0, Source.INTERNAL)]
    assert 205 < bench.pose().x < 210  # part of the way: the start place counts for something, too
    bench.run(20.0)
    assert bench.pose().x == pytest.approx(210, abs=0.1)


def test_the_filtered_position_goes_to_the_core(bench: Bench) -> None:
    bench.run(2.2)
    assert bench.messages()[2:4] == [KalmanPositionRequest(), KalmanPositionResponse(200, 1800, 0, Source.INTERNAL)]
    assert bench.core.positions[KalmanPositionResponse].position == bench.messages()[3]
    assert NaviPositionResponse not in bench.core.positions  # Table 5: to the drive only
