"""Writes the suites of devices as text: those of CiA 301 from all chapters, or of a profile, up to which tier."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from eurobot_od.check.conformance import broadcasts, nmt, objects, page, pdo, profiles, sdo, step, storage
from eurobot_od.check.conformance.clauses import ANSWERS, Chapter, DeviceUnderTest, StepName, Tier, awake
from eurobot_od.check.conformance.page import DeviceRun
from eurobot_od.check.conformance.step import Data, documents, hexadecimal, title
from eurobot_od.check.report import AS_THEY_WERE, ONLY_WITH, RunFacts, SuiteResult
from eurobot_od.device.profiles import KINDS
from eurobot_od.errors import LocalError
from eurobot_od.export.forms import DocBlock
from eurobot_od.od import cia401
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import ERRORS, VERIFY_CONFIGURATION
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.od.words import profile_of

CHAPTERS = (
    *(each.CHAPTER for each in (nmt, objects, sdo, storage, pdo)),
    broadcasts.EMCY_CHAPTER,
    nmt.GUARDED,
    broadcasts.SYNC_CHAPTER,
)
"""The suites in the order in which they are run: later ones rely on services that earlier ones test."""


def text(dictionary: Dictionary, tier: Tier = Tier.READING) -> str:
    """Return the conformance suites of a device, one per chapter, with the steps up to a tier."""
    return documents(_suite(DeviceUnderTest(dictionary, tier), chapter) for chapter in CHAPTERS)


MARKS = {"7.5.2.4": (Tier.DESTRUCTIVE, [ERRORS]), "7.5.2.23": (Tier.READING, VERIFY_CONFIGURATION)}
"""Objects that the device itself changes during a run, by clause, with the first tier where it does.

They are restored: errors that it remembers, and the date of its configuration, which masters rely on.
"""


def _suite(device: DeviceUnderTest, chapter: Chapter[DeviceUnderTest]) -> Data:
    # The reading tier sends no NMT command, as a reset would stop a device at work.
    resets = device.tier.allows(Tier.REVERSIBLE)
    reset = {**step.nmt("reset"), "name": "7.3.2.2.3 NMT: reset, for the values of power-on [reversible]"}
    pause = {**step.nmt("pre-operational"), "name": "7.2.8.2.1 NMT: to PRE-OPERATIONAL [reversible]", "needed": "no"}
    # Not needed, so that a device without boot-up is red for that only.
    up = {**step.booted("7.2.8.3.3 Boot-up: boot-up after reset [reversible]"), "needed": "no"}
    alive = awake(device, ANSWERS)
    marks = {clause: device.kept(each) for clause, (tier, each) in MARKS.items() if device.tier.allows(tier)}
    named = [(f"{clause} Values: {title(each[0])}", each) for clause, kept in marks.items() for each in kept]
    kept = [{**step.save(*each), "name": f"{name} [reading]", "needed": "no"} for name, each in named]
    back = [{**step.put_back(*each), "name": f"{name} is as it was [reading]"} for name, each in named]
    alone = {"name": "7.2.8.2.1 NMT: nobody else commands [reversible]", "unheard": hexadecimal(NMT_COB_ID, 3)}
    first = {"name": "7.4 Values: they are read, to be compared in the end [reading]", "dump": "before", "needed": "no"}
    last = {"name": AS_THEY_WERE, "dump": "equal"}
    return chapter.suite(
        device,
        "conformance",
        [*([reset, up] * resets), alive, *([pause] * resets), *kept, first],
        [*([reset, up, alive] * resets), *back, last, *([alone] * resets)],
    )


def _numbers(steps: Iterable[Data], before: str = "") -> Iterator[str]:
    """Yield the numbers of CiA's tool that steps ask, without those that are only skipped."""
    for each in steps:
        name = StepName.of(f"{before}{each['name']}")
        if name is not None and "skip" not in each:
            yield from name.numbers
        yield from _numbers(each.get("steps", ()), f"{before}{each['name']}: ")


class MadeSuites(NamedTuple):
    """Suites by CiA 301, or by a device `profile` (401, 402), up to a `tier`.

    `motion`, a distance and a velocity in the drive's units, lets those of 402 move the motor; `outputs` lets those of
    401 switch outputs.
    """

    profile: int | None = None
    tier: Tier = Tier.READING
    motion: tuple[int, int] | None = None
    outputs: bool = False

    def texts(self, dictionaries: Iterable[Dictionary]) -> dict[Path, str]:
        """Return the suites of each device of the profile, by the file name for reports; raises LocalError."""
        is_reversible = self.tier is not Tier.READING
        if self.profile is None:
            make = partial(text, tier=self.tier)
        elif self.profile == cia401.PROFILE:
            make = partial(profiles.module_text, reversible=is_reversible, outputs=self.outputs)
        else:
            motion = profiles.MotionBounds(*self.motion) if self.motion else None
            make = partial(profiles.drive_text, reversible=is_reversible, motion=motion)
        return {file_of(each): make(each) for each in self._fitting(list(dictionaries))}

    def _fitting(self, dictionaries: Sequence[Dictionary]) -> list[Dictionary]:
        """Return the devices without those of another profile; raises LocalError if these are all."""
        others = self.others(dictionaries)
        if others and len(others) == len(dictionaries):
            raise LocalError("; ".join(others.values()))
        return [each for each in dictionaries if each.name not in others]

    def others(self, dictionaries: Iterable[Dictionary]) -> dict[str, str]:
        """Return of which other profile devices are, by their names; nothing if none is asked."""
        said = {each.name: (each.file, profile_of(each.objects)) for each in dictionaries if self.profile is not None}
        return {
            name: f"{file}: 0x1000 says CiA {profile}, not {self.profile}: write --profile {profile}"
            for name, (file, profile) in said.items()
            if profile in KINDS and profile != self.profile
        }

    def device_runs(self, results: Sequence[SuiteResult], run: RunFacts) -> list[DeviceRun]:
        """Return the results by device."""
        found = []
        for each in run.devices:
            own = [result for result in results if result.file == file_of(each.dictionary)]
            found.append(DeviceRun(each, self.tier, own, run, self._beyond(each.dictionary, own)))
        return found

    def blocks(self, results: Sequence[SuiteResult], run: RunFacts) -> Iterator[DocBlock]:
        """Yield the report of each device."""
        for each in self.device_runs(results, run):
            yield from page.blocks(each)

    def _beyond(self, dictionary: Dictionary, results: Iterable[SuiteResult]) -> dict[str, str]:
        """Return why no step asked the tests of CiA's tool that a higher tier asks, in the chapters that were run."""
        names = {each.name for each in results}
        chapters = [each for each in CHAPTERS if each.about in names]
        reasons: dict[str, str] = {}
        for tier in (Tier.DESTRUCTIVE, Tier.REVERSIBLE):  # the lower one last, as it is enough
            if not self.tier.allows(tier):
                made = [_suite(DeviceUnderTest(dictionary, tier), each) for each in chapters]
                numbers = (number for suite in made for number in _numbers(suite["steps"]))
                reasons |= dict.fromkeys(numbers, f"{ONLY_WITH}--{tier.value}")
        return reasons


def parse_motion(text: str) -> tuple[int, int]:
    """Parse the distance and velocity of a motor; raises LocalError."""
    distance, _, velocity = (int(each) if each.isdecimal() and len(each) < 10 else 0 for each in text.partition("@"))
    if not (distance and velocity):
        raise LocalError(f"{text!r}: a distance and a velocity above 0, such as 2000@100")
    return distance, velocity


def file_of(device: Dictionary) -> Path:
    """Return the file name of a device's suites."""
    return Path(f"{device.name}.yaml")
