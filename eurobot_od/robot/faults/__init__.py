"""Faults of the robot's nodes, besides those of any device; see `eurobot_od.device.faults`.

Every fault names the step of the shipped suite that finds it; `tools/fault_matrix.py` proves it for all of them, which
shows that the suites would find such a fault in a real node.
"""

from __future__ import annotations

from eurobot_od.device.faults import Caught
from eurobot_od.device.nmt import NmtState
from eurobot_od.device.node import Node
from eurobot_od.frame import Frame
from eurobot_od.plugin import Faults
from eurobot_od.robot.faults import core, drive, navigation
from eurobot_od.robot.nodes import Core, Drive, Navigation

# Faults that any node of the robot can have: stops, and frames of a wrong length


class DeafWhenStopped(Node):
    """Heeds emergencies and stops only in OPERATIONAL, like any other message."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        always = {self.device.protocol.cob_id(each) for each in self.CATALOGUE.always if each in self.HANDLERS}
        if self.device.state is not NmtState.OPERATIONAL and frame.cob_id in always:
            return []
        return super().receive(frame, now)


class Padded(Node):
    """Fills up short messages with what is left in the buffer, and acts on them (2014 robot)."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        lengths = {each.cob_id: each.layout.length for each in self.device.protocol.bindings}
        return super().receive(Frame(frame.cob_id, frame.data.ljust(lengths.get(frame.cob_id, 0), b"\x01")), now)


OF_ANY_NODE = {
    "deaf-when-stopped": Caught("canopen", "4.2.2 Emergency mushroom: acts in every NMT state").fault(
        "heeds stops and shutdowns only in OPERATIONAL", DeafWhenStopped
    ),
    "short-frame-filled-up": Caught("canopen", "7.2.7 EMCY: a frame that is too short").fault(
        "fills up short messages with left-over bytes and acts on them (2014 robot)", Padded
    ),
}


# All

FAULTS: Faults = {
    Core: core.FAULTS,
    Drive: drive.FAULTS,
    Navigation: navigation.FAULTS,
    Node: OF_ANY_NODE,
}
"""The faults with their names, by the class of node that can have them; those of Node any node can have."""
