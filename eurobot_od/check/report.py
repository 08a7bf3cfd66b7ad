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
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.normal import Refusal
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

    `cause` is the error that the node itself reports, `meanwhile` what else may be the reason.
    """

    what: str
    expected: str = ""
    came: str = ""
    mismatches: tuple[Mismatch, ...] = ()
    frames: tuple[Line, ...] = ()
    cause: str = ""
    meanwhile: str = ""

    @property
    def facts(self) -> list[tuple[str, str]]:
        """All facts but `what`, each with its heading."""
        off = [(each.what, each.words) for each in self.mismatches]
        why = [("the node says", self.cause), ("meanwhile", self.meanwhile)]
        said = [("expected", self.expected), ("came", self.came), *off, *why]
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


class CheckedDevice(NamedTuple):
    """A device under test, and the identity that it has `shown` on the bus; `doubt` says why it may be another one."""

    dictionary: Dictionary
    shown: Identity | None = None
    doubt: str = ""

    @property
    def facts(self) -> list[tuple[str, str]]:
        """File, node-ID and identities, each with its heading."""
        device = self.dictionary
        identity = ("Identity in the file (0x1018)", str(Identity.of(device)))
        shown = ("Identity of the device (0x1018)", str(self.shown or ""))
        facts = [("File", device.file.name), ("Node-ID", str(device.node_id)), identity, shown]
        return [each for each in facts if each[1]]


class RunFacts(NamedTuple):
    """What somebody else has to know of a run: by which program, when it `began` (ISO 8601), and where; its devices."""

    made_by: str = ""
    began: str = ""
    bus: str = ""
    devices: Sequence[CheckedDevice] = ()

    @property
    def rows(self) -> list[tuple[str, str]]:
        """The facts with their headings, without the devices."""
        rows = [("Bus", self.bus), ("Begun", self.began.replace("T", " ")), ("Made by", self.made_by)]
        return [each for each in rows if each[1]]

    @property
    def doubts(self) -> list[str]:
        """Why a device may be another one than its file describes."""
        return [each.doubt for each in self.devices if each.doubt]

    @property
    def left_out(self) -> dict[Path, Sequence[Refusal]]:
        """What is left out of the devices' files, by file."""
        found = {each.dictionary.file: each.dictionary.normal.refusals for each in self.devices}
        return {file: refusals for file, refusals in found.items() if refusals}

    @property
    def properties(self) -> Iterator[tuple[str, str]]:
        """The properties of a JUnit report."""
        yield from (("program", self.made_by), ("bus", self.bus))
        for each in self.devices:
            facts = [*each.facts, *([("doubt", each.doubt)] if each.doubt else [])]
            yield from ((f"{each.dictionary.name}: {what}", said) for what, said in facts)


UNTOLD = RunFacts()
"""The facts of a run of which nothing is known."""

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


def summary(results: Sequence[SuiteResult], facts: RunFacts = UNTOLD) -> str:
    """Return the last line of the output, with the number of steps by status."""
    steps = counted(Counter(step.status for result in results for step in result.steps))
    seconds = sum(result.seconds for result in results)
    asked_again = sum(result.asked_again for result in results)
    again = f"; {amount(asked_again, 'SDO request')} asked again, as no answer came" if asked_again else ""
    nothing = "; NOTHING WAS CHECKED" if checked_nothing(results) else ""
    parts = "".join(f"; NOT COMPLETE: {each}" for each in not_whole(facts))
    done = f"{amount(len(results), 'suite')}: {steps or 'no steps'} in {seconds:.1f} s of bus time"
    return f"{done}{again}{nothing}{parts}"


def not_whole(facts: RunFacts) -> Iterator[str]:
    """Yield a sentence for each device's file that is not read whole, so that the device is not checked whole."""
    for file, lost in facts.left_out.items():
        are = "is" if len(lost) == 1 else "are"
        yield f"{amount(len(lost), 'object')} of {file.name} {are} left out"


def checked_nothing(results: Sequence[SuiteResult]) -> bool:
    """Return whether no step was done: all were skipped, or there are none."""
    return not any(result.count(*(each for each in Status if each is not Status.SKIPPED)) for result in results)


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
        yield f"{option} runs what {amount(count, 'skipped step')} stand{'s' if count == 1 else ''} for"


def places(results: Iterable[SuiteResult]) -> Iterator[str]:
    """Yield which file the places of red steps of generated suites are in, if there are some."""
    if any(result.failed for result in results):
        yield "The places are those in the file that -o FILE writes with the same options"


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
                by = "CHANGED during" if step.reason.meanwhile else "LEFT CHANGED by"
                yield one_line(f"{result.file.stem}: {by} {result.name}: {objects}. {HOW_TO_RESTORE}")


# JUnit


def junit(results: Sequence[SuiteResult], facts: RunFacts = UNTOLD) -> str:
    """Return a JUnit XML report: a test suite per suite, a test case per step."""
    began = {"timestamp": facts.began} if facts.began else {}
    results = [*results, *_of_files(facts)]
    root = ElementTree.Element("testsuites", _totals(results) | began)
    for result in results:
        suite = ElementTree.SubElement(root, "testsuite", {"name": result.name} | _totals([result]) | began)
        properties = ElementTree.SubElement(suite, "properties")
        for name, value in [*facts.properties, ("run", result.how)]:
            ElementTree.SubElement(properties, "property", {"name": name, "value": value})
        if whole := _as_one_case(result):
            case = ElementTree.SubElement(suite, "testcase", {"classname": result.file.stem, "name": result.name})
            ElementTree.SubElement(case, *whole)
        for step in result.steps:
            suite.append(_test_case(result, step))
    # XML 1.0 allows no control characters, not even escaped ones, and ElementTree does not check.
    for each in root.iter():
        each.attrib.update({key: one_line(value) for key, value in each.attrib.items()})
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _of_files(facts: RunFacts) -> Iterator[SuiteResult]:
    """Yield a suite with one red step for each device's file that is not read whole."""
    for said, (file, lost) in zip(not_whole(facts), facts.left_out.items()):
        why = StepReason("; ".join((said, *map(str, lost))))
        step = StepResult(SuitePart.STEPS, "it is read whole", Place(lost[0].line, 1), Status.FAILED, 0.0, 0.0, why)
        yield SuiteResult(file, f"the file {file.name}", facts.bus, (step,))


def _as_one_case(result: SuiteResult) -> tuple[str, dict[str, str]] | None:
    """Return the element of a suite that has no step with its result: it is skipped, or has failed before one."""
    if result.skipped:
        return "skipped", {"message": result.skipped}
    return ("error", {"message": result.error}) if result.error and not result.count(Status.BUS_FAILED) else None


def _totals(results: Sequence[SuiteResult]) -> dict[str, str]:
    whole = Counter(each[0] for result in results if (each := _as_one_case(result)))
    counts = {
        "tests": sum(len(result.steps) for result in results) + whole.total(),
        "failures": sum(result.count(Status.FAILED) for result in results),
        "errors": sum(result.count(Status.BUS_FAILED, Status.INTERRUPTED) for result in results) + whole["error"],
        "skipped": sum(result.count(Status.SKIPPED) for result in results) + whole["skipped"],
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


def as_data(results: Sequence[SuiteResult], facts: RunFacts = UNTOLD) -> list[dict[str, Any]]:
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
        for result in [*results, *_of_files(facts)]
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
    said = {key: getattr(reason, key) for key in ("what", "expected", "came", "cause", "meanwhile")}
    return {**said, "differences": [each._asdict() for each in reason.mismatches], "frames": frames}
