"""A stop is neither dropped nor merely sent, and has the last word (decision 13)."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

import pytest

from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model.messages import (
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
from eurobot_od.robot.model.values import (
    Obstacle,
    Outcome,
    Source,
)
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.nodes.core.flows import NotStanding, Standstill
from tests.robot.nodes.driving import (
    BRAKED,
    FAR,
    GOTO,
    NEAR,
    NOT_STANDING,
    Runaway,
    commands,
    drive_off,
    goto,
    ready,
)
from tests.robot.nodes.harness import DICTIONARIES, RED, Bench

# Stops (document 2.1, 4.2.2)

CALLS: list[tuple[Callable[[Core], object], Message]] = [
    (Core.stop, StopDrive()),
    (lambda core: core.emergency_stop(Obstacle.OBJECT), EmergencyStop(Obstacle.OBJECT)),
    (lambda core: core.emergency_stop(Obstacle.ENEMY), EmergencyStop(Obstacle.ENEMY)),
    (Core.emergency_shutdown, EmergencyShutdown()),
]


@pytest.mark.parametrize(("call", "stop"), CALLS)
def test_a_stop_goes_out_at_once_and_ends_the_goto(alone: Bench, call: Callable[[Core], object], stop: Message) -> None:
    driving = goto(alone)
    alone.say("drive", GotoConfirm(), within=0.1)
    now = alone.now
    count = len(alone.log)
    call(alone.core)
    report = driving.result(0)
    assert (report.outcome, report.confirmed is None) == (Outcome.STOPPED, False)
    alone.run(3.0)
    assert alone.messages()[count] == stop
    assert alone.log[count].time - now < 0.001


@pytest.mark.parametrize(("call", "stop"), CALLS)
def test_a_goto_that_was_not_confirmed_is_not_sent_again_after_a_stop(
    alone: Bench, call: Callable[[Core], object], stop: Message
) -> None:
    driving = goto(alone)
    call(alone.core)
    alone.run(5.0)
    assert alone.messages()[:2] == [GOTO, stop]
    assert alone.sent(GotoXY) == [GOTO]
    assert driving.result(0).confirmed is None


@pytest.mark.parametrize(("call", "stop"), CALLS)
def test_a_confirm_that_comes_after_a_stop_is_answered_by_that_stop(
    alone: Bench, call: Callable[[Core], object], stop: Message
) -> None:
    goto(alone)
    call(alone.core)
    alone.run(0.05)
    alone.say("drive", GotoConfirm())
    assert alone.messages() == [GOTO, stop, GotoConfirm(), stop]


@pytest.mark.parametrize(("call", "stop"), CALLS)
def test_a_stop_that_overtakes_its_goto_on_the_bus_still_stops_the_drive(
    call: Callable[[Core], object], stop: Message
) -> None:
    bench = Bench()
    bench.configure()
    bench.core.offer(GOTO)
    call(bench.core)  # in the same instant: the stop has the lower COB-ID and leaves first
    bench.run(2.0)
    driving = [message for message in bench.messages() if isinstance(message, (GotoXY, GotoConfirm, type(stop)))]
    if isinstance(stop, EmergencyShutdown):
        assert driving[:2] == [stop, GOTO]  # the drive is in its safe state and confirms nothing
    else:
        assert driving[:4] == [stop, GOTO, GotoConfirm(), stop]
    assert (bench.drive.goto, bench.drive.moving) == (None, False)


def test_a_confirm_after_the_next_goto_stops_nothing(alone: Bench) -> None:
    alone.core.stop()
    goto(alone)
    alone.say("drive", GotoConfirm(), within=0.1)
    assert alone.messages() == [StopDrive(), GOTO, GotoConfirm()]


def test_after_a_shutdown_there_is_no_goto_until_the_next_start_configuration(alone: Bench) -> None:
    alone.configure()
    alone.core.emergency_shutdown()
    assert alone.core.shut_down
    with pytest.raises(StateError, match="after an emergency shutdown"):
        alone.core.goto(*GOTO)
    alone.configure()
    assert not alone.core.shut_down
    call = goto(alone)
    assert not call.done()


def test_a_start_configuration_under_way_is_not_sent_again_after_a_shutdown(alone: Bench) -> None:
    call = alone.core.configure_start(*RED)
    alone.run(0.1)
    alone.core.emergency_shutdown()
    alone.run(5.0)
    assert alone.messages()[:2] == [RED, EmergencyShutdown()]
    assert alone.sent(StartConfigurationSet) == [RED]
    assert isinstance(call.exception(0), StateError)
    assert alone.core.shut_down


def test_a_shutdown_that_overtakes_a_start_configuration_is_sent_again() -> None:
    bench = Bench()
    bench.core.offer(RED)
    bench.core.emergency_shutdown()  # in the same instant: it leaves first
    bench.run(1.0)
    assert bench.messages()[:4] == [EmergencyShutdown(), RED, StartConfigurationConfirm(), EmergencyShutdown()]
    assert (bench.core.shut_down, bench.drive.safe, bench.navigation.safe) == (True, True, True)


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
    call = stop(bench.core)
    told = bench.now
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


def test_13_a_robot_that_does_not_stand_is_told_and_shut_down_until_it_does() -> None:
    bench = Bench()
    drive = Runaway(DICTIONARIES["drive"])
    bench.replace("drive", drive)
    bench.run(0.1)
    bench.configure()
    drive_off(bench)
    call = bench.core.stop()
    told = bench.now
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


@pytest.mark.parametrize(("after", "stands", "why"), APART)
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
