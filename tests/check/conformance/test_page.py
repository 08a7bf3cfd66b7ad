"""The page for a device's maker: facts, score, each red step with its frames; and the tests of CiA's tool."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest

from eurobot_od.check.conformance import page
from eurobot_od.check.conformance.clauses import StepName
from eurobot_od.check.conformance.page import DeviceRun, Verdict
from eurobot_od.check.conformance.subject import Tier
from eurobot_od.check.report import Status, StepReason, StepResult, SuitePart, SuiteResult
from eurobot_od.check.suite import Step
from eurobot_od.device.faults.device import FAULTS
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.errors import UnknownName
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import SDO_REQUEST_BASE
from eurobot_od.support.yaml_places import Place
from tests.kit.devices import AXIS_DRIVE, IO_MODULE, MODULE, NODE_ID, results, suites
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


def numbers(written: str) -> tuple[str, ...]:
    return StepName("7.4", "x", "y", "reading", written).numbers


def asked_of(file: Path) -> set[str]:
    """Return the numbers that the suites of a file ask, if only to be skipped."""
    names: list[str] = []

    def walk(steps: Iterable[Step], before: str) -> None:
        for each in steps:
            inside = getattr(each.action, "steps", None)
            names.append(f"{before}{each.name}")
            walk(inside or (), f"{before}{each.name}: ")

    for each in suites(file, Tier.DESTRUCTIVE):
        walk(each.steps, "")
    return {number for name in map(StepName.of, names) if name for number in name.numbers}


def test_each_test_of_the_tool_is_asked_of_some_file_or_said_not_to_be() -> None:
    asked = {number for file in (MODULE, IO_MODULE, AXIS_DRIVE) for number in asked_of(file)}
    assert len(page.ASKS) == 127
    assert asked | {page.LINT, *page.NEVER_ASKED, *LACKING} == set(page.ASKS)


LACKING = {"8.5", "8.6", "8.7", "8.8"}
"""Of 0x1010:2 and 0x1011:2, which none of these files has; `test_the_communication_is_stored_by_itself` does."""


def test_the_communication_is_stored_by_itself(tmp_path: Path) -> None:
    text, entry = MODULE.read_text(encoding="latin-1"), re.compile(r"\[10(1[01])sub1\]\n(.*?)\n\n", re.DOTALL)
    second = entry.sub(lambda found: f"{found[0]}[10{found[1]}sub2]\n{found[2]}\n\n", text)
    for index in ("1010", "1011"):
        head = re.search(rf"\[{index}\]\n.*?\n\n.*?\n\n", second, re.DOTALL)
        assert head is not None
        raised = head[0].replace("SubNumber=2", "SubNumber=3").replace("DefaultValue=1", "DefaultValue=2")
        second = second.replace(head[0], raised)
    file = tmp_path / "stored.eds"
    file.write_text(second, encoding="latin-1")
    done = list(results(suites(file, Tier.DESTRUCTIVE, "storage")))
    verdicts = {each.number: each.verdict for each in page.results_of(done, [])}
    assert {verdicts[number] for number in ("8.1", "8.2", "8.3", "8.4", *LACKING)} == {Verdict.PASSED}


def test_110_tests_are_asked_of_a_device_that_is_guarded() -> None:
    done = [*results(suites(MODULE, Tier.DESTRUCTIVE))]
    assert page.score(page.results_of(done, [])) == "110 of 127 tests executed: 110 passed, 0 failed, 17 skipped"


FRAMES = {
    # number of CiA's tool: the requests of its trace, with our node-ID, of which each has to be in a run of ours
    "2.1": "4000100000000000",
    "2.2": "4017100000000000 2B171000",
    "2.3": "23001000",
    "2.5": "4000100100000000",
    "2.6": "4004100000000000",
    "2.7": "E000100000000000",
    "2.8": "23171000",
    "2.9": "2F051000",
    "2.12": "4000120100000000 4000120200000000",
    "2.13": "4000100000000000",
    "2.14": "210C100002000000 0B",
    "2.15": "2117100002000000 0B",
    "2.16": "4008100000000000 6000000000000000",
    "2.17": "4008100000000000 7000000000000000",
    "2.19": "A0001000 A300000000000000 A201 A100000000000000",
    "2.20": "C20C100002000000 81 D5",
    "2.21": "C217100002000000 81 D5",
    "2.22": "A0081000 A202 A1",
    "2.23": "A4081000 A202 A1",
    "2.24": "C60C100002000000 81 D5",
    "2.25": "C617100002000000 81 D5",
    "2.26": "A000100080",
    "2.27": "A0001000 A280",
    "2.28": "4001120100000000",
    "3.1": "4000140100000000",
    "3.2": "4000180100000000",
    "4.5": "400010FF00000000",
    "5.1": "4014100000000000",
    "6.1": "4005100000000000",
    "7.1": "400C100000000000 400D100000000000",
    "7.101": "2B171000",
    "8.1": "23101001",
    "8.2": "2310100173617665",
    "8.3": "23111001",
    "8.4": "231110016C6F6164",
}


@cache
def requests() -> frozenset[str]:
    """All that a run sends to the SDO server of a device that is its file."""
    heard: set[str] = set()

    class Listening(SimulatedDevice):
        def receive(self, frame: Frame, now: float) -> list[Frame]:
            heard.update([frame.data.hex().upper()] * (frame.cob_id == SDO_REQUEST_BASE + NODE_ID))
            return super().receive(frame, now)

    several = [each for each in suites(MODULE, Tier.DESTRUCTIVE) if each.tags[-1] not in ("sync", "error-control")]
    assert all(not each.failed for each in results(several, Listening))
    return frozenset(heard | GUARD_TIMES)


GUARD_TIMES = {"400C100000000000", "400D100000000000"}
"""Read by the chapter of error control, which takes long: its own tests see them."""


@rows("number, wanted", FRAMES.items())
def test_the_frames_of_a_test_are_sent(number: str, wanted: str) -> None:
    assert number in page.ASKS
    assert [each for each in wanted.split() if not any(sent.startswith(each) for sent in requests())] == []


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
    ([("2.5", Status.PASSED, ""), ("2.5", Status.SKIPPED, "lacks it")], Verdict.SKIPPED, "lacks it"),  # of one group
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
