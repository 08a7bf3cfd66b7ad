"""Each fault that is one against CiA 301 turns its step of the conformance suites red, and none before it."""

from __future__ import annotations

from functools import cache

import pytest

from eurobot_od.check.conformance import suite
from eurobot_od.check.conformance.clauses import Tier
from eurobot_od.device.faults import Fault
from eurobot_od.device.simulated import SimulatedDevice
from tests.kit.devices import MODULE, first_red, suites
from tests.kit.faults import CONFORMANCE
from tests.rows import rows


@cache
def by_chapter() -> dict[str, dict[str, Fault]]:
    """Return the faults by the chapter that finds them; what all of them find is the first one's."""
    chapters = {
        step.name: each.tags[-1]
        for each in reversed(suites(MODULE, Tier.DESTRUCTIVE))
        for step in (*each.setup, *each.steps)
    }
    found: dict[str, dict[str, Fault]] = {each.word: {} for each in suite.CHAPTERS}
    for name, fault in CONFORMANCE.items():
        found[next(chapters[step] for step in chapters if step.startswith(fault.caught_by.step))][name] = fault
    return found


def wrong(chapter: str, faults: dict[str, Fault]) -> dict[str, str]:
    """Return the first red step of each fault that turns another one red than it names."""
    asked = suites(MODULE, Tier.DESTRUCTIVE, chapter)
    red = {name: first_red(asked, fault.given_to(SimulatedDevice)) for name, fault in faults.items()}
    return {name: step for name, step in red.items() if not step.startswith(faults[name].caught_by.step)}


@pytest.mark.long
@pytest.mark.parametrize("chapter", [each.word for each in suite.CHAPTERS])
def test_the_first_red_step_of_a_chapter_is_the_one_named_by_the_fault(chapter: str) -> None:
    assert (faults := by_chapter()[chapter])
    assert wrong(chapter, faults) == {}


@rows("chapter, name", ((chapter, name) for chapter, faults in by_chapter().items() for name in faults), sample=3)
def test_a_single_fault_makes_its_named_step_red(chapter: str, name: str) -> None:
    assert wrong(chapter, {name: CONFORMANCE[name]}) == {}


def test_every_chapter_has_faults() -> None:
    assert len(CONFORMANCE) >= 60
    assert {fault.caught_by.step.split()[0] for fault in CONFORMANCE.values()} >= {
        *("7.2.8.3.3", "7.2.8.2.1", "7.3.2.2.4", "7.5.2.20"),  # NMT
        *("7.3.2.2.3", "7.4.5", "7.5.2.21", "7.2.4.3.17"),  # objects
        *("7.2.4.3.4", "7.2.4.3.7", "7.2.4.3.12"),  # SDO
        *("7.5.2.35", "7.5.2.36", "7.5.2.37", "7.5.2.38", "7.2.2.2"),  # PDOs
        *("7.2.7", "7.5.2.4", "7.5.2.13", "7.5.2.14"),  # EMCY, store, restore
    }
