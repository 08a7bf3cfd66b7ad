"""Node checks and the start configuration (document 2.3): how often and when they are sent, and what a start needs."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import pytest

from eurobot_od.errors import FieldError, NoAnswer, StateError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import Message
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    CheckDriveResponse,
    CheckNaviRequest,
    CheckNaviResponse,
    GotoXY,
    NaviPositionRequest,
    StartConfigurationConfirm,
    StartConfigurationSet,
)
from eurobot_od.robot.model.values import (
    TeamColour,
)
from eurobot_od.robot.nodes import ROLES, Core
from eurobot_od.robot.nodes.core.agreement import NodeMismatch
from tests.robot.nodes.driving import (
    GOTO,
    ON_THE_WIRE,
    gaps,
)
from tests.robot.nodes.harness import DICTIONARIES, RED, Bench

# Node checks (document 2.3)


def test_the_drive_is_checked_before_the_navigation(alone: Bench) -> None:
    call = alone.core.check_nodes()
    alone.run(0.1)
    assert alone.messages() == [CheckDriveRequest()]
    alone.say("drive", CheckDriveResponse())
    assert alone.messages()[2:] == [CheckNaviRequest()]
    alone.run(0.2)
    alone.say("navigation", CheckNaviResponse())
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
def test_a_node_that_does_not_answer_is_named(alone: Bench, answered: list[Message], error: str) -> None:
    call = alone.core.check_nodes()
    alone.say("drive", *answered, within=30.0)
    assert str(call.exception(0)) == error


def test_a_check_waits_one_second(alone: Bench) -> None:
    alone.core.check_nodes()
    alone.run(30.0)
    times = alone.times(CheckDriveRequest)
    assert len(times) == 10
    assert gaps(times) == pytest.approx([1.0] * 9, abs=ON_THE_WIRE)


# Start configuration (document 2.3)


def test_a_start_configuration_is_set_until_it_is_confirmed(alone: Bench) -> None:
    call = alone.core.configure_start(*RED)
    alone.run(1.2)
    alone.say("navigation", StartConfigurationConfirm())
    alone.check()
    alone.run(1.0)
    times = alone.times(StartConfigurationSet)
    assert gaps(times) == pytest.approx([0.5, 0.5], abs=ON_THE_WIRE)
    assert call.result(0) == pytest.approx(1.2, abs=0.002)
    assert alone.core.configuration == RED


def test_a_start_configuration_that_nobody_confirms_is_an_error(alone: Bench) -> None:
    call = alone.core.configure_start(*RED)
    alone.run(10.0)
    assert len(alone.times(StartConfigurationSet)) == 6
    assert isinstance(call.exception(0), NoAnswer)
    assert alone.core.configuration is None
    assert alone.times(NaviPositionRequest) == []


@pytest.mark.parametrize("confirms", [1, 2])
def test_one_confirm_of_two_is_enough_and_a_second_changes_nothing(alone: Bench, confirms: int) -> None:
    call = alone.core.configure_start(*RED)
    alone.run(0.01)
    for peer in ("drive", "navigation")[:confirms]:
        alone.say(peer, StartConfigurationConfirm())
    alone.check()
    assert call.done()
    alone.run(2.2)
    assert len(alone.times(NaviPositionRequest)) == 1


@pytest.mark.parametrize(
    ("answered", "missing"),
    [
        ([], "CheckDriveResponse"),  # the confirm was anybody's
        ([CheckDriveResponse()], "CheckNaviResponse"),
    ],
)
def test_both_nodes_are_checked_again_after_the_confirm(alone: Bench, answered: list[Message], missing: str) -> None:
    call = alone.core.configure_start(*RED)
    alone.run(0.01)
    alone.say("drive", StartConfigurationConfirm(), *answered, within=30.0)
    assert f"no {missing} after 10 x" in str(call.exception(0))
    assert alone.core.configuration is None


def test_confirms_of_drive_and_navigation_merge_on_the_wire() -> None:
    bench = Bench()
    call = bench.core.configure_start(*RED)
    bench.run(0.1)
    assert bench.messages()[:3] == [RED, StartConfigurationConfirm(), CheckDriveRequest()]
    assert call.done()
    assert (bench.drive.configuration, bench.navigation.configuration) == (RED, RED)


def test_a_newer_start_configuration_replaces_one_that_is_not_confirmed(alone: Bench) -> None:
    yellow = RED._replace(team_colour=TeamColour.YELLOW)
    old = alone.core.configure_start(*RED)
    alone.run(0.1)
    new = alone.core.configure_start(*yellow)
    alone.run(1.2)
    assert isinstance(old.exception(0), StateError)
    assert alone.sent(StartConfigurationSet) == [RED, yellow, yellow, yellow]
    alone.say("drive", StartConfigurationConfirm())
    alone.check()
    assert new.done()
    assert alone.core.configuration == yellow


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


def test_no_goto_leaves_a_core_that_has_done_nothing(alone: Bench) -> None:
    assert refused(alone.core) == f"no goto yet: {NOT_CHECKED}; {NOT_CONFIGURED}"
    alone.run(1.0)
    assert alone.messages() == []


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


def test_nodes_that_do_not_answer_their_next_check_count_as_checked_no_longer(alone: Bench) -> None:
    alone.configure()
    call = alone.core.check_nodes()
    alone.run(30.0)
    assert isinstance(call.exception(0), NoAnswer)
    assert refused(alone.core) == f"no goto yet: {NOT_CHECKED}"


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
    alone: Bench, values: tuple[Any, ...], field: str
) -> None:
    with pytest.raises(FieldError, match=f"Start Configuration Set: {field} = "):
        alone.core.configure_start(*values)
    alone.run(0.1)
    assert alone.messages() == []


# 17: who has said it


def test_17_the_confirm_of_the_navigation_alone_does_not_start_a_robot_without_a_drive() -> None:
    bench = Bench("drive")
    call = bench.core.configure_start(*RED)
    bench.run(30.0)
    assert StartConfigurationConfirm() in bench.messages()
    assert str(call.exception(0)).startswith("no CheckDriveResponse after 10 x")
    assert bench.core.configuration is None
