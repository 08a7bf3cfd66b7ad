"""CiA's conformance test tool (CTT): the tests of its list, and what a run of ours says about each.

Numbers are the tool's, words are ours. A test of it that a device cannot be asked is skipped with the reason; it counts
as executed only if a step of ours has passed or failed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import Enum
from typing import NamedTuple

from eurobot_od.check.conformance.clauses import StepName
from eurobot_od.check.report import Status, SuiteResult

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
    "2.14": "a download by segments",
    "2.15": "more than 4 bytes by segments",
    "2.16": "a wrong toggle bit, upload",
    "2.17": "a wrong toggle bit, download",
    "2.18": "a long object as a whole",
    "2.19": "0x1000 in blocks",
    "2.20": "a download in blocks",
    "2.21": "a download in blocks, with CRC",
    "2.22": "a long object in blocks",
    "2.23": "a long object in blocks, with CRC",
    "2.24": "an upload in blocks",
    "2.25": "an upload in blocks, with CRC",
    "2.26": "a block of 128 segments",
    "2.27": "segment 128 acknowledged",
    "2.28": "further SDO servers",
    "2.29": "further SDO servers after a reset",
    "2.30": "SDO clients stored",
    "3.1": "which RPDOs there are",
    "3.2": "which TPDOs there are",
    "3.3": "a TPDO by remote frame",
    "3.4": "a TPDO by event",
    "3.5": "a TPDO by event timer",
    "3.6": "a TPDO by SYNC",
    "3.7": "a TPDO by SYNC after an event",
    "3.8": "a TPDO from the SYNC of its start value on",
    "3.9": "no TPDO by remote frame in STOPPED",
    "3.10": "all TPDOs by event",
    "3.11": "all TPDOs by event timer",
    "3.12": "all TPDOs by SYNC",
    "3.13": "all TPDOs by SYNC after an event",
    "3.14": "all TPDOs from the SYNC of their start value on",
    "3.15": "all TPDOs by remote frame",
    "3.16": "all TPDOs by event, once more",
    "3.17": "all TPDOs by event timer, once more",
    "3.18": "all TPDOs by SYNC, once more",
    "3.19": "all TPDOs by SYNC after an event, once more",
    "3.20": "all TPDOs from the SYNC of their start value on, once more",
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
    "8.1": "0x1010:1",
    "8.2": "0x1011:1",
    "8.3": "0x1010:2",
    "8.4": "0x1011:2",
    "8.5": "0x1010:3",
    "8.6": "0x1011:3",
    "8.7": "0x1010, further sub-indices",
    "8.8": "0x1011, further sub-indices",
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
"""The tests of the tool by number, and what each asks."""

LINT = "1.0"
"""The test of the file, not of the device."""

NOT_ASKED = "no step of this run asks it"


class Verdict(Enum):
    """What became of a test; the value is the word in reports."""

    PASSED = "passed"
    FAILED = "FAILED"
    SKIPPED = "skipped"


class CttResult(NamedTuple):
    """A test of the tool by its number: what became of it, and why, of a failed one the step that is red."""

    number: str
    verdict: Verdict
    why: str = ""

    @property
    def asks(self) -> str:
        """What the test asks."""
        return ASKS[self.number]


def results_of(results: Iterable[SuiteResult], file_errors: Sequence[str]) -> list[CttResult]:
    """Return what a run says about each test; `file_errors` are lint's errors in the device's file."""
    steps = [(StepName.of(step.name), step) for result in results for step in result.steps]
    found: dict[str, dict[Verdict, str]] = {
        LINT: {Verdict.FAILED: file_errors[0]} if file_errors else {Verdict.PASSED: ""}
    }
    for name, step in steps:
        verdict = VERDICTS.get(step.status)
        for number in name.numbers if name and verdict else ():
            why = step.reason.what if step.reason and verdict is Verdict.SKIPPED else step.name
            found.setdefault(number, {}).setdefault(verdict, why)  # type: ignore[arg-type]  # None has no numbers
    return [_judged(number, found.get(number, {})) for number in ASKS]


VERDICTS: Mapping[Status, Verdict] = {
    Status.PASSED: Verdict.PASSED,
    Status.FAILED: Verdict.FAILED,
    Status.SKIPPED: Verdict.SKIPPED,
}


def _judged(number: str, verdicts: Mapping[Verdict, str]) -> CttResult:
    """One red step makes a test fail, one green step pass."""
    for verdict in (Verdict.FAILED, Verdict.PASSED, Verdict.SKIPPED):
        if verdict in verdicts:
            # Several of our steps may stand for one of its tests: what is red counts more than what is green, and both
            # more than what was skipped.
            why = "" if verdict is Verdict.PASSED else verdicts[verdict]
            return CttResult(number, verdict, why)
    return CttResult(number, Verdict.SKIPPED, NOT_ASKED)


def score(tests: Sequence[CttResult]) -> str:
    """Return the line that such a report ends with."""
    counts = Counter(each.verdict for each in tests)
    executed = counts[Verdict.PASSED] + counts[Verdict.FAILED]
    words = ", ".join(f"{counts[each]} {each.value.lower()}" for each in Verdict)
    return f"{executed} of {len(tests)} tests executed: {words}"


def lines(tests: Sequence[CttResult]) -> Iterator[str]:
    """Yield the report of a run as the tool's: a line for each test, and the score."""
    for each in tests:
        why = f" ({each.why})" if each.why else ""
        yield f"{each.number:>6}  {each.verdict.value:<8} {each.asks}{why}"
    yield score(tests)
