"""The heartbeat consumer: notices nodes that fall silent (CiA 301, 7.2.8.2.2 and 7.5.2.19).

Rule of this file: a node is watched from its first heartbeat on, never before; times are in seconds. A boot-up message
is not a heartbeat, although it has the same identifier: a node that has 0 in its 0x1017 boots as well.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf

from eurobot_od.od.values import ERROR_CONTROL_BASE, NODE_IDS


def split(entry: int) -> tuple[int, float]:
    """Return node-ID and time in seconds of an entry of 0x1016 (CiA 301, Figure 60); 0.0 if it is not used."""
    node_id, milliseconds = entry >> 16 & 0xFF, entry & 0xFFFF
    return node_id, milliseconds / 1000 if node_id in NODE_IDS else 0.0


class HeartbeatConsumer:
    """Watches the heartbeats that 0x1016 names; `lost` are the node-IDs that are silent now."""

    def __init__(self) -> None:
        self._times: dict[int, float] = {}
        self._deadlines: dict[int, float] = {}
        self.lost: set[int] = set()

    def configure(self, entries: Iterable[int]) -> None:
        """Take over the entries of 0x1016; what does not change goes on."""
        times = {node_id: time for node_id, time in map(split, entries) if time}
        # Any change of the communication objects ends up here: it must not stop the watch over the other nodes.
        kept = {node_id for node_id in times if times[node_id] == self._times.get(node_id)}
        self._times = times
        self._deadlines = {node_id: self._deadlines[node_id] for node_id in kept & self._deadlines.keys()}
        self.lost &= kept

    @property
    def identifiers(self) -> set[int]:
        """COB-IDs of the heartbeats that are watched."""
        return {ERROR_CONTROL_BASE + node_id for node_id in self._times}

    def heard(self, node_id: int, now: float, *, boot_up: bool = False) -> bool:
        """Note a heartbeat or boot-up message; return whether its node had been lost."""
        if node_id not in self._times:
            return False
        # A node without heartbeats boots as well: that begins no watch, but in one that is on the node is back.
        if not boot_up or node_id in self._deadlines:
            self._deadlines[node_id] = now + self._times[node_id]
        was_lost = node_id in self.lost
        self.lost.discard(node_id)
        return was_lost

    @property
    def next(self) -> float:
        """When the next node will have been silent too long, infinite if none is awaited."""
        return min(self._deadlines.values()) if self._deadlines else inf

    def overdue(self, now: float) -> list[int]:
        """Return the nodes that have fallen silent by now, each once."""
        silent = [node_id for node_id, deadline in self._deadlines.items() if deadline <= now]
        for node_id in silent:
            del self._deadlines[node_id]  # reported once; its next heartbeat starts the watch again
            self.lost.add(node_id)
        return silent
