"""Suites made from a device's file, read as any others are, and run against the simulated device or a faulty one."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from eurobot_od.check.conformance import suite
from eurobot_od.check.conformance.clauses import StepName, Tier
from eurobot_od.check.format import SuiteReader
from eurobot_od.check.on_bus import MakeNodes, NodeUnderTest, run_simulated
from eurobot_od.check.report import Status, StepResult, SuiteResult
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.shapes import Networks
from eurobot_od.check.suite import Suite
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


class Run:
    """A run of some suites against a device that is its file: its results, and what was `asked` by CTT's numbers."""

    def __init__(self, *several: Suite) -> None:
        self.asked, self._heard = defaultdict[str, list[str]](list), list[str]()
        heard = self._heard

        class Listening(SimulatedDevice):
            def receive(self, frame: Frame, now: float) -> list[Frame]:
                heard.append(f"{frame.cob_id:03X}#{frame.data.hex().upper()}")
                return super().receive(frame, now)

            def requested(self, cob_id: int, now: float) -> list[Frame]:
                heard.append(f"{cob_id:03X}#R")
                return super().requested(cob_id, now)

        self.suites, options = several, RunOptions(keep_going=True, show=self._note)
        self.results = [run_simulated(each, options, of_kind(Listening)) for each in several]

    def _note(self, step: StepResult) -> None:
        name = StepName.of(step.name)
        for number in name.numbers if name and step.status is Status.PASSED else ():
            self.asked[number] += self._heard
        self._heard.clear()

    @property
    def steps(self) -> list[StepResult]:
        """The results of all steps."""
        return [step for result in self.results for step in result.steps]


@cache
def asked_for_everything(file: Path, tier: Tier = Tier.DESTRUCTIVE) -> Run:
    """Run all suites of a file up to a tier, once for all tests."""
    return Run(*suites(file, tier))
