"""Faults of the robot's nodes, besides those of any device; see `eurobot_od.device.faults`.

Every fault names the step of the shipped suite that finds it; `tools/fault_matrix.py` proves it for all of them, which
shows that the suites would find such a fault in a real node.
"""

from __future__ import annotations

from eurobot_od.device.node import Node
from eurobot_od.plugin import Faults
from eurobot_od.robot.faults import any_node, core, drive, navigation
from eurobot_od.robot.nodes import Core, Drive, Navigation

FAULTS: Faults = {
    Core: core.FAULTS,
    Drive: drive.FAULTS,
    Navigation: navigation.FAULTS,
    Node: any_node.FAULTS,
}
"""The faults with their names, by the class of node that can have them; those of Node any node can have."""
