"""The page for a device's maker: facts, score, each red step with its frames; and the tests of CiA's tool."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable
from functools import cache
from itertools import chain, repeat
from pathlib import Path

import pytest

from eurobot_od.check.conformance import page
from eurobot_od.check.conformance.clauses import StepName, Tier
from eurobot_od.check.conformance.page import DeviceRun
from eurobot_od.check.page import skipped_steps
from eurobot_od.check.report import CheckedDevice, RunFacts, Status, StepReason, StepResult, SuitePart, SuiteResult
from eurobot_od.check.suite import Step, Suite
from eurobot_od.device.faults import FAULTS
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.errors import UnknownName
from eurobot_od.export.forms import form_of, html_of, markdown_of
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.support.yaml_places import Place
from tests.kit.devices import (
    AXIS_DRIVE,
    IO_MODULE,
    MODULE,
    NODE_ID,
    Run,
    asked_for_everything,
    results,
    suites,
    suites_of,
)
from tests.kit.faults import CONFORMANCE

# The page

SHOWN = Identity(0xA01, 0x110, 0x10000, 0x1234)
MODULE_SHOWN = CheckedDevice(Dictionary.load(IO_MODULE, NODE_ID), SHOWN, "it is another device")
TODAY = RunFacts("the program", "2026-11-29T12:00:00+00:00", "can0", [MODULE_SHOWN])


@cache
def report() -> DeviceRun:
    """What there is to say about an I/O module with a fault: of the chapter that finds it."""
    kind = FAULTS["guarding-toggle-stuck"].given_to(SimulatedDevice)
    done = list(results(suites(IO_MODULE, chapter="error-control"), kind))
    return DeviceRun(MODULE_SHOWN, Tier.REVERSIBLE, done, TODAY)


SAID = [
    "# Conformance of io-module",
    "| Product | DIO 16 |",
    "| Tier | reversible |",
    "it is another device",
    "| Identity of the device (0x1018) | 0x00000A01:0x00000110:0x00010000:0x00001234 |",
    "| Bus | can0 |",
    "| Begun | 2026-11-29 12:00:00+00:00 |",
    "| Made by | the program |",
    "| node guarding and heartbeat consumer |",
    "### Node guarding: 2. PRE-OPERATIONAL, toggle bit 1",
    "| clause | CiA 301, 7.2.8.3.2.1 |",
    "| expected | 705\\#FF |",
    "> 705#R1                remote frame",
    "| 7.3 | its toggle bit | FAILED |",
]


def test_the_report_has_expected_and_received_values() -> None:
    text = markdown_of([*page.blocks(report())])
    assert [said for said in SAID if said not in text] == []


def test_the_html_is_one_page_with_all_text_escaped() -> None:
    html = html_of([*page.blocks(report())])
    assert html.startswith("<!DOCTYPE html>")
    assert "&gt; 705#R1" in html


def test_steps_red_for_the_same_reason_are_one_line_each() -> None:
    kind = CONFORMANCE["unknown-object-code-wrong"].given_to(SimulatedDevice)
    done = list(results(suites(IO_MODULE, chapter="objects"), kind))
    run = DeviceRun(MODULE_SHOWN, Tier.REVERSIBLE, done, TODAY)
    text = markdown_of([*page.blocks(run)])
    assert text.count("### Unknown object: read") == 1
    assert "| read 0x5FFF:0 |" in text


def test_steps_after_a_red_one_of_their_group_are_skipped() -> None:
    assert skipped_steps(report().results)["'2. PRE-OPERATIONAL, toggle bit 1 [CTT 7.3]' before it is red"] == 12


def test_another_suffix_is_refused() -> None:
    with pytest.raises(UnknownName, match=r"unknown document format '\.txt'"):
        form_of(Path("page.txt"))


# CiA's tool

GUIDE = Path(__file__).parents[3] / "docs" / "conformance.md"


def asked_by(several: Iterable[Suite]) -> dict[str, list[StepName]]:
    """Return the steps of some suites by the numbers that they ask, if only to be skipped."""
    asked = defaultdict[str, list[StepName]](list)

    def walk(steps: Iterable[Step], before: str) -> None:
        for each in steps:
            name = StepName.of(f"{before}{each.name}")
            if name:
                for number in name.numbers:
                    asked[number].append(name)
            walk(getattr(each.action, "steps", ()), f"{before}{each.name}: ")

    for each in several:
        walk(each.steps, "")
    return asked


def test_each_ctt_number_is_tested_with_some_file_or_listed_as_never() -> None:
    asked = asked_by(each for file in (MODULE, IO_MODULE, AXIS_DRIVE) for each in suites(file, Tier.DESTRUCTIVE))
    assert len(page.ASKS) == 127
    assert {*asked, page.LINT, *page.NEVER_ASKED, *LACKING} == set(page.ASKS)


LACKING = {"8.5", "8.6", "8.7", "8.8"}
"""Of 0x1010:2 and 0x1011:2, which none of these files has; `stored` makes one that has."""


def test_communication_parameters_are_stored_separately() -> None:
    assert passed(stored()) >= {"8.1", "8.2", "8.3", "8.4", *LACKING}
    assert [number for number in LACKING if lacking(stored(), number)] == []


def passed(run: Run) -> set[str]:
    """Return the numbers that pass in a run."""
    return {each.number for each in page.results_of(run.results, []) if each.verdict is Status.PASSED}


def lacking(run: Run, number: str) -> list[str]:
    """Return the frames of the tool's trace that are not in a run, the first not in a step of this number."""
    anywhere = {frame for each in run.bus.values() for frame in each.requests}
    asked = zip(FRAMES[number].replace("~", "").split(), chain([run.bus[number].requests], repeat(anywhere)))
    return [frame for frame, sent in asked if not any(map(pattern(frame).fullmatch, sent))]


def pattern(recorded: str) -> re.Pattern[str]:
    """Return what a frame of the tool's trace is for our device."""
    identifier, _, data = recorded.partition("#")
    number = int(re.sub(r"[\[\]]", "", identifier), 16)
    if number == NMT_COB_ID:
        data = f"{data[:-2]}{NODE_ID:02X}"
    elif number & 0x7F == 4:
        identifier = f"{identifier[:-1]}{NODE_ID}"
    return re.compile(re.sub(r"\[\w*\]", r"\\w*", f"{identifier}#{data}"))


@cache
def stored() -> Run:
    """A device that stores and restores its communication by itself."""
    text = MODULE.read_text(encoding="latin-1")
    entry = re.compile(r"\[10(1[01])sub1\]\n(.*?)\n\n", re.DOTALL)
    second = entry.sub(lambda found: f"{found[0]}[10{found[1]}sub2]\n{found[2]}\n\n", text)
    for index in ("1010", "1011"):
        head = re.search(rf"\[{index}\]\n.*?\n\n.*?\n\n", second, re.DOTALL)
        assert head is not None
        raised = head[0].replace("SubNumber=2", "SubNumber=3").replace("DefaultValue=1", "DefaultValue=2")
        second = second.replace(head[0], raised)
    dictionary = Dictionary.read(second.encode("latin-1"), Path("stored.eds"), NODE_ID)
    return Run(*(each for each in suites_of(dictionary, Tier.DESTRUCTIVE) if "storage" in each.tags))


FRAMES = {
    # number of CiA's tool: requests of its trace, where the device is node 4, of which the first asks what the number
    # asks; in brackets is what belongs to that device; after ~ what follows from the tool's words, of which its trace
    # has nothing
    "2.1": "604#4000100000000000",
    "2.2": "604#2B171000[00000000] 604#4017100000000000",
    "2.3": "604#23001000[91010F00]",
    "2.4": "~604#4000[20]0000000000",
    "2.5": "604#4000100100000000",
    "2.6": "604#4004100000000000",
    "2.7": "604#E000100000000000",
    "2.8": "604#23[031000]00000000",
    "2.9": "604#2F051000[80000000]",
    "2.10": "604#2[F031000FF00]0000",
    "2.11": "~604#2[B0720009BFF]0000",
    "2.12": "604#4000120100000000 604#4000120200000000",
    "2.13": "604#4000100000000000",
    "2.14": "~604#210C100002000000 ~604#0B[00]000000000000",
    "2.15": "604#2117100002000000 604#0B[0000]0000000000",
    "2.16": "604#4008100000000000 604#6000000000000000",
    "2.17": "604#7000000000000000 604#4008100000000000",
    "2.18": "604#4008100000000000 604#6000000000000000",
    "2.19": "604#A0001000[14]000000 604#A300000000000000 604#A201[14]0000000000 604#A100000000000000",
    "2.20": "~604#C20C100002000000 ~604#81[00]000000000000 ~604#D500000000000000",
    "2.21": "604#C217100002000000 604#81[0000]0000000000 604#D500000000000000",
    "2.22": "604#A0081000[14]000000 604#A2[0314]0000000000 604#A100000000000000",
    "2.23": "604#A4081000[14]000000 604#A2[0314]0000000000 604#A100000000000000",
    "2.24": "~604#C60C100002000000 ~604#81[00]000000000000 ~604#D5[0000]0000000000",
    "2.25": "604#C617100002000000 604#81[0000]0000000000 604#D5[0000]0000000000",
    "2.26": "604#A000100080000000",
    "2.27": "604#A280[14]0000000000 604#A0001000[14]000000 604#A300000000000000",
    "2.28": "604#4001120100000000",
    "2.29": "~604#4001120100000000 ~000#8204",
    "2.30": "~604#23801201[7F060080] ~604#2310100173617665 ~000#8204",
    "3.1": "604#4000140100000000 604#4001140100000000",
    "3.2": "604#4000180100000000 604#4001180100000000",
    "3.3": "~[1]84#R 604#4000180100000000 000#8004",
    "3.4": "604#2B001805[64]000000 604#2F001802FE000000 000#0104",
    "3.5": "604#2B001805[64]000000 000#0104",
    "3.6": "604#2F00180201000000 000#0104 080#",
    "3.8": "~604#2F001806[03]000000 ~080#[01]",
    "3.9": "~[1]84#R ~000#0204",
    "3.10": "604#2B001805[64]000000 604#2F001802FE000000 000#0204",
    "3.11": "604#2B001805[64]000000 000#0204",
    "3.12": "604#2F00180201000000 080# 000#0204",
    "3.13": "604#2F00180200000000 080# 000#0204",
    "3.14": "~604#2F001806[03]000000 ~080#[01]",
    "3.15": "~[1]84#R 000#8004",
    "3.16": "604#2B001805[64]000000 604#2F001802FE000000 000#8004",
    "3.17": "604#2B001805[64]000000 000#8004",
    "3.18": "604#2F00180201000000 080# 000#8004",
    "3.19": "604#2F00180200000000 080# 000#8004",
    "3.20": "~604#2F001806[03]000000 ~080#[01]",
    "3.21": "604#4000160100000000 604#40001A0100000000",
    "3.22": "604#2F001600[02]000000 604#23001401[0402]0080 604#23001601[08010062] 604#23001401[0402]0000",
    "3.23": "604#23001601[08010062] 604#23001401[0402]0080",
    "3.24": "~604#2F00160000000000 604#4000140100000000",
    "3.25": "604#2F001600[09]000000 604#23001401[0402]0080",
    "3.26": "604#2F001A00[08]000000 604#23001A01[20010012] 604#23001801[8401]00C0",
    "3.27": "~604#23001601[10010120] 604#2F00160000000000",
    "3.28": "604#23001601[08000110] 604#2F00160000000000",
    "3.29": "604#23001601[10001510] 604#2F00160000000000",
    "3.30": "604#23001A01[08000110] 604#2F001A0000000000",
    "3.31": "~604#23001A01[10010120] 604#2F001A0000000000",
    "3.32": "604#23001A0120000010 604#2F001A0000000000",
    "3.33": "604#2300160108000[2]00 604#2F00160000000000",
    "4.1": "604#4000100000000000 604#4001100000000000 604#4018100100000000 604#2305100080000000",
    "4.2": "604#4000100000000000 604#4005100000000000 604#4008100000000000",
    "4.3": "604#2F01100000000000 604#23001000[91010F00] 604#23181001[00000000]",
    "4.4": "~604#40[0020]0000000000",
    "4.6": "~604#2B[0720009BFF]0000",
    "4.9": "604#2[F00620100]000000 604#40[006201]00000000",
    "5.1": "604#4014100000000000",
    "5.2": "604#4001100000000000",
    "5.3": "604#4003100000000000 604#4003100100000000",
    "5.4": "[2]04#[] 000#0104",
    "5.5": "604#4001100000000000",
    "5.6": "604#4003100100000000",
    "6.1": "604#4005100000000000",
    "6.2": "604#23061000A0860100 604#2305100080000040",
    "6.3": "604#2F001802[0A]000000 604#4000180100000000 000#0104",
    "6.4": "604#2306100000000000 604#4005100000000000",
    "6.5": "604#2F19100001000000 604#2306100000000000",
    "6.6": "604#23061000A0860100 604#2305100080000040 604#2F19100000000000",
    "6.7": "604#2F19100005000000 604#23061000[400D0300] 604#2305100080000040",
    "6.8": "604#2310100173617665 604#2F19100005000000 604#2306100000000000",
    "6.9": "604#2F19100005000000 604#23061000[E8030000]",
    "6.10": "604#2310100173617665 604#2305100080000000 604#2F19100005000000",
    "7.1": "~604#400C100000000000 ~604#400D100000000000",
    "7.2": "~704#R",
    "7.3": "~704#R",
    "7.4": "~7[7F]#R",
    "7.5": "~604#2B0C1000[6400]0000 ~604#2F0D1000[03]000000",
    "7.6": "~704#R ~604#2B0C1000[6400]0000",
    "7.101": "604#2B171000[0000]0000",
    "7.102": "604#2B17100064000000",
    "7.103": "604#2B17100000000000",
    "7.104": "604#23161001[341205]00 604#23161002[341205]00",
    "7.105": "7[01]#[7F] 604#23161001[E80301]00 604#2B171000[E803]0000",
    "7.106": "7[01]#[7F] 604#23161001[E80301]00",
    "7.107": "7[47]#[7F] 604#23161001[E80347]00 000#8104",
    "7.201": "~604#400C100000000000 604#4017100000000000",
    "7.202": "~604#2B17100000000000",
    "7.203": "~704#R ~604#2B17100000000000",
    "7.204": "~604#2B17100064000000",
    "7.205": "~704#R",
    "7.206": "~604#2B171000[6400]0000 ~604#2B0C1000[6400]0000",
    "7.207": "~704#R ~604#2B0C1000[6400]0000",
    "8.1": "~604#23101001[6E6F7277] 604#4010100100000000",
    "8.2": "~604#2310100173617665 604#4010100100000000",
    "8.3": "604#23111001[6E6F7277] 604#4011100100000000",
    "8.4": "604#231110016C6F6164 604#2B171000[204E]0000 000#8104",
    "8.5": "604#23101002[6E6F7277]",
    "8.6": "604#2310100273617665 604#2B171000[204E]0000 000#8104",
    "8.7": "604#23111002[6E6F7277]",
    "8.8": "604#231110026C6F6164 604#2B171000[204E]0000 000#8104",
    "8.9": "~604#23201001[28230000] ~604#23201002[00512502] ~604#2310100173617665",
    "8.10": "604#23051000FF050000 604#23121000FF050000 604#23141000FF050000",
    "9.1": "604#2B171000[F401]0000 000#8104",
    "9.2": "604#40[00]100000000000 000#8104",
    "9.3": "604#40[00]100000000000 000#0104",
    "9.4": "604#40[00]100000000000 000#0204",
    "10.1": "000#8104 000#8204 000#0104",
    "10.2": "000#8004 000#0104 000#0204 604#2B171000[F401]0000",
    "10.3": "000#0104 000#0204",
    "10.4": "000#0204 000#0104",
}


MAKERS_ONLY = {"2.4", "2.29", "2.30", "4.4"}
"""Numbers that ask for what the first file has not."""


@pytest.mark.long
def test_115_numbers_pass_on_a_device_that_is_guarded_and_each_has_sent_the_frames_of_the_tool() -> None:
    run = asked_for_everything(MODULE)
    found = passed(asked_for_everything(MODULE))
    assert page.score(page.results_of(run.results, [])) == "115 of 127 tests executed: 115 ok, 12 skipped"
    makers = [asked_for_everything(file) for file in (IO_MODULE, AXIS_DRIVE)]
    asked = [(run, found - {page.LINT}), *((each, MAKERS_ONLY & passed(each)) for each in makers)]
    for each, numbers in asked:
        assert [(number, lack) for number in sorted(numbers) if (lack := lacking(each, number))] == []
    assert found.union(LACKING, *map(passed, makers)) == {*FRAMES, page.LINT}


RIGHTLY_SILENT = {"3.9", "3.15", "7.205", "7.207"}
"""Numbers that ask what must not be answered, and nothing else."""


@pytest.mark.parametrize("file", [MODULE, IO_MODULE, AXIS_DRIVE], ids=lambda file: file.stem)
def test_each_number_has_a_question_and_an_answer_of_its_own_on_the_bus(file: Path) -> None:
    run = asked_for_everything(file)
    assert run.shared == []
    numbers = passed(run) - {page.LINT}
    assert {number for number in numbers if not run.bus[number].requests} == set()
    assert {number for number in numbers if not run.bus[number].answers} <= RIGHTLY_SILENT


# The guide's table

BEGIN = "<!-- made by `.venv/bin/python -m tests.check.conformance.test_page` -->\n"
END = "<!-- made -->\n"


def made() -> str:
    """Return the table of the tool's tests: what each asks, which step of ours does, and how often it has asked."""
    runs = [asked_for_everything(file) for file in (MODULE, IO_MODULE, AXIS_DRIVE)] + [stored()]
    words = ("", " on an I/O module", " on a drive", " on a device that stores its communication")
    devices = [(word, run, passed(run)) for word, run in zip(words, runs, strict=True)]
    asked = asked_by(each for run in runs for each in run.suites)
    judged = page.results_of(runs[0].results, [])
    found = {each.number: each for each in judged}
    rows = []
    for number, what in page.ASKS.items():
        steps = asked[number]
        ours = ", ".join(dict.fromkeys(each.clause for each in steps)) or "none"
        tiers = ", ".join(dict.fromkeys(each.tier for each in steps))
        often = (f"{len(run.bus[number].questions)}{word}" for word, run, numbers in devices if number in numbers)
        asked_by_us = next(often, found[number].why)
        if number == page.LINT:
            ours = "`lint`"
            asked_by_us = "1"
        rows.append(f"| {number} | {what} | {ours} | {tiers} | {asked_by_us} |\n")
    head = "| CTT | it asks | our clause | tier | asked |\n|---|---|---|---|---|\n"
    return f"{BEGIN}On one device, which is guarded: {page.score(judged)}.\n\n{head}{''.join(rows)}{END}"


def guide(text: str) -> str:
    """Return the guide with the table as it is made now."""
    before, _, rest = text.partition(BEGIN)
    return before + made() + rest.partition(END)[2]


def test_the_guide_has_the_table_of_today() -> None:
    text = GUIDE.read_text(encoding="utf-8")
    assert text == guide(text)


def run(*steps: tuple[str, Status, str]) -> SuiteResult:
    """A run whose steps have numbers, statuses and reasons."""
    done = (
        StepResult(SuitePart.STEPS, f"7.4 x: y [reading, CTT {number}]", Place(1, 1), status, 0, 0, StepReason(why))
        for number, status, why in steps
    )
    return SuiteResult(Path("device.yaml"), "suite", "simulated", tuple(done))


JUDGED = [
    # steps of one number, and what becomes of it
    ([("2.5", Status.PASSED, "")], Status.PASSED, ""),
    ([("2.5", Status.PASSED, ""), ("2.5", Status.SKIPPED, "lacks it")], Status.SKIPPED, "lacks it"),  # of one group
    ([("2.5", Status.PASSED, ""), ("2.5", Status.FAILED, "")], Status.FAILED, "7.4 x: y [reading, CTT 2.5]"),
    ([("2.5", Status.SKIPPED, "lacks it")], Status.SKIPPED, "lacks it"),
    ([("2.6", Status.PASSED, "")], Status.SKIPPED, page.NOT_ASKED),
]


@pytest.mark.parametrize(("steps", "verdict", "why"), JUDGED)
def test_a_red_step_fails_a_test_and_a_green_one_passes_it(
    steps: list[tuple[str, Status, str]], verdict: Status, why: str
) -> None:
    judged = {each.number: each for each in page.results_of([run(*steps)], [])}
    assert (judged["2.5"].verdict, judged["2.5"].why) == (verdict, why)


def test_ctt_1_0_is_the_lint_of_the_file() -> None:
    fine, wrong = (page.results_of([], errors)[0] for errors in ([], ["device.eds:3:1: E101 odd"]))
    assert (fine.number, fine.verdict) == ("1.0", Status.PASSED)
    assert (wrong.verdict, wrong.why) == (Status.FAILED, "device.eds:3:1: E101 odd")


def test_the_last_line_of_a_report_is_the_score() -> None:
    tests = page.results_of([run(("2.5", Status.FAILED, ""), ("2.6", Status.PASSED, ""))], [])
    assert list(page.lines(tests))[-1] == "3 of 127 tests executed: 2 ok, 1 FAILED, 124 skipped"


if __name__ == "__main__":
    GUIDE.write_text(guide(GUIDE.read_text(encoding="utf-8")), encoding="utf-8")
