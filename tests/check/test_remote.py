"""Remote frames in suites: node guarding and a TPDO that is asked for, simulated and on a bus in this process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import can
import pytest

from eurobot_od.bus import live as runtime
from eurobot_od.check.format import SuiteReader
from eurobot_od.check.on_bus import run_live, run_simulated
from eurobot_od.check.report import Status, SuiteResult
from eurobot_od.check.runner import RunOptions
from eurobot_od.check.shapes import Networks
from eurobot_od.check.suite import Suite
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame, RemoteFrame
from eurobot_od.od.dictionary import Dictionary
from tests.kit.devices import IO_MODULE, NODE_ID, of_kind

TEXT = """
spec: 1
name: a device that is asked
node: io-module
steps:
  - nmt: reset communication
  - heartbeat: boot-up
  - send: {raw: "705#R1"}
  - expect: {raw: "705#7F"}
  - send: {raw: "705#R1"}
  - expect: {raw: "705#FF"}
  - send: {raw: "185#R2"}
  - {never: {raw: "185#????"}, for: 50 ms}
  - nmt: start
  - wait: 50 ms
  - send: {raw: "185#R2"}
  - expect: {raw: "185#0000"}
"""


def suite(text: str = TEXT) -> Suite:
    dictionary = Dictionary.load(IO_MODULE, NODE_ID)
    networks = Networks(lambda _: IO_MODULE, load=lambda _: (dictionary,))
    (read,) = SuiteReader(networks).read_texts({Path("asked.yaml"): text})
    return read


def simulated() -> SuiteResult:
    return run_simulated(suite(), RunOptions(), of_kind(SimulatedDevice))


def live() -> SuiteResult:
    def open_bus() -> can.BusABC:
        return runtime.open_bus("virtual", "remote frames")

    with runtime.Live.node(open_bus(), SimulatedDevice.load(IO_MODULE, NODE_ID)):
        return run_live(suite(), RunOptions(), open_bus)


@pytest.mark.parametrize("run", [simulated, live])
def test_a_remote_frame_is_answered(run: Callable[[], SuiteResult]) -> None:
    assert [each.name for each in run().steps if each.status is not Status.PASSED] == []


def test_a_remote_frame_is_written_as_candump_does() -> None:
    assert str(RemoteFrame(0x705, bytes(1))) == "705#R1"
    assert str(RemoteFrame(0x080)) == "080#R"
    assert RemoteFrame(0x705).is_remote
    assert not Frame(0x705).is_remote


def test_a_report_shows_a_remote_frame() -> None:
    red = suite(TEXT.replace("705#7F", "705#05"))
    step = run_simulated(red, RunOptions(), of_kind(SimulatedDevice)).steps[3]
    assert step.reason is not None
    assert [(str(each.frame), each.meaning) for each in step.reason.frames][-2] == ("705#R1", "remote frame")
