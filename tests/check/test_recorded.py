"""A stretch of a log as a suite: green on the device of the log, and red on one that answers otherwise."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from eurobot_od.check.on_bus import NodeUnderTest, run_simulated
from eurobot_od.check.recorded import suite_of
from eurobot_od.check.report import Status, SuiteResult
from eurobot_od.check.runner import RunOptions
from eurobot_od.client.network import simulated
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.errors import LocalError, NodeRefused, UnknownName
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import Address, Value
from eurobot_od.traffic.meaning import Decoder
from tests.kit.devices import MOTOR, NODE_ID, read

DEVICE = Dictionary.load(MOTOR, NODE_ID).named("motor")
DECODER = Decoder([DEVICE])

TEMPERATURE: Address = (0x2100, 0)


def recorded() -> list[tuple[float, str, Frame]]:
    """Record how a master asks the motor, starts it, sets its target speed and waits."""
    log: list[tuple[float, str, Frame]] = []
    with simulated(DEVICE) as network:
        network.simulation.observers.append(lambda now, frame: log.append((now, "", frame)))
        node = network[NODE_ID]
        for name in ("Identity object.Vendor-ID", "Temperature", "Manufacturer device name", "Temperature"):
            node[name].value  # noqa: B018 (it is read)
        with pytest.raises(NodeRefused):
            network.master.node(NODE_ID).upload((0x5000, 0))
        with pytest.raises(NodeRefused):
            network.master.node(NODE_ID).download((0x1008, 0), b"A")
        network.master.node(NODE_ID).command(NmtCommand.START)
        network.sleep(2.0)
        node["Motor.Target speed"].value = 1500
        network.sleep(2.0)
        node["Motor.Target speed"].value  # noqa: B018
        for speed in (700, 700, 900):
            network.send(0x205, speed.to_bytes(2, "little"))
            network.sleep(0.5)
    return log


LOG = recorded()


def run(text: str, given: Mapping[str | Address, Value] | None = None) -> SuiteResult:
    """Run a suite against the motor, or one with other values."""
    (suite,) = read(DEVICE, text)
    return run_simulated(
        suite,
        RunOptions(keep_going=True),
        lambda known, *_: [NodeUnderTest(SimulatedDevice(each, given=given or {})) for each in known.values()],
    )


def test_a_recorded_suite_is_green_on_the_device_of_the_log() -> None:
    result = run(suite_of(DECODER, "motor", LOG, "as it was"))
    assert [(step.name, step.reason) for step in result.steps if step.status is not Status.PASSED] == []
    assert len(result.steps) > 8


def test_a_recorded_suite_has_objects_and_values_in_words() -> None:
    lines = suite_of(DECODER, "motor", LOG, "as it was").splitlines()
    assert lines[:4] == ["spec: 1", "name: as it was", "node: motor", "steps:"]
    assert "  - sdo: {read: 0x2100, expect: 20.0}  # Temperature" in lines
    assert """  - sdo: {read: "0x5000:0", abort: 0x06020000}""" in lines
    assert """  - sdo: {write: 0x1008, data: "41", abort: 0x06010002}  # Manufacturer device name""" in lines
    assert "  - nmt: start" in lines
    assert """  - sdo: {write: "0x2000:3", value: 1500}  # Motor.Target speed""" in lines
    assert any(line.startswith("  - period: {message: {heartbeat: operational}, every: 500 ms") for line in lines)
    assert any(line.startswith("  - period: {message: {motor.TPDO1:") for line in lines)


def test_an_rpdo_is_sent_again_when_its_data_changed() -> None:
    told = [line for line in suite_of(DECODER, "motor", LOG, "as it was").splitlines() if "send:" in line]
    assert told == [
        """  - send: {raw: "205#BC02"}  # motor.RPDO1: target_speed=700""",
        """  - send: {raw: "205#8403"}  # motor.RPDO1: target_speed=900""",
    ]


def test_a_recorded_field_has_the_range_of_its_values_or_the_one_that_it_had() -> None:
    log = [*LOG, *((LOG[-1][0] + 0.1 * n, "", Frame(0x185, bytes([n, 0, 9, 0, 0, 0, 0, 0]))) for n in range(1, 9))]
    text = suite_of(DECODER, "motor", log, "a ramp", begin=LOG[-1][0])
    assert "{motor.TPDO1: {speed: 1..8, current: 9," in text


def test_a_recorded_suite_is_red_on_a_device_with_other_answers() -> None:
    result = run(suite_of(DECODER, "motor", LOG, "as it was"), {TEMPERATURE: 300})
    red = [step for step in result.steps if step.status is Status.FAILED]
    assert red
    assert "Temperature" in red[0].name


def test_only_frames_between_begin_and_end_are_recorded() -> None:
    text = suite_of(DECODER, "motor", LOG, "a part", begin=0.5, end=2.5)
    assert "read: 0x2100" not in text
    assert 'write: "0x2000:3"' in text


def test_a_node_that_is_not_in_the_log_has_no_suite() -> None:
    with pytest.raises(LocalError, match="the log has nothing of motor in this stretch"):
        suite_of(DECODER, "motor", LOG[:1], "nothing", begin=9.0)
    with pytest.raises(UnknownName):
        suite_of(DECODER, "pump", LOG, "nobody")
