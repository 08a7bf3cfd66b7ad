"""Reports say what happened: for people, and in the forms that other programs read."""

from __future__ import annotations

import json
from pathlib import Path
from xml.etree import ElementTree

import pytest
from junitparser import Error, Failure, JUnitXml, Skipped, TestCase, TestSuite

from eurobot_od.check import report
from eurobot_od.check.report import Line, RunFacts, Status, StepReason, StepResult, SuitePart, SuiteResult
from eurobot_od.check.suite import Mismatch
from eurobot_od.frame import Frame
from eurobot_od.support.yaml_places import Place

REASON = StepReason(
    "Move State Response is not as expected",
    "Move State Response: time 0 ms",
    "Move State Response  time=5 ms",
    (Mismatch("time", "0 ms", "5 ms"),),
    (
        Line(0.5, True, Frame(0x302), "Move State Request"),
        Line(0.5002, False, Frame(0x282, b"\5\0\0"), "Move State Response  time=5 ms"),
    ),
)


def step(
    name: str, status: Status, section: SuitePart = SuitePart.STEPS, reason: StepReason | None = None
) -> StepResult:
    return StepResult(section, name, Place(7, 5), status, 0.5, 0.0012, reason)


RED = SuiteResult(
    Path("lift.yaml"),
    "the lift",
    "simulated",
    (
        step("prepared", Status.PASSED, SuitePart.SETUP),
        step("<it> arrives & stays # here", Status.FAILED, reason=REASON),
        step("the rest", Status.SKIPPED),
        step("broken off", Status.INTERRUPTED),
    ),
    seconds=1.5,
)
LEFT_OUT = SuiteResult(Path("bytes.yaml"), "bytes", "simulated", skipped="it is for another dialect")
BROKEN = SuiteResult(
    Path("panel.yaml"),
    "the panel",
    "on can0",
    (step("asked", Status.BUS_FAILED, reason=StepReason("the bus can0 failed: gone")),),
    error="the bus can0 failed: gone",
)
ALL = [RED, LEFT_OUT, BROKEN]


def test_a_step_is_a_line() -> None:
    assert report.step_line(RED.steps[0]) == "  ok              0.500 s       1.2 ms     7  [setup] prepared"
    assert report.step_line(RED.steps[2]) == "  skipped         0.500 s       1.2 ms     7  the rest"


def test_a_step_has_its_colour_on_a_terminal() -> None:
    assert report.step_line(RED.steps[1], in_colour=True).startswith("  \x1b[31mFAILED     \x1b[0m")


def test_a_reason_has_all_facts_and_the_last_frames() -> None:
    assert list(report.reason_lines(REASON)) == [
        "    Move State Response is not as expected",
        "      expected  Move State Response: time 0 ms",
        "      came      Move State Response  time=5 ms",
        "      time      expected 0 ms, came 5 ms",
        "      last frames (> sent, < received)",
        "           0.5000 s > 302#                  Move State Request",
        "           0.5002 s < 282#050000            Move State Response  time=5 ms",
    ]


@pytest.mark.parametrize(
    ("results", "line"),
    [
        ([], "0 suites: no steps in 0.0 s of bus time; NOTHING WAS CHECKED"),
        ([RED], "1 suite: 1 ok, 1 FAILED, 1 skipped, 1 interrupted in 1.5 s of bus time"),
        (ALL, "3 suites: 1 ok, 1 FAILED, 1 skipped, 1 interrupted, 1 bus failed in 1.5 s of bus time"),
    ],
)
def test_the_last_line_counts_suites_and_steps(results: list[SuiteResult], line: str) -> None:
    assert report.summary(results) == line


def test_junitparser_reads_the_junit_report() -> None:
    suites = list(JUnitXml.fromstring(report.junit(ALL).encode()))
    assert all(isinstance(each, TestSuite) for each in suites)
    red, left_out, broken = suites
    assert (red.name, red.tests, red.failures, red.errors, red.skipped) == ("the lift", 4, 1, 1, 1)
    assert red.time == pytest.approx(1.5)
    assert (left_out.tests, left_out.skipped, broken.errors) == (1, 1, 1)
    passed, failed, skipped, interrupted = red
    assert isinstance(failed, TestCase)
    assert (passed.name, passed.classname, passed.is_passed) == ("setup: prepared", "lift", True)
    assert (failed.name, failed.time) == ("<it> arrives & stays # here", pytest.approx(0.0012))
    assert [type(each) for case in (failed, skipped, interrupted) for each in case.result] == [Failure, Skipped, Error]
    assert failed.result[0].message == REASON.what
    assert "came 5 ms" in str(failed.result[0].text)


def test_the_junit_report_has_the_run_and_its_devices() -> None:
    facts = RunFacts("the program", "2026-11-29T12:00:00+00:00", "can0")
    lost = SuiteResult(Path("x"), "x", "", error="lost")
    text = report.junit([RED, lost], facts)
    red, broken = JUnitXml.fromstring(text.encode())
    assert red.timestamp == facts.began
    properties = {each.get("name"): each.get("value") for each in ElementTree.fromstring(text)[0].iter("property")}
    assert properties == {"program": "the program", "bus": "can0", "run": "simulated"}
    assert (broken.tests, broken.errors) == (1, 1), "a suite without a step has one case, with what stopped it"


@pytest.mark.parametrize(
    ("statuses", "expected"),
    [((), True), ((Status.SKIPPED,), True), ((Status.SKIPPED, Status.PASSED), False), ((Status.INTERRUPTED,), False)],
)
def test_a_run_of_skipped_steps_has_checked_nothing(statuses: tuple[Status, ...], expected: bool) -> None:
    result = SuiteResult(Path("a.yaml"), "a", "simulated", tuple(step("", each) for each in statuses))
    assert report.checked_nothing([result]) is expected


def test_green_and_skipped_steps_are_counted() -> None:
    assert [report.folded(each) for each in ALL] == ["1 ok, 1 skipped", "", ""]


def test_red_steps_are_repeated_at_the_end_with_their_place() -> None:
    assert list(report.failures(ALL)) == [
        "lift.yaml:7: <it> arrives & stays # here (simulated)",
        *report.reason_lines(REASON),
        "panel.yaml:7: asked (on can0)",
        "    the bus can0 failed: gone",
    ]


def test_json_has_all_facts() -> None:
    red, left_out, broken = json.loads(json.dumps(report.as_data(ALL)))
    assert [each["status"] for each in red["steps"]] == ["ok", "failed", "skipped", "interrupted"]
    assert red["steps"][1]["line"] == 7
    assert red["steps"][1]["finding"]["differences"] == [{"what": "time", "expected": "0 ms", "came": "5 ms"}]
    assert red["steps"][1]["finding"]["frames"][1] == {
        "time": 0.5002,
        "direction": "received",
        "frame": "282#050000",
        "meaning": "Move State Response  time=5 ms",
    }
    assert (left_out["skipped"], broken["error"]) == ("it is for another dialect", "the bus can0 failed: gone")
