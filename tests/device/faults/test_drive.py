"""Each fault of a drive turns its step of the suite by CiA 402 red, and none before it; a healthy drive is green."""

from __future__ import annotations

from functools import cache

import pytest

from eurobot_od.check.conformance import drive
from eurobot_od.check.conformance.drive import MotionBounds
from eurobot_od.check.reader import SuiteReader
from eurobot_od.check.results import Status, StepResult
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.simulated import run_simulated
from eurobot_od.check.suite import Suite
from eurobot_od.check.vocabulary import Networks
from eurobot_od.device.faults.drive import FAULTS
from eurobot_od.device.profiles.devices import SimulatedDrive
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary
from tests.check.conformance.devices import of_kind
from tests.client.servo import EDS, SERVO

LIMITS = MotionBounds(2000, 100)


def suites_of(text: str, dictionary: Dictionary = SERVO) -> list[Suite]:
    networks = Networks(lambda _: EDS, load=lambda _: (dictionary,), refused=lambda _: None)
    return SuiteReader(networks).read_texts({EDS: text})


@cache
def suite(reversible: bool = True, motion: MotionBounds | None = LIMITS) -> Suite:
    (found,) = suites_of(drive.text(SERVO, reversible, motion))
    return found


def steps(kind: type[SimulatedDevice], suite: Suite, keep_going: bool = True) -> list[StepResult]:
    return list(run_simulated(suite, RunOptions(keep_going), of_kind(kind)).steps)


def test_a_healthy_drive_is_green() -> None:
    done = steps(SimulatedDrive, suite())
    assert {each.status for each in done} == {Status.PASSED}
    assert len(done) > 300


@pytest.mark.long
@pytest.mark.parametrize("name", FAULTS)
def test_the_first_red_step_is_the_one_that_the_fault_names(name: str) -> None:
    done = steps(FAULTS[name].given_to(SimulatedDrive), suite(), keep_going=False)
    first = next(each for each in done if each.status is Status.FAILED)
    assert first.name.startswith(FAULTS[name].caught_by.step)


def test_a_device_that_does_not_move_is_red() -> None:
    done = steps(SimulatedDevice, suite(), keep_going=False)
    assert next(each for each in done if each.status is Status.FAILED).name.startswith("8.1 States: ")


@pytest.mark.parametrize(("reversible", "states"), [(False, set()), (True, {"Ready to switch on", "Switched on"})])
def test_without_motion_the_motor_gets_no_torque(reversible: bool, states: set[str]) -> None:
    moved: list[float] = []
    seen: set[str] = set()

    class Watched(SimulatedDrive):
        def _changed(self) -> list[object]:  # type: ignore[override]
            frames = super()._changed()
            seen.update(axis.state.words for axis in self.axes)
            moved.extend(axis.motor.position for axis in self.axes)
            return frames  # type: ignore[return-value]

    done = steps(Watched, suite(reversible, None))
    assert {each.status for each in done} <= {Status.PASSED, Status.SKIPPED}
    assert seen - {"Not ready to switch on", "Switch on disabled"} == states
    assert {*moved} == {0.0}


def test_nothing_is_faster_or_farther_than_it_may_be() -> None:
    places: list[float] = []
    speeds: list[float] = []

    class Watched(SimulatedDrive):
        def tick(self, now: float) -> list[object]:  # type: ignore[override]
            frames = super().tick(now)
            places.append(self.axes[0].motor.position - self.axes[0].motor.origin)
            speeds.append(abs(self.axes[0].motor.velocity))
            return frames  # type: ignore[return-value]

    done = steps(Watched, suite())
    assert {each.status for each in done} == {Status.PASSED}
    turn, rpm = 4096, 4096 / 60
    assert max(speeds) <= LIMITS.velocity * rpm * 1.02
    assert max(places) <= LIMITS.way + turn  # and what profile velocity needs to be reached, and to stop


def test_a_file_without_the_modes_skips_them() -> None:
    text = EDS.read_text(encoding="utf-8").replace("DefaultValue=0x000003AD", "DefaultValue=0x00000200")
    dictionary = Dictionary.read(text.encode(), EDS, 5)
    (found,) = suites_of(drive.text(dictionary, motion=LIMITS), dictionary)
    skipped = [each.name for each in steps(SimulatedDrive, found) if each.status is Status.SKIPPED]
    assert [each.split(":")[0] for each in skipped] == ["11.1 Homing", "10.1 Profile position", "14.1 Profile velocity"]
