"""Each fault of a drive turns its step of the suite by CiA 402 red, and none before it; a healthy drive is green."""

from __future__ import annotations

from functools import cache

import pytest

from eurobot_od.check.conformance.profiles import MotionBounds, drive_text
from eurobot_od.check.report import Status
from eurobot_od.check.suite import Suite
from eurobot_od.device.faults import DRIVE_FAULTS
from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.dictionary import Dictionary
from tests.client.servo import EDS, SERVO
from tests.kit.devices import first_red, read, steps

LIMITS = MotionBounds(2000, 100)


@cache
def suite(reversible: bool = True, motion: MotionBounds | None = LIMITS) -> list[Suite]:
    return read(SERVO, drive_text(SERVO, reversible, motion))


def test_a_drive_without_faults_is_green() -> None:
    done = list(steps(suite(), SimulatedDrive))
    assert {each.status for each in done} == {Status.PASSED}
    assert len(done) > 300


def test_a_drive_that_was_homed_before_is_green() -> None:
    class Homed(SimulatedDrive):
        def tick(self, now: float) -> list[object]:  # type: ignore[override]
            for axis in self.axes:
                axis.homed = True
            return super().tick(now)  # type: ignore[return-value]

    assert [each.name for each in steps(suite(), Homed) if each.status is not Status.PASSED] == []


@pytest.mark.long
def test_the_first_red_step_is_the_one_named_by_the_fault() -> None:
    red = {name: first_red(suite(), fault.given_to(SimulatedDrive)) for name, fault in DRIVE_FAULTS.items()}
    assert {name: step for name, step in red.items() if not step.startswith(DRIVE_FAULTS[name].caught_by.step)} == {}


def test_a_drive_that_does_not_move_is_red() -> None:
    assert first_red(suite(), SimulatedDevice).startswith("8.1 States: ")


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

    done = steps(suite(reversible, None), Watched)
    assert {each.status for each in done} <= {Status.PASSED, Status.SKIPPED}
    assert seen - {"Not ready to switch on", "Switch on disabled"} == states
    assert {*moved} == {0.0}


def test_moves_stay_within_speed_and_distance() -> None:
    places: list[float] = []
    speeds: list[float] = []

    class Watched(SimulatedDrive):
        def tick(self, now: float) -> list[object]:  # type: ignore[override]
            frames = super().tick(now)
            places.append(self.axes[0].motor.position - self.axes[0].motor.origin)
            speeds.append(abs(self.axes[0].motor.velocity))
            return frames  # type: ignore[return-value]

    done = list(steps(suite(), Watched))
    assert {each.status for each in done} == {Status.PASSED}
    turn = 4096
    rpm = 4096 / 60
    assert max(speeds) <= LIMITS.velocity * rpm * 1.02
    assert max(places) <= LIMITS.distance + turn  # and what profile velocity needs to be reached, and to stop


LIMITED = [
    (0x6098, (0, 36), "11.1 Homing", "method 35"),
    (0x6098, (0, 34), "11.1 Homing", "the limits of 0x6098 allow none of the methods (37, 35)"),
    (0x607A, (0, 5000), "10.1 Profile position", "the limits of 0x607A do not allow -2000"),
    (0x6081, (0, 99), "10.1 Profile position", "the limits of 0x6081 do not allow 100"),
    (0x60FF, (1, 200), "14.1 Profile velocity", "the limits of 0x60FF do not allow 0"),
]


@pytest.mark.parametrize(
    ("index", "limits", "clause", "said"), LIMITED, ids=[f"{row[0]:#x} {row[1]}" for row in LIMITED]
)
def test_what_the_limits_of_the_file_forbid_is_not_asked(
    index: int, limits: tuple[int, int], clause: str, said: str
) -> None:
    low, high = limits
    section = f"[{index:04X}]\n"
    text = EDS.read_text().replace(section, f"{section}LowLimit={low}\nHighLimit={high}\n")
    limited = Dictionary.read(text.encode(), EDS, 5)
    made = drive_text(limited, True, LIMITS)
    assert read(limited, made)  # the reader refuses a value that the file does not allow
    assert said in made[made.index(clause) :]


def test_a_file_without_the_modes_skips_them() -> None:
    text = EDS.read_text(encoding="utf-8").replace("DefaultValue=0x000003AD", "DefaultValue=0x00000200")
    dictionary = Dictionary.read(text.encode(), EDS, 5)
    done = steps(read(dictionary, drive_text(dictionary, motion=LIMITS)), SimulatedDrive)
    skipped = [each.name for each in done if each.status is Status.SKIPPED]
    assert [each.split(":")[0] for each in skipped] == ["11.1 Homing", "10.1 Profile position", "14.1 Profile velocity"]
