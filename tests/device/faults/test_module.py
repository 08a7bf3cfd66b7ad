"""Each fault of an I/O module turns its step of the suite by CiA 401 red, and none before it."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import pytest

from eurobot_od.check.conformance import module
from eurobot_od.check.reader import SuiteReader
from eurobot_od.check.results import Status, StepResult
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.simulated import run_simulated
from eurobot_od.check.suite import Suite
from eurobot_od.check.vocabulary import Networks
from eurobot_od.device.faults.drive import FAULTS as DRIVE_FAULTS
from eurobot_od.device.faults.module import FAULTS
from eurobot_od.device.profiles.devices import SimulatedModule, simulated_kind
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.errors import LocalError
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address
from tests.check.conformance.devices import IO_MODULE, of_kind

EDS = Path(__file__).parents[3] / "docs" / "io.eds"
MODULE = Dictionary.load(EDS, 5)

WIRES: Mapping[Address, Address] = {(0x6200, 1): (0x6000, 1), (0x6411, 1): (0x6401, 1)}
"""An output of each sort, and the input that it is wired to."""

WIRED = simulated_kind(MODULE, wires=WIRES)


@cache
def suite(reversible: bool = True, outputs: bool = True, wired: bool = True, file: Path = EDS) -> Suite:
    dictionary = Dictionary.load(file, 5)
    text = module.text(dictionary, reversible, outputs, WIRES if wired else None)
    (found,) = SuiteReader(Networks(lambda _: file, load=lambda _: (dictionary,), refused=lambda _: None)).read_texts(
        {file: text}
    )
    return found


def steps(kind: type[SimulatedDevice], suite: Suite, keep_going: bool = True) -> list[StepResult]:
    return list(run_simulated(suite, RunOptions(keep_going), of_kind(kind)).steps)


def test_a_healthy_module_is_green() -> None:
    done = steps(WIRED, suite())
    assert {each.status for each in done} == {Status.PASSED}
    assert len(done) > 600


@pytest.mark.parametrize("name", FAULTS)
def test_the_first_red_step_is_the_one_that_the_fault_names(name: str) -> None:
    done = steps(FAULTS[name].given_to(WIRED), suite(), keep_going=False)
    first = next(each for each in done if each.status is Status.FAILED)
    assert first.name.startswith(FAULTS[name].caught_by.step)


def test_drives_and_modules_have_twenty_faults_and_more() -> None:
    assert len({*DRIVE_FAULTS, *FAULTS}) == len(DRIVE_FAULTS) + len(FAULTS) >= 20


class Watched(SimulatedModule):
    """Keeps what has been on the terminals of its outputs."""

    seen: set[tuple[Address, int]]

    def _changed(self) -> list[object]:  # type: ignore[override]
        frames = super()._changed()
        self.seen.update(self.outputs.items())
        return frames  # type: ignore[return-value]


@pytest.mark.parametrize("reversible", [False, True])
def test_nothing_is_switched_without_the_option_for_it(reversible: bool) -> None:
    seen: set[tuple[Address, int]] = set()
    done = steps(type("Kept", (Watched,), {"seen": seen}), suite(reversible, False, False))
    assert {each.status for each in done} <= {Status.PASSED, Status.SKIPPED}
    assert {value for _, value in seen} == {0}


def test_with_it_outputs_are_switched_and_are_as_after_power_on_in_the_end() -> None:
    seen: set[tuple[Address, int]] = set()
    kept = list[SimulatedModule]()

    class Kept(Watched):
        def __init__(self, *arguments: object, **options: object) -> None:
            self.seen = seen
            super().__init__(*arguments, **options)  # type: ignore[arg-type]
            kept.append(self)

    steps(Kept, suite(wired=False))
    assert ((0x6200, 1), 0xFF) in seen
    assert {*kept[-1].outputs.values()} == {0}


def test_without_a_wire_what_only_a_terminal_shows_is_skipped() -> None:
    done = steps(SimulatedModule, suite(wired=False))
    skipped = {each.name.partition(":")[0] for each in done if each.status is Status.SKIPPED}
    assert {each.caught_by.step.partition(":")[0] for each in FAULTS.values()} - skipped == {
        "0x6002 Polarity of inputs"
    }
    assert all(each.status in (Status.PASSED, Status.SKIPPED) for each in done)


def test_a_makers_file_with_nothing_but_inputs_and_outputs_is_green() -> None:
    done = steps(SimulatedModule, suite(wired=False, file=IO_MODULE))
    assert {each.status for each in done} == {Status.PASSED, Status.SKIPPED}


WRONG_WIRES = {
    "an input to an output": {(0x6000, 1): (0x6200, 1)},
    "a digital output to an analogue input": {(0x6200, 1): (0x6401, 1)},
    "an output that the file lacks": {(0x6200, 3): (0x6000, 1)},
    "an input that the file lacks": {(0x6411, 1): (0x6401, 9)},
}


@pytest.mark.parametrize("wires", WRONG_WIRES.values(), ids=WRONG_WIRES)
def test_a_wire_that_cannot_be_is_refused(wires: Mapping[Address, Address]) -> None:
    with pytest.raises(LocalError, match="no wire can lead from 0x6"):
        module.text(MODULE, outputs=True, wires=wires)
