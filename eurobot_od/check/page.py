"""The page of a run, for somebody else: its facts, what failed with its frames, what was skipped, and all steps.

The formats (Markdown, HTML) only write the blocks. The page of a conformance run has most of them, too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from eurobot_od.check import report
from eurobot_od.check.conformance.clauses import StepName
from eurobot_od.check.report import CheckedDevice, RunFacts, Status, StepReason, StepResult, SuitePart, SuiteResult
from eurobot_od.export.forms import DocBlock, DocHeading, DocTable, Paragraph, Preformatted
from eurobot_od.od.identity import Identity

COUNTED = Status.PASSED, Status.FAILED, Status.SKIPPED
"""Statuses that have a column in each table of suites; the others only if a step ended so."""


def blocks(results: Sequence[SuiteResult], facts: RunFacts) -> Iterator[DocBlock]:
    """Yield the page of a run of any suites."""
    names = ", ".join(dict.fromkeys(each.dictionary.name for each in facts.devices))
    yield DocHeading(1, f"Check of {names}" if names else "Check")
    yield from opening(results, facts, facts.rows)
    if facts.devices:
        yield DocHeading(2, "Who is who")
        is_asked = any(each.shown for each in facts.devices)
        head = "Node-ID", "Name", "File", "Identity in the file (0x1018)", *["Identity of the device"] * is_asked
        yield DocTable(head, [_who(each)[: len(head)] for each in facts.devices], head[:1])
    yield DocHeading(2, "Suites")
    yield suites_table("Suite", results)
    yield from failed(results)
    yield from skipped(results)
    yield DocHeading(2, "All steps")
    numbers = line, at, took = "Line", "At, s", "Took, ms"
    for result in results:
        yield DocHeading(3, f"{result.name} ({result.file.name}, {result.how})")
        yield DocTable((line, "Step", "", at, took), list(map(_row, result.steps)), numbers)


def _who(device: CheckedDevice) -> tuple[str, ...]:
    each = device.dictionary
    return str(each.node_id), each.name, each.file.name, str(Identity.of(each)), str(device.shown or "no answer")


def _row(step: StepResult) -> tuple[str, ...]:
    part = "" if step.section is SuitePart.STEPS else f"{step.section.value}: "
    took = f"{step.seconds * 1000:.1f}"
    return str(step.place.line), f"{part}{step.name}", step.status.value, f"{step.started:.3f}", took


# Blocks of both pages


def opening(
    results: Sequence[SuiteResult],
    facts: RunFacts,
    rows: Sequence[tuple[str, str]],
    notes: Iterable[str] = (),
) -> Iterator[DocBlock]:
    """Yield what stands under the title: doubts about the devices, the verdict, notes, and the `rows` of facts."""
    yield from map(Paragraph, facts.doubts)
    yield Paragraph(f"{verdict(results, facts)} {report.summary(results, facts)}.")
    for noted in (report.changed(results), report.remarks(results), notes, report.not_run(results)):
        yield from map(Paragraph, noted)
    yield DocTable(("", ""), rows)


def verdict(results: Sequence[SuiteResult], facts: RunFacts) -> str:
    """Return in one sentence how a run has ended."""
    if any(result.error or result.count(Status.INTERRUPTED) for result in results):
        return "NOT FINISHED."
    is_red = any(result.failed for result in results) or report.checked_nothing(results)
    if is_red:
        return "FAILED."
    return "Green as far as the file is read." if facts.left_out else "Passed."


def suites_table(title: str, results: Sequence[SuiteResult]) -> DocTable:
    """Return the table of the suites with the number of their steps by status."""
    statuses = [each for each in Status if each in COUNTED or any(result.count(each) for result in results)]
    words = [each.value for each in statuses]
    rows = [
        (result.name.removeprefix("CiA 301, "), *(str(result.count(each)) for each in statuses)) for result in results
    ]
    return DocTable((title, *words), rows, words)


def skipped_steps(results: Sequence[SuiteResult]) -> Counter[str]:
    """Return the reasons for skipped steps, with the number of steps."""
    steps = (step for result in results for step in result.steps if step.status is Status.SKIPPED)
    return Counter(step.reason.what if step.reason else "a step before it is red" for step in steps)


def skipped(results: Sequence[SuiteResult]) -> Iterator[DocBlock]:
    """Yield why steps were skipped."""
    yield DocHeading(2, "What was skipped")
    rows = [(why, str(count)) for why, count in skipped_steps(results).items()]
    yield DocTable(("Why", "Steps"), rows, ("Steps",)) if rows else Paragraph("Nothing.")


def failed(results: Sequence[SuiteResult]) -> Iterator[DocBlock]:
    """Yield each red step with its frames; those with a common cause are in a table below the first of them."""
    yield DocHeading(2, "What failed")
    for result in results:
        if result.error:
            yield Paragraph(f"{result.name} ended before its time: {result.error}")
        for step in result.steps:
            if step.status is Status.INTERRUPTED:
                yield Paragraph(f"{result.name} was interrupted in '{step.name}'.")
    red = [step for result in results for step in result.steps if step.status is Status.FAILED]
    if not red:
        yield Paragraph("Nothing.")
    for _, together in groupby(red, _belongs_to):
        first, *others = together
        yield from _red(first)
        if others:
            yield DocTable(("also failed there", "expected", "came"), list(map(_also_red, others)))


def _belongs_to(step: StepResult) -> tuple[str, ...]:
    """Return what red steps with a common cause share: their group, otherwise their clause."""
    name = StepName.of(step.name)
    if name is None:
        return (step.name,)
    return name.clause, name.topic, name.tier, name.what if name.inside else ""


def _also_red(step: StepResult) -> tuple[str, str, str]:
    name = StepName.of(step.name)
    reason = step.reason or StepReason("red")
    return (name.inside or name.what if name else step.name), reason.expected or reason.what, reason.came


def _red(step: StepResult) -> Iterator[DocBlock]:
    name = StepName.of(step.name)
    reason = step.reason or StepReason("red")
    yield DocHeading(3, step.name if name is None else f"{name.topic}: {name.inside or name.what}")
    rows = [("what", reason.what), *reason.facts]
    if name is not None:
        looked_at = name.what if name.inside else ""
        rows = [("clause", f"CiA 301, {name.clause}"), ("CTT", name.ctt), ("looked at", looked_at), *rows]
    yield DocTable(("", ""), [each for each in rows if each[1]])
    if reason.frames:
        yield Preformatted(list(report.frame_lines(reason)))
