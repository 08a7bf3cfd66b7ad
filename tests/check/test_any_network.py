"""Suites for devices that nobody here wrote: nodes, messages and objects of any network, simulated and on a bus."""

from __future__ import annotations

import shutil
from contextlib import ExitStack
from pathlib import Path

import pytest

from eurobot_od.bus import live as runtime
from eurobot_od.check.format import SuiteReader
from eurobot_od.check.on_bus import run_live, run_simulated
from eurobot_od.check.report import Status, SuiteResult
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.shapes import Networks
from eurobot_od.check.suite import Suite
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od import network
from eurobot_od.od.network import NodeFile
from tests.kit import plant

SAMPLES = Path(__file__).parents[1] / "lint" / "samples"

SUITE = """
spec: 1
name: somebody's motor, and a panel
node: [my motor, panel]
steps:
  - nmt: start
  - name: an object by its name, of the node that is named
    sdo: {write: Outputs and inputs.Input, value: 77, node: my motor}
  - sdo: {read: "0x2001:3", expect: 77, node: my motor}
  - sdo: {write: "0x1800:5", value: 100, node: my motor}
  - name: a message by its node and its PDO, its fields by the mapped objects
    expect: {my motor.TPDO1: {measured value: 0, input: 77}}
  - save: {seen: my motor.TPDO1.input}
  - sdo: {read: "0x2001:3", expect: "{seen}", node: my motor}
  - send: {my motor.RPDO2: {set value: -7}}
  - name: what it was sent is in its object
    sdo: {read: Set value, expect: -7, node: my motor}
  - sdo: {read: Device Type, node: panel}
  - nmt: {command: reset, node: panel}
  - heartbeat: {state: boot-up, node: panel}
"""


@pytest.fixture
def files(tmp_path: Path) -> list[NodeFile]:
    """The files of two devices, one with a blank in its name."""
    motor = shutil.copy(SAMPLES / "clean.eds", tmp_path / "my motor.eds")
    panel = shutil.copy(SAMPLES / "crlf_io_module.eds", tmp_path / "panel.eds")
    return [NodeFile(str(motor), 5), NodeFile(str(panel), 6)]


def from_files(files: list[NodeFile]) -> Networks:
    return Networks(lambda _: Path(), load=lambda _: network.load(files))


def from_folder(files: list[NodeFile]) -> Networks:
    """Both in one folder with a network file, which gives them their names and node-IDs."""
    path = Path(files[0].file).with_name("eurobot-od.yaml")
    path.write_text("nodes:\n  my motor: {file: my motor.eds, node_id: 5}\n  panel: {file: panel.eds, node_id: 6}\n")
    return Networks(lambda _: path)


def read(networks: Networks) -> Suite:
    (suite,) = SuiteReader(networks).read_texts({Path("motor.yaml"): SUITE})
    return suite


def red(result: SuiteResult) -> list[str]:
    return [f"{each.name}: {each.reason}" for each in result.steps if each.status is not Status.PASSED]


@pytest.mark.parametrize("networks", [from_files, from_folder])
def test_simulated(files: list[NodeFile], networks: object) -> None:
    assert callable(networks)
    assert red(run_simulated(read(networks(files)), RunOptions(keep_going=True), plant.PLUGINS.under_test)) == []


def test_on_a_bus(files: list[NodeFile]) -> None:
    suite = read(from_files(files))
    with ExitStack() as stack:
        for each in suite.dictionaries.values():
            device = SimulatedDevice(each)
            stack.enter_context(runtime.Live.node(runtime.open_bus("virtual", "any network"), device))
        result = run_live(suite, RunOptions(keep_going=True), lambda: runtime.open_bus("virtual", "any network"))
    assert red(result) == []
