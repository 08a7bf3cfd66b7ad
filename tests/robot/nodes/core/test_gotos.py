"""One goto at a time (document 2.1; decisions 14 and 18): its handshake, its end, and that it never drives on alone."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

import pytest

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.errors import FieldError, NoAnswer, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import Message, field_name
from eurobot_od.robot.model.messages import (
    EmergencyShutdown,
    GotoConfirm,
    GotoStateRequest,
    GotoStateResponse,
    GotoXY,
    KalmanPositionRequest,
    KalmanPositionResponse,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import (
    Barriers,
    Direction,
    GotoFault,
    Obstacle,
    Outcome,
    Passage,
    Source,
    TeamColour,
)
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.nodes.core.flows import GotoReport
from eurobot_od.robot.nodes.motion import Odometry, WheelCommand
from eurobot_od.robot.nodes.node import DEVIATION, Detection
from eurobot_od.sdo.client import download
from tests.robot.nodes.core.test_distrust import ROOT, reports, with_stranger
from tests.robot.nodes.driving import (
    BRAKED,
    CORE_ID,
    FAR,
    GOTO,
    NEAR,
    ON_THE_WIRE,
    commands,
    configured,
    drive_off,
    gaps,
    goto,
    match_under_way,
    nmt,
    ready,
)
from tests.robot.nodes.harness import DICTIONARIES, PROTOCOL, RED, Bench, Peer, as_if_started

# Gotos (document 2.1)


def test_a_goto_that_is_not_confirmed_is_sent_six_times_500_ms_apart(alone: Bench) -> None:
    call = goto(alone)
    alone.run(10.0)
    times = alone.times(GotoXY)
    assert len(times) == 6
    assert gaps(times) == pytest.approx([0.5] * 5, abs=ON_THE_WIRE)
    assert str(call.exception(0)) == "no GotoConfirm after 6 x GotoXY (500 ms each)"


def test_a_confirm_ends_the_transmissions(alone: Bench) -> None:
    goto(alone)
    alone.run(0.6)
    alone.say("drive", GotoConfirm(), within=1.0)
    assert len(alone.times(GotoXY)) == 2


def test_the_state_is_asked_for_200_ms_after_the_confirm_and_then_every_100_ms(alone: Bench) -> None:
    goto(alone)
    alone.say("drive", GotoConfirm())
    confirmed = alone.times(GotoConfirm)[0]
    for _ in range(5):
        asked = len(alone.times(GotoStateRequest))
        while len(alone.times(GotoStateRequest)) == asked:
            alone.run(0.001)
        alone.say("drive", GotoStateResponse(1000), within=0.0)
    times = alone.times(GotoStateRequest)
    assert times[0] - confirmed == pytest.approx(0.2, abs=ON_THE_WIRE)
    answered = alone.times(GotoStateResponse)
    pauses = [asked - answer for answer, asked in zip(answered, times[1:])]
    assert pauses == pytest.approx([0.1] * 4, abs=ON_THE_WIRE)


def test_a_state_request_waits_500_ms_for_its_answer(alone: Bench) -> None:
    call = goto(alone)
    alone.say("drive", GotoConfirm(), within=10.0)
    times = alone.times(GotoStateRequest)[:6]
    assert gaps(times) == pytest.approx([0.5] * 5, abs=ON_THE_WIRE)
    assert str(call.exception(0)) == "no GotoStateResponse after 6 x GotoStateRequest (500 ms each)"


@pytest.mark.parametrize(
    ("time", "outcome"),
    [
        (GotoFault.NOT_POSSIBLE, Outcome.NOT_POSSIBLE),
        (GotoFault.BLOCKED, Outcome.BLOCKED),
    ],
)
def test_a_goto_ends_when_its_state_says_so(alone: Bench, time: int | GotoFault, outcome: Outcome) -> None:
    call = goto(alone)
    alone.run(0.098)
    alone.say("drive", GotoConfirm(), within=0.25)
    alone.say("drive", GotoStateResponse(5000), within=0.11)
    alone.say("drive", GotoStateResponse(None), within=0.11)
    assert not call.done()
    alone.say("drive", GotoStateResponse(time))
    report = call.result(0)
    assert (report.goto, report.outcome) == (GOTO, outcome)
    assert report.confirmed == pytest.approx(0.1, abs=0.001)
    assert report.ended == pytest.approx(alone.times(GotoStateResponse)[-1] - alone.times(GotoXY)[0], abs=0.001)
    asked = len(alone.log)
    alone.run(2.0)
    assert len(alone.log) == asked


def test_a_goto_has_arrived_when_the_drive_says_so_and_is_there(alone: Bench) -> None:
    call = goto(alone)
    alone.say("drive", GotoConfirm(), within=0.25)
    alone.say("drive", GotoStateResponse(0), within=0.05)
    assert not call.done()
    assert alone.messages()[-1] == KalmanPositionRequest()
    alone.say("drive", KalmanPositionResponse(GOTO.x, GOTO.y, GOTO.angle, Source.INTERNAL))
    assert call.result(0).outcome is Outcome.ARRIVED
    asked = len(alone.log)
    alone.run(2.0)
    assert len(alone.log) == asked


def test_a_new_goto_ends_the_one_before(alone: Bench) -> None:
    first = goto(alone)
    alone.say("drive", GotoConfirm())
    second = alone.core.goto(500, 500, 0, 50)
    assert first.result(0).outcome is Outcome.REPLACED
    alone.run(0.01)
    assert alone.sent(GotoXY) == [GOTO, GotoXY(500, 500, 0, 50)]
    alone.say("drive", GotoConfirm(), within=0.3)
    alone.arrive(GotoXY(500, 500, 0, 50))
    assert second.result(0).outcome is Outcome.ARRIVED


def test_two_gotos_at_once_send_the_newer_only(alone: Bench) -> None:
    as_if_started(alone.core)
    first, second = alone.core.goto(*GOTO), alone.core.goto(500, 500, 0, 50)
    alone.run(0.1)
    assert first.result(0).outcome is Outcome.REPLACED
    assert alone.sent(GotoXY) == [GotoXY(500, 500, 0, 50)]
    assert not second.done()


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ((3001, 0, 0, 0), "x"),
        ((-1, 0, 0, 0), "x"),
        ((0, 2001, 0, 0), "y"),
        ((0, 0, 0, 101), "speed"),
        ((0, 0, 0, -1), "speed"),
    ],
)
def test_a_goto_out_of_range_is_an_error_before_anything_is_sent(
    alone: Bench, values: tuple[int, int, int, int], field: str
) -> None:
    driving = goto(alone)
    with pytest.raises(FieldError, match=f"Goto XY: {field} = "):
        alone.core.goto(*values)
    alone.run(0.1)
    assert alone.messages() == [GOTO]
    assert not driving.done()


def test_a_goto_that_the_dialect_cannot_carry_is_an_error(alone: Bench) -> None:
    with pytest.raises(FieldError, match="direction = backward is not allowed"):
        alone.core.goto(*GOTO[:5], Direction.BACKWARD)


def test_a_cancelled_goto_is_stopped_at_once(alone: Bench) -> None:
    assert goto(alone).cancel()
    alone.run(0.002)  # not only when it would be sent again
    assert alone.messages()[-1] == StopDrive()


def test_a_cancelled_goto_is_not_sent_again_and_the_next_one_is(alone: Bench) -> None:
    assert goto(alone).cancel()
    alone.run(1.0)
    assert alone.sent(GotoXY) == [GOTO]
    goto(alone)
    assert alone.sent(GotoXY) == [GOTO, GOTO]


# 14: a goto that ends in any way but arrived, replaced, impossible or blocked is stopped


def cancelled(_: Bench, call: Future[GotoReport]) -> None:
    assert call.cancel()


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


@pytest.mark.parametrize(("place", "outcome", "why"), ARRIVALS)
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
    assert bench.core.device.objects.number(bench.core.device.dictionary.address(DEVIATION)) == unsure.deviation


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


ORDERS = {GotoXY: "Goto XY", StartConfigurationSet: "Start configuration"}


def order(bench: Bench, message: Message) -> None:
    """Write a message into the core's object, as a master does."""
    core = DICTIONARIES["core"]
    (_, raw) = PROTOCOL.unpack(*PROTOCOL.encode(message))
    index = core.data_index(ORDERS[type(message)])
    assert index is not None
    for subindex, variable in core.members[index].items():
        if (field := field_name(variable.name)) in raw:
            content = raw[field].to_bytes((len(variable) + 7) // 8, "little")
            (request,) = download((index, subindex), content, 1.0).start(0.0)
            bench.nodes["stranger"].put(Frame(0x600 + CORE_ID, request))
            bench.run(0.01)


def distance(bench: Bench) -> float:
    """How far the robot is from where it was ordered to go, mm."""
    return bench.pose().distance(Point(*NEAR[:2]))


def test_an_ordered_goto_is_driven_and_watched_by_the_core() -> None:
    bench = with_stranger()
    order(bench, NEAR)
    assert bench.core.is_commanding
    bench.run(10.0)
    assert distance(bench) < 50
    assert reports(bench) == ""


def test_an_order_replaces_the_goto_under_way() -> None:
    bench = with_stranger()
    call = drive_off(bench)
    order(bench, NEAR)
    bench.run(10.0)
    assert call.result(0).outcome.value == "replaced"
    assert distance(bench) < 50


def test_a_core_that_was_reset_recovers_and_drives() -> None:
    bench = with_stranger()
    drive_off(bench)
    nmt(bench, NmtCommand.RESET_NODE, CORE_ID)
    bench.run(0.2)
    order(bench, NEAR)
    bench.run(12.0)
    assert distance(bench) < 50


def test_a_core_that_nobody_has_configured_asks_the_drive() -> None:
    bench = with_stranger()
    bench.replace("core", Core(DICTIONARIES["core"]))
    bench.run(0.1)
    order(bench, NEAR)
    bench.run(12.0)
    assert distance(bench) < 50


def test_after_an_emergency_shutdown_a_start_configuration_comes_first() -> None:
    bench = with_stranger()
    bench.core.emergency_shutdown()
    bench.run(1.0)
    order(bench, NEAR)
    bench.run(1.0)
    assert not bench.drive.moving
    there = bench.pose()
    order(bench, RED)
    order(bench, NEAR)  # it waits until that is done
    bench.run(0.1)
    assert bench.pose().distance(there.point) < 20, "in a match the drive keeps its place"
    bench.run(10.0)
    assert distance(bench) < 50


def test_a_failed_order_is_reported() -> None:
    bench = match_under_way()
    bench.attach("stranger", Peer(Dictionary.load(ROOT / "docs" / "io.eds", 9)))
    bench.run(61.0)
    order(bench, NEAR)
    bench.run(1.0)
    assert "an order by SDO has failed: no goto after the match" in reports(bench)


class SomethingAhead:
    """A sensor that sees the robot drive into something."""

    distance = 700.0

    def look(self, _now: float) -> Detection:
        self.distance = max(self.distance - 40.0, 0.0)
        return Detection(Obstacle.OBJECT, self.distance, 0.0)


def test_a_goto_that_was_stopped_is_told_with_its_reason() -> None:
    bench = with_stranger()
    bench.core.sensor = SomethingAhead()
    order(bench, NEAR)
    bench.run(3.0)
    assert not bench.drive.moving
    assert "an order by SDO has failed: goto stopped, object ahead" in reports(bench)


@pytest.mark.parametrize("message", [NEAR, StartConfigurationSet(TeamColour.RED, 0, 0, 30, 0)])
def test_nothing_is_ordered_from_a_core_that_is_held_or_by_contradictory_values(message: Message) -> None:
    bench = with_stranger()
    if isinstance(message, GotoXY):
        nmt(bench, NmtCommand.ENTER_PRE_OPERATIONAL, CORE_ID)
        bench.run(3.0)
    before = len(bench.log)
    order(bench, message)
    bench.run(1.0)
    assert type(message) not in {type(each.message) for each in bench.log[before:]}
