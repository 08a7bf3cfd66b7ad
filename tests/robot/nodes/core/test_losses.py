"""Nodes that fall silent or boot, and the navigation that a match goes on without (decisions 16 and 17)."""

from __future__ import annotations

import pytest

from eurobot_od.errors import NoAnswer
from eurobot_od.frame import Frame
from eurobot_od.od.values import ERROR_CONTROL_BASE
from eurobot_od.robot.model.messages import (
    CheckNaviRequest,
    CheckNaviResponse,
    ConfederatePositionResponse,
    Enemy1PositionResponse,
    Enemy2PositionResponse,
    GotoConfirm,
    GotoStateResponse,
    GotoXY,
    NaviPositionResponse,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.values import (
    Outcome,
    RobotError,
)
from eurobot_od.robot.nodes import Core, Navigation
from tests.kit.bench import put
from tests.robot.nodes.driving import (
    FAR,
    GOTO,
    NEAR,
    commands,
    goto,
    match_under_way,
    reboot,
    true_robot,
)
from tests.robot.nodes.harness import DICTIONARIES, PROTOCOL, RED, Bench, as_if_started


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


@pytest.mark.parametrize(("node_id", "outcome"), [(2, Outcome.LOST), (3, None)], ids=["drive", "navigation"])
def test_a_drive_that_boots_has_lost_its_goto(alone: Bench, node_id: int, outcome: Outcome | None) -> None:
    call = goto(alone)
    alone.say("drive", Frame(ERROR_CONTROL_BASE + node_id, b"\0"))
    assert (call.result(0).outcome if call.done() else None) == outcome
    assert (StopDrive() in alone.messages()) is (outcome is not None)


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
    assert any("the navigation answers again" in str(report) for report in bench.network.reports)
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
    assert any("the navigation answers again" in str(report) for report in bench.network.reports)


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
