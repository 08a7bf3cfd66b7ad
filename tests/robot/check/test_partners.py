"""The robot's nodes under test: in one world, and a core that drives by itself."""

from __future__ import annotations

import pytest

from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.plugin import Plugins
from eurobot_od.robot import dialects
from eurobot_od.robot.check import BELIEVED
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.nodes import Core, Drive, Navigation
from eurobot_od.robot.nodes.motion import WheelCommand
from eurobot_od.robot.plugin import ROBOT

DICTIONARIES = {each.name: each for each in dialects.load_all()}


def test_all_nodes_are_in_one_world_and_only_the_core_has_a_program() -> None:
    core, drive, navigation = Plugins(ROBOT).under_test(DICTIONARIES, 1, lambda: 0.0)
    assert isinstance(core.node, Core)
    assert isinstance(drive.node, Drive)
    assert isinstance(navigation.node, Navigation)
    assert navigation.node.beacons is not None
    before = navigation.node.beacons.locate(Source.INTERNAL, 0.0)
    for _ in range(10):
        drive.node.chassis.advance(WheelCommand(500.0, 0.0), 0.1)
    after = navigation.node.beacons.locate(Source.INTERNAL, 0.0)
    assert before is not None
    assert after is not None
    assert after.x - before.x == pytest.approx(500, abs=50)
    assert core.node.sensor is None, "what comes along would stop it"
    assert [each.program is None for each in (core, drive, navigation)] == [False, True, True]


@pytest.mark.parametrize("command", [NmtCommand.START, NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION])
def test_a_core_that_is_checked_believes_nodes_without_sdo_after_resets_too(command: NmtCommand) -> None:
    core = Plugins(ROBOT).under_test(DICTIONARIES, 1, lambda: 0.0)[0].node
    network = Simulation()
    station = network.attach(core)
    network.run(0.1)
    station.controller.receive(Frame(NMT_COB_ID, bytes([command, core.device.node_id])), network.now)
    network.run(0.2)
    assert core.device.objects.number(core.device.dictionary.address(BELIEVED)) == 1


def test_the_nodes_that_can_have_a_fault_have_it() -> None:
    core, drive, navigation = (
        type(each.node) for each in Plugins(ROBOT).under_test(DICTIONARIES, 1, lambda: 0.0, ["goto-not-confirmed"])
    )
    assert (core, navigation) == (Core, Navigation)
    assert issubclass(drive, Drive)
    assert drive is not Drive


def another_device() -> Dictionary:
    """Return a device that is none of the robot's nodes."""
    lift = DICTIONARIES["drive"].renumbered(7)
    lift.name = "lift"
    return lift


def test_a_node_that_the_robot_does_not_have_is_run_from_its_file() -> None:
    lift = another_device()
    (tested,) = Plugins(ROBOT).under_test({"lift": lift}, 1, lambda: 0.0)
    assert type(tested.node) is SimulatedDevice


def test_a_fault_of_any_device_is_one_of_a_device_from_its_file() -> None:
    kind = Plugins(ROBOT).kind(another_device(), ["heartbeat-missing"])
    assert issubclass(kind, SimulatedDevice)
    assert kind is not SimulatedDevice
