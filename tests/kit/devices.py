"""Suites made from a device's file, read as any others are, and run against the simulated device or a faulty one."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

from eurobot_od.check.conformance import suite
from eurobot_od.check.conformance.clauses import StepName, Tier
from eurobot_od.check.format import SuiteReader
from eurobot_od.check.on_bus import MakeNodes, NodeUnderTest, run_simulated
from eurobot_od.check.report import Status, StepResult, SuiteResult
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.shapes import Networks
from eurobot_od.check.suite import Suite
from eurobot_od.device.faults import Leaving
from eurobot_od.device.node import Node
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary

DOCS = Path(__file__).parents[2] / "docs"
MOTOR, SERVO, IO = DOCS / "motor.eds", DOCS / "servo.eds", DOCS / "io.eds"
"""The documentation's devices: a motor controller of our own, a drive of CiA 402, a module of CiA 401."""

SAMPLES = Path(__file__).parents[1] / "lint" / "samples"
MODULE = SAMPLES / "clean.eds"
"""A device with everything that a suite looks at but write-only objects."""

MAKERS = Path(__file__).parent / "makers"
"""Files in the style of makers, of no device that there is: guarding, SYNC, little else."""

IO_MODULE, AXIS_DRIVE = MAKERS / "io-module.eds", MAKERS / "axis-drive.eds"

NODE_ID = 5


def read(dictionary: Dictionary, text: str) -> list[Suite]:
    """Read suites for a device."""
    networks = Networks(lambda _: dictionary.file, load=lambda _: (dictionary,), refused=lambda _: None)
    return SuiteReader(networks).read_texts({dictionary.file: text})


def suites_of(dictionary: Dictionary, tier: Tier = Tier.REVERSIBLE) -> list[Suite]:
    """Return the conformance suites of a dictionary."""
    return read(dictionary, suite.text(dictionary, tier))


@cache
def suites(file: Path, tier: Tier = Tier.REVERSIBLE, chapter: str | None = None) -> list[Suite]:
    """Return the conformance suites of a file, all of them or that of one chapter."""
    found = suites_of(Dictionary.load(file, NODE_ID), tier)
    return [each for each in found if chapter is None or chapter in each.tags]


def of_kind(kind: type[Node]) -> MakeNodes:
    """Return what makes devices of a class."""
    return lambda dictionaries, _seed, _clock: [NodeUnderTest(kind(each)) for each in dictionaries.values()]


def results(
    several: Iterable[Suite], kind: type[Node] = SimulatedDevice, *, keep_going: bool = True
) -> Iterator[SuiteResult]:
    """Run suites against a device of a class."""
    return (run_simulated(each, RunOptions(keep_going), of_kind(kind)) for each in several)


def steps(
    several: Iterable[Suite], kind: type[Node] = SimulatedDevice, *, keep_going: bool = True
) -> Iterator[StepResult]:
    """Run suites and give the results of their steps."""
    return (each for result in results(several, kind, keep_going=keep_going) for each in result.steps)


def first_red(several: Iterable[Suite], kind: type[Node]) -> str:
    """Return the name of the first step that is red on a device of a class; empty if none is."""
    done = steps(several, kind, keep_going=False)
    return next((each.name for each in done if each.status is Status.FAILED), "")


def red(done: Iterable[StepResult]) -> list[str]:
    """Return the names of the steps that are red, with the reason."""
    return [f"{each.name}: {each.reason}" for each in done if each.status is Status.FAILED]


class Exchange(NamedTuple):
    """The frames of the steps that have asked a test of CiA's tool: the tester's and the device's, and how often."""

    requests: list[str]
    answers: list[str]
    questions: set[tuple[str, ...]]


class Run:
    """A run of some suites against a device that is its file: its results, and the bus as recorded, by CTT's numbers.

    `shared` are steps that ask more than one number at once: their frames count for none.
    """

    def __init__(self, *several: Suite) -> None:
        self.bus = defaultdict[str, Exchange](lambda: Exchange([], [], set()))
        self.shared, self._heard, self._said = list[str](), list[str](), list[str]()
        heard, said = self._heard, self._said

        class Listening(Leaving, SimulatedDevice):
            def receive(self, frame: Frame, now: float) -> list[Frame]:
                heard.append(f"{frame.cob_id:03X}#{frame.data.hex().upper()}")
                return super().receive(frame, now)

            def requested(self, cob_id: int, now: float) -> list[Frame]:
                heard.append(f"{cob_id:03X}#R")
                return super().requested(cob_id, now)

            def outgoing(self, frames: list[Frame]) -> list[Frame]:
                said.extend(f"{frame.cob_id:03X}#{frame.data.hex().upper()}" for frame in frames)
                return frames

        self.suites, options = several, RunOptions(keep_going=True, show=self._note)
        self.results = [run_simulated(each, options, of_kind(Listening)) for each in several]

    def _note(self, step: StepResult) -> None:
        name = StepName.of(step.name)
        numbers = name.numbers if name and step.status is Status.PASSED else ()
        if name and len(numbers) == 1:
            exchange = self.bus[numbers[0]]
            exchange.requests.extend(self._heard)
            exchange.answers.extend(self._said)
            exchange.questions.add(name[:3])
        elif numbers:
            self.shared.append(step.name)
        self._heard.clear()
        self._said.clear()

    @property
    def steps(self) -> list[StepResult]:
        """The results of all steps."""
        return [step for result in self.results for step in result.steps]


@cache
def asked_for_everything(file: Path, tier: Tier = Tier.DESTRUCTIVE) -> Run:
    """Run all suites of a file up to a tier, once for all tests."""
    return Run(*suites(file, tier))
