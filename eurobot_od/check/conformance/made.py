"""The suites that are generated from device files: by which standard, and up to which tier."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from eurobot_od.check.conformance import profiles
from eurobot_od.check.conformance import suite as chapters
from eurobot_od.check.conformance.clauses import Tier
from eurobot_od.check.conformance.page import DeviceRun
from eurobot_od.check.report import SuiteResult
from eurobot_od.errors import LocalError
from eurobot_od.od import cia401
from eurobot_od.od.dictionary import Dictionary


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
        """Return the suites of each device, by the file name for reports; raises LocalError."""
        is_reversible = self.tier is not Tier.READING
        if self.profile is None:
            make = partial(chapters.text, tier=self.tier)
        elif self.profile == cia401.PROFILE:
            make = partial(profiles.module_text, reversible=is_reversible, outputs=self.outputs)
        else:
            motion = profiles.MotionBounds(*self.motion) if self.motion else None
            make = partial(profiles.drive_text, reversible=is_reversible, motion=motion)
        return {file_of(each): make(each) for each in dictionaries}

    def device_runs(
        self, dictionaries: Iterable[Dictionary], results: Sequence[SuiteResult], made: str
    ) -> list[DeviceRun]:
        """Return the results by device; `made` says by which program and when."""
        of_device = {each: [result for result in results if result.file == file_of(each)] for each in dictionaries}
        return [DeviceRun(each, self.tier, own, made) for each, own in of_device.items()]


def parse_motion(text: str) -> tuple[int, int]:
    """Parse the distance and velocity of a motor; raises LocalError."""
    distance, _, velocity = (int(each) if each.isdecimal() and len(each) < 10 else 0 for each in text.partition("@"))
    if not (distance and velocity):
        raise LocalError(f"{text!r}: a distance and a velocity above 0, such as 2000@100")
    return distance, velocity


def file_of(device: Dictionary) -> Path:
    """Return the file name of a device's suites."""
    return Path(f"{device.name}.yaml")
