"""Detects nodes that boot, fall silent and come back, by heartbeats or node guarding (CiA 301, 7.2.8.3).

`Heartbeats` and `NodeWatch` have no clock and no bus: frames and the time in seconds go in; events, and the COB-IDs to
ask by remote frames, come out.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping
from enum import Enum
from math import inf
from typing import NamedTuple

from eurobot_od.client.master import Guard, Master, Observer, Procedure, unguarded
from eurobot_od.device.nmt import TOGGLE, NmtState
from eurobot_od.errors import RemoteError
from eurobot_od.od.standard import HEARTBEAT_TIME
from eurobot_od.od.values import ERROR_CONTROL_BASE, NODE_IDS

LOST_AFTER = 2.0
"""Number of heartbeat periods without a heartbeat after which a node is lost."""

LATE_AFTER = 1.5
"""Number of periods after which a node is late, or a PDO with an event timer."""

REMEMBERED_INTERVALS = 5
"""Number of intervals whose median is the period of a node."""

SHORTEST_PAUSE, LONGEST_PAUSE = 0.001, 0.1
"""Minimum and maximum interval between two checks for lost nodes, in s; `watch_nodes` checks its end as often."""


class Life(Enum):
    """Liveness of a node; unknown if it never sent a heartbeat."""

    ALIVE = "alive"
    LATE = "late"
    LOST = "lost"
    UNKNOWN = "unknown"


class Heartbeats:
    """Heartbeats of a node: `heard` is the time of the last one, None before the first.

    `period` is the expected period in seconds, 0 if unknown. The measured period takes precedence.
    """

    def __init__(self, period: float = 0.0) -> None:
        self.period = period
        self.heard: float | None = None
        self._last_beat: float | None = None
        self._intervals: deque[float] = deque(maxlen=REMEMBERED_INTERVALS)

    def beat(self, now: float) -> None:
        """Record a heartbeat."""
        if self._last_beat is not None:
            self._intervals.append(now - self._last_beat)
        self.heard = self._last_beat = now

    def boot(self, now: float) -> None:
        """Record a boot-up message; the next heartbeat may come at any time within the period."""
        self.heard = now
        self._last_beat = None
        self._intervals.clear()

    @property
    def deadline(self) -> float:
        """Time at which the node is lost unless it is heard before; infinite if the period is unknown."""
        return self._due(LOST_AFTER)

    def _due(self, periods: float) -> float:
        """Return the time after a number of periods."""
        # One late or lost heartbeat does not change the median.
        period = sorted(self._intervals)[(len(self._intervals) - 1) // 2] if self._intervals else self.period
        return self.heard + periods * period if self.heard is not None and period else inf

    def lost(self, now: float) -> bool:
        """Return whether the deadline has passed."""
        return now > self.deadline

    def life(self, now: float) -> Life:
        """Return the liveness of the node."""
        if self.deadline == inf:
            return Life.UNKNOWN
        if self.lost(now):
            return Life.LOST
        return Life.LATE if now > self._due(LATE_AFTER) else Life.ALIVE


class NodeChange(Enum):
    """A change of a node, with its text."""

    FOUND = "is there"
    BOOTED = "has booted"
    LOST = "is lost"
    BACK = "is back"


class NodeEvent(NamedTuple):
    """A `change` of a node at a `time` in seconds; `state` is the last one reported, None without one."""

    time: float
    node_id: int
    change: NodeChange
    state: NmtState | None


class WatchedNode:
    """A node: its `pulse`, its `state`, and whether it is `lost`."""

    def __init__(self, period: float = 0.0) -> None:
        self.pulse = Heartbeats(period)
        self.lost = False
        self.state: NmtState | None = None
        self.toggle: int | None = None


class NodeWatch:
    """Watches nodes and calls `report` with each event.

    `periods` are heartbeat periods in seconds by node-ID, where they are known. `expected` nodes are lost if they are
    not heard within `patience` seconds of the first tick. `guarded` has, by node-ID, the periods in seconds at which
    nodes are asked by a remote frame: without a heartbeat a node can be watched only in this way.
    """

    def __init__(
        self,
        report: Callable[[NodeEvent], object],
        periods: Mapping[int, float] = {},
        expected: Iterable[int] = (),
        patience: float = LOST_AFTER,
        guarded: Mapping[int, float] = {},
    ) -> None:
        self._report = report
        self.nodes: dict[int, WatchedNode] = {node_id: WatchedNode(period) for node_id, period in periods.items()}
        self._expected = {*expected, *guarded}
        self._patience = patience
        self._guarded = dict(guarded)
        self._next_guard = dict.fromkeys(guarded, -inf)
        self._started: float | None = None

    def receive(self, node_id: int, data: bytes, now: float) -> None:
        """Process an error control frame; other frames are ignored."""
        state = data[0] & ~TOGGLE if len(data) == 1 else None
        if state not in set(NmtState):
            return
        node = self._node(node_id)
        # A boot-up is not an answer, and always has toggle bit 0.
        if state and node_id in self._guarded and data[0] & TOGGLE == node.toggle:
            return  # a repeated answer, or one of a stuck node, is no sign of life
        # After a boot-up the first answer has the toggle bit 0 (CiA 301, 7.2.8.3.2.1).
        node.toggle = data[0] & TOGGLE if state and node_id in self._guarded else None
        first = node.pulse.heard is None
        was_lost = node.lost
        node.state = NmtState(state)
        node.lost = False
        (node.pulse.beat if state else node.pulse.boot)(now)
        if not state:
            self._report_change(now, node_id, NodeChange.BOOTED)
        elif was_lost:
            self._report_change(now, node_id, NodeChange.BACK)
        elif first:
            self._report_change(now, node_id, NodeChange.FOUND)

    def tick(self, now: float) -> list[int]:
        """Report lost nodes, and return the COB-IDs to request by remote frames now."""
        if self._started is None:
            self._started = now
        self._lose(lambda node_id, node: now > self._deadline(node_id, node), now)
        asked = [node_id for node_id, due in self._next_guard.items() if now >= due]
        # Counted from now, so that missed requests are not sent all at once after a pause.
        self._next_guard |= {node_id: now + self._guarded[node_id] for node_id in asked}
        return [ERROR_CONTROL_BASE + node_id for node_id in asked]

    def end(self, now: float) -> None:
        """Report the expected nodes that were never heard: a watch may end before they have had their time."""
        self._lose(lambda node_id, node: node_id in self._expected and node.pulse.heard is None, now)

    def _lose(self, is_lost: Callable[[int, WatchedNode], bool], now: float) -> None:
        for node_id in sorted({*self.nodes, *self._expected}):
            node = self._node(node_id)
            if not node.lost and is_lost(node_id, node):
                node.lost = True
                self._report_change(now, node_id, NodeChange.LOST)

    def observer(self, master: Master) -> Observer:
        """Return the observer that a master calls with every frame."""

        def heard(cob_id: int, data: bytes, _: float) -> None:
            if cob_id - ERROR_CONTROL_BASE in NODE_IDS:
                self.receive(cob_id - ERROR_CONTROL_BASE, data, master.clock())

        return heard

    def ask(self, master: Master) -> float:
        """Report lost nodes, send due requests, and return the time in s until the next call."""
        now = master.clock()
        for cob_id in self.tick(now):
            master.request(cob_id)
        # A deadline at this moment has not passed, and the loop would run without a pause.
        return max(self.next_wakeup - now, SHORTEST_PAUSE)

    @property
    def next_wakeup(self) -> float:
        """When to call `tick`, infinite if nothing is planned."""
        waiting = (self._deadline(node_id, node) for node_id, node in self.nodes.items() if not node.lost)
        return min([*waiting, *self._next_guard.values()], default=inf)

    def _node(self, node_id: int) -> WatchedNode:
        return self.nodes.setdefault(node_id, WatchedNode(self._guarded.get(node_id, 0.0)))

    def _deadline(self, node_id: int, node: WatchedNode) -> float:
        # A node that was never heard has no period, so all have the same time to boot.
        if node.pulse.heard is None and node_id in self._expected and self._started is not None:
            return self._started + self._patience
        return node.pulse.deadline

    def _report_change(self, now: float, node_id: int, change: NodeChange) -> None:
        self._report(NodeEvent(now, node_id, change, self.nodes[node_id].state))


@Procedure
async def without_heartbeat(master: Master, node_ids: Iterable[int]) -> list[int]:
    """Return the nodes that do not report a heartbeat period (0x1017). Raises BusError.

    A device with a heartbeat does not answer node guarding: it has one or the other (CiA 301, 7.2.8.2.2).
    """
    found = []
    for node_id in node_ids:
        try:
            period = await master.node(node_id).upload.steps(HEARTBEAT_TIME)
        except RemoteError:  # not there yet, or without the object
            period = b""
        if not any(period):
            found.append(node_id)
    return found


def watch_nodes(master: Master, watch: NodeWatch, end: float = inf, guard: Guard = unguarded) -> None:
    """Watch the nodes of a bus until time `end` of its clock, each step under the guard. Raises BusError."""

    def step() -> None:
        left = end - master.clock()
        master.pump(min(watch.ask(master), LONGEST_PAUSE, left))

    with master.observed(watch.observer(master)):
        while master.clock() < end:
            guard(step)
