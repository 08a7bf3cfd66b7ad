"""Faults that any node of the robot can have, besides those of any device: stops, and frames of a wrong length."""

from __future__ import annotations

from eurobot_od.device.faults.fault import Caught
from eurobot_od.device.nmt import NmtState
from eurobot_od.device.node import Node
from eurobot_od.frame import Frame


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


FAULTS = {
    "deaf-when-stopped": Caught("canopen", "4.2.2 Emergency mushroom: acts in every NMT state").fault(
        "heeds stops and shutdowns only in OPERATIONAL", DeafWhenStopped
    ),
    "short-frame-filled-up": Caught("canopen", "7.2.7 EMCY: a frame that is too short").fault(
        "fills up short messages with left-over bytes and acts on them (2014 robot)", Padded
    ),
}
