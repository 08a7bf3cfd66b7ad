"""The page for a device's maker: facts, score, each red step with its frames; and the tests of CiA's tool."""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path

import pytest

from eurobot_od.check.conformance import page, suite
from eurobot_od.check.conformance.clauses import StepName
from eurobot_od.check.conformance.page import DeviceRun, Verdict
from eurobot_od.check.conformance.subject import Tier
from eurobot_od.check.report import Status, StepReason, StepResult, SuitePart, SuiteResult
from eurobot_od.device.faults.device import FAULTS
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.errors import UnknownName
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.support.yaml_places import Place
from tests.kit.devices import IO_MODULE, NODE_ID, results, suites
from tests.kit.faults import CONFORMANCE
from tests.rows import rows

# The page


@cache
def report() -> DeviceRun:
    """What there is to say about an I/O module with a fault: of the chapter that finds it."""
    kind = FAULTS["guarding-toggle-stuck"].given_to(SimulatedDevice)
    done = list(results(suites(IO_MODULE, chapter="error-control"), kind))
    return DeviceRun(Dictionary.load(IO_MODULE, NODE_ID), Tier.REVERSIBLE, done, "today")


SAID = [
    "# Conformance of io-module",
    "| Product | DIO 16 |",
    "| Tier | reversible |",
    "| Made by | today |",
    "| node guarding and heartbeat consumer |",
    "### Node guarding: 2. PRE-OPERATIONAL, toggle bit 1",
    "| Clause | CiA 301, 7.2.8.3.2.1 |",
    "| Expected | 705\\#FF |",
    "> 705#R1                remote frame",
    "| 7.3 | its toggle bit | FAILED |",
]


def test_the_page_says_what_was_asked_and_what_came() -> None:
    text = page.text(Path("page.md"), [report()])
    assert [said for said in SAID if said not in text] == []


def test_the_html_is_one_page_with_everything_escaped() -> None:
    html = page.text(Path("page.html"), [report()])
    assert html.startswith("<!DOCTYPE html>")
    assert "&gt; 705#R1" in html


def test_what_is_red_for_the_same_reason_is_a_line_each() -> None:
    kind = CONFORMANCE["unknown-object-code-wrong"].given_to(SimulatedDevice)
    done = list(results(suites(IO_MODULE, chapter="objects"), kind))
    run = DeviceRun(Dictionary.load(IO_MODULE, NODE_ID), Tier.REVERSIBLE, done, "today")
    text = page.text(Path("page.md"), [run])
    assert text.count("### Unknown object: read") == 1
    assert "| read 0x5FFF:0 |" in text


def test_what_follows_a_red_step_of_its_group_is_skipped_for_it() -> None:
    assert report().skipped["'2. PRE-OPERATIONAL, toggle bit 1' before it is red"] == 12


def test_json_has_the_same() -> None:
    (data,) = json.loads(page.text(Path("page.json"), [report()]))
    assert (data["device"], data["tier"], len(data["ctt"])) == ("io-module", "reversible", 127)
    assert {each["number"] for each in data["ctt"] if each["verdict"] == "failed"} >= {"7.3"}


def test_another_suffix_is_refused() -> None:
    with pytest.raises(UnknownName, match=r"form of a report '\.txt'"):
        page.check_form(Path("page.txt"))


# CiA's tool

GUIDE = Path(__file__).parents[3] / "docs" / "conformance.md"
CLAUSES = [clause for chapter in suite.CHAPTERS for clause in chapter]


def numbers(written: str) -> tuple[str, ...]:
    return StepName("7.4", "x", "y", "reading", written).numbers


def test_each_test_of_the_tool_has_a_clause_and_no_clause_another_number() -> None:
    asked = {number for clause in CLAUSES for number in numbers(clause.ctt)}
    assert len(page.ASKS) == 127
    assert asked | {page.LINT} == set(page.ASKS)


def test_the_guide_names_each_test_once() -> None:
    table = GUIDE.read_text(encoding="utf-8").partition("Where we ask less")[0]
    cells = re.findall(r"^\| ([\d., to]+) \|", table, re.MULTILINE)
    told = [number for cell in cells for number in numbers(cell)]
    assert sorted(told) == sorted(page.ASKS)


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
    ([("2.6", Status.PASSED, "")], Verdict.SKIPPED, page.NOT_ASKED),
]


@rows("steps, verdict, why", JUDGED)
def test_a_red_step_fails_a_test_and_a_green_one_passes_it(
    steps: list[tuple[str, Status, str]], verdict: Verdict, why: str
) -> None:
    judged = {each.number: each for each in page.results_of([run(*steps)], [])}
    assert (judged["2.5"].verdict, judged["2.5"].why) == (verdict, why)


def test_the_file_is_the_first_test() -> None:
    fine, wrong = (page.results_of([], errors)[0] for errors in ([], ["device.eds:3:1: E101 odd"]))
    assert (fine.number, fine.verdict) == ("1.0", Verdict.PASSED)
    assert (wrong.verdict, wrong.why) == (Verdict.FAILED, "device.eds:3:1: E101 odd")


def test_the_last_line_is_the_score() -> None:
    tests = page.results_of([run(("2.5", Status.FAILED, ""), ("2.6", Status.PASSED, ""))], [])
    assert list(page.lines(tests))[-1] == "3 of 127 tests executed: 2 passed, 1 failed, 124 skipped"
