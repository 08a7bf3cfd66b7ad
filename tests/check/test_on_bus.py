"""Suites run against simulated nodes made from anybody's EDS files, the same way with each run."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

import pytest

from eurobot_od.check.format import SuiteReader
from eurobot_od.check.on_bus import NodeUnderTest, run_simulated
from eurobot_od.check.report import Status, as_data, remarks
from eurobot_od.check.runner import Interrupt, RunOptions
from eurobot_od.check.shapes import Networks
from eurobot_od.device.node import Node
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from tests.check.suites import document, results, suite
from tests.kit import plant

SAMPLES = Path(__file__).parents[1] / "lint" / "samples"
FILES = ("clean", "crlf_io_module", "editor_with_comments", "generated", "old")
HEAD = "spec: 1\nname: somebody's device\n"
STEPS = """
- nmt: reset
- heartbeat: boot-up
- sdo: {read: 0x1000, save: type}
- sdo: {read: '0x1000:0', expect: "{type}"}
- sdo: {read: 0x5FFF, abort: 0x06020000}
"""


def plain_nodes(dictionaries: Mapping[str, Dictionary], _seed: int, _clock: object) -> list[NodeUnderTest]:
    return [NodeUnderTest(Node(each)) for each in dictionaries.values()]


@pytest.mark.parametrize("name", FILES)
def test_a_device_made_from_its_eds_alone_passes(tmp_path: Path, name: str) -> None:
    eds = (SAMPLES / f"{name}.eds").read_text() + "[DeviceComissioning]\nNodeID=5\n"
    (tmp_path / "device.eds").write_text(eds)
    file = tmp_path / "suite.yaml"
    file.write_text(document(STEPS, HEAD))
    (suite,) = SuiteReader(Networks(lambda _: tmp_path)).read_files([file])
    result = run_simulated(suite, RunOptions(), plain_nodes)
    assert [step.status for step in result.steps] == 5 * [Status.PASSED]


def test_a_program_restarts_with_each_boot_of_its_node() -> None:
    begun: list[str] = []

    def nodes(dictionaries: Mapping[str, Dictionary], _seed: int, _clock: object) -> list[NodeUnderTest]:
        async def program() -> None:
            begun.append("begun")

        return [NodeUnderTest(Node(each), program) for each in dictionaries.values()]

    boot = "- nmt: reset\n- heartbeat: boot-up\n- wait: 1 s\n"
    run_simulated(suite(document(2 * boot)), RunOptions(), nodes)
    assert len(begun) == 1 + 2


class Broken(Node):
    """Fails with each frame that it hears."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        super().receive(frame, now)
        raise IndexError("no such floor")


def test_an_exception_of_a_node_is_reported_once_with_its_line() -> None:
    def nodes(dictionaries: Mapping[str, Dictionary], _seed: int, _clock: object) -> list[NodeUnderTest]:
        return [NodeUnderTest(Broken(each)) for each in dictionaries.values()]

    result = run_simulated(suite(document(2 * "- send: Place Request\n- wait: 1 s\n")), RunOptions(), nodes)
    (line,) = remarks([result])
    assert re.fullmatch(r"suite.yaml: a suite: lift has failed: .*test_on_bus.py:\d+: IndexError: .*", line)
    assert as_data([result])[0]["remarks"] == [*result.remarks]


def test_the_same_seed_gives_the_same_frames() -> None:
    one, other = (results(document("- send: Place Request\n- expect: Move Confirm")) for _ in range(2))
    assert one.steps == other.steps
    assert one.steps[1].reason is not None
    assert len(one.steps[1].reason.frames) > 1


def test_the_processing_time_of_a_node_comes_from_the_seed() -> None:
    steps = document("- send: Check Lift Request\n- expect: Check Lift Response")
    seconds = {round(results(steps, seed=seed).steps[1].seconds, 6) for seed in range(1, 9)}
    assert len(seconds) > 2


def test_an_interrupt_ends_a_repeated_step_without_waiting() -> None:
    """A loop in which nothing is waited for gave the interrupt no turn."""
    interrupt = Interrupt()
    steps = "- wait: 1 ms\n- repeat: 1000\n  steps: [{answer: {Move State Request: Move Confirm}, repeat: 100}]"
    options = RunOptions(interrupt=interrupt, show=lambda _: interrupt.request())
    result = run_simulated(suite(document(steps)), options, plant.PLUGINS.under_test)
    assert [step.status for step in result.steps] == [Status.PASSED, Status.INTERRUPTED]
