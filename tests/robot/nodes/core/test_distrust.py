"""What nobody has asked for stops the robot, and a place that jumps is not believed."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.errors import StateError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot.model.messages import (
    EmergencyShutdown,
    EmergencyStop,
    GotoConfirm,
    GotoXY,
    KalmanPositionRequest,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import Obstacle, Outcome, TeamColour
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.nodes.core.distrust import GotoConfirms, jumps
from eurobot_od.robot.nodes.core.flows import PlaceLost
from eurobot_od.robot.nodes.estimate import Estimate
from tests.robot.nodes.driving import FAR, NEAR, drive_off, match_under_way
from tests.robot.nodes.harness import DICTIONARIES, PROTOCOL, Bench, Peer

ROOT = Path(__file__).resolve().parents[4]

BACK = GotoXY(400, 1700, 0, 50)


def with_stranger(navigation: bool = True) -> Bench:
    """A match in which the robot has driven for 2 s, and somebody else is on the bus."""
    bench = match_under_way()
    bench.attach("stranger", Peer(Dictionary.load(ROOT / "docs" / "io.eds", 9)))
    bench.run(0.1)
    if not navigation:
        bench.network.detach(bench.stations["navigation"])
        bench.run(3.0)
    return bench


def reports(bench: Bench) -> str:
    """What a person has read so far."""
    return "\n".join(map(str, bench.network.reports))


COMMANDS: list[tuple[Message, Outcome, str]] = [
    (EmergencyShutdown(), Outcome.STOPPED, "Emergency Shutdown"),
    (StopDrive(), Outcome.STOPPED, "Stop Drive"),
    (EmergencyStop(Obstacle.ENEMY), Outcome.STOPPED, "Emergency Stop"),
    (BACK, Outcome.LOST, "Goto XY"),
    (StartConfigurationSet(TeamColour.YELLOW, 0, 0, 0, 0), Outcome.LOST, "Start Configuration Set"),
]


@pytest.mark.parametrize(("message", "outcome", "name"), COMMANDS)
def test_a_command_of_somebody_else_ends_the_goto_with_the_robot_standing(
    message: Message, outcome: Outcome, name: str
) -> None:
    bench = with_stranger()
    call = drive_off(bench)
    bench.say("stranger", message)
    bench.run(1.0)
    assert call.result(0).outcome is outcome
    assert call.result(0).why == f"somebody else sent {name}"
    assert not bench.drive.moving


def test_a_request_of_somebody_else_stops_nothing() -> None:
    bench = with_stranger()
    call = drive_off(bench)
    bench.say("stranger", KalmanPositionRequest())
    bench.run(10.0)
    assert call.result(0).outcome is Outcome.ARRIVED


@pytest.mark.parametrize("navigation", [True, False])
def test_after_a_stray_start_configuration_the_next_goto_arrives_where_it_says(navigation: bool) -> None:
    bench = with_stranger(navigation)
    drive_off(bench)
    bench.say("stranger", Frame(0x2C0, bytes([1, 0])), StartConfigurationSet(TeamColour.RED, 0, 0, 0, 0))
    call = bench.core.goto(*NEAR)  # at once
    bench.run(15.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    assert bench.drive.chassis.pose.distance(Point(*NEAR[:2])) < 50  # type: ignore[attr-defined]


def test_a_goto_by_sdo_during_the_cores_own_is_not_driven() -> None:
    bench = with_stranger()
    call = drive_off(bench)
    bench.drive._obey(BACK)  # what the SDO server does once the last sub-index is written
    bench.drive._call()
    bench.run(1.0)
    assert call.result(0).outcome is Outcome.LOST
    assert "did not send" in call.result(0).why
    assert not bench.drive.moving


def test_an_emergency_shutdown_of_somebody_else_is_known_before_the_next_goto() -> None:
    bench = with_stranger()
    bench.say("stranger", EmergencyShutdown())
    assert bench.core.shut_down
    with pytest.raises(StateError, match="recover"):
        bench.core.goto(*FAR)
    recovered = bench.core.recover()
    bench.run(3.0)
    recovered.result(0)
    call = bench.core.goto(*NEAR)
    bench.run(10.0)
    assert call.result(0).outcome is Outcome.ARRIVED


def test_a_second_core_is_told_and_the_robot_stands() -> None:
    bench = with_stranger()
    call = drive_off(bench)
    bench.attach("second", Core(DICTIONARIES["core"]))
    bench.run(1.5)
    assert call.result(0).outcome is not Outcome.ARRIVED
    assert not bench.drive.moving
    assert "another node uses the core's identifiers" in reports(bench)


@pytest.mark.parametrize(("navigation", "goes_on"), [(True, True), (False, False)])
def test_a_place_that_jumps_is_believed_only_with_the_navigation(navigation: bool, goes_on: bool) -> None:
    bench = with_stranger(navigation)
    call = drive_off(bench)
    bench.drive.estimate = Estimate(bench.drive.estimate.tuning, bench.pose().moved(-900.0, 0.0))
    bench.run(1.5)
    assert call.result(0).outcome is Outcome.LOST
    assert "has jumped" in call.result(0).why
    again = bench.core.goto(*NEAR)
    bench.run(15.0)
    assert (again.exception(0) is None) is goes_on
    assert goes_on or isinstance(again.exception(0), PlaceLost)


@pytest.mark.parametrize(("times", "asked_for"), [
    ((0.001,), [True]),
    ((0.001, 0.002), [True, True]),  # the bus brought it twice
    ((0.001, 0.1), [True, False]),  # somebody else's goto
    ((0.501, 1.002), [True, True]),  # sent twice, each confirm is late
    ((0.501, 1.002, 1.5), [True, True, False]),
])  # fmt: skip
def test_a_goto_explains_as_many_confirms_as_it_was_sent_times(times: tuple[float, ...], asked_for: list[bool]) -> None:
    confirms = GotoConfirms(0.0, 0.5, 6)
    assert [confirms.is_asked_for(each) for each in times] == asked_for


@pytest.mark.parametrize(("before", "after", "seconds", "found"), [
    ((0, 0, 0), (600, 0, 0), 0.6, False),  # 480 mm, and both positions are off
    ((0, 0, 0), (700, 0, 0), 0.6, True),
    ((None, None, None), (700, 0, 0), 0.6, False),
    ((0, 0, 0), (None, None, None), 0.6, False),
])  # fmt: skip
def test_a_place_jumps_if_no_robot_can_have_driven_there(
    before: object, after: object, seconds: float, found: bool
) -> None:
    assert jumps(before, after, seconds) is found  # type: ignore[arg-type]


def test_a_confirm_of_the_goto_is_known_by_its_message() -> None:
    assert PROTOCOL.name(GotoConfirm) == "Goto Confirm"
