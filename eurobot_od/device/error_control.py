"""Error control: own heartbeat, consumed heartbeats, and node guarding (CiA 301, 7.2.8.2.2)."""

from __future__ import annotations

from math import inf

from eurobot_od.device import nmt
from eurobot_od.device.broadcasts import Emergencies
from eurobot_od.device.nmt import NmtState, NmtStates
from eurobot_od.device.objects import Objects
from eurobot_od.device.reaction import FrameHandler, Reaction
from eurobot_od.device.timers import caught_up
from eurobot_od.frame import Frame
from eurobot_od.od import standard
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import ERROR_CONTROL_BASE, Address, Value
from eurobot_od.sdo.wire import Abort, Reason


class ErrorControl:
    """Error control of a device from one reset to the next; all times are in s.

    `own` is the COB-ID of its heartbeat, boot-up message, and answers to node guarding.
    """

    def __init__(self, objects: Objects, nmt_states: NmtStates, emergencies: Emergencies, node_id: int) -> None:
        self._objects, self._nmt, self._emergencies, self._node_id = objects, nmt_states, emergencies, node_id
        self.own = ERROR_CONTROL_BASE + node_id
        self._consumer, self._guarding = nmt.HeartbeatConsumer(), nmt.NodeGuarding()
        self._next_heartbeat = inf
        self._beating = False

    @property
    def next(self) -> float:
        """Time of the next action, infinite if there is none."""
        return min(self._next_heartbeat, self._consumer.next, self._guarding.next)

    @property
    def handlers(self) -> dict[int | None, FrameHandler]:
        """Handlers by COB-ID, for the consumed heartbeats."""
        return dict.fromkeys(self._consumer.identifiers, self._receive)

    @property
    def remote_handlers(self) -> dict[int, FrameHandler]:
        """Handlers of remote frames by COB-ID, for node guarding if the file has 0x100C."""
        is_guarded = standard.GUARD_TIME[0] in self._objects.dictionary.members
        return {self.own: self._answer_guard} if is_guarded else {}

    def configure(self) -> None:
        """Update from the present objects."""
        self._consumer.configure(self._entries())
        self._guarding.configure(self._life_time())

    def _entries(self) -> list[int]:
        count = self._objects.raw((standard.CONSUMED_HEARTBEATS, 0))
        return [self._objects.raw((standard.CONSUMED_HEARTBEATS, subindex)) for subindex in range(1, count + 1)]

    def _life_time(self) -> float:
        """Return the life time of node guarding; 0.0 if it is infinite, or if heartbeats are used instead."""
        factor = 0 if self._objects.raw(standard.HEARTBEAT_TIME) else self._objects.raw(standard.LIFE_TIME_FACTOR)
        return self._objects.raw(standard.GUARD_TIME) / 1000 * factor

    # The own heartbeat

    def start(self, now: float) -> None:
        """Start the heartbeat after a boot-up."""
        self._beating = False
        self._plan(now)

    def set_period(self, address: Address, value: Value, now: float) -> None:
        """Write 0x1017, and start the heartbeat with its new period."""
        self._objects.put(address, value)
        # At once, because the old period may be a minute.
        self._plan(now)
        self._guarding.configure(self._life_time())

    def _plan(self, now: float) -> None:
        period = self._objects.raw(standard.HEARTBEAT_TIME)
        self._next_heartbeat = now + period / 1000 if period else inf

    def first_heartbeat(self) -> list[Frame]:
        """Return a heartbeat if none was sent since the boot-up."""
        if self._beating or self._next_heartbeat == inf:
            return []
        return self._heartbeat()

    def due(self, now: float) -> list[Frame]:
        """Return the heartbeat if it is due."""
        if now < self._next_heartbeat:
            return []
        # From the planned time, so that late calls do not add up.
        self._plan(caught_up(self._next_heartbeat, now))
        return self._heartbeat()

    def _heartbeat(self) -> list[Frame]:
        self._beating = True
        return [nmt.error_control(self._node_id, self._nmt.state)]

    # Heartbeats of other nodes

    def watch(self, address: Address, value: Value) -> None:
        """Write 0x1016; a node must not be watched twice (CiA 301, 7.5.2.19)."""
        node_id, time = nmt.heartbeat_entry(value if isinstance(value, int) else 0)
        entries = enumerate(self._entries(), 1)
        others = [nmt.heartbeat_entry(entry) for subindex, entry in entries if subindex != address[1]]
        # Two time-outs for one node would contradict each other.
        if time and any(node_id == other and others_time for other, others_time in others):
            raise Abort(Reason.WATCHED_TWICE)
        self._objects.put(address, value)

    def _receive(self, frame: Frame, now: float) -> Reaction:
        node_id = frame.cob_id - ERROR_CONTROL_BASE
        boot_up = frame == nmt.error_control(node_id, NmtState.INITIALISING)
        if (self._consumer.booted if boot_up else self._consumer.heard)(node_id, now):
            self._emergencies.cleared((nmt.HeartbeatConsumer, node_id))
        return Reaction([], booted=node_id if boot_up else None)

    def overdue(self, now: float) -> tuple[tuple[int, ...], bool]:
        """Report lost nodes by EMCY; return their node-IDs, and whether a guarding master is lost."""
        lost = tuple(self._consumer.overdue(now))
        unguarded = self._guarding.overdue(now)
        for node_id in lost:
            self._emergencies.raised(ErrorCode.HEARTBEAT_LOST, (nmt.HeartbeatConsumer, node_id), bytes([node_id]))
        if unguarded:
            self._emergencies.raised(ErrorCode.HEARTBEAT_LOST, nmt.NodeGuarding)
        return lost, bool(unguarded)

    def _answer_guard(self, _: Frame, now: float) -> Reaction:
        """Answer node guarding, unless the device sends heartbeats (CiA 301, 7.2.8.2.2)."""
        if self._objects.raw(standard.HEARTBEAT_TIME):
            return Reaction([])
        if self._guarding.missed:
            self._emergencies.cleared(nmt.NodeGuarding)
        return Reaction([self._guarding.answer(self._node_id, self._nmt.state, now)])
