"""Conformance suites of devices from their files, read and run against the simulated device or a faulty one."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path

from eurobot_od.check.conformance import suite
from eurobot_od.check.conformance.subject import Tier
from eurobot_od.check.reader import SuiteReader
from eurobot_od.check.results import StepResult
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.simulated import MakeNodes, NodeUnderTest, run_simulated
from eurobot_od.check.suite import Suite
from eurobot_od.check.vocabulary import Networks
from eurobot_od.device.node import Node
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary

SAMPLES = Path(__file__).parents[2] / "lint" / "samples"
MODULE = SAMPLES / "clean.eds"
"""A device with everything that a suite looks at but write-only objects."""

MAKERS = Path(__file__).parent / "makers"
"""Files in the style of makers, of no device that there is: guarding, SYNC, little else."""

IO_MODULE, AXIS_DRIVE = MAKERS / "io-module.eds", MAKERS / "axis-drive.eds"

NODE_ID = 5


@cache
def suites(file: Path, *, tier: Tier = Tier.REVERSIBLE) -> list[Suite]:
    """Return the conformance suites of a file, read as any others are."""
    return suites_of(Dictionary.load(file, NODE_ID), tier=tier)


def suites_of(dictionary: Dictionary, *, tier: Tier = Tier.REVERSIBLE) -> list[Suite]:
    """Return the conformance suites of a dictionary."""
    file = dictionary.file
    networks = Networks(lambda _: file, load=lambda _: (dictionary,), refused=lambda _: None)
    return SuiteReader(networks).read_texts({file: suite.text(dictionary, tier)})


def of_kind(kind: type[Node]) -> MakeNodes:
    """Return what makes devices of a class."""
    return lambda dictionaries, _seed, _clock: [NodeUnderTest(kind(each)) for each in dictionaries.values()]


def steps(
    file: Path,
    kind: type[Node] = SimulatedDevice,
    *,
    tier: Tier = Tier.REVERSIBLE,
    keep_going: bool = True,
    chapter: str | None = None,
) -> Iterator[StepResult]:
    """Run all suites of a file, or that of one chapter, and give the results of their steps."""
    run = partial(run_simulated, options=RunOptions(keep_going), make_nodes=of_kind(kind))
    for each in suites(file, tier=tier):
        if chapter is None or chapter in each.tags:
            yield from run(each).steps


@cache
def asked_for_everything(file: Path) -> list[StepResult]:
    """Run all suites of a file up to the destructive ones, once for all tests."""
    return list(steps(file, tier=Tier.DESTRUCTIVE))


def run_all(dictionary: Dictionary, *, tier: Tier = Tier.REVERSIBLE) -> list[StepResult]:
    """Run all suites of a dictionary against the device simulated from it."""
    run = partial(run_simulated, options=RunOptions(keep_going=True), make_nodes=of_kind(SimulatedDevice))
    return [step for each in suites_of(dictionary, tier=tier) for step in run(each).steps]
