"""The heartbeat consumer: notices nodes that fall silent (CiA 301, 7.2.8.2.2 and 7.5.2.19).

Rule of this file: a node is watched from its first heartbeat on, never before; times are in seconds. A boot-up message
is not a heartbeat, although it has the same identifier: a node that has 0 in its 0x1017 boots as well.
"""

from __future__ import annotations

from collections.abc import Iterable

from eurobot_od.device.deadlines import Deadlines
from eurobot_od.od.values import ERROR_CONTROL_BASE, NODE_IDS


def split(entry: int) -> tuple[int, float]:
    """Return node-ID and time in seconds of an entry of 0x1016 (CiA 301, Figure 60); 0.0 if it is not used."""
    node_id, milliseconds = entry >> 16 & 0xFF, entry & 0xFFFF
    return node_id, milliseconds / 1000 if node_id in NODE_IDS else 0.0


class HeartbeatConsumer(Deadlines[int]):
    """Watches the heartbeats that 0x1016 names; `missed` are the node-IDs that are silent now."""

    def configure(self, entries: Iterable[int]) -> None:
        """Take over the entries of 0x1016."""
        # Any change of the communication objects ends up here: it must not stop the watch over the other nodes.
        self.change({node_id: time for node_id, time in map(split, entries) if time})

    @property
    def identifiers(self) -> set[int]:
        """COB-IDs of the heartbeats that are watched."""
        return {ERROR_CONTROL_BASE + node_id for node_id in self.times}

    def booted(self, node_id: int, now: float) -> bool:
        """Note a boot-up message; return whether its node had been lost."""
        # A node without heartbeats boots as well: that begins no watch, but in one that is on the node is back.
        return self.heard(node_id, now) if self.awaits(node_id) else self.back(node_id)
