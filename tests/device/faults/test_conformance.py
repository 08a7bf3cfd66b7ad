"""Each fault that is one against CiA 301 turns its step of the conformance suite red, and none before it."""

from __future__ import annotations

import pytest

from eurobot_od.check.conformance.subject import Tier
from eurobot_od.check.results import Status
from eurobot_od.device.faults import conformance, device
from eurobot_od.device.faults.fault import Fault
from eurobot_od.device.simulated import SimulatedDevice
from tests.check.conformance.devices import MODULE, steps, suites

FOUND: dict[str, tuple[Fault, str]] = {
    **{name: (fault, fault.caught_by.step) for name, fault in conformance.FAULTS.items()},
    **{name: (device.FAULTS[name], step) for name, step in conformance.ALSO_FOUND.items()},
}


def first_red(fault: Fault, chapter: str | None = None) -> str:
    """Return the name of the first step that is red on a device with a fault, of all chapters or of one."""
    kind = fault.given_to(SimulatedDevice)
    done = steps(MODULE, kind, tier=Tier.DESTRUCTIVE, keep_going=False, chapter=chapter)
    return next(each.name for each in done if each.status is Status.FAILED)


def chapter_of(step: str) -> str:
    """Return the word of the chapter that has a step."""
    return next(
        each.tags[-1]
        for each in suites(MODULE, tier=Tier.DESTRUCTIVE)
        if any(one.name.startswith(step) for one in (*each.setup, *each.steps))
    )


@pytest.mark.parametrize("name", FOUND)
def test_the_first_red_step_of_its_chapter_is_the_one_that_the_fault_names(name: str) -> None:
    fault, step = FOUND[name]
    assert first_red(fault, chapter_of(step)).startswith(step)


@pytest.mark.long
@pytest.mark.parametrize("name", FOUND)
def test_the_first_red_step_is_the_one_that_the_fault_names(name: str) -> None:
    fault, step = FOUND[name]
    assert first_red(fault).startswith(step)


def test_there_are_faults_of_every_chapter() -> None:
    assert len(FOUND) >= 60
    assert {step.split()[0] for _, step in FOUND.values()} >= {
        *("7.2.8.3.3", "7.2.8.2.1", "7.3.2.2.4", "7.5.2.20"),  # NMT
        *("7.3.2.2.3", "7.4.5", "7.5.2.21", "7.2.4.3.17"),  # objects
        *("7.2.4.3.4", "7.2.4.3.7", "7.2.4.3.12"),  # SDO
        *("7.5.2.35", "7.5.2.36", "7.5.2.37", "7.5.2.38", "7.2.2.2"),  # PDOs
        *("7.2.7", "7.5.2.4", "7.5.2.13", "7.5.2.14"),  # EMCY, store, restore
    }
