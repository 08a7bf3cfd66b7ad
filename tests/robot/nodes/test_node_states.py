"""The robot's nodes in the NMT states, and what is no answer to the core."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.errors import StateError
from eurobot_od.frame import Frame
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    CheckNaviRequest,
    EmergencyShutdown,
    EmergencyStop,
    Enemy1PositionRequest,
    GotoStateRequest,
    GotoXY,
    KalmanPositionRequest,
    KalmanPositionResponse,
    NaviPositionRequest,
    NaviPositionResponse,
    StartConfigurationConfirm,
    StopDrive,
)
from eurobot_od.robot.model.values import Obstacle, Source
from eurobot_od.robot.nodes import ROLES, Core
from tests.robot.nodes.harness import DICTIONARIES, PROTOCOL, RED, Bench


@pytest.mark.parametrize(("role", "node_id"), [("core", 1), ("drive", 2), ("navigation", 3)])
def test_a_node_boots_and_is_operational_by_itself(role: str, node_id: int) -> None:
    node = ROLES[role](DICTIONARIES[role])
    assert node.start(0.0) == [Frame(0x700 + node_id, b"\0")]
    assert node.device.state is NmtState.OPERATIONAL


@pytest.mark.parametrize(("role", "period"), [("core", 0.25), ("drive", 1.0), ("navigation", 1.0)])
def test_heartbeats_come_at_their_times_however_late_the_node_is_called(role: str, period: float) -> None:
    node = ROLES[role](DICTIONARIES[role])
    node.start(0.0)
    assert node.next_wakeup == period
    assert node.tick(period - 0.001) == []
    assert node.tick(period + 0.1) == [Frame(0x700 + node.device.node_id, b"\x05")]
    assert node.next_wakeup == 2 * period


# NMT states (CiA 301, 7.3.2)

STATES = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
}


def in_state(peer: str, command: NmtCommand) -> Bench:
    """Return a bench with a stand-in, configured, where all nodes have been commanded into an NMT state."""
    bench = Bench(peer)
    if peer == "core":
        bench.say("core", RED)
    else:
        bench.configure()
    bench.command(peer, command)
    return bench


@pytest.mark.parametrize("command", STATES)
@pytest.mark.parametrize("stop", [EmergencyShutdown(), EmergencyStop(Obstacle.ENEMY), StopDrive()])
def test_stops_act_in_every_nmt_state(command: NmtCommand, stop: Message) -> None:
    bench = Bench("core")
    bench.say("core", RED, GotoXY(1500, 1000, 0, 100), within=0.5)
    bench.command("core", command)
    assert bench.drive.device.state is STATES[command]
    assert bench.drive.moving
    bench.say("core", stop, within=1.0)
    assert bench.drive.stopped_by == stop
    assert not bench.drive.moving
    shut_down = isinstance(stop, EmergencyShutdown)
    assert (bench.drive.safe, bench.navigation.safe) == (shut_down, shut_down)


@pytest.mark.parametrize("command", STATES)
@pytest.mark.parametrize(
    ("call", "stop"),
    [
        (Core.emergency_shutdown, EmergencyShutdown()),
        (lambda core: core.emergency_stop(Obstacle.OBJECT), EmergencyStop(Obstacle.OBJECT)),
        (Core.stop, StopDrive()),
    ],
)
def test_the_core_sends_stops_in_every_nmt_state(
    command: NmtCommand, call: Callable[[Core], None], stop: Message
) -> None:
    bench = in_state("drive", command)
    call(bench.core)
    bench.run(0.01)
    assert bench.core.device.state is STATES[command]
    assert bench.messages()[-1] == stop


OTHERS = [
    GotoXY(1500, 1000, 0, 100),
    GotoStateRequest(),
    NaviPositionRequest(),
    NaviPositionResponse(1000, 1000, 0, Source.INTERNAL),
    KalmanPositionRequest(),
    Enemy1PositionRequest(),
    RED,
    CheckNaviRequest(),
    CheckDriveRequest(),
]


@pytest.mark.parametrize("command", [NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.STOP])
@pytest.mark.parametrize("message", OTHERS)
def test_other_messages_act_in_operational_only(command: NmtCommand, message: Message) -> None:
    bench = in_state("core", command)
    before = bench.pose()
    bench.say("core", message, within=0.2)
    assert bench.messages() == [RED, StartConfigurationConfirm(), message]
    assert (bench.pose(), bench.drive.goto) == (before, None)


@pytest.mark.parametrize("command", [NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.STOP])
def test_a_core_that_is_not_operational_polls_no_positions_and_takes_no_calls(command: NmtCommand) -> None:
    bench = in_state("drive", command)
    sent = len(bench.log)
    bench.run(3.0)
    assert len(bench.log) == sent
    with pytest.raises(StateError):
        bench.core.goto(1500, 1000, 0, 100)


def test_a_core_started_again_goes_on_polling_at_its_times() -> None:
    bench = in_state("drive", NmtCommand.ENTER_PRE_OPERATIONAL)
    bench.run(5.0)
    bench.command("drive", NmtCommand.START)
    bench.run(2.0)
    confirmed = bench.times(StartConfigurationConfirm)[0]
    offsets = [(time - confirmed - 2.1) % 0.6 for time in bench.times(NaviPositionRequest)]
    assert len(offsets) >= 3
    assert offsets == pytest.approx([0.0] * len(offsets), abs=0.001)


@pytest.mark.parametrize("field", [3001, 4095])
def test_a_position_out_of_range_is_no_answer_to_the_core(field: int) -> None:
    bench = Bench("drive", "navigation")
    call = bench.core.position()
    bench.run(0.01)
    data = PROTOCOL.pack("Kalman Position Response", x=field, y=0, angle=0, source=0)
    bench.say("drive", Frame(PROTOCOL.cob_id(KalmanPositionResponse), data))
    assert not call.done()
    assert bench.core.positions == {}
    answer = KalmanPositionResponse(1, 2, 3, Source.INTERNAL)
    bench.say("drive", answer)
    assert call.result(0) == answer
