"""The robot's own rules of `diagnose`, and that a match breaks no rule."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import pytest

from eurobot_od.cli.devices import Devices
from eurobot_od.errors import NoAnswer
from eurobot_od.frame import Frame
from eurobot_od.robot.check.diagnosis import EurobotRule
from eurobot_od.robot.match import MatchOptions
from eurobot_od.robot.match.stage import EdsFiles, play_simulated
from eurobot_od.robot.model.messages import (
    EmergencyShutdown,
    GotoStateResponse,
    GotoXY,
    KalmanPositionResponse,
    StopDrive,
)
from eurobot_od.robot.model.values import GotoFault, Source
from eurobot_od.robot.plugin import ROBOT
from eurobot_od.traffic.diagnosis import Diagnosis
from eurobot_od.traffic.diagnosis.incidents import Incident, IncidentRule
from eurobot_od.traffic.diagnosis.rules import BusRule

DECODER = Devices().decoder()
PROMISED = Devices().promised(DECODER)


def diagnosed(frames: list[tuple[float, Any]]) -> list[Incident]:
    diagnosis = Diagnosis(DECODER, lambda _: ROBOT.watchers(), promised=PROMISED)
    for time, frame in frames:
        diagnosis.take(time, "", frame)
    diagnosis.end()
    return diagnosis.incidents.sorted()


def match(**options: Any) -> list[Incident]:
    frames: list[tuple[float, Frame]] = []
    chosen = MatchOptions(**options)
    with suppress(NoAnswer):
        play_simulated(chosen, lambda _: None, lambda *each: frames.append(each), EdsFiles.read(chosen))
    return diagnosed(frames)


def test_a_match_breaks_no_rule() -> None:
    assert [each.title for each in match(duration=20.0)] == []


@pytest.mark.long
@pytest.mark.parametrize("seed", range(1, 6))
def test_whole_matches_break_no_rule(seed: int) -> None:
    assert [each.title for each in match(seed=seed)] == []


FAULTS = [
    ("goto-not-confirmed", BusRule.ANSWER_MISSING, "drive", {}),
    ("drive-check-not-answered", BusRule.ANSWER_MISSING, "drive", {}),
    ("shutdown-ignored", EurobotRule.STOP_NOT_OBEYED, "drive", {"emergency_at": 3.0}),
]


@pytest.mark.parametrize(("fault", "rule", "who", "options"), FAULTS)
def test_a_fault_is_the_first_that_is_named(fault: str, rule: IncidentRule, who: str, options: dict[str, Any]) -> None:
    found = match(faults=(fault,), duration=8.0, **options)
    assert (found[0].rule, found[0].who) == (rule, who)


def at(x: int, source: Source = Source.INTERNAL) -> KalmanPositionResponse:
    return KalmanPositionResponse(x, 1000, 90, source)


# What breaks a rule, and what nearly does.
MESSAGES = [
    (EurobotRule.STOP_NOT_OBEYED, [(1.0, StopDrive()), (1.1, GotoStateResponse(500))]),
    (EurobotRule.STOP_NOT_OBEYED, [(1.0, EmergencyShutdown()), (1.6, at(500)), (1.8, at(530))]),
    (EurobotRule.POSITION_SOURCE, [(1.0, at(500)), (1.1, at(500, Source.CONFEDERATE))]),
]
NEARLY = [
    ("it says so at once", [(1.0, StopDrive()), (1.02, GotoStateResponse(500))]),
    ("there is a new goto", [(1.0, StopDrive()), (1.05, GotoXY(1, 2, 3, 4)), (1.1, GotoStateResponse(500))]),
    ("it is blocked", [(1.0, StopDrive()), (1.1, GotoStateResponse(GotoFault.BLOCKED))]),
    ("it brakes", [(1.0, EmergencyShutdown()), (1.2, at(500)), (1.4, at(530)), (1.6, at(535)), (1.8, at(536))]),
    ("the place is unknown", [(1.0, at(500)), (1.1, KalmanPositionResponse(None, None, None, Source.INTERNAL))]),
]


def of_ours(messages: list[tuple[float, Any]]) -> list[Incident]:
    found = diagnosed([(time, DECODER.protocol.encode(message)) for time, message in messages])
    return [each for each in found if isinstance(each.rule, EurobotRule)]


@pytest.mark.parametrize(("rule", "messages"), MESSAGES)
def test_a_rule_finds_its_defect(rule: EurobotRule, messages: list[tuple[float, Any]]) -> None:
    assert [(each.rule, each.who) for each in of_ours(messages)] == [(rule, "drive")]


@pytest.mark.parametrize(("why", "messages"), NEARLY)
def test_a_near_miss_is_not_found(why: str, messages: list[tuple[float, Any]]) -> None:
    assert of_ours(messages) == [], why
