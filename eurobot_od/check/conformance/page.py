"""The report of a run, for a device's manufacturer, and the result of each test of CiA's own tool (CTT).

The tests have the numbers of CiA's conformance test tool, and our words. A test that cannot be done is skipped with the
reason; it counts as executed only if a step of ours has passed or failed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from eurobot_od.check import page, report
from eurobot_od.check.conformance.clauses import StepName, Tier
from eurobot_od.check.report import CheckedDevice, RunFacts, Status, SuiteResult
from eurobot_od.export import forms
from eurobot_od.export.forms import DocBlock, DocHeading, DocTable, Paragraph
from eurobot_od.lint.findings import Severity
from eurobot_od.lint.rules import lint

# CiA's conformance test tool

TPDO_WAYS = (
    "by remote frame",
    "by event",
    "by event timer",
    "by SYNC",
    "by SYNC after an event",
    "from the SYNC of its start value on",
)
"""When a TPDO is sent: it comes in OPERATIONAL (3.3 to 3.8), and does not in STOPPED and PRE-OPERATIONAL."""

ASKS: Mapping[str, str] = {
    "1.0": "the EDS is sound",
    "2.1": "0x1000 expedited",
    "2.2": "a value read and written back",
    "2.3": "0x1000 written",
    "2.4": "a write-only object read",
    "2.5": "0x1000:1 read",
    "2.6": "0x1004 read",
    "2.7": "an unknown command",
    "2.8": "too many bytes",
    "2.9": "too few bytes",
    "2.10": "a value that is too high",
    "2.11": "a value that is too low",
    "2.12": "the identifiers of the first SDO server",
    "2.13": "0x1000 by segments",
    "2.14": "0x100C by segments",
    "2.15": "0x1017 by segments",
    "2.16": "a long object by segments",
    "2.17": "a wrong toggle bit",
    "2.18": "a long object by segments, as a whole",
    "2.19": "0x1000 in blocks",
    "2.20": "0x100C in blocks",
    "2.21": "0x1017 in blocks",
    "2.22": "a long object in blocks",
    "2.23": "a long object in blocks, with CRC",
    "2.24": "0x100C in blocks, with CRC",
    "2.25": "0x1017 in blocks, with CRC",
    "2.26": "a block of 128 segments",
    "2.27": "128 segments acknowledged",
    "2.28": "further SDO servers",
    "2.29": "further SDO servers after a reset",
    "2.30": "SDO clients stored",
    "3.1": "which RPDOs there are",
    "3.2": "which TPDOs there are",
    **{f"3.{number}": f"a TPDO {way}" for number, way in enumerate(TPDO_WAYS, 3)},
    **{f"3.{number}": f"no TPDO {way} in STOPPED" for number, way in enumerate(TPDO_WAYS, 9)},
    **{f"3.{number}": f"no TPDO {way} in PRE-OPERATIONAL" for number, way in enumerate(TPDO_WAYS, 15)},
    "3.21": "objects of the default mapping",
    "3.22": "another mapping by the procedure",
    "3.23": "a mapping without the procedure",
    "3.24": "a mapping while the PDO is valid",
    "3.25": "too many objects mapped",
    "3.26": "too many bits mapped",
    "3.27": "rww and wo in an RPDO",
    "3.28": "rwr and ro in an RPDO",
    "3.29": "what cannot be mapped in an RPDO",
    "3.30": "rwr and ro in a TPDO",
    "3.31": "rww and wo in a TPDO",
    "3.32": "what cannot be mapped in a TPDO",
    "3.33": "a dummy in an RPDO",
    "4.1": "every object by its access",
    "4.2": "every default",
    "4.3": "read-only objects written",
    "4.4": "write-only objects read",
    "4.5": "sub-index 255",
    "4.6": "limits",
    "4.7": "every object by its access, once more",
    "4.8": "every default, once more",
    "4.9": "every value written back",
    "5.1": "0x1014",
    "5.2": "0x1001 before an error",
    "5.3": "0x1003 before an error",
    "5.4": "EMCY by an RPDO that is too short",
    "5.5": "0x1001 after it",
    "5.6": "0x1003 after it",
    "6.1": "0x1005",
    "6.2": "SYNC at its time",
    "6.3": "TPDOs by the device's own SYNC",
    "6.4": "TPDOs by another's SYNC, 0x1006 being 0",
    "6.5": "0x1019 with values that it cannot have",
    "6.6": "SYNC without a counter",
    "6.7": "SYNC with a counter",
    "6.8": "0x1019 stored",
    "6.9": "0x1019 while 0x1006 is set",
    "6.10": "0x1005, 0x1006 and 0x1019 stored",
    "7.1": "0x100C and 0x100D",
    "7.2": "a guarding remote frame answered",
    "7.3": "its toggle bit",
    "7.4": "its identifier",
    "7.5": "0x100C and 0x100D written",
    "7.6": "life guarding",
    "7.101": "0x1017 written",
    "7.102": "the heartbeat at its time",
    "7.103": "no heartbeat with 0",
    "7.104": "a node twice in 0x1016",
    "7.105": "a watched heartbeat in time",
    "7.106": "a watched heartbeat too late",
    "7.107": "a watched node that boots",
    "7.201": "0x1017, 0x100C and 0x100D",
    "7.202": "the heartbeat switched off",
    "7.203": "node guarding then",
    "7.204": "a heartbeat without guard times",
    "7.205": "remote frames, with a heartbeat and without guard times",
    "7.206": "a heartbeat with guard times",
    "7.207": "remote frames, with a heartbeat and guard times",
    "8.1": "0x1010:1 with a wrong signature",
    "8.2": "0x1010:1 stores",
    "8.3": "0x1011:1 with a wrong signature",
    "8.4": "0x1011:1 restores",
    "8.5": "0x1010:2 with a wrong signature",
    "8.6": "0x1010:2 stores",
    "8.7": "0x1011:2 with a wrong signature",
    "8.8": "0x1011:2 restores",
    "8.9": "0x1020 stored",
    "8.10": "restricted identifiers",
    "9.1": "boot-up after values were changed",
    "9.2": "services in PRE-OPERATIONAL",
    "9.3": "services in OPERATIONAL",
    "9.4": "services in STOPPED",
    "10.1": "resets from every state",
    "10.2": "PRE-OPERATIONAL from every state",
    "10.3": "OPERATIONAL from every state",
    "10.4": "STOPPED from every state",
}
"""The tests of the tool by number, with their subject."""

LINT = "1.0"
"""Number of the test of the file."""

NOT_ASKED = "no step of this run asks it"

NEVER_ASKED = {
    "3.7": "what an event is, is the maker's: nobody can cause one over the bus",
    "4.7": "as 4.1, and not counted",
    "4.8": "as 4.2, and not counted",
}
"""Tests that no step of ours does, with the reason."""


WORST_FIRST = Status.FAILED, Status.SKIPPED, Status.PASSED
"""Statuses of a group, by priority: red if a step is red, and green only if all steps were done."""

RED_OR_GREEN_FIRST = Status.FAILED, Status.PASSED, Status.SKIPPED
"""Statuses of a test, by priority: a skipped group counts only if no other group was done."""


class CttResult(NamedTuple):
    """The result of one test of the tool, by its number; `why` is the red step or the reason for skipping."""

    number: str
    verdict: Status
    why: str = ""

    @property
    def asks(self) -> str:
        """Subject of the test."""
        return ASKS[self.number]


def results_of(
    results: Iterable[SuiteResult], file_errors: Sequence[str], beyond: Mapping[str, str] = MappingProxyType({})
) -> list[CttResult]:
    """Return the result of each test.

    `file_errors` are lint's errors in the device's file; `beyond` has the reasons for tests that an option would run.
    """
    # By test: its groups, each with the first reason for each status. A group counts only if all of it was done.
    asked: dict[str, dict[object, dict[Status, str]]] = {number: {} for number in ASKS}
    asked[LINT][LINT] = {Status.FAILED: file_errors[0]} if file_errors else {Status.PASSED: ""}
    for step in (step for result in results for step in result.steps):
        name = StepName.of(step.name)
        verdict = step.status if step.status in WORST_FIRST else Status.SKIPPED
        why = step.reason.what if step.reason and verdict is Status.SKIPPED else step.name
        for number in asked.keys() & (name.numbers if name else ()):  # edited suites may have other names
            asked[number].setdefault(name and name[:3], {}).setdefault(verdict, why)
    unasked = {number: beyond.get(number, NOT_ASKED) for number in ASKS} | NEVER_ASKED
    return [_judged(number, groups.values(), unasked[number]) for number, groups in asked.items()]


def _judged(number: str, groups: Iterable[Mapping[Status, str]], unasked: str) -> CttResult:
    """Return the result of a test from the statuses of its groups; `unasked` is the reason if there are none."""
    worst = ((each, next(verdict for verdict in WORST_FIRST if verdict in each)) for each in groups)
    found = {verdict: each[verdict] for each, verdict in worst}
    verdict = next((each for each in RED_OR_GREEN_FIRST if each in found), None)
    if verdict is None:
        return CttResult(number, Status.SKIPPED, unasked)
    return CttResult(number, verdict, "" if verdict is Status.PASSED else found[verdict])


def score(tests: Sequence[CttResult]) -> str:
    """Return the score, the report's last line."""
    counts = Counter(each.verdict for each in tests)
    return f"{len(tests) - counts[Status.SKIPPED]} of {len(tests)} tests executed: {report.counted(counts)}"


def lines(tests: Sequence[CttResult]) -> Iterator[str]:
    """Yield one line per test, and the score."""
    for each in tests:
        why = f" ({each.why})" if each.why else ""
        yield f"{each.number:>6}  {each.verdict.value:<8} {each.asks}{why}"
    yield score(tests)


# The page


class DeviceRun(NamedTuple):
    """A run: the device, the tier of the steps, the results, and what is known of the run.

    `beyond` has the reason for each test that steps of a higher tier would do.
    """

    device: CheckedDevice
    tier: Tier
    results: Sequence[SuiteResult]
    run: RunFacts = report.UNTOLD
    beyond: Mapping[str, str] = MappingProxyType({})

    @property
    def facts(self) -> list[tuple[str, str]]:
        """The facts at the top of the report, with their headings."""
        document = self.device.dictionary.device.document
        said = [(what.capitalize(), document.text("deviceinfo", key)) for what, key in forms.INFORMATION]
        how = next((each.how for each in self.results), "not run")
        facts = [*self.device.facts, *said, ("Tier", self.tier.value), ("Run", how), *self.run.rows]
        return [each for each in facts if each[1]]

    @property
    def tests(self) -> list[CttResult]:
        """The results by test of CiA's tool; `lint` checks the file."""
        dictionary = self.device.dictionary
        found = lint(dictionary.content, dictionary.file.name)
        errors = [str(each) for each in found if each.severity is Severity.ERROR]
        return results_of(self.results, errors, self.beyond)


def blocks(run: DeviceRun) -> Iterator[DocBlock]:
    """Yield the report of a device."""
    yield DocHeading(1, f"Conformance of {run.device.dictionary.name}")
    facts = run.run._replace(devices=[run.device])
    yield from page.opening(run.results, facts, run.facts, report.slowest(run.results))
    yield DocHeading(2, "Score by chapter")
    yield page.suites_table("Chapter", run.results)
    yield from page.failed(run.results)
    yield DocHeading(2, "By the numbers of CiA's test tool")
    tests = run.tests
    yield Paragraph(f"{score(tests)}. This is not a run of that tool, and not a certificate.")
    rows = [(each.number, each.asks, each.verdict.value, each.why) for each in tests]
    yield DocTable(("Test", "It asks", "", "Why"), rows, words=("Test", ""))
    yield from page.skipped(run.results)
