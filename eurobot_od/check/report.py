"""Formats results: for the console, as JUnit XML, and as JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

from eurobot_od.check.suite import Mismatch, Suite
from eurobot_od.frame import Frame
from eurobot_od.support.texts import amount, one_line
from eurobot_od.support.yaml_places import Place


class Status(Enum):
    """How a step ended; the value is its word in reports."""

    PASSED = "ok"
    FAILED = "FAILED"
    SKIPPED = "skipped"
    INTERRUPTED = "interrupted"
    BUS_FAILED = "bus failed"


class SuitePart(Enum):
    """The part of a suite that a step belongs to."""

    SETUP = "setup"
    STEPS = "steps"
    TEARDOWN = "teardown"


class Line(NamedTuple):
    """A frame on the bus: time in s since the suite's start, whether the tester sent it, and its meaning."""

    time: float
    own: bool
    frame: Frame
    meaning: str


class StepReason(NamedTuple):
    """Why a step failed: a sentence, the differences, and the last frames on the bus.

    `cause` is the error that the node itself reports.
    """

    what: str
    expected: str = ""
    came: str = ""
    mismatches: tuple[Mismatch, ...] = ()
    frames: tuple[Line, ...] = ()
    cause: str = ""

    @property
    def facts(self) -> list[tuple[str, str]]:
        """All facts but `what`, each with its heading."""
        off = [(each.what, each.words) for each in self.mismatches]
        said = [("expected", self.expected), ("came", self.came), *off, ("the node says", self.cause)]
        return [each for each in said if each[1]]


class StepResult(NamedTuple):
    """How a step ended; it began `started` s after the suite and took `seconds`."""

    section: SuitePart
    name: str
    place: Place
    status: Status
    started: float
    seconds: float
    reason: StepReason | None = None


@dataclass(frozen=True)
class SuiteResult:
    """How a suite ended.

    `skipped` says why it was not run, `error` what stopped it. `ended` is the name of the red step after which no
    others were done. `asked_again` is the number of SDO requests that were repeated, `slowest` the longest wait for a
    frame, in s, of the steps that name no time. `remarks` are exceptions of simulated nodes, and nodes that
    are on the bus beside a tester that plays them.
    """

    file: Path
    name: str
    how: str
    steps: tuple[StepResult, ...] = ()
    seconds: float = 0.0
    skipped: str = ""
    error: str = ""
    ended: str = ""
    asked_again: int = 0
    slowest: float = 0.0
    remarks: tuple[str, ...] = ()

    def count(self, *statuses: Status) -> int:
        """Return the number of steps that ended in one of these ways."""
        return sum(step.status in statuses for step in self.steps)

    @property
    def failed(self) -> bool:
        """Whether a step is red."""
        return self.count(Status.FAILED) > 0


AS_THEY_WERE = "7.4 Values: they are as they were [reading]"
"""Name of the last step of each conformance suite."""

HOW_TO_RESTORE = "`write` writes them back, `emcy --clear` clears errors; what was not stored is gone with a reset"

COLOURS = {Status.PASSED: 32, Status.FAILED: 31, Status.BUS_FAILED: 31, Status.SKIPPED: 33, Status.INTERRUPTED: 33}
"""Terminal colours, as SGR codes."""


# Console


def heading(suite: Suite, how: str) -> str:
    """Return the line above a suite's steps; `how` says how it is run, or why it is not."""
    return one_line(f"{suite.file.name}: {suite.name} ({how})")


def step_line(step: StepResult, in_colour: bool = False) -> str:
    """Return a step's line: how it ended, when it began, how long it took, its line in the file, its name."""
    status = f"{step.status.value:<11}"
    if in_colour:
        status = f"\x1b[{COLOURS[step.status]}m{status}\x1b[0m"
    section = "" if step.section is SuitePart.STEPS else f"[{step.section.value}] "
    times = f"{step.started:9.3f} s {step.seconds * 1000:9.1f} ms"
    return f"  {status} {times}  {step.place.line:>4}  {section}{one_line(step.name)}"


def reason_lines(reason: StepReason) -> Iterator[str]:
    """Yield the lines that say why a step failed or was skipped: what was expected and came, and the last frames."""
    lines = [f"    {reason.what}", *(f"      {what:<8}  {text}" for what, text in reason.facts)]
    if reason.frames:
        lines.append("      last frames (> sent, < received)")
    lines += (f"        {line}" for line in frame_lines(reason))
    # The lines contain text that nodes have sent, which must not break a line or control the terminal.
    return map(one_line, lines)


def frame_lines(reason: StepReason) -> Iterator[str]:
    """Yield the last frames of a step: time in the suite, > sent or < received, the frame, and what it means."""
    for time, own, frame, meaning in reason.frames:
        # The longest frame (identifier, `#`, eight bytes) has 20 characters, so the meanings are aligned.
        yield f"{time:9.4f} s {'>' if own else '<'} {frame!s:<21} {meaning}".rstrip()


GOES_ON = (Status.PASSED, Status.SKIPPED)
"""Steps that do not end their suite; if not all steps are shown, these are only counted."""


def folded(result: SuiteResult) -> str:
    """Return the line that counts the steps that are not shown; empty if there are none."""
    return counted({status: result.count(status) for status in GOES_ON})


def counted(counts: Mapping[Status, int]) -> str:
    """Return the counts as one line, such as "3 ok, 1 skipped"."""
    return ", ".join(f"{counts[status]} {status.value}" for status in Status if counts.get(status))


def failures(results: Iterable[SuiteResult]) -> Iterator[str]:
    """Yield the lines of each red step for the end of the output, with its place in the file and its reason."""
    for result in results:
        for step in result.steps:
            if step.status in (Status.FAILED, Status.BUS_FAILED):
                yield one_line(f"{result.file}:{step.place.line}: {step.name} ({result.how})")
                yield from reason_lines(step.reason) if step.reason else ()


def summary(results: Sequence[SuiteResult]) -> str:
    """Return the last line of the output, with the number of steps by status."""
    steps = counted(Counter(step.status for result in results for step in result.steps))
    seconds = sum(result.seconds for result in results)
    asked_again = sum(result.asked_again for result in results)
    again = f"; {amount(asked_again, 'SDO request')} asked again, as no answer came" if asked_again else ""
    return f"{amount(len(results), 'suite')}: {steps or 'no steps'} in {seconds:.1f} s of bus time{again}"


def not_run(results: Iterable[SuiteResult]) -> Iterator[str]:
    """Yield one line per suite that was not run or not finished, with the reason."""
    for result in results:
        if result.skipped:
            yield one_line(f"{result.file.stem}: NOT RUN: {result.name}: {result.skipped}")
        elif result.ended:
            yield one_line(f"{result.file.stem}: NOT FINISHED: {result.name}: ended by '{result.ended}', which is red")


ONLY_WITH = "only with "
"""How the reason begins why a step is skipped that an option would run; the option follows."""


def further(results: Iterable[SuiteResult]) -> Iterator[str]:
    """Yield a line for each option that runs steps which were skipped."""
    steps = (step.reason.what for result in results for step in result.steps if step.reason)
    options = Counter(what.removeprefix(ONLY_WITH) for what in steps if what.startswith(ONLY_WITH))
    for option, count in options.items():
        yield f"{option} runs {amount(count, 'step')} more"


SLOW = 1.0
"""Minimum wait for an answer that is reported, in s."""


def slowest(results: Sequence[SuiteResult]) -> Iterator[str]:
    """Yield a line for the slowest answer of a device, if it is slow."""
    longest = max((result.slowest for result in results), default=0.0)
    if longest > SLOW:
        yield f"The slowest answer, or boot-up, came after {longest:.2f} s: no clause names a time"


def remarks(results: Iterable[SuiteResult]) -> Iterator[str]:
    """Yield a line for each remark on a suite, and for each green step that did not compare everything."""
    for result in results:
        yield from (one_line(f"{result.file.name}: {result.name}: {each}") for each in result.remarks)
        for step in result.steps:
            if step.status is Status.PASSED and step.reason is not None:
                yield one_line(f"{result.file.stem}: {result.name}: {step.reason.what}")


def changed(results: Iterable[SuiteResult]) -> Iterator[str]:
    """Yield a line for each suite that left objects changed, with how to restore them."""
    for result in results:
        for step in result.steps:
            if step.status is Status.FAILED and step.name == AS_THEY_WERE and step.reason is not None:
                off = step.reason.mismatches
                objects = "; ".join(f"{each.what} was {each.expected}, is {each.came}" for each in off)
                yield one_line(f"{result.file.stem}: LEFT CHANGED by {result.name}: {objects}. {HOW_TO_RESTORE}")


# JUnit


def junit(results: Sequence[SuiteResult]) -> str:
    """Return a JUnit XML report: a test suite per suite, a test case per step."""
    root = ElementTree.Element("testsuites", _totals(results))
    for result in results:
        suite = ElementTree.SubElement(root, "testsuite", {"name": result.name} | _totals([result]))
        if result.skipped:
            case = ElementTree.SubElement(suite, "testcase", {"classname": result.file.stem, "name": result.name})
            ElementTree.SubElement(case, "skipped", {"message": result.skipped})
        for step in result.steps:
            suite.append(_test_case(result, step))
    # XML 1.0 allows no control characters, not even escaped ones, and ElementTree does not check.
    for each in root.iter():
        each.attrib.update({key: one_line(value) for key, value in each.attrib.items()})
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _totals(results: Sequence[SuiteResult]) -> dict[str, str]:
    counts = {
        # A suite that is skipped as a whole is one test case (see `junit`).
        "tests": sum(len(result.steps) + bool(result.skipped) for result in results),
        "failures": sum(result.count(Status.FAILED) for result in results),
        "errors": sum(result.count(Status.BUS_FAILED, Status.INTERRUPTED) for result in results),
        "skipped": sum(result.count(Status.SKIPPED) + bool(result.skipped) for result in results),
    }
    return {name: str(count) for name, count in counts.items()} | {"time": f"{sum(r.seconds for r in results):.6f}"}


JUNIT = {Status.FAILED: "failure", Status.SKIPPED: "skipped", Status.BUS_FAILED: "error", Status.INTERRUPTED: "error"}
"""JUnit's elements for steps that did not pass."""


def _test_case(result: SuiteResult, step: StepResult) -> ElementTree.Element:
    name = step.name if step.section is SuitePart.STEPS else f"{step.section.value}: {step.name}"
    attributes = {"classname": result.file.stem, "name": name, "time": f"{step.seconds:.6f}"}
    case = ElementTree.Element("testcase", attributes | {"file": str(result.file), "line": str(step.place.line)})
    if step.status in JUNIT:
        message = step.reason.what if step.reason else step.status.value
        element = ElementTree.SubElement(case, JUNIT[step.status], {"message": message})
        element.text = "\n".join(reason_lines(step.reason)) if step.reason else None
    return case


# JSON


def as_data(results: Sequence[SuiteResult]) -> list[dict[str, Any]]:
    """Return the results as plain data, for JSON."""
    return [
        {
            "file": str(result.file),
            "name": result.name,
            "how": result.how,
            "seconds": round(result.seconds, 6),
            "skipped": result.skipped or None,
            "error": result.error or None,
            "remarks": [*result.remarks],
            "steps": [
                {
                    "section": step.section.value,
                    "name": step.name,
                    "line": step.place.line,
                    "status": step.status.value.lower(),
                    "started": round(step.started, 6),
                    "seconds": round(step.seconds, 6),
                    "finding": None if step.reason is None else _reason_data(step.reason),
                }
                for step in result.steps
            ],
        }
        for result in results
    ]


def _reason_data(reason: StepReason) -> dict[str, Any]:
    frames = [
        {
            "time": round(line.time, 6),
            "direction": "sent" if line.own else "received",
            "frame": str(line.frame),
            "meaning": line.meaning,
        }
        for line in reason.frames
    ]
    said = {key: getattr(reason, key) for key in ("what", "expected", "came", "cause")}
    return {**said, "differences": [each._asdict() for each in reason.mismatches], "frames": frames}
