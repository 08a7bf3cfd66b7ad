"""The core node: its calls, how often and when it asks, and that a stop always has the last word."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from contextlib import AbstractContextManager
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.errors import FieldError, NoAnswer, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import ERROR_CONTROL_BASE, NMT_COB_ID
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    CheckDriveResponse,
    CheckNaviRequest,
    CheckNaviResponse,
    ConfederatePositionRequest,
    EmergencyShutdown,
    EmergencyStop,
    Enemy1PositionRequest,
    Enemy1PositionResponse,
    Enemy2PositionRequest,
    GotoConfirm,
    GotoStateRequest,
    GotoStateResponse,
    GotoXY,
    KalmanPositionRequest,
    KalmanPositionResponse,
    NaviPositionRequest,
    StartConfigurationConfirm,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.values import Direction, GotoFault, Obstacle, Outcome, Source, TeamColour
from eurobot_od.robot.nodes import ROLES
from eurobot_od.robot.nodes.core import Core
from eurobot_od.robot.nodes.core.agreement import NodeMismatch
from eurobot_od.robot.nodes.core.flows import GotoReport
from tests.robot.nodes.harness import DICTIONARIES, PROTOCOL, RED, Bench, as_if_started
from tests.rows import rows

GOTO = GotoXY(1500, 1000, 90, 80)
ON_THE_WIRE = 0.0005
"""Longer than a frame and its answer take on an idle bus, s."""


@pytest.fixture
def bench() -> Bench:
    """The core, and stand-ins for the others."""
    return Bench("drive", "navigation")


def gaps(times: list[float]) -> list[float]:
    """Return the times between one and the next."""
    return [later - earlier for earlier, later in pairwise(times)]


def goto(bench: Bench) -> Future[GotoReport]:
    """Have the core begin with a goto."""
    as_if_started(bench.core)
    call = bench.core.goto(*GOTO)
    bench.run(0.002)
    return call


# Node checks (document 2.3)


def test_the_drive_is_checked_before_the_navigation(bench: Bench) -> None:
    call = bench.core.check_nodes()
    bench.run(0.1)
    assert bench.messages() == [CheckDriveRequest()]
    bench.say("drive", CheckDriveResponse())
    assert bench.messages()[2:] == [CheckNaviRequest()]
    bench.run(0.2)
    bench.say("navigation", CheckNaviResponse())
    took = call.result(0)
    assert list(took) == ["drive", "navigation"]
    assert took == pytest.approx({"drive": 0.1, "navigation": 0.21}, abs=0.002)


@pytest.mark.parametrize(
    ("answered", "error"),
    [
        ([], "no CheckDriveResponse after 10 x CheckDriveRequest (1000 ms each)"),
        ([CheckDriveResponse()], "no CheckNaviResponse after 10 x CheckNaviRequest (1000 ms each)"),
    ],
)
def test_a_node_that_does_not_answer_is_named(bench: Bench, answered: list[Message], error: str) -> None:
    call = bench.core.check_nodes()
    bench.say("drive", *answered, within=30.0)
    assert str(call.exception(0)) == error


def test_a_check_waits_one_second(bench: Bench) -> None:
    bench.core.check_nodes()
    bench.run(30.0)
    times = bench.times(CheckDriveRequest)
    assert len(times) == 10
    assert gaps(times) == pytest.approx([1.0] * 9, abs=ON_THE_WIRE)


# Start configuration (document 2.3)


def test_a_start_configuration_is_set_until_it_is_confirmed(bench: Bench) -> None:
    call = bench.core.configure_start(*RED)
    bench.run(1.2)
    bench.say("navigation", StartConfigurationConfirm())
    bench.check()
    bench.run(1.0)
    times = bench.times(StartConfigurationSet)
    assert gaps(times) == pytest.approx([0.5, 0.5], abs=ON_THE_WIRE)
    assert call.result(0) == pytest.approx(1.2, abs=0.002)
    assert bench.core.configuration == RED


def test_a_start_configuration_that_nobody_confirms_is_an_error(bench: Bench) -> None:
    call = bench.core.configure_start(*RED)
    bench.run(10.0)
    assert len(bench.times(StartConfigurationSet)) == 6
    assert isinstance(call.exception(0), NoAnswer)
    assert bench.core.configuration is None
    assert bench.times(NaviPositionRequest) == []


@pytest.mark.parametrize("confirms", [1, 2])
def test_one_confirm_of_two_is_enough_and_a_second_changes_nothing(bench: Bench, confirms: int) -> None:
    call = bench.core.configure_start(*RED)
    bench.run(0.01)
    for peer in ("drive", "navigation")[:confirms]:
        bench.say(peer, StartConfigurationConfirm())
    bench.check()
    assert call.done()
    bench.run(2.2)
    assert len(bench.times(NaviPositionRequest)) == 1


@pytest.mark.parametrize(
    ("answered", "missing"),
    [
        ([], "CheckDriveResponse"),  # the confirm was anybody's
        ([CheckDriveResponse()], "CheckNaviResponse"),
    ],
)
def test_both_nodes_are_checked_again_after_the_confirm(bench: Bench, answered: list[Message], missing: str) -> None:
    call = bench.core.configure_start(*RED)
    bench.run(0.01)
    bench.say("drive", StartConfigurationConfirm(), *answered, within=30.0)
    assert f"no {missing} after 10 x" in str(call.exception(0))
    assert bench.core.configuration is None


def test_confirms_of_drive_and_navigation_merge_on_the_wire() -> None:
    bench = Bench()
    call = bench.core.configure_start(*RED)
    bench.run(0.1)
    assert bench.messages()[:3] == [RED, StartConfigurationConfirm(), CheckDriveRequest()]
    assert call.done()
    assert (bench.drive.configuration, bench.navigation.configuration) == (RED, RED)


def test_a_newer_start_configuration_replaces_one_that_is_not_confirmed(bench: Bench) -> None:
    yellow = RED._replace(team_colour=TeamColour.YELLOW)
    old = bench.core.configure_start(*RED)
    bench.run(0.1)
    new = bench.core.configure_start(*yellow)
    bench.run(1.2)
    assert isinstance(old.exception(0), StateError)
    assert bench.sent(StartConfigurationSet) == [RED, yellow, yellow, yellow]
    bench.say("drive", StartConfigurationConfirm())
    bench.check()
    assert new.done()
    assert bench.core.configuration == yellow


PERIODS = {"2103sub1": "polling_period", "2102sub4": "state_request_period", "2107sub1": "stop_period"}


@pytest.mark.parametrize(("section", "period"), PERIODS.items())
def test_no_step_of_time_is_0_whatever_the_eds_says(spoil_eds: Callable[..., Path], section: str, period: str) -> None:
    folder = spoil_eds(("core", section, "DefaultValue", "0"), ("core", section, "LowLimit", "0"))
    assert getattr(Core(Dictionary.load(folder / "core.eds")), period) == 0.001


# No goto before the start


def refused(core: Core) -> str:
    with pytest.raises(StateError) as error:
        core.goto(*GOTO)
    return str(error.value)


NOT_CHECKED = "the drive and the navigation must answer a check: call check_nodes()"
NOT_CONFIGURED = "a start configuration must be confirmed: call configure_start()"


def test_no_goto_leaves_a_core_that_has_done_nothing(bench: Bench) -> None:
    assert refused(bench.core) == f"no goto yet: {NOT_CHECKED}; {NOT_CONFIGURED}"
    bench.run(1.0)
    assert bench.messages() == []


@pytest.mark.parametrize(
    ("silent", "missing"),
    [("drive", NOT_CHECKED), ("navigation", "the navigation must answer a check: call check_nodes()")],
)
def test_no_goto_leaves_while_a_node_is_missing(silent: str, missing: str) -> None:
    bench = Bench(silent)
    call = bench.core.check_nodes()
    bench.run(30.0)
    assert isinstance(call.exception(0), NoAnswer)
    assert refused(bench.core) == f"no goto yet: {missing}; {NOT_CONFIGURED}"


@pytest.mark.parametrize("silent", ["drive", "navigation"])
def test_no_goto_leaves_when_a_node_has_died_after_its_check(silent: str) -> None:
    bench = Bench()
    bench.core.check_nodes()
    bench.run(1.0)
    bench.network.detach(bench.stations[silent])
    call = bench.core.configure_start(*RED)
    bench.run(30.0)
    assert isinstance(call.exception(0), NoAnswer)
    assert NOT_CONFIGURED in refused(bench.core)
    bench.run(1.0)
    assert bench.sent(GotoXY) == []


def test_no_goto_leaves_before_the_start_is_configured() -> None:
    bench = Bench()
    bench.core.check_nodes()
    bench.run(1.0)
    assert refused(bench.core) == f"no goto yet: {NOT_CONFIGURED}"


@pytest.mark.parametrize("other", ["drive", "navigation"])
@pytest.mark.parametrize("checked", [True, False])
def test_no_goto_leaves_with_a_node_of_another_dialect(other: str, checked: bool) -> None:
    bench = Bench()
    bench.replace(other, ROLES[other](dialects.load(other, "firmware2014")))
    calls: list[Future[Any]] = [bench.core.check_nodes()] if checked else []
    bench.run(1.0)
    configured = bench.core.configure_start(*RED)
    bench.run(5.0)
    for call in (*calls, configured):
        error = call.exception(0)
        assert isinstance(error, (NodeMismatch, NoAnswer))  # a drive refuses what it reads of a configuration
    assert f"{other}" in refused(bench.core)
    bench.run(1.0)
    assert bench.sent(GotoXY) == []


def test_a_core_that_boots_starts_anew_if_the_drive_has_booted_too() -> None:
    bench = Bench()
    bench.configure()
    bench.drive.reset()
    bench.core.restart(bench.now)
    call = bench.core.goto(*GOTO)  # not refused yet: the drive is asked what it remembers
    bench.run(1.0)
    assert str(call.exception(0)) == f"no goto yet: {NOT_CHECKED}; {NOT_CONFIGURED}"
    assert bench.sent(GotoXY) == []


def test_a_configuration_that_fails_takes_the_one_before_with_it() -> None:
    bench = Bench()
    bench.configure()
    bench.lose(StartConfigurationConfirm)
    bench.core.configure_start(*RED)
    bench.run(10.0)
    assert refused(bench.core) == f"no goto yet: {NOT_CONFIGURED}"


@pytest.mark.parametrize("booted", ["drive", "navigation"])
def test_a_node_that_boots_before_the_first_goto_is_checked_again(booted: str) -> None:
    bench = Bench()
    bench.configure()
    bench.replace(booted, ROLES[booted](DICTIONARIES[booted]))
    bench.run(1.0)
    checks = len(bench.sent(CheckDriveRequest)), len(bench.sent(CheckNaviRequest))
    bench.core.goto(*GOTO)
    bench.run(1.0)
    first = bench.times(GotoXY)[0]
    again = [time for time in bench.times(CheckDriveRequest, CheckNaviRequest) if time < first]
    assert len(again) > sum(checks)


@pytest.mark.parametrize("booted", ["drive", "navigation"])
def test_the_check_of_a_node_that_boots_counts_no_longer(booted: str) -> None:
    bench = Bench()
    bench.core.check_nodes()
    bench.run(1.0)
    bench.replace(booted, ROLES[booted](DICTIONARIES[booted]))
    bench.run(1.0)
    assert refused(bench.core) == f"no goto yet: the {booted} must answer a check: call check_nodes(); {NOT_CONFIGURED}"


def test_nodes_that_do_not_answer_their_next_check_count_as_checked_no_longer(bench: Bench) -> None:
    bench.configure()
    call = bench.core.check_nodes()
    bench.run(30.0)
    assert isinstance(call.exception(0), NoAnswer)
    assert refused(bench.core) == f"no goto yet: {NOT_CHECKED}"


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
def test_only_those_who_are_there_are_asked_for(
    bench: Bench, enemies: int, confederates: int, asked: set[type[Message]]
) -> None:
    bench.core.configure_start(TeamColour.RED, enemies, confederates)
    bench.run(0.01)
    bench.say("drive", StartConfigurationConfirm())
    bench.check()
    started = len(bench.messages())
    bench.run(4.0)
    assert {type(message) for message in bench.messages()[started:]} == asked


def test_a_new_start_configuration_begins_a_new_series(bench: Bench) -> None:
    bench.configure()
    bench.run(5.0)
    bench.core.configure_start(TeamColour.YELLOW)
    bench.run(0.01)
    bench.say("drive", StartConfigurationConfirm())
    bench.check()
    confirmed, asked = bench.times(StartConfigurationConfirm)[-1], len(bench.times(*OFFSETS))
    bench.run(4.0)
    new = bench.times(*OFFSETS)[asked:]
    assert new[0] - confirmed == pytest.approx(2.1, abs=0.001)
    assert {type(sent.message) for sent in bench.log if sent.time >= new[0]} == {
        NaviPositionRequest,
        KalmanPositionRequest,
    }


def test_positions_are_kept_with_the_time_they_came(bench: Bench) -> None:
    position = KalmanPositionResponse(1, 2, 3, Source.INTERNAL)
    for each in (position, position._replace(x=5)):
        bench.say("drive", each)
    sighting = bench.core.positions[KalmanPositionResponse]
    assert sighting.position == position._replace(x=5)
    assert sighting.time == pytest.approx(bench.log[-1].time)


def test_where_a_robot_was_seen_last_is_kept_while_it_is_not_seen(bench: Bench) -> None:
    assert bench.core.last_seen(Source.ENEMY_1) is None
    for x, y in ((700, 800), (None, None)):
        bench.say("navigation", Enemy1PositionResponse(x, y, None, Source.ENEMY_1))
    seen = bench.core.last_seen(Source.ENEMY_1)
    assert seen is not None
    assert seen.point == (700, 800)
    assert seen.time < bench.core.positions[Enemy1PositionResponse].time


# Gotos (document 2.1)


def test_a_goto_that_is_not_confirmed_is_sent_six_times_500_ms_apart(bench: Bench) -> None:
    call = goto(bench)
    bench.run(10.0)
    times = bench.times(GotoXY)
    assert len(times) == 6
    assert gaps(times) == pytest.approx([0.5] * 5, abs=ON_THE_WIRE)
    assert str(call.exception(0)) == "no GotoConfirm after 6 x GotoXY (500 ms each)"


def test_a_confirm_ends_the_transmissions(bench: Bench) -> None:
    goto(bench)
    bench.run(0.6)
    bench.say("drive", GotoConfirm(), within=1.0)
    assert len(bench.times(GotoXY)) == 2


def test_the_state_is_asked_for_200_ms_after_the_confirm_and_then_every_100_ms(bench: Bench) -> None:
    goto(bench)
    bench.say("drive", GotoConfirm())
    confirmed = bench.times(GotoConfirm)[0]
    for _ in range(5):
        asked = len(bench.times(GotoStateRequest))
        while len(bench.times(GotoStateRequest)) == asked:
            bench.run(0.001)
        bench.say("drive", GotoStateResponse(1000), within=0.0)
    times = bench.times(GotoStateRequest)
    assert times[0] - confirmed == pytest.approx(0.2, abs=ON_THE_WIRE)
    answered = bench.times(GotoStateResponse)
    pauses = [asked - answer for answer, asked in zip(answered, times[1:])]
    assert pauses == pytest.approx([0.1] * 4, abs=ON_THE_WIRE)


def test_a_state_request_waits_500_ms_for_its_answer(bench: Bench) -> None:
    call = goto(bench)
    bench.say("drive", GotoConfirm(), within=10.0)
    times = bench.times(GotoStateRequest)[:6]
    assert gaps(times) == pytest.approx([0.5] * 5, abs=ON_THE_WIRE)
    assert str(call.exception(0)) == "no GotoStateResponse after 6 x GotoStateRequest (500 ms each)"


@pytest.mark.parametrize(
    ("time", "outcome"),
    [
        (GotoFault.NOT_POSSIBLE, Outcome.NOT_POSSIBLE),
        (GotoFault.BLOCKED, Outcome.BLOCKED),
    ],
)
def test_a_goto_ends_when_its_state_says_so(bench: Bench, time: int | GotoFault, outcome: Outcome) -> None:
    call = goto(bench)
    bench.run(0.098)
    bench.say("drive", GotoConfirm(), within=0.25)
    bench.say("drive", GotoStateResponse(5000), within=0.11)
    bench.say("drive", GotoStateResponse(None), within=0.11)
    assert not call.done()
    bench.say("drive", GotoStateResponse(time))
    report = call.result(0)
    assert (report.goto, report.outcome) == (GOTO, outcome)
    assert report.confirmed == pytest.approx(0.1, abs=0.001)
    assert report.ended == pytest.approx(bench.times(GotoStateResponse)[-1] - bench.times(GotoXY)[0], abs=0.001)
    asked = len(bench.log)
    bench.run(2.0)
    assert len(bench.log) == asked


def test_a_goto_has_arrived_when_the_drive_says_so_and_is_there(bench: Bench) -> None:
    call = goto(bench)
    bench.say("drive", GotoConfirm(), within=0.25)
    bench.say("drive", GotoStateResponse(0), within=0.05)
    assert not call.done()
    assert bench.messages()[-1] == KalmanPositionRequest()
    bench.say("drive", KalmanPositionResponse(GOTO.x, GOTO.y, GOTO.angle, Source.INTERNAL))
    assert call.result(0).outcome is Outcome.ARRIVED
    asked = len(bench.log)
    bench.run(2.0)
    assert len(bench.log) == asked


def test_a_new_goto_ends_the_one_before(bench: Bench) -> None:
    first = goto(bench)
    bench.say("drive", GotoConfirm())
    second = bench.core.goto(500, 500, 0, 50)
    assert first.result(0).outcome is Outcome.REPLACED
    bench.run(0.01)
    assert bench.sent(GotoXY) == [GOTO, GotoXY(500, 500, 0, 50)]
    bench.say("drive", GotoConfirm(), within=0.3)
    bench.arrive(GotoXY(500, 500, 0, 50))
    assert second.result(0).outcome is Outcome.ARRIVED


def test_two_gotos_at_once_send_the_newer_only(bench: Bench) -> None:
    as_if_started(bench.core)
    first, second = bench.core.goto(*GOTO), bench.core.goto(500, 500, 0, 50)
    bench.run(0.1)
    assert first.result(0).outcome is Outcome.REPLACED
    assert bench.sent(GotoXY) == [GotoXY(500, 500, 0, 50)]
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
    bench: Bench, values: tuple[int, int, int, int], field: str
) -> None:
    driving = goto(bench)
    with pytest.raises(FieldError, match=f"Goto XY: {field} = "):
        bench.core.goto(*values)
    bench.run(0.1)
    assert bench.messages() == [GOTO]
    assert not driving.done()


def test_a_goto_that_the_dialect_cannot_carry_is_an_error(bench: Bench) -> None:
    with pytest.raises(FieldError, match="direction = backward is not allowed"):
        bench.core.goto(*GOTO[:5], Direction.BACKWARD)


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ((TeamColour.RED, 3), "enemies"),
        ((TeamColour.RED, 2, 2), "confederates"),
        ((TeamColour.RED, 2, 1, 51), "enemy_1_diameter"),
        ((TeamColour.RED, 2, 1, 50, 51), "enemy_2_diameter"),
    ],
)
def test_a_start_configuration_out_of_range_is_an_error_before_anything_is_sent(
    bench: Bench, values: tuple[Any, ...], field: str
) -> None:
    with pytest.raises(FieldError, match=f"Start Configuration Set: {field} = "):
        bench.core.configure_start(*values)
    bench.run(0.1)
    assert bench.messages() == []


# Stops (document 2.1, 4.2.2)

STOPS: list[tuple[Callable[[Core], object], Message]] = [
    (Core.stop, StopDrive()),
    (lambda core: core.emergency_stop(Obstacle.OBJECT), EmergencyStop(Obstacle.OBJECT)),
    (lambda core: core.emergency_stop(Obstacle.ENEMY), EmergencyStop(Obstacle.ENEMY)),
    (Core.emergency_shutdown, EmergencyShutdown()),
]


@pytest.mark.parametrize(("call", "stop"), STOPS)
def test_a_stop_goes_out_at_once_and_ends_the_goto(bench: Bench, call: Callable[[Core], object], stop: Message) -> None:
    driving = goto(bench)
    bench.say("drive", GotoConfirm(), within=0.1)
    now, count = bench.now, len(bench.log)
    call(bench.core)
    report = driving.result(0)
    assert (report.outcome, report.confirmed is None) == (Outcome.STOPPED, False)
    bench.run(3.0)
    assert bench.messages()[count] == stop
    assert bench.log[count].time - now < 0.001


@pytest.mark.parametrize(("call", "stop"), STOPS)
def test_a_goto_that_was_not_confirmed_is_not_sent_again_after_a_stop(
    bench: Bench, call: Callable[[Core], object], stop: Message
) -> None:
    driving = goto(bench)
    call(bench.core)
    bench.run(5.0)
    assert bench.messages()[:2] == [GOTO, stop]
    assert bench.sent(GotoXY) == [GOTO]
    assert driving.result(0).confirmed is None


@pytest.mark.parametrize(("call", "stop"), STOPS)
def test_a_confirm_that_comes_after_a_stop_is_answered_by_that_stop(
    bench: Bench, call: Callable[[Core], object], stop: Message
) -> None:
    goto(bench)
    call(bench.core)
    bench.run(0.05)
    bench.say("drive", GotoConfirm())
    assert bench.messages() == [GOTO, stop, GotoConfirm(), stop]


@pytest.mark.parametrize(("call", "stop"), STOPS)
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


def test_a_confirm_after_the_next_goto_stops_nothing(bench: Bench) -> None:
    bench.core.stop()
    goto(bench)
    bench.say("drive", GotoConfirm(), within=0.1)
    assert bench.messages() == [StopDrive(), GOTO, GotoConfirm()]


@pytest.mark.parametrize("silent", [0x702, 0x703])
def test_a_node_that_falls_silent_stops_the_drive(silent: int) -> None:
    core = Core(DICTIONARIES["core"])
    core.start(0.0)
    as_if_started(core)
    core.goto(*GOTO)
    core.receive(Frame(silent, b"\x05"), 0.5)
    sent: list[Frame] = []
    while (wakeup := core.next_wakeup) < 4.0:
        sent += core.tick(wakeup)
    assert PROTOCOL.encode(StopDrive()) in sent


# After an Emergency Shutdown


@pytest.mark.parametrize(("node_id", "outcome"), [(2, Outcome.LOST), (3, None)], ids=["drive", "navigation"])
def test_a_drive_that_boots_has_lost_its_goto(bench: Bench, node_id: int, outcome: Outcome | None) -> None:
    call = goto(bench)
    bench.say("drive", Frame(ERROR_CONTROL_BASE + node_id, b"\0"))
    assert (call.result(0).outcome if call.done() else None) == outcome
    assert (StopDrive() in bench.messages()) is (outcome is not None)


def test_after_a_shutdown_there_is_no_goto_until_the_next_start_configuration(bench: Bench) -> None:
    bench.configure()
    bench.core.emergency_shutdown()
    assert bench.core.shut_down
    with pytest.raises(StateError, match="after an emergency shutdown"):
        bench.core.goto(*GOTO)
    bench.configure()
    assert not bench.core.shut_down
    call = goto(bench)
    assert not call.done()


def test_a_start_configuration_under_way_is_not_sent_again_after_a_shutdown(bench: Bench) -> None:
    call = bench.core.configure_start(*RED)
    bench.run(0.1)
    bench.core.emergency_shutdown()
    bench.run(5.0)
    assert bench.messages()[:2] == [RED, EmergencyShutdown()]
    assert bench.sent(StartConfigurationSet) == [RED]
    assert isinstance(call.exception(0), StateError)
    assert bench.core.shut_down


def test_a_shutdown_that_overtakes_a_start_configuration_is_sent_again() -> None:
    bench = Bench()
    bench.core.offer(RED)
    bench.core.emergency_shutdown()  # in the same instant: it leaves first
    bench.run(1.0)
    assert bench.messages()[:4] == [EmergencyShutdown(), RED, StartConfigurationConfirm(), EmergencyShutdown()]
    assert (bench.core.shut_down, bench.drive.safe, bench.navigation.safe) == (True, True, True)


# Calls from several threads


class Interleaved(AbstractContextManager[None]):
    """A guard that another thread gets just before a call takes it, or just after the call has let it go, once."""

    def __init__(self, core: Core, before: Callable[[Core], object], after: Callable[[Core], object]) -> None:
        self.core, self.depth = core, 0
        self.before, self.after = before, after
        core.guard = self

    def __enter__(self) -> None:
        if self.depth == 0:
            before, self.before = self.before, no_call
            before(self.core)
        self.depth += 1

    def __exit__(self, *_: object) -> None:
        self.depth -= 1
        if self.depth == 0:
            after, self.after = self.after, no_call
            after(self.core)


def no_call(_: Core) -> None:
    """Do nothing."""


def stopped_by_a_master(core: Core) -> None:
    core.receive(Frame(NMT_COB_ID, bytes([NmtCommand.STOP, 0])), core.now)


@pytest.mark.parametrize(
    ("call", "meanwhile"),
    [
        (lambda core: core.goto(*GOTO), Core.emergency_shutdown),
        (lambda core: core.goto(*GOTO), stopped_by_a_master),
        (lambda core: core.configure_start(*RED), stopped_by_a_master),
    ],
)
def test_a_call_sees_what_another_thread_did_just_before_it(
    bench: Bench, call: Callable[[Core], object], meanwhile: Callable[[Core], object]
) -> None:
    bench.configure()
    before = len(bench.messages())
    Interleaved(bench.core, before=meanwhile, after=no_call)
    with pytest.raises(StateError):
        call(bench.core)
    bench.run(1.0)
    assert not {type(message) for message in bench.messages()[before:]} & {GotoXY, StartConfigurationSet}


def test_a_confirm_that_comes_right_after_a_shutdown_does_not_end_it(bench: Bench) -> None:
    call = bench.core.configure_start(*RED)
    bench.run(0.1)
    confirm = PROTOCOL.encode(StartConfigurationConfirm())
    Interleaved(bench.core, before=no_call, after=lambda core: core.receive(confirm, core.now))
    bench.core.emergency_shutdown()
    assert bench.core.shut_down
    assert isinstance(call.exception(0), StateError)


def test_positions_are_polled_on_after_a_shutdown(bench: Bench) -> None:
    bench.configure()
    bench.core.emergency_shutdown()
    bench.run(4.0)
    assert len(bench.times(NaviPositionRequest)) == 4


# Positions on demand, cancelled calls, reset


def test_a_position_is_asked_for_and_returned(bench: Bench) -> None:
    call = bench.core.position()
    bench.run(0.7)
    answer = KalmanPositionResponse(None, None, None, Source.INTERNAL)
    bench.say("drive", answer)
    assert call.result(0) == answer
    assert gaps(bench.times(KalmanPositionRequest)) == pytest.approx([0.5], abs=ON_THE_WIRE)


def test_a_cancelled_goto_is_stopped_at_once(bench: Bench) -> None:
    assert goto(bench).cancel()
    bench.run(0.002)  # not only when it would be sent again
    assert bench.messages()[-1] == StopDrive()


def test_a_cancelled_goto_is_not_sent_again_and_the_next_one_is(bench: Bench) -> None:
    assert goto(bench).cancel()
    bench.run(1.0)
    assert bench.sent(GotoXY) == [GOTO]
    goto(bench)
    assert bench.sent(GotoXY) == [GOTO, GOTO]


@rows(
    "call",
    [
        Core.check_nodes,
        lambda core: core.configure_start(*RED),
        lambda core: core.goto(*GOTO),
        Core.position,
    ],
)
@rows("running", [0.0, 0.1])
def test_an_nmt_reset_ends_every_call(call: Callable[[Core], Future[Any]], running: float) -> None:
    bench = Bench("drive", "navigation")
    as_if_started(bench.core)
    future = call(bench.core)
    bench.run(running)
    bench.command("drive", NmtCommand.RESET_NODE, bench.core.device.node_id)
    assert isinstance(future.exception(0), StateError)
    asked = len(bench.log)
    bench.run(1.0)
    assert not {type(each) for each in bench.messages()[asked:]} & {CheckDriveRequest, GotoXY, StartConfigurationSet}


def test_an_nmt_reset_forgets_configuration_and_positions(bench: Bench) -> None:
    bench.configure()
    bench.say("drive", KalmanPositionResponse(1, 2, 3, Source.INTERNAL))
    bench.core.emergency_shutdown()
    bench.command("drive", NmtCommand.RESET_NODE)
    assert (bench.core.configuration, bench.core.positions, bench.core.shut_down) == (None, {}, False)


WATCHED = [GOTO, RED, StopDrive(), EmergencyStop(Obstacle.ENEMY), EmergencyShutdown()]


@pytest.mark.parametrize("message", WATCHED, ids=lambda message: type(message).__name__)
def test_what_a_call_watches_is_not_sent_past_it(bench: Bench, message: Message) -> None:
    with pytest.raises(StateError, match=r"is sent by core\.\w+\(\), which sees to what comes of it"):
        bench.core.send(message)
    with pytest.raises(StateError, match="is sent by core"):
        bench.core.ask(message, GotoConfirm)
    bench.run(0.1)
    assert bench.messages() == []


def test_any_other_message_is_sent_asked_for_and_told(bench: Bench) -> None:
    told: list[Message] = []
    end = bench.core.on(GotoStateResponse, told.append)
    call = bench.core.ask(GotoStateRequest(), GotoStateResponse)
    bench.run(0.01)
    bench.say("drive", GotoStateResponse(5))
    assert (call.result(0), told) == (GotoStateResponse(5), [GotoStateResponse(5)])
    end()
    bench.core.send(GotoStateRequest())
    bench.say("drive", GotoStateResponse(6))
    assert (bench.sent(GotoStateRequest), told) == ([GotoStateRequest()] * 2, [GotoStateResponse(5)])


def test_the_next_message_as_wanted_is_waited_for(bench: Bench) -> None:
    next_one = bench.core.hear(GotoStateResponse)
    wanted = bench.core.hear(GotoStateResponse, lambda each: each.time == 7, timeout=1.0)
    for time in (5, 6, 7):
        bench.run(0.3)
        bench.say("drive", GotoStateResponse(time))
    assert (next_one.result(0), wanted.result(0)) == (GotoStateResponse(5), GotoStateResponse(7))
    assert {type(each) for each in bench.messages()} == {GotoStateResponse}


@pytest.mark.parametrize(
    ("where", "error", "text"),
    [
        (None, NoAnswer, "no GotoStateResponse within 500 ms"),
        (lambda each: each.time == 7, NoAnswer, "no GotoStateResponse as wanted within 500 ms"),
        (lambda each: each.place, AttributeError, "'GotoStateResponse' object has no attribute 'place'"),
    ],
)
def test_a_message_that_does_not_come_as_wanted_is_an_error_of_the_call(
    bench: Bench, where: Callable[[GotoStateResponse], object] | None, error: type[Exception], text: str
) -> None:
    heard = bench.core.hear(GotoStateResponse, where)
    bench.run(0.4)
    if where is not None:
        bench.say("drive", GotoStateResponse(6))
    bench.run(0.2)
    with pytest.raises(error, match=f"^{text}$"):
        heard.result(0)
    assert bench.core.open_calls == 0


def test_what_the_core_never_receives_is_not_waited_for(bench: Bench) -> None:
    with pytest.raises(StateError):
        bench.core.hear(GotoXY)


def test_a_function_that_wants_one_message_takes_it_from_no_other(bench: Bench) -> None:
    told: list[str] = []

    def once(_: Message) -> None:
        told.append("once")
        end()

    end = bench.core.on(GotoStateResponse, once)
    bench.core.on(GotoStateResponse, lambda _: told.append("always"))
    for _ in range(2):
        bench.say("drive", GotoStateResponse(5))
    assert told == ["once", "always", "always"]


def test_an_answer_that_does_not_come_in_time_is_an_error(bench: Bench) -> None:
    call = bench.core.ask(GotoStateRequest(), GotoStateResponse, timeout=0.2)
    bench.run(0.19)
    assert not call.done()
    bench.run(0.02)
    with pytest.raises(NoAnswer, match="no GotoStateResponse within 200 ms after GotoStateRequest"):
        call.result(0)


def test_what_the_core_can_neither_send_nor_receive_is_told_with_its_file(bench: Bench) -> None:
    with pytest.raises(StateError, match=r"core has no TPDO for GotoConfirm; .*core\.eds says what it can send"):
        bench.core.send(GotoConfirm())
    for receive in (lambda: bench.core.ask(GotoStateRequest(), GotoXY), lambda: bench.core.on(GotoXY, print)):
        with pytest.raises(StateError, match=r"core has no RPDO for GotoXY; .*core\.eds says what it can receive"):
            receive()
    bench.run(0.1)
    assert bench.messages() == []


def test_a_call_of_a_core_that_is_off_ends_at_once() -> None:
    """Nobody calls its `tick` any more: it would wait for ever."""
    core = Core(DICTIONARIES["core"])
    core.switched_off()
    for call in (core.position(), core.check_nodes()):
        with pytest.raises(StateError, match="the core is being switched off"):
            call.result(timeout=0)
    assert core.open_calls == 0
