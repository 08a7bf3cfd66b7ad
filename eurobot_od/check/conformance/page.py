"""A page to hand to a device's maker: what was asked, the score by chapter, and each red step with its frames.

`DeviceRun` has all that the page says; the forms (Markdown, HTML, JSON) only write it.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from eurobot_od.check import report
from eurobot_od.check.conformance import ctt
from eurobot_od.check.conformance.clauses import StepName
from eurobot_od.check.conformance.subject import Tier
from eurobot_od.check.report import Status, StepReason, StepResult, SuiteResult
from eurobot_od.errors import UnknownName
from eurobot_od.export.forms import FORMS, SUFFIXES, DocBlock, DocHeading, DocTable, Paragraph, Preformatted
from eurobot_od.lint.findings import Severity
from eurobot_od.lint.rules import lint
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.support.texts import amount

JSON = ".json"

INFORMATION = (
    ("Vendor", "vendorname"),
    ("Vendor number", "vendornumber"),
    ("Product", "productname"),
    ("Product number", "productnumber"),
    ("Revision", "revisionnumber"),
)
"""What [DeviceInfo] says about a device."""


class DeviceRun(NamedTuple):
    """A run: the device, up to which tier it was asked, its results, and by what and when they were `made`."""

    dictionary: Dictionary
    tier: Tier
    results: Sequence[SuiteResult]
    made: str = ""

    @property
    def facts(self) -> list[tuple[str, str]]:
        """What the page begins with."""
        device, document = self.dictionary, self.dictionary.device.document
        said = [(what, document.text("deviceinfo", key)) for what, key in INFORMATION]
        run = next((each.how for each in self.results), "not run")
        facts = [("File", device.file.name), ("Node-ID", str(device.node_id)), *said]
        return [each for each in [*facts, ("Tier", self.tier.value), ("Run", run), ("Made by", self.made)] if each[1]]

    @property
    def red(self) -> list[StepResult]:
        """The steps that failed."""
        return [step for result in self.results for step in result.steps if step.status is Status.FAILED]

    @property
    def skipped(self) -> Counter[str]:
        """Why steps were skipped, and how many of them."""
        skipped = (step for result in self.results for step in result.steps if step.status is Status.SKIPPED)
        return Counter(step.reason.what if step.reason else "a step before it is red" for step in skipped)

    @property
    def tests(self) -> list[ctt.CttResult]:
        """What the run says about each test of CiA's tool; the file is checked by `lint`."""
        found = lint(self.dictionary.content, self.dictionary.file.name)
        return ctt.results_of(self.results, [str(each) for each in found if each.severity is Severity.ERROR])

    def as_data(self) -> dict[str, Any]:
        """Return all of it as plain data."""
        return {
            "device": self.dictionary.name,
            **{what.lower().replace(" ", "_"): value for what, value in self.facts},
            "chapters": report.as_data(self.results),
            "ctt": [
                {**each._asdict(), "verdict": each.verdict.value.lower(), "asks": each.asks} for each in self.tests
            ],
        }


def check_form(file: Path) -> None:
    """Raise UnknownName unless a file's suffix is that of a form."""
    if file.suffix.lower() not in (*SUFFIXES, JSON):
        raise UnknownName("form of a report", file.suffix or file.name, [*SUFFIXES, JSON])


def text(file: Path, reports: Sequence[DeviceRun]) -> str:
    """Return the page of some devices in the form of a file's suffix; raises UnknownName."""
    check_form(file)
    if file.suffix.lower() == JSON:
        return json.dumps([each.as_data() for each in reports], indent=1) + "\n"
    return FORMS[SUFFIXES[file.suffix.lower()]]([block for each in reports for block in blocks(each)])


# What it says


def blocks(run: DeviceRun) -> Iterator[DocBlock]:
    """Give the page of a device."""
    yield DocHeading(1, f"Conformance of {run.dictionary.name}")
    passed = sum(each.count(Status.PASSED) for each in run.results)
    red = f"{amount(len(run.red), 'step')} red" if run.red else "no step red"
    yield Paragraph(f"{amount(passed, 'step')} green, {red}.")
    yield DocTable(("", ""), run.facts, words=("",))
    yield DocHeading(2, "Score by chapter")
    statuses = (Status.PASSED, Status.FAILED, Status.SKIPPED)
    scores = [(r.name.removeprefix("CiA 301, "), *(str(r.count(each)) for each in statuses)) for r in run.results]
    yield DocTable(("Chapter", "Green", "Red", "Skipped"), scores, ("Green", "Red", "Skipped"))
    yield DocHeading(2, "What is red")
    yield from _all_red(run)
    yield DocHeading(2, "By the numbers of CiA's test tool")
    tests = run.tests
    yield Paragraph(f"{ctt.score(tests)}. This is not a run of that tool, and not a certificate.")
    rows = [(each.number, each.asks, each.verdict.value, each.why) for each in tests]
    yield DocTable(("Test", "It asks", "", "Why"), rows, words=("Test", ""))
    yield DocHeading(2, "What was skipped")
    yield DocTable(("Why", "Steps"), [(why, str(count)) for why, count in run.skipped.items()], ("Steps",))


def _all_red(run: DeviceRun) -> Iterator[DocBlock]:
    for result in run.results:
        if result.error:
            yield Paragraph(f"{result.name} ended before its time: {result.error}")
    if not run.red:
        yield Paragraph("Nothing.")
    for _, together in groupby(run.red, _belongs_to):
        first, *others = together
        yield from _red(first)
        if others:
            yield DocTable(("Also red there", "Expected", "Came"), list(map(_also_red, others)))


def _belongs_to(step: StepResult) -> tuple[str, ...]:
    """Return what steps have in common that one fault makes red: their group, else the question put to each object."""
    name = StepName.of(step.name)
    if name is None:
        return (step.name,)
    return name.clause, name.topic, name.tier, name.what if name.inside else ""


def _also_red(step: StepResult) -> tuple[str, str, str]:
    name, reason = StepName.of(step.name), step.reason or StepReason("red")
    return (name.inside or name.what if name else step.name), reason.expected or reason.what, reason.came


def _red(step: StepResult) -> Iterator[DocBlock]:
    name, reason = StepName.of(step.name), step.reason or StepReason("red")
    yield DocHeading(3, step.name if name is None else f"{name.topic}: {name.inside or name.what}")
    rows = [("What", reason.what), ("Expected", reason.expected), ("Came", reason.came)]
    rows += [(each.what, f"expected {each.expected}, came {each.came}") for each in reason.mismatches]
    if name is not None:
        looked_at = [("Looked at", name.what)] if name.inside else []
        rows = [("Clause", f"CiA 301, {name.clause}"), ("CTT", name.ctt), *looked_at, *rows]
    rows.append(("The device itself says", reason.cause))
    yield DocTable(("", ""), [each for each in rows if each[1]], words=("",))
    if reason.frames:
        yield Preformatted(list(report.frame_lines(reason)))
