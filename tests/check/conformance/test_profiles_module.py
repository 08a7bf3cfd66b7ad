"""The suite by CiA 401: green on a healthy module, red on a faulty one, outputs as before in the end."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

from eurobot_od.check.conformance.profiles import module_text
from eurobot_od.check.report import Status
from eurobot_od.check.suite import Suite
from eurobot_od.device.profiles import SimulatedModule
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address
from tests.kit.devices import IO_MODULE, first_red, read, steps
from tests.kit.faults import PolarityIgnored

EDS = Path(__file__).parents[3] / "docs" / "io.eds"


@cache
def suite(reversible: bool = True, outputs: bool = True, file: Path = EDS) -> list[Suite]:
    dictionary = Dictionary.load(file, 5)
    return read(dictionary, module_text(dictionary, reversible, outputs))


def test_a_module_without_faults_is_green() -> None:
    done = list(steps(suite(), SimulatedModule))
    assert {each.status for each in done} == {Status.PASSED}
    assert len(done) > 150


def test_a_module_that_ignores_the_polarity_of_its_inputs_is_red() -> None:
    assert first_red(suite(), PolarityIgnored).startswith("0x6002 Polarity of inputs: ")


class Watched(SimulatedModule):
    """Keeps what has been on the terminals of its outputs."""

    seen: set[tuple[Address, int]]

    def _changed(self) -> list[object]:  # type: ignore[override]
        frames = super()._changed()
        self.seen.update(self.outputs.items())
        return frames  # type: ignore[return-value]


@pytest.mark.parametrize("reversible", [False, True])
def test_without_outputs_nothing_is_switched(reversible: bool) -> None:
    seen: set[tuple[Address, int]] = set()
    done = steps(suite(reversible, False), type("Kept", (Watched,), {"seen": seen}))
    assert {each.status for each in done} <= {Status.PASSED, Status.SKIPPED}
    assert {value for _, value in seen} == {0}


def test_with_outputs_they_are_switched_and_restored() -> None:
    seen: set[tuple[Address, int]] = set()
    kept = list[SimulatedModule]()

    class Kept(Watched):
        def __init__(self, *arguments: object, **options: object) -> None:
            self.seen = seen
            super().__init__(*arguments, **options)  # type: ignore[arg-type]
            kept.append(self)

    assert list(steps(suite(), Kept))
    assert ((0x6200, 1), 0xFF) in seen
    assert {*kept[-1].outputs.values()} == {0}


def test_a_manufacturers_file_of_inputs_and_outputs_is_green() -> None:
    done = steps(suite(file=IO_MODULE), SimulatedModule)
    assert {each.status for each in done} == {Status.PASSED, Status.SKIPPED}


def test_only_the_functions_that_a_module_says_it_has_are_read(tmp_path: Path) -> None:
    file = tmp_path / "outputs.eds"
    file.write_text(EDS.read_text().replace("DefaultValue=0x000F0191", "DefaultValue=0x00020191"))
    done = {each.name: each.status for each in steps(suite(False, False, file), SimulatedModule)}
    read_ones = [name for name, status in done.items() if "Device type" in name and status is Status.PASSED]
    assert [name.split(": ")[1] for name in read_ones] == ["an I/O module [reading]", "digital outputs [reading]"]
