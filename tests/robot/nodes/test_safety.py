"""The robot stands whenever nobody can command it: a section for each decision, 13 to 19 of the design.

Rule of this file: "stops" is what the core does, "stands" what the drive's wheels do; a test of safety looks at the
wheels.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, ClassVar

import pytest

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.pdo.message import Message
from eurobot_od.robot.messages import (
    EmergencyShutdown,
    EmergencyStop,
    GotoConfirm,
    GotoStateRequest,
    GotoStateResponse,
    GotoXY,
    KalmanPositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.nodes import Core, Drive
from eurobot_od.robot.nodes.goto import GotoReport
from eurobot_od.robot.nodes.motion import Odometry
from eurobot_od.robot.nodes.node import Handlers
from eurobot_od.robot.nodes.standstill import NotStanding, Standstill
from eurobot_od.robot.values import Barriers, GotoFault, Obstacle, Outcome, Passage, RobotError, Source
from tests.robot.nodes.harness import DICTIONARIES, PROTOCOL, RED, Bench

FAR = GotoXY(2700, 1700, 0, 50)
"""A goto that takes more than 6 s from the red start place."""

NEAR = GotoXY(400, 1700, 0, 100)
"""A goto that takes less than 2 s from the red start place."""

BRAKED = 1.0
"""Within this many seconds the robot stands, whatever one frame was lost."""

NOT_STANDING, HEARTBEAT_LOST = RobotError.NOT_STANDING, 0x8130

CORE_ID, DRIVE_ID, NAVIGATION_ID = 1, 2, 3


@pytest.fixture
def bench() -> Bench:
    """All three nodes, configured."""
    bench = Bench()
    bench.configure()
    return bench


@pytest.fixture
def half() -> Bench:
    """The core, and stand-ins for the others, configured."""
    bench = Bench("drive", "navigation")
    bench.configure()
    return bench


def drive_off(bench: Bench, goto: GotoXY = FAR, seconds: float = 2.0) -> Future[GotoReport]:
    """Begin with a goto, and have the robot drive for some time."""
    call = bench.core.goto(*goto)
    bench.run(seconds)
    assert bench.drive.moving
    assert not call.done()
    return call


def nmt(bench: Bench, command: NmtCommand, node_id: int) -> None:
    """Have a master, which is no node of this bus, send an NMT command to one node."""
    for station in bench.stations.values():
        station.gatekeeper.receive(Frame(NMT_COB_ID, bytes([command, node_id])), bench.now)


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


@pytest.mark.parametrize(("after", "stands", "why"), APART)
def test_13_two_positions_have_to_agree(
    half: Bench, after: tuple[int | None, int | None, int | None], stands: bool, why: str
) -> None:
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


def asleep(bench: Bench, _: Future[GotoReport]) -> None:
    """Nobody hears what the drive says of its goto."""
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
    ("a new start configuration", lambda bench, _: bench.core.configure_start(*RED) and None, Outcome.STOPPED),
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
    assert (report.outcome, report.ended) == (Outcome.TIMED_OUT, pytest.approx(1.5, abs=0.001))
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


async def waits_for_too_short(core: Core) -> None:
    with pytest.raises(asyncio.TimeoutError):
        await asyncio.wait_for(core.goto(*FAR), 1.0)  # type: ignore[arg-type]  # a Call is awaitable
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
        asyncio.ensure_future(bench.core.goto(*FAR))
        await asyncio.sleep(1.0)
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

    def advance(self, command: Any, dt: float) -> Any:
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
    assert call.result(0).outcome is Outcome.LOST  # the nodes' heartbeats
    bench.run(1.0 + BRAKED)
    assert FAR in bench.messages()
    assert not bench.drive.moving
