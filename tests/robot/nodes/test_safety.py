"""The robot stands whenever nobody can command it: a section for each decision, 13 to 19 of the design.

Rule of this file: "stops" is what the core does, "stands" what the drive's wheels do; a test of safety looks at the
wheels.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from concurrent.futures import Future
from contextlib import ExitStack, suppress
from random import Random
from typing import Any, ClassVar

import pytest

from eurobot_od.bus.live import Live
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    CheckNaviRequest,
    CheckNaviResponse,
    ConfederatePositionResponse,
    EmergencyShutdown,
    EmergencyStop,
    Enemy1PositionResponse,
    Enemy2PositionResponse,
    GotoConfirm,
    GotoStateRequest,
    GotoStateResponse,
    GotoXY,
    KalmanPositionResponse,
    NaviPositionResponse,
    PositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.places import Pose
from eurobot_od.robot.model.values import (
    Barriers,
    GotoFault,
    Obstacle,
    Outcome,
    Passage,
    RobotError,
    Source,
    TeamColour,
)
from eurobot_od.robot.nodes import ROLES, Core, Drive, Navigation
from eurobot_od.robot.nodes.core.flows import GotoReport, NotStanding, Standstill
from eurobot_od.robot.nodes.core.recovery import PlaceLost
from eurobot_od.robot.nodes.estimate import Estimate
from eurobot_od.robot.nodes.motion import Odometry, WheelCommand
from eurobot_od.robot.nodes.navigation import Fix
from eurobot_od.robot.nodes.node import DEVIATION, NO_MATCH, TIME_LEFT, Handlers
from tests.client.peers import new_channel, open_bus
from tests.kit.bench import put
from tests.robot.nodes.harness import DICTIONARIES, PROTOCOL, RED, TUNING, Bench
from tests.rows import rows

FAR = GotoXY(2700, 1700, 0, 50)
"""A goto that takes more than 6 s from the red start place."""

NEAR = GotoXY(400, 1700, 0, 100)
"""A goto that takes less than 2 s from the red start place."""

BRAKED = 1.0
"""Within this many seconds the robot stands, whatever one frame was lost."""

NOT_STANDING, HEARTBEAT_LOST = RobotError.NOT_STANDING, 0x8130

CORE_ID, DRIVE_ID, NAVIGATION_ID = 1, 2, 3


def ready(*peers: str) -> Bench:
    """Return all three nodes, configured; the peers are stand-ins."""
    bench = Bench(*peers)
    bench.configure()
    return bench


@pytest.fixture
def bench() -> Bench:
    """All three nodes, configured."""
    return ready()


@pytest.fixture
def half() -> Bench:
    """The core, and stand-ins for the others, configured."""
    return ready("drive", "navigation")


def drive_off(bench: Bench, goto: GotoXY = FAR, seconds: float = 2.0) -> Future[GotoReport]:
    """Begin with a goto, and have the robot drive for some time."""
    call = bench.core.goto(*goto)
    bench.run(seconds)
    assert bench.drive.moving
    assert not call.done()
    return call


def nmt(bench: Bench, command: NmtCommand, node_id: int) -> None:
    """Have a master, which is not a node of this bus, send an NMT command to one node."""
    for station in bench.stations.values():
        station.controller.receive(Frame(NMT_COB_ID, bytes([command, node_id])), bench.now)


def commands(bench: Bench, since: float = 0.0) -> list[Message]:
    """Return the gotos and stops on the bus since a time."""
    kinds = (GotoXY, StopDrive, EmergencyStop, EmergencyShutdown)
    return [message for time, message in bench.log if time >= since and isinstance(message, kinds)]


# 13: a stop is neither dropped nor merely sent

STOPS: list[tuple[Callable[[Core], Future[Standstill]], type[Message]]] = [
    (Core.stop, StopDrive),
    (lambda core: core.emergency_stop(Obstacle.ENEMY), EmergencyStop),
    (Core.emergency_shutdown, EmergencyShutdown),
]


@pytest.mark.parametrize("lost", [1, 3])
@pytest.mark.parametrize(("stop", "kind"), STOPS)
def test_13_a_stop_that_is_lost_is_sent_again(
    bench: Bench, stop: Callable[[Core], Future[Standstill]], kind: type[Message], lost: int
) -> None:
    drive_off(bench)
    bench.lose(kind, count=lost)
    call, told = stop(bench.core), bench.now
    bench.run(BRAKED)
    assert not bench.drive.moving
    bench.run(0.5)
    assert call.result(0).seconds < BRAKED + 0.5
    assert len([time for time in bench.times(kind) if time >= told]) > 1


def test_13_a_kind_of_stop_that_never_arrives_does_not_matter(bench: Bench) -> None:
    drive_off(bench)
    bench.lose(EmergencyStop)
    call = bench.core.emergency_stop(Obstacle.OBJECT)
    bench.run(BRAKED)
    assert not bench.drive.moving
    bench.run(0.5)
    assert call.done()


@pytest.mark.parametrize("answer", [GotoStateResponse, KalmanPositionResponse])
def test_13_answers_of_the_drive_that_are_lost_only_delay_the_result(bench: Bench, answer: type[Message]) -> None:
    drive_off(bench)
    bench.lose(answer, count=4)
    call = bench.core.stop()
    bench.run(BRAKED)
    assert not bench.drive.moving
    bench.run(1.0)
    position = call.result(0).position
    assert (position.x, position.y) == pytest.approx(bench.pose().point, abs=1)


@pytest.mark.parametrize("seconds", [1.0, 5.0])
@pytest.mark.parametrize(("stop", "kind"), STOPS)
def test_13_stops_outlast_a_bus_that_is_off_and_only_one_of_a_kind_waits(
    bench: Bench, stop: Callable[[Core], Future[Standstill]], kind: type[Message], seconds: float
) -> None:
    drive_off(bench)
    off = bench.now
    bench.network.cut(off + seconds)
    for _ in range(5):
        stop(bench.core)
        bench.run(seconds / 10)
    bench.run(seconds / 2)
    bench.run(0.003)
    back = [message for time, message in bench.log if time >= off and isinstance(message, kind)]
    assert len(back) == 1
    bench.run(BRAKED)
    assert not bench.drive.moving
    bench.run(5.0)
    assert bench.core.is_commanding is False
    assert not bench.drive.moving


class Runaway(Drive):
    """A drive that brakes for nothing until it is `tamed`."""

    tamed = False

    def _stop(self, stop: Any) -> None:
        if self.tamed:
            super()._stop(stop)

    HANDLERS: ClassVar[Handlers] = {
        **Drive.HANDLERS,
        StopDrive: _stop,
        EmergencyStop: _stop,
        EmergencyShutdown: lambda self, shutdown: self._shut_down(shutdown) if self.tamed else None,
    }


def test_13_a_robot_that_does_not_stand_is_told_and_shut_down_until_it_does() -> None:
    bench = Bench()
    drive = Runaway(DICTIONARIES["drive"])
    bench.replace("drive", drive)
    bench.run(0.1)
    bench.configure()
    drive_off(bench)
    call, told = bench.core.stop(), bench.now
    bench.run(1.9)
    assert not call.done()
    assert EmergencyShutdown() not in bench.messages()
    bench.run(0.4)
    error = call.exception(0)
    assert isinstance(error, NotStanding)
    assert (
        str(error)
        == "the robot was told to stop and was not seen to stand within 2.0 s; Emergency Shutdown is being sent"
    )
    assert [str(report.text) for report in bench.network.reports if "not seen to stand" in str(report.text)]
    assert bench.emergencies("core") == [NOT_STANDING]
    assert bench.core.shut_down
    with pytest.raises(StateError, match="after an emergency shutdown"):
        bench.core.goto(*NEAR)
    bench.run(1.0)
    repeated = [time for time in bench.times(EmergencyShutdown) if time >= told]
    assert len(repeated) > 3
    drive.tamed = True
    bench.run(BRAKED)
    assert not drive.moving
    bench.run(0.5)
    assert bench.emergencies("core") == [NOT_STANDING, 0]
    sent = len(bench.times(EmergencyShutdown))
    bench.run(2.0)
    assert len(bench.times(EmergencyShutdown)) == sent


def test_13_a_start_configuration_ends_the_emergency_and_the_next_goto_is_left_alone(bench: Bench) -> None:
    drive_off(bench)
    bench.lose(GotoStateResponse)
    call = bench.core.stop()
    bench.run(2.4)
    assert isinstance(call.exception(0), NotStanding)
    bench.lose()
    bench.configure()
    begun = bench.now
    bench.core.goto(*FAR)
    bench.run(2.0)
    assert bench.drive.moving
    assert commands(bench, begun) == [FAR]


def test_13_a_drive_that_says_it_stopped_and_rolls_on_is_not_believed(half: Bench) -> None:
    call = half.core.stop()
    for step in range(20):
        half.say("drive", GotoStateResponse(None), KalmanPositionResponse(500 + 10 * step, 500, 0, Source.INTERNAL))
        half.run(0.1)
    half.run(0.5)
    assert isinstance(call.exception(0), NotStanding)
    sent = len(half.times(EmergencyShutdown))
    half.run(1.0)
    assert len(half.times(EmergencyShutdown)) - sent >= 4


def test_13_a_drive_that_says_it_drives_does_not_stand(half: Bench) -> None:
    call = half.core.stop()
    for _ in range(20):  # the wheels may just not have begun to roll
        half.say("drive", GotoStateResponse(1000), KalmanPositionResponse(500, 500, 0, Source.INTERNAL))
        half.run(0.1)
    half.run(0.5)
    assert isinstance(call.exception(0), NotStanding)


# How far apart two positions of a robot that stands may be: mm and degrees; the drive rounds to whole ones.
APART = [
    ((500, 500, 0), True, "not at all"),
    ((502, 500, 0), True, "as far as the rounding of a robot at rest goes"),
    ((503, 500, 0), False, "30 mm/s"),
    ((500, 497, 0), False, "sideways as well"),
    ((500, 500, 1), True, "the rounding of its angle"),
    ((500, 500, 359), True, "the other way round"),
    ((500, 500, 2), False, "it turns"),
    ((None, None, None), False, "it knew where it was, and does not any more"),
]


@rows("after, stands, why", APART)
def test_13_two_positions_have_to_agree(
    after: tuple[int | None, int | None, int | None], stands: bool, why: str
) -> None:
    half = ready("drive", "navigation")
    call = half.core.stop()
    half.run(0.101)
    half.say("drive", GotoStateResponse(None), within=0.001)
    half.say("drive", KalmanPositionResponse(500, 500, 0, Source.INTERNAL), within=0.101)
    half.say("drive", KalmanPositionResponse(*after, Source.INTERNAL))
    assert call.done() is stands, why


def test_13_a_cancelled_stop_is_watched_all_the_same(bench: Bench) -> None:
    drive_off(bench)
    bench.lose(StopDrive, count=1)
    assert bench.core.stop().cancel()
    bench.run(BRAKED)
    assert not bench.drive.moving


def test_13_stops_in_a_row_are_watched_as_one(bench: Bench) -> None:
    drive_off(bench)
    first = bench.core.stop()
    bench.run(0.15)
    second = bench.core.emergency_stop(Obstacle.ENEMY)
    asked = len(bench.times(GotoStateRequest))
    bench.run(2.0)
    assert first.result(0) == second.result(0)
    assert len(bench.times(GotoStateRequest)) - asked < 8


def test_13_a_new_goto_ends_the_watch(bench: Bench) -> None:
    drive_off(bench)
    stop = bench.core.stop()
    bench.run(0.05)
    goto = bench.core.goto(*NEAR)
    bench.run(5.0)
    assert isinstance(stop.exception(0), StateError)
    assert goto.result(0).outcome is Outcome.ARRIVED
    assert commands(bench) == [FAR, StopDrive(), NEAR]


def test_13_a_configuration_that_fails_does_not_end_the_watch(bench: Bench) -> None:
    """A drive that hears neither the stop nor the configuration drives on, and is stopped when it hears again."""
    drive_off(bench, FAR._replace(speed=20))
    bench.lose(StopDrive, StartConfigurationSet)
    call = bench.core.configure_start(*RED)
    bench.run(4.0)
    assert isinstance(call.exception(0), NoAnswer)
    assert bench.drive.moving
    bench.lose()
    bench.run(BRAKED)
    assert not bench.drive.moving


def test_13_a_stop_before_a_configuration_that_is_replaced_shuts_nothing_down_afterwards(bench: Bench) -> None:
    bench.core.emergency_shutdown()
    bench.run(1.0)
    bench.lose(StartConfigurationConfirm, count=1)
    bench.core.configure_start(*RED)
    bench.run(0.1)
    bench.lose(GotoStateResponse, count=5)
    new = bench.core.configure_start(*RED)
    bench.run(2.0)
    new.result(0)
    assert (bench.core.shut_down, bench.drive.safe) == (False, False)


def test_13_a_late_confirm_after_a_shutdown_that_is_over_does_not_shut_down_again(half: Bench) -> None:
    half.core.emergency_shutdown()
    half.run(0.1)
    half.configure()
    half.say("drive", GotoConfirm())
    assert half.messages()[-1] == StopDrive()
    assert not half.core.shut_down


# 14: a goto that ends in any way but arrived, replaced, impossible or blocked is stopped


def cancelled(_: Bench, call: Future[GotoReport]) -> None:
    assert call.cancel()


def configured(bench: Bench, _: Future[GotoReport]) -> None:
    bench.core.configure_start(*RED)


def asleep(bench: Bench, _: Future[GotoReport]) -> None:
    """Nobody hears what the drive says about its goto."""
    bench.lose(GotoStateResponse)
    bench.run(3.3)
    bench.lose()


def command(command: NmtCommand) -> Callable[[Bench, Future[GotoReport]], None]:
    return lambda bench, _: nmt(bench, command, CORE_ID)


# What ends a goto under way, and what its call then says: an outcome, an error, or None for a call that was cancelled.
ENDS: list[tuple[str, Callable[[Bench, Future[GotoReport]], None], Outcome | type[Exception] | None]] = [
    ("nobody waits for it", cancelled, None),
    ("its state is not told", asleep, NoAnswer),
    ("a master stops the core", command(NmtCommand.STOP), Outcome.STOPPED),
    ("a master makes the core pre-operational", command(NmtCommand.ENTER_PRE_OPERATIONAL), Outcome.STOPPED),
    ("a master resets the core", command(NmtCommand.RESET_NODE), StateError),
    ("a master resets the core's communication", command(NmtCommand.RESET_COMMUNICATION), StateError),
    ("a new start configuration", configured, Outcome.STOPPED),
]


@pytest.mark.parametrize(("why", "end", "said"), ENDS, ids=[why for why, _, _ in ENDS])
def test_14_however_a_goto_ends_the_robot_stands(
    bench: Bench,
    why: str,
    end: Callable[[Bench, Future[GotoReport]], None],
    said: Outcome | type[Exception] | None,
) -> None:
    call = drive_off(bench)
    end(bench, call)
    bench.run(BRAKED)
    assert not bench.drive.moving, why
    assert StopDrive() in bench.messages()
    assert call.done()
    if isinstance(said, Outcome):
        assert call.result(0).outcome is said
    elif said is not None:
        assert isinstance(call.exception(0), said)
    bench.run(5.0)
    assert not bench.drive.moving


def test_14_a_core_that_is_reset_sees_to_its_stop_itself(bench: Bench) -> None:
    drive_off(bench)
    bench.lose(StopDrive, count=1)
    bench.drive.booted = id  # type: ignore[assignment]  # a drive that overlooks the boot-up message
    nmt(bench, NmtCommand.RESET_NODE, CORE_ID)
    bench.run(BRAKED)
    assert not bench.drive.moving


def test_14_a_core_that_may_not_ask_does_not_believe_that_the_robot_stands(bench: Bench) -> None:
    """A master has stopped it in the midst of a goto: it sends what it may, and that is stops."""
    drive_off(bench)
    nmt(bench, NmtCommand.STOP, CORE_ID)
    bench.run(3.0)
    assert commands(bench)[-2:] == [EmergencyShutdown(), StopDrive()]
    assert bench.core.shut_down
    nmt(bench, NmtCommand.START, CORE_ID)
    bench.run(1.0)
    sent = len(commands(bench))
    bench.run(2.0)
    assert len(commands(bench)) == sent
    bench.configure()
    drive_off(bench, NEAR, 0.5)


@pytest.mark.parametrize("lost", [1, 2])
@pytest.mark.parametrize(("why", "end", "said"), ENDS[:6], ids=[why for why, _, _ in ENDS[:6]])
def test_14_also_if_the_first_stops_are_lost(
    bench: Bench, why: str, end: Callable[[Bench, Future[GotoReport]], None], said: object, lost: int
) -> None:
    call = drive_off(bench, FAR._replace(speed=20))
    end(bench, call)
    bench.lose(StopDrive, count=lost)
    bench.run(BRAKED + 1.0)
    assert not bench.drive.moving, (why, said)


def test_14_a_goto_whose_confirm_never_comes_is_stopped(bench: Bench) -> None:
    bench.lose(GotoConfirm)
    call = bench.core.goto(*FAR)
    bench.run(2.9)
    assert bench.drive.moving
    bench.run(0.2 + BRAKED)
    assert isinstance(call.exception(0), NoAnswer)
    assert not bench.drive.moving


def test_14_a_goto_without_time_is_timed_out(bench: Bench) -> None:
    call = bench.core.goto(*FAR, timeout=1.5)
    bench.run(1.4)
    assert bench.drive.moving
    assert not call.done()
    bench.run(0.2)
    report = call.result(0)
    assert report.outcome is Outcome.TIMED_OUT
    assert report.ended == pytest.approx(1.5, abs=0.001)
    bench.run(BRAKED)
    assert not bench.drive.moving


@pytest.mark.parametrize("timeout", [0.0, 0.0001, -1.0])
def test_14_a_goto_that_has_no_time_at_all_does_not_drive(bench: Bench, timeout: float) -> None:
    call = bench.core.goto(*FAR, timeout=timeout)
    bench.run(BRAKED)
    assert call.result(0).outcome is Outcome.TIMED_OUT
    assert not bench.drive.moving


def test_14_the_time_out_is_a_setting(bench: Bench) -> None:
    bench.core.device.objects.put(bench.core.device.dictionary.address("Goto handshake.Time-out"), 1)
    call = bench.core.goto(*FAR)
    bench.run(1.1 + BRAKED)
    assert call.result(0).outcome is Outcome.TIMED_OUT
    assert not bench.drive.moving


def test_14_the_time_of_a_goto_that_has_ended_is_no_limit_for_the_next_one(bench: Bench) -> None:
    slow = FAR._replace(speed=10)
    first = bench.core.goto(*slow, timeout=2.0)
    bench.run(1.0)
    second = bench.core.goto(*slow)
    bench.run(2.0)
    assert first.result(0).outcome is Outcome.REPLACED
    assert bench.drive.moving
    assert not second.done()


async def waits_for_too_short(core: Core) -> None:
    with pytest.raises(asyncio.TimeoutError):
        await asyncio.wait_for(core.goto(*FAR), 1.0)
    await asyncio.sleep(BRAKED)


async def cancels_its_task(core: Core) -> None:
    task = asyncio.ensure_future(core.goto(*FAR))
    await asyncio.sleep(1.0)
    task.cancel()
    await asyncio.sleep(BRAKED)


@pytest.mark.parametrize("strategy", [waits_for_too_short, cancels_its_task])
def test_14_a_strategy_that_does_not_wait_any_longer(bench: Bench, strategy: Callable[[Core], Any]) -> None:
    bench.play(strategy(bench.core))
    assert set(commands(bench)) == {FAR, StopDrive()}
    assert not bench.drive.moving


def test_14_an_exception_in_a_strategy(bench: Bench) -> None:
    async def strategy() -> None:
        goto = asyncio.ensure_future(bench.core.goto(*FAR))
        await asyncio.sleep(1.0)
        assert not goto.done()
        assert bench.drive.moving
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        bench.play(strategy())
    bench.run(BRAKED)
    assert not bench.drive.moving


def test_14_no_stop_is_sent_for_a_goto_that_has_arrived(bench: Bench) -> None:
    call = bench.core.goto(*NEAR)
    bench.run(5.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    assert commands(bench) == [NEAR]


def test_14_no_stop_is_sent_for_a_goto_that_is_replaced(bench: Bench) -> None:
    first = drive_off(bench)
    bench.core.goto(*NEAR)
    bench.run(9.0)
    assert first.result(0).outcome is Outcome.REPLACED
    assert commands(bench) == [FAR, NEAR]


class Stuck:
    """Wheels that do nothing."""

    def advance(self, _command: WheelCommand, _dt: float) -> Odometry:
        return Odometry(0.0, 0.0)


def test_14_no_stop_is_sent_for_a_goto_that_is_impossible_or_blocked(bench: Bench) -> None:
    impossible = GotoXY(900, 900, 0, 100, Barriers.of({7: Passage.FORCED}))
    call = bench.core.goto(*impossible)
    bench.run(1.0)
    assert call.result(0).outcome is Outcome.NOT_POSSIBLE
    bench.drive.chassis = Stuck()
    blocked = bench.core.goto(*FAR)
    bench.run(2.0)
    assert blocked.result(0).outcome is Outcome.BLOCKED
    assert commands(bench) == [impossible, FAR]
    assert not bench.drive.moving


@pytest.mark.parametrize("late", [GotoConfirm(), GotoStateResponse(1500)])
def test_14_what_the_drive_says_of_a_goto_that_was_given_up_is_answered_with_a_stop(half: Bench, late: Message) -> None:
    call = half.core.goto(*FAR)
    half.run(4.0)
    assert isinstance(call.exception(0), NoAnswer)
    half.say("drive", GotoStateResponse(None), within=0.0)
    half.run(60.0)
    now = half.now
    half.say("drive", late)
    assert commands(half, now) in ([StopDrive()], [EmergencyShutdown()])


@pytest.mark.parametrize("late", [GotoStateResponse(0), GotoStateResponse(None), GotoStateResponse(GotoFault.BLOCKED)])
def test_14_a_state_that_moves_nothing_is_left_alone(bench: Bench, late: Message) -> None:
    bench.core.stop()
    bench.run(1.0)
    sent = len(commands(bench))
    bench.core.receive(PROTOCOL.encode(late), bench.now)
    bench.run(1.0)
    assert len(commands(bench)) == sent


def test_14_a_goto_that_comes_to_the_drive_when_it_was_given_up_long_ago(bench: Bench) -> None:
    """The bus is off, so the goto waits in the mailboxes until nobody wants it any more."""
    bench.network.cut(bench.now + 10.0)
    call = bench.core.goto(*FAR)
    bench.run(9.0)
    assert isinstance(call.exception(0), NoAnswer)
    bench.run(1.0 + BRAKED)
    assert FAR in bench.messages()
    assert not bench.drive.moving


# 15: the drive watches the core

CORE_WATCHED = 0.75
"""Seconds of silence after which the drive brakes (its 0x1016)."""


def test_15_a_core_that_is_gone_brakes_the_drive_and_only_a_new_goto_moves_it() -> None:
    bench = Bench()
    bench.configure()
    drive_off(bench)
    bench.network.detach(bench.stations["core"])
    gone = bench.now
    while not bench.emergencies("drive"):
        bench.run(0.01)
    assert bench.now - gone <= CORE_WATCHED + 0.01
    bench.run(0.5)
    assert not bench.drive.moving
    assert bench.emergencies("drive") == [HEARTBEAT_LOST]
    bench.run(5.0)
    assert not bench.drive.moving
    bench.attach("core", Core(DICTIONARIES["core"]))
    bench.run(2.0)
    assert bench.emergencies("drive") == [HEARTBEAT_LOST, 0]
    assert not bench.drive.moving
    bench.configure()
    drive_off(bench, FAR, 1.0)


def test_15_a_core_without_heartbeats_is_not_watched() -> None:
    bench = Bench()
    bench.replace("drive", Drive(DICTIONARIES["drive"]))  # it has never heard the core before
    core = Core(DICTIONARIES["core"])
    core.device.objects.put((0x1017, 0), 0)
    bench.replace("core", core)
    bench.run(0.01)
    bench.configure()
    call = bench.core.goto(*FAR)
    bench.run(3.0)
    assert bench.drive.moving
    assert bench.emergencies("drive") == []
    bench.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED


def test_15_a_core_that_is_gone_right_after_its_first_goto_is_missed() -> None:
    """Its next heartbeat would have come 250 ms after its boot-up."""
    bench = Bench()
    bench.configure()
    bench.core.goto(*FAR)
    bench.run(0.1)
    bench.network.detach(bench.stations["core"])
    bench.run(CORE_WATCHED)
    assert bench.emergencies("drive") == [HEARTBEAT_LOST]
    bench.run(0.5)
    assert not bench.drive.moving


def test_15_a_core_that_boots_brakes_the_drive(bench: Bench) -> None:
    drive_off(bench)
    bench.replace("core", Core(DICTIONARIES["core"]))
    bench.run(0.5)
    assert not bench.drive.moving
    bench.run(5.0)
    assert not bench.drive.moving


def test_15_a_core_that_hangs_for_a_moment_is_not_missed(bench: Bench) -> None:
    call = drive_off(bench)
    bench.network.freeze(bench.stations["core"], bench.now + 0.4)
    bench.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED


def test_15_a_core_that_hangs_for_long_finds_its_goto_stopped(bench: Bench) -> None:
    call = drive_off(bench)
    bench.network.freeze(bench.stations["core"], bench.now + 5.0)
    bench.run(CORE_WATCHED + 0.5)
    assert not bench.drive.moving
    bench.run(6.0)
    assert call.result(0).outcome is Outcome.LOST  # it asks once more, and hears that the drive has no goto
    assert not bench.drive.moving


# 16: nodes that are lost


def reboot(bench: Bench, name: str) -> None:
    """Switch a node off and on: the wheels stay where they are, and what it knew is gone."""
    node: Drive | Navigation
    if name == "drive":
        node = Drive(DICTIONARIES[name], bench.drive.chassis)
    else:
        node = Navigation(DICTIONARIES[name], bench.navigation.beacons)
    bench.replace(name, node)


class TrueRobot:
    """Wheels that know where the robot really is, and beacons that see it there if they are `clear`."""

    def __init__(self, pose: Pose) -> None:
        self.pose, self.clear = pose, True

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        self.pose = self.pose.moved(command.speed * dt, command.turn * dt)
        return Odometry(command.speed * dt, command.turn * dt)

    def locate(self, whom: Source, _now: float) -> Fix | None:
        return Fix(*self.pose) if whom is Source.INTERNAL and self.clear else None


def true_robot(bench: Bench) -> TrueRobot:
    """Put the robot of a bench at the place where the drive believes it is."""
    robot = TrueRobot(bench.pose())
    bench.drive.chassis = bench.navigation.beacons = robot
    return robot


def test_16_a_drive_that_knows_of_no_goto_again_and_again_has_lost_it(half: Bench) -> None:
    call = half.core.goto(*FAR)
    half.run(0.002)
    half.say("drive", GotoConfirm(), within=0.25)
    for _ in range(4):
        half.say("drive", GotoStateResponse(None), within=0.11)
    assert not call.done()
    half.say("drive", GotoStateResponse(None), within=0.11)
    report = call.result(0)
    assert (report.outcome, report.why) == (Outcome.LOST, "the drive knows of no goto")
    assert commands(half) == [FAR, StopDrive()]


def test_16_answers_without_a_goto_count_in_a_row_only(half: Bench) -> None:
    call = half.core.goto(*FAR)
    half.run(0.002)
    half.say("drive", GotoConfirm(), within=0.25)
    for _ in range(3):
        for left in (None, None, None, None, 500):
            half.say("drive", GotoStateResponse(left), within=0.11)
    assert not call.done()


@pytest.mark.parametrize(("after", "place"), [(0.1, "unknown"), (0.5, "unknown"), (2.0, "seen"), (5.0, "seen")])
def test_16_a_drive_that_boots_loses_its_goto_and_the_next_one_recovers_it(
    bench: Bench, after: float, place: str
) -> None:
    """Once the beacons have seen a drive that has booted, it knows its place, and nothing may erase that."""
    true_robot(bench)
    bench.run(2.5)  # positions are polled
    call = drive_off(bench)
    reboot(bench, "drive")
    bench.run(0.01)
    assert call.result(0).outcome is Outcome.LOST
    bench.run(after)
    assert not bench.drive.moving
    begun = len(bench.log)
    next_goto = bench.core.goto(*FAR)
    bench.run(8.0)
    assert next_goto.result(0).outcome is Outcome.ARRIVED
    order = [type(each) for each in bench.messages()[begun:]]
    configured = [StartConfigurationSet] if place == "unknown" else []
    steps = [CheckDriveRequest, *configured, NaviPositionResponse, GotoXY]
    assert sorted(steps, key=order.index) == steps
    assert order.count(StartConfigurationSet) == len(configured)
    assert next_goto.result(0).ended < call.result(0).ended + 6.0  # it began where the beacons saw it


@pytest.mark.parametrize("attempts", [1, 3])
@pytest.mark.parametrize("after", [0.05, 0.5, 5.0])
def test_16_a_drive_that_has_lost_its_place_is_not_driven(bench: Bench, after: float, attempts: int) -> None:
    """After it has booted it says "unknown", and after the configuration its start place: neither is to be believed."""
    bench.run(2.5)
    drive_off(bench, FAR._replace(speed=100))
    reboot(bench, "drive")
    bench.run(after)
    booted = bench.now
    for _ in range(attempts):
        call = bench.core.goto(*FAR)
        bench.run(5.0)
        error = call.exception(0)
        assert isinstance(error, StateError)
        assert str(error).startswith("the drive has lost its place: it was last seen at (")
    assert GotoXY not in {type(message) for time, message in bench.log if time > booted}
    assert not bench.drive.moving
    bench.configure()
    drive_off(bench, FAR, 1.0)


def test_16_beacons_that_see_the_robot_again_bring_it_back(bench: Bench) -> None:
    robot = true_robot(bench)
    bench.run(2.5)
    drive_off(bench, FAR._replace(speed=100))
    robot.clear = False
    reboot(bench, "drive")
    bench.run(0.5)
    lost = bench.core.goto(*FAR)
    bench.run(3.0)
    assert isinstance(lost.exception(0), StateError)
    robot.clear = True
    call = bench.core.goto(*FAR)
    bench.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED


def test_16_a_navigation_that_boots_is_configured_before_the_next_goto_and_this_one_goes_on(bench: Bench) -> None:
    true_robot(bench)
    bench.run(2.5)
    call = drive_off(bench)
    reboot(bench, "navigation")
    bench.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    back = bench.core.goto(2000, 1700, 180, 50)
    bench.run(8.0)
    assert back.result(0).outcome is Outcome.ARRIVED
    assert bench.navigation.configuration == RED


@pytest.mark.parametrize("name", ["drive", "navigation"])
def test_16_after_a_lost_heartbeat_no_goto_goes_out_before_checks_and_a_healthy_drive_keeps_its_place(
    name: str,
) -> None:
    bench = Bench()
    bench.run(1.5)  # a heartbeat of each
    bench.configure()
    true_robot(bench)
    bench.core.goto(*FAR._replace(speed=1))
    bench.run(0.5)
    lost, frozen = bench.now, bench.now + 2.8
    bench.network.freeze(bench.stations[name], frozen)
    bench.run(2.2)
    assert bench.core.is_commanding is False
    call = bench.core.goto(*FAR)
    while bench.now < frozen:
        bench.run(0.05)
        assert GotoXY not in {type(message) for time, message in bench.log if time > lost}
    bench.run(12.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    order = [type(message) for time, message in bench.log if time > lost]
    steps = [CheckDriveRequest, GotoXY]
    assert sorted(steps, key=order.index) == steps
    assert StartConfigurationSet not in order


def test_16_a_goto_that_replaces_another_after_a_loss_has_the_drive_stand_first(bench: Bench) -> None:
    """The navigation boots and dies: nobody would look at the drive during its checks, which are not answered."""
    bench.run(2.5)
    slow = FAR._replace(speed=10)
    first = drive_off(bench, slow, 1.0)
    reboot(bench, "navigation")
    bench.run(0.05)
    bench.network.detach(bench.stations["navigation"])
    second = bench.core.goto(*FAR)
    bench.run(BRAKED)
    assert first.result(0).outcome is Outcome.REPLACED
    assert not bench.drive.moving
    bench.run(20.0)
    assert second.done()
    assert not bench.drive.moving


def test_16_a_stop_is_watched_on_while_a_goto_waits_for_lost_nodes(bench: Bench) -> None:
    bench.run(2.5)
    drive_off(bench, FAR._replace(speed=10), 1.0)
    bench.lose(StopDrive, CheckDriveRequest)
    bench.core.heartbeat_lost(NAVIGATION_ID)
    bench.core.goto(*FAR)
    bench.run(0.5)
    assert bench.drive.moving
    bench.lose(CheckDriveRequest)
    bench.run(BRAKED)
    assert not bench.drive.moving


@pytest.mark.parametrize("name", ["drive", "navigation"])
def test_16_a_node_that_boots_while_it_is_configured_is_configured_again(half: Bench, name: str) -> None:
    call = half.core.configure_start(*RED)
    half.run(0.01)
    half.say("navigation", StartConfigurationConfirm())
    half.say(name, Frame(0x700 + half.nodes[name].device.node_id, b"\x00"))
    half.check()
    assert call.done()
    half.core.goto(*FAR)
    half.run(0.01)
    assert half.messages()[-1] == CheckDriveRequest()


def test_16_a_goto_that_is_cancelled_while_it_waits_for_lost_nodes_is_never_sent(bench: Bench) -> None:
    bench.lose(CheckDriveRequest)
    bench.core.heartbeat_lost(NAVIGATION_ID)
    call = bench.core.goto(*FAR)
    bench.run(1.5)
    assert call.cancel()
    bench.lose()
    bench.run(5.0)
    assert FAR not in bench.messages()
    assert not bench.drive.moving


def test_16_a_goto_that_waits_for_lost_nodes_ends_when_the_robot_does_not_stand() -> None:
    bench = Bench()
    drive = Runaway(DICTIONARIES["drive"])
    bench.replace("drive", drive)
    bench.run(0.1)
    bench.configure()
    drive_off(bench, FAR._replace(speed=10), 0.5)
    bench.lose(CheckDriveRequest)
    bench.core.heartbeat_lost(NAVIGATION_ID)
    call = bench.core.goto(*NEAR)
    bench.run(3.0)
    assert isinstance(call.exception(0), NotStanding)
    assert bench.core.shut_down
    drive.tamed = True
    bench.run(BRAKED)
    assert not drive.moving


# 17: who has said it


def test_17_the_confirm_of_the_navigation_alone_does_not_start_a_robot_without_a_drive() -> None:
    bench = Bench("drive")
    call = bench.core.configure_start(*RED)
    bench.run(30.0)
    assert StartConfigurationConfirm() in bench.messages()
    assert str(call.exception(0)).startswith("no CheckDriveResponse after 10 x")
    assert bench.core.configuration is None


# Each position, who may be in it, and who says it.
OWN: list[tuple[type[PositionResponse], Source, str]] = [
    (KalmanPositionResponse, Source.INTERNAL, "drive"),
    (ConfederatePositionResponse, Source.CONFEDERATE, "navigation"),
    (Enemy1PositionResponse, Source.ENEMY_1, "navigation"),
    (Enemy2PositionResponse, Source.ENEMY_2, "navigation"),
]


@rows("kind, right, name, wrong", [(*each, wrong) for each in OWN for wrong in Source if wrong is not each[1]])
def test_17_a_position_of_another_robot_is_dropped_counted_and_told_once(
    kind: type[PositionResponse], right: Source, name: str, wrong: Source
) -> None:
    half = ready("drive", "navigation")
    half.run(1.0)
    before = half.core.positions.copy()
    half.say(name, kind(1, 2, 3, wrong), kind(4, 5, 6, wrong))
    assert half.core.positions == before
    assert half.core.ignored == 2
    assert half.emergencies("core") == [RobotError.WRONG_SOURCE]
    half.say(name, kind(7, 8, 9, right))
    assert half.core.positions[kind].position == kind(7, 8, 9, right)
    assert half.emergencies("core") == [RobotError.WRONG_SOURCE, 0]
    half.say(name, kind(1, 2, 3, wrong))
    assert half.emergencies("core") == [RobotError.WRONG_SOURCE, 0, RobotError.WRONG_SOURCE]


def test_17_a_position_of_another_robot_answers_no_question(half: Bench) -> None:
    call = half.core.position()
    half.run(0.01)
    half.say("drive", KalmanPositionResponse(1, 2, 3, Source.ENEMY_1))
    assert not call.done()
    half.say("drive", KalmanPositionResponse(1, 2, 3, Source.INTERNAL))
    assert call.done()


def test_17_the_drive_drops_a_navigation_position_of_another_robot() -> None:
    bench = Bench("navigation")
    bench.configure()
    before = bench.pose()
    bench.say("navigation", *[NaviPositionResponse(1000, 1000, 90, Source.ENEMY_1)] * 9)
    assert bench.pose() == before
    assert bench.drive.ignored == 9
    assert bench.emergencies("drive") == [RobotError.WRONG_SOURCE]
    bench.say("navigation", NaviPositionResponse(210, 1800, 0, Source.INTERNAL))
    assert bench.pose() != before
    assert bench.emergencies("drive") == [RobotError.WRONG_SOURCE, 0]


def raw(name: str, **values: int) -> Frame:
    return Frame(PROTOCOL.cob_id(name), PROTOCOL.pack(name, **values))


OUTSIDE: list[tuple[str, str, Frame, str]] = [
    ("drive", "core", raw("Kalman Position Response", x=3001, y=0, angle=0, source=0), "x"),
    ("drive", "core", raw("Kalman Position Response", x=0, y=2001, angle=0, source=0), "y"),
    ("drive", "core", raw("Kalman Position Response", x=0, y=0, angle=360, source=0), "angle"),
    ("drive", "core", raw("Kalman Position Response", x=0, y=0, angle=0, source=9), "a source that is reserved"),
    ("navigation", "core", raw("Enemy 1 Position Response", x=4095, y=0, angle=0, source=2), "another type"),
]


@pytest.mark.parametrize(("name", "hearer", "frame", "why"), OUTSIDE, ids=[each[-1] for each in OUTSIDE])
def test_17_a_value_out_of_range_is_told_once_for_each_type(
    half: Bench, name: str, hearer: str, frame: Frame, why: str
) -> None:
    half.say(name, frame, frame, frame)
    assert half.emergencies(hearer) == [0xFF00], why
    half.say("drive", raw("Goto State Response", time=0x0FFFFE + 3))
    assert half.emergencies(hearer)[1:] in ([], [0xFF00])
    half.say(name, frame)
    assert half.emergencies(hearer).count(0xFF00) <= 2


def test_17_a_goto_out_of_range_is_told_by_the_drive_and_moves_nothing() -> None:
    bench = Bench("core")
    frame = raw("Goto XY", x=3001, y=0, angle=0, speed=50, barriers=0)
    bench.say("core", frame, frame)
    assert bench.emergencies("drive") == [0xFF00]
    assert not bench.drive.moving
    assert bench.sent(GotoConfirm) == []


# 18: arrived is where it was sent

GOAL = GotoXY(1500, 1000, 90, 80)
# Where a drive with no time left says that it is, and what the core makes of it after 5 such answers.
ARRIVALS: list[tuple[tuple[int | None, int | None, int | None], Outcome, str]] = [
    ((1500, 1000, 90), Outcome.ARRIVED, "there"),
    ((1520, 1000, 90), Outcome.ARRIVED, "20 mm off, the tolerance"),
    ((1500, 980, 90), Outcome.ARRIVED, "20 mm off the other way"),
    ((1514, 1014, 90), Outcome.ARRIVED, "19.8 mm off, by both together"),
    ((1521, 1000, 90), Outcome.LOST, "21 mm off"),
    ((1515, 1015, 90), Outcome.LOST, "21.2 mm off, by both together"),
    ((1500, 1000, 95), Outcome.ARRIVED, "5 degrees off, the tolerance"),
    ((1500, 1000, 85), Outcome.ARRIVED, "5 degrees off the other way"),
    ((1500, 1000, 96), Outcome.LOST, "6 degrees off"),
    ((1500, 1000, 270), Outcome.LOST, "it looks back"),
    ((1500, 1000, None), Outcome.ARRIVED, "the place is known, the heading is not"),
    ((None, None, None), Outcome.LOST, "it does not know where it is"),
    ((200, 1800, 0), Outcome.LOST, "it has not left"),
]


@rows("place, outcome, why", ARRIVALS)
def test_18_arrived_is_within_the_tolerances(
    place: tuple[int | None, int | None, int | None], outcome: Outcome, why: str
) -> None:
    half = ready("drive", "navigation")
    call = half.core.goto(*GOAL)
    half.run(0.002)
    half.say("drive", GotoConfirm(), within=0.21)
    for _ in range(5):
        half.say("drive", GotoStateResponse(0), within=0.0)
        half.say("drive", KalmanPositionResponse(*place, Source.INTERNAL), within=0.11)
    report = call.result(0)
    assert report.outcome is outcome, why
    assert commands(half) == ([GOAL] if outcome is Outcome.ARRIVED else [GOAL, StopDrive()])
    if outcome is Outcome.LOST:
        assert report.why.startswith("the drive has arrived at (")


def test_18_a_drive_that_has_arrived_by_its_wheels_alone_says_how_badly_it_knows_its_place() -> None:
    bench = match_under_way()
    there = bench.core.goto(*FAR)
    bench.run(10.0)
    bench.network.detach(bench.stations["navigation"])
    back = bench.core.goto(*NEAR)
    bench.run(10.0)
    sure, unsure = there.result(0), back.result(0)
    assert (sure.outcome, unsure.outcome) == (Outcome.ARRIVED, Outcome.ARRIVED)
    assert sure.deviation is not None
    assert unsure.deviation is not None
    assert sure.deviation < 10 < 25 < unsure.deviation
    deviations = bench.drive.estimate.deviations
    assert deviations is not None
    assert unsure.deviation == round(deviations.worst)
    assert bench.core.device.number(bench.core.device.dictionary.address(DEVIATION)) == unsure.deviation


def test_18_an_answer_about_the_goto_before_is_tolerated(half: Bench) -> None:
    call = half.core.goto(*GOAL)
    half.run(0.002)
    half.say("drive", GotoConfirm(), within=0.21)
    half.arrive(GOAL._replace(x=GOAL.x - 100))
    half.run(0.11)
    assert not call.done()
    half.say("drive", GotoStateResponse(900), within=0.11)
    half.arrive(GOAL)
    assert call.result(0).outcome is Outcome.ARRIVED


@pytest.mark.parametrize("angle", [0, 2, 357, -3, 362])
def test_18_angles_are_compared_around_the_circle(half: Bench, angle: int) -> None:
    call = half.core.goto(*GOAL._replace(angle=angle))
    half.run(0.002)
    half.say("drive", GotoConfirm(), within=0.21)
    half.say("drive", GotoStateResponse(0), KalmanPositionResponse(1500, 1000, 359, Source.INTERNAL))
    assert call.result(0).outcome is Outcome.ARRIVED


# 19: the core ends the match


def test_19_a_match_that_ends_stops_the_drive_and_no_goto_goes_out_until_the_next_one(bench: Bench) -> None:
    bench.core.start_match(2.0)
    begun = bench.now
    call = drive_off(bench, FAR, 1.99)
    bench.run(0.02)
    report = call.result(0)
    assert (report.outcome, report.why) == (Outcome.STOPPED, "the match is over")
    assert bench.times(StopDrive)[-1] - begun == pytest.approx(2.0, abs=0.001)
    bench.run(BRAKED)
    assert not bench.drive.moving
    assert str(bench.core.goto(*NEAR).exception(0)) == "no goto after the match"
    bench.core.start_match(60.0)
    drive_off(bench, FAR, 1.0)


def test_19_the_stop_at_the_end_is_repeated(bench: Bench) -> None:
    bench.core.start_match(2.0)
    drive_off(bench, FAR, 1.9)
    bench.lose(StopDrive, count=2)
    bench.run(0.1 + BRAKED)
    assert not bench.drive.moving


@pytest.mark.parametrize("pause", [1.0, 3.0, 5.0])
def test_20_a_drive_that_knows_its_place_is_not_configured_again(bench: Bench, pause: float) -> None:
    """Without the navigation only the drive knows the place: a start configuration would put it at its start."""
    true_robot(bench)
    bench.core.start_match(90.0)
    drive_off(bench)
    bench.network.detach(bench.stations["navigation"])
    bench.run(3.0)
    drive_off(bench, GotoXY(500, 500, 0, 50))
    bench.network.freeze(bench.stations["core"], bench.now + pause)
    bench.run(pause + 3.0)
    begun = len(bench.log)
    call = bench.core.goto(*FAR)
    bench.run(20.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    assert StartConfigurationSet not in {type(each) for each in bench.messages()[begun:]}


def lose_for(bench: Bench, what: str, seconds: float) -> None:
    """Freeze a node, or have the bus off, for so long, and give the core time to find out."""
    end = bench.now + seconds
    if what == "bus":
        bench.network.cut(end)
    else:
        bench.network.freeze(bench.stations[what], end)
    bench.run(seconds + 3.0)


def shut_down_far_off(bench: Bench) -> None:
    """Have the robot shut down far from its start, when only the drive knows where it is."""
    true_robot(bench)
    bench.core.start_match(90.0)
    drive_off(bench)
    bench.network.detach(bench.stations["navigation"])
    bench.run(3.0)
    bench.core.emergency_shutdown()
    bench.run(1.0)


@pytest.mark.parametrize("what", ["drive", "bus"])
def test_20_a_loss_that_ends_in_a_shutdown_leaves_the_drive_its_place(bench: Bench, what: str) -> None:
    """A start configuration alone ends the safe state, and only the drive knows where the robot is."""
    true_robot(bench)
    bench.core.start_match(90.0)
    drive_off(bench)
    bench.network.detach(bench.stations["navigation"])
    bench.run(3.0)
    drive_off(bench, GotoXY(500, 500, 0, 50))
    lose_for(bench, what, 5.0)
    assert bench.core.shut_down
    there = bench.pose()
    recovered = bench.core.recover()
    bench.run(15.0)
    assert recovered.result(0)[:2] == tuple(round(each) for each in there.point)
    call = bench.core.goto(*FAR)
    bench.run(20.0)
    assert call.result(0).outcome is Outcome.ARRIVED


def test_20_a_drive_that_does_not_answer_is_not_configured_in_a_recovery(bench: Bench) -> None:
    """Unasked to keep its place, it would forget it."""
    shut_down_far_off(bench)
    begun = len(bench.log)
    bench.network.freeze(bench.stations["drive"], bench.now + 10.0)
    recovered = bench.core.recover()
    bench.run(6.0)
    assert isinstance(recovered.exception(0), NoAnswer)
    assert bench.core.shut_down
    assert StartConfigurationSet not in {type(each) for each in bench.messages()[begun:]}


@rows(
    "done, kept",
    [
        (lambda _: None, True),
        (lambda bench: bench.drive.heartbeat_lost(CORE_ID), False),  # whoever wanted it kept is gone
        (lambda bench: bench.drive.booted(CORE_ID), False),
        (lambda bench: bench.drive.configure(RED), False),  # it has been kept once
        (lambda bench: bench.drive.reset(), False),  # there is no place to keep
    ],
)
def test_20_the_place_is_kept_once_and_for_the_core_that_asked(done: Callable[[Bench], object], kept: bool) -> None:
    bench = ready()
    shut_down_far_off(bench)
    there = bench.pose()
    put(bench.drive, TIME_LEFT, NO_MATCH)  # in a match it is kept in any case
    put(bench.drive, "Place.Keep place", 1)
    done(bench)
    bench.drive.configure(RED)
    assert (bench.drive.estimate.pose == there) is kept
    assert bench.drive.estimate.pose == (there if kept else bench.drive.facts.start(TeamColour.RED))
    assert not bench.drive.keep_place


def test_20_a_recovery_that_is_to_start_over_does(bench: Bench) -> None:
    shut_down_far_off(bench)
    put(bench.core, "Place.Keep place", 0)
    recovered = bench.core.recover()
    bench.run(15.0)
    assert isinstance(recovered.exception(0), PlaceLost)
    assert bench.pose() == bench.drive.facts.start(TeamColour.RED)


@pytest.mark.parametrize(("setting", "found"), [(1400, False), (1600, True)])
def test_20_a_robot_that_was_moved_farther_than_the_setting_is_not_recovered(
    bench: Bench, setting: int, found: bool
) -> None:
    shut_down_far_off(bench)
    put(bench.core, "Recovery.Displacement", setting)
    bench.drive.estimate = Estimate(bench.drive.estimate.tuning, bench.pose().moved(-1500.0, 0.0))
    recovered = bench.core.recover()
    bench.run(15.0)
    assert isinstance(recovered.exception(0), PlaceLost) is not found


def test_19_a_match_lasts_as_long_as_the_setting_says(bench: Bench) -> None:
    bench.core.start_match()
    bench.run(89.9)
    assert not bench.core.match_over
    bench.run(0.2)
    assert bench.core.match_over
    bench.core.device.objects.put((0x2105, 1), 3)
    bench.core.start_match()
    bench.run(2.9)
    assert not bench.core.match_over
    bench.run(0.2)
    assert bench.core.match_over


def test_19_a_match_that_is_started_again_begins_anew(bench: Bench) -> None:
    bench.core.start_match(2.0)
    bench.run(1.5)
    bench.core.start_match(2.0)
    bench.run(1.9)
    assert not bench.core.match_over
    bench.run(0.2)
    assert bench.core.match_over


@pytest.mark.parametrize("before", [1.0, 3.0])
def test_19_an_nmt_reset_does_not_prolong_the_match(bench: Bench, before: float) -> None:
    end = bench.now + 2.0
    bench.core.start_match(2.0)
    bench.run(before)
    nmt(bench, NmtCommand.RESET_NODE, CORE_ID)
    bench.run(max(end - bench.now - 0.1, 0.5))
    assert bench.core.match_over is (before > 2.0)
    bench.run(0.3)
    assert bench.core.match_over
    bench.configure()
    bench.core.start_match(9.0)
    drive_off(bench, FAR, 1.0)


def test_19_a_configuration_does_not_open_a_match_that_is_over(bench: Bench) -> None:
    bench.core.start_match(0.5)
    bench.run(1.0)
    bench.configure()
    assert str(bench.core.goto(*NEAR).exception(0)) == "no goto after the match"


def test_19_a_goto_that_waits_for_lost_nodes_does_not_outlive_the_match(bench: Bench) -> None:
    bench.run(2.5)
    bench.core.start_match(1.0)
    bench.core.heartbeat_lost(NAVIGATION_ID)
    bench.network.detach(bench.stations["navigation"])
    call = bench.core.goto(*NEAR)
    bench.run(2.0)
    assert call.result(0).outcome is Outcome.STOPPED
    assert commands(bench)[-1] == StopDrive() or NEAR not in commands(bench)


# Calls from several threads at once, in real time

ROUNDS = 300
"""How often the calls meet, a millisecond or less apart."""


@pytest.mark.long
def test_a_shutdown_that_races_gotos_always_wins_and_every_call_ends() -> None:
    channel, calls = new_channel(), list[Future[Any]]()
    core, drive, navigation = (role(DICTIONARIES[name]) for name, role in ROLES.items())
    assert isinstance(core, Core)
    assert isinstance(drive, Drive)
    with ExitStack() as stack:
        for node in (navigation, drive, core):
            stack.enter_context(Live.node(open_bus(channel), node))
        core.device.objects.put(core.device.dictionary.address("Standstill.Stop period"), 5)
        core.configure_start(*RED).result(10)
        end = time.monotonic() + 8.0
        for round_ in range(ROUNDS):
            if time.monotonic() > end:
                break
            _race(core, calls, round_)
            assert core.shut_down
            assert calls[-1].result(5).seconds < 5.0
            assert drive.safe
            assert comes_to_rest(drive)
            core.configure_start(*RED).result(10)
        assert round_ > 20  # on a machine that has much else to do
        last = core.emergency_shutdown()
        last.result(5)
        assert comes_to_rest(drive)
    assert [call for call in calls if not call.done()] == []


def comes_to_rest(drive: Drive) -> bool:
    """Tell whether the drive stands soon: in stop periods of 5 ms it may roll the last of its braking unseen."""
    end, pause = time.monotonic() + 1.0, threading.Event()
    while drive.moving and time.monotonic() < end:
        pause.wait(0.01)
    return not drive.moving


def _race(core: Core, calls: list[Future[Any]], round_: int) -> None:
    """Have one thread send gotos while this one shuts down; the last of `calls` is the shutdown's."""
    begin = threading.Barrier(2)

    def drive_on() -> None:
        begin.wait()
        with suppress(StateError):
            for x in (500, 600, 700):
                calls.append(core.goto(x, 1700, 0, 100))

    thread = threading.Thread(target=drive_on)
    thread.start()
    begin.wait()
    for _ in range(round_ % 50 * 20):  # a moment that is a little longer each time
        pass
    shutdown = core.emergency_shutdown()
    thread.join()
    calls.append(shutdown)


def test_stops_gotos_and_cancels_of_many_threads_end_with_a_robot_that_stands() -> None:
    channel, calls = new_channel(), list[Future[Any]]()
    core, drive, navigation = (role(DICTIONARIES[name]) for name, role in ROLES.items())
    assert isinstance(core, Core)
    assert isinstance(drive, Drive)
    end = time.monotonic() + 0.7

    def play(seed: int) -> None:
        chance = Random(seed)
        while time.monotonic() < end:
            begin: list[Callable[[], Future[Any]]] = [
                lambda: core.goto(chance.randrange(300, 2700), 1700, 0, 100),
                core.stop,
                core.position,
                lambda: core.emergency_stop(Obstacle.ENEMY),
            ]
            call = chance.choice(begin)()
            calls.append(call)
            if chance.random() < 0.3:
                call.cancel()

    with ExitStack() as stack:
        for node in (navigation, drive, core):
            stack.enter_context(Live.node(open_bus(channel), node))
        core.configure_start(*RED).result(10)
        threads = [threading.Thread(target=play, args=(seed,)) for seed in range(3)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert not drive.moving
    assert len(calls) > 100
    assert [call for call in calls if not call.done()] == []


# Without the navigation


def match_under_way() -> Bench:
    """All three nodes in a match, each heard once, the robot seen by the beacons."""
    bench = Bench()
    bench.run(1.5)
    bench.configure()
    true_robot(bench)
    bench.core.start_match(60.0)
    bench.run(0.1)
    return bench


def test_a_navigation_that_dies_in_a_match_is_told_and_the_robot_drives_on() -> None:
    bench = match_under_way()
    call = bench.core.goto(*FAR)
    bench.network.detach(bench.stations["navigation"])
    bench.run(10.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    back = bench.core.goto(*NEAR)
    bench.run(10.0)
    assert back.result(0).outcome is Outcome.ARRIVED
    assert len([text for text in map(str, bench.network.reports) if "the navigation is lost" in text]) == 1


def test_a_navigation_that_boots_in_a_match_is_checked_and_configured_and_the_drive_keeps_its_place() -> None:
    bench = match_under_way()
    call = bench.core.goto(*FAR)
    bench.run(2.0)
    started = len(bench.sent(StartConfigurationSet))
    reboot(bench, "navigation")
    bench.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    assert bench.navigation.configuration == RED
    assert len(bench.sent(StartConfigurationSet)) == started
    assert any("the navigation is back" in str(report) for report in bench.network.reports)
    assert bench.core.without == ()


def test_a_robot_that_knows_its_place_too_badly_stands_until_the_navigation_is_back() -> None:
    bench = match_under_way()
    put(bench.drive, "Estimate.Largest deviation", 20)
    call = bench.core.goto(*FAR)
    bench.network.detach(bench.stations["navigation"])
    bench.run(10.0)
    assert call.result(0).outcome is Outcome.NOT_POSSIBLE
    assert not bench.drive.moving
    assert RobotError.PLACE_UNSURE in bench.emergencies("drive")
    bench.attach("navigation", Navigation(DICTIONARIES["navigation"]))
    true_robot(bench)
    bench.run(5.0)
    again = bench.core.goto(*FAR)
    bench.run(8.0)
    assert again.result(0).outcome is Outcome.ARRIVED


def test_a_navigation_that_answers_nothing_but_sends_heartbeats_is_told_and_taken_back() -> None:
    bench = match_under_way()
    others = (Enemy1PositionResponse, Enemy2PositionResponse, ConfederatePositionResponse)
    bench.lose(CheckNaviResponse, NaviPositionResponse, *others)
    silent_since = bench.now
    call = bench.core.goto(*FAR)
    bench.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    (told,) = [each for each in bench.network.reports if "the navigation is lost" in str(each)]
    assert "it does not answer" in str(told)
    asked = [time - silent_since for time in bench.times(CheckNaviRequest) if silent_since < time < told.timestamp]
    assert asked == pytest.approx([2.0, 3.0, 4.0], abs=0.1)
    assert bench.core.open_calls == 0
    bench.lose()
    bench.run(2.0)
    assert any("the navigation is back" in str(report) for report in bench.network.reports)


def test_a_way_keeps_its_distance_as_the_place_becomes_less_sure() -> None:
    bench = match_under_way()
    bench.core.goto(*FAR)
    bench.network.detach(bench.stations["navigation"])
    bench.run(1.0)
    planned = bench.drive._planned
    belief = bench.drive.estimate._belief
    assert belief is not None
    bench.drive.estimate._belief = belief.loosened(20.0)
    bench.run(0.1)
    assert bench.drive._planned > planned + 15.0
    assert bench.drive.moving


def test_before_the_match_there_is_no_goto_without_the_navigation() -> None:
    bench = Bench()
    bench.run(1.5)
    bench.configure()
    bench.network.detach(bench.stations["navigation"])
    bench.run(3.0)
    call = bench.core.goto(*FAR)
    bench.run(20.0)
    assert isinstance(call.exception(0), NoAnswer)
    assert bench.sent(GotoXY) == []


# A second drive


@pytest.mark.parametrize("processing", [0.0, 1e-4])  # they answer at once, or one by one
def test_two_drives_that_differ_are_told_once(processing: float) -> None:
    bench, second = Bench(), Drive(DICTIONARIES["drive"])
    bench.network.attach(second, bench.now, processing)
    bench.run(0.1)
    bench.configure()
    true_robot(bench)
    second.estimate = Estimate(TUNING, Pose(1000.0, 1000.0, 0.0))
    bench.core.goto(*FAR)
    bench.run(3.0)
    (told,) = [text for text in map(str, bench.network.reports) if "two drives answer" in text]
    assert "switch one of them off" in told


# After an Emergency Shutdown


def test_one_call_has_the_robot_go_on_after_a_shutdown() -> None:
    bench = match_under_way()
    drive_off(bench)
    bench.core.emergency_shutdown()
    bench.run(2.0)
    with pytest.raises(StateError, match=r"`await core\.recover\(\)` ends it"):
        bench.core.goto(*NEAR)
    recovered = bench.core.recover()
    bench.run(2.0)
    place = recovered.result(0)
    assert (place.x, place.y) == pytest.approx(bench.pose().point, abs=1)
    call = bench.core.goto(*NEAR)
    bench.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED


def test_a_recovery_without_a_navigation_that_sees_the_robot_is_refused() -> None:
    bench = Bench()
    bench.configure()
    drive_off(bench)
    bench.core.emergency_shutdown()
    bench.run(2.0)
    bench.core.position()
    bench.run(0.5)
    bench.drive.reset()  # it knows no place any more, and begins at its start
    recovered = bench.core.recover()
    bench.run(2.0)
    assert "the drive has lost its place" in str(recovered.exception(0))
    fresh = Bench()
    nothing = fresh.core.recover()
    fresh.run(5.0)
    assert "there is nothing to go back to" in str(nothing.exception(0))
