"""What came out of a suite, step by step, with everything that a report may want to say."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import NamedTuple

from eurobot_od.check.patterns import Mismatch
from eurobot_od.frame import Frame
from eurobot_od.support.yaml_places import Place


class Status(Enum):
    """How a step ended; the value is the word in reports."""

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
    """A frame on the bus: seconds since the suite's start, whether the tester sent it, and what it means."""

    time: float
    own: bool
    frame: Frame
    meaning: str


class StepReason(NamedTuple):
    """Why a step failed: in words, thing by thing, and the frames on the bus up to then.

    `cause` is the error that the node itself has reported by then, and not taken back.
    """

    what: str
    expected: str = ""
    came: str = ""
    mismatches: tuple[Mismatch, ...] = ()
    frames: tuple[Line, ...] = ()
    cause: str = ""


class StepResult(NamedTuple):
    """How a step ended: `started` seconds after the suite's start, it took `seconds`."""

    section: SuitePart
    name: str
    place: Place
    status: Status
    started: float
    seconds: float
    reason: StepReason | None = None


@dataclass(frozen=True)
class SuiteResult:
    """How a suite ended; `skipped` says why it was not run at all, `error` what ended it before its time."""

    file: Path
    name: str
    how: str
    steps: tuple[StepResult, ...] = ()
    seconds: float = 0.0
    skipped: str = ""
    error: str = ""

    def count(self, *statuses: Status) -> int:
        """Return how many steps ended in one of some ways."""
        return sum(step.status in statuses for step in self.steps)

    @property
    def ended(self) -> bool:
        """Whether a step that others need was red, so that they were not done."""
        return any(step.status is Status.SKIPPED and step.reason is None for step in self.steps)

    @property
    def failed(self) -> bool:
        """Whether a step is red."""
        return self.count(Status.FAILED) > 0


class CheckedSeed(NamedTuple):
    """How all suites ended for one seed of the simulation."""

    seed: int
    suites: tuple[SuiteResult, ...]
