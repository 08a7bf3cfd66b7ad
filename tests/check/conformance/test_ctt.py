"""The tests of CiA's tool: each has a clause of ours and stands in the guide, and a run says what became of it."""

from __future__ import annotations

import re
from pathlib import Path

from eurobot_od.check.conformance import ctt, suite
from eurobot_od.check.conformance.clauses import StepName
from eurobot_od.check.conformance.ctt import Verdict
from eurobot_od.check.report import Status, StepReason, StepResult, SuitePart, SuiteResult
from eurobot_od.support.yaml_places import Place
from tests.rows import rows

GUIDE = Path(__file__).parents[3] / "docs" / "conformance.md"
CLAUSES = [clause for chapter in suite.CHAPTERS for clause in chapter]


def numbers(written: str) -> tuple[str, ...]:
    return StepName("7.4", "x", "y", "reading", written).numbers


def test_each_test_of_the_tool_has_a_clause_and_no_clause_another_number() -> None:
    asked = {number for clause in CLAUSES for number in numbers(clause.ctt)}
    assert len(ctt.ASKS) == 127
    assert asked | {ctt.LINT} == set(ctt.ASKS)


def test_the_guide_names_each_test_once() -> None:
    table = GUIDE.read_text(encoding="utf-8").partition("Where we ask less")[0]
    cells = re.findall(r"^\| ([\d., to]+) \|", table, re.MULTILINE)
    told = [number for cell in cells for number in numbers(cell)]
    assert sorted(told) == sorted(ctt.ASKS)


def run(*steps: tuple[str, Status, str]) -> SuiteResult:
    """A run whose steps have numbers, statuses and reasons."""
    done = (
        StepResult(SuitePart.STEPS, f"7.4 x: y [reading, CTT {number}]", Place(1, 1), status, 0, 0, StepReason(why))
        for number, status, why in steps
    )
    return SuiteResult(Path("device.yaml"), "suite", "simulated", tuple(done))


JUDGED = [
    # steps of one number, and what becomes of it
    ([("2.5", Status.PASSED, "")], Verdict.PASSED, ""),
    ([("2.5", Status.SKIPPED, "lacks it"), ("2.5", Status.PASSED, "")], Verdict.PASSED, ""),
    ([("2.5", Status.PASSED, ""), ("2.5", Status.FAILED, "")], Verdict.FAILED, "7.4 x: y [reading, CTT 2.5]"),
    ([("2.5", Status.SKIPPED, "lacks it")], Verdict.SKIPPED, "lacks it"),
    ([("2.6", Status.PASSED, "")], Verdict.SKIPPED, ctt.NOT_ASKED),
]


@rows("steps, verdict, why", JUDGED)
def test_a_red_step_fails_a_test_and_a_green_one_passes_it(
    steps: list[tuple[str, Status, str]], verdict: Verdict, why: str
) -> None:
    judged = {each.number: each for each in ctt.results_of([run(*steps)], [])}
    assert (judged["2.5"].verdict, judged["2.5"].why) == (verdict, why)


def test_the_file_is_the_first_test() -> None:
    fine, wrong = (ctt.results_of([], errors)[0] for errors in ([], ["device.eds:3:1: E101 odd"]))
    assert (fine.number, fine.verdict) == ("1.0", Verdict.PASSED)
    assert (wrong.verdict, wrong.why) == (Verdict.FAILED, "device.eds:3:1: E101 odd")


def test_the_last_line_is_the_score() -> None:
    tests = ctt.results_of([run(("2.5", Status.FAILED, ""), ("2.6", Status.PASSED, ""))], [])
    assert list(ctt.lines(tests))[-1] == "3 of 127 tests executed: 2 passed, 1 failed, 124 skipped"
