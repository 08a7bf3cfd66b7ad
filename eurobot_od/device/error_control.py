"""Error control: the device's own heartbeat, the heartbeats that it watches, and node guarding (CiA 301, 7.2.8.2.2)."""

from __future__ import annotations

from math import inf

from eurobot_od.device import nmt
from eurobot_od.device.broadcasts import Emergencies
from eurobot_od.device.nmt import NmtState, NmtStates
from eurobot_od.device.objects import Objects
from eurobot_od.device.reaction import Ear, Reaction
from eurobot_od.device.timers import caught_up
from eurobot_od.frame import Frame
from eurobot_od.od import standard
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import ERROR_CONTROL_BASE, Address, Value
from eurobot_od.sdo.wire import Abort, Reason


class ErrorControl:
    """The error control of a device from one reset to the next; all times are in s.

    `own` is the COB-ID of its heartbeat, its boot-up message, and its answers to a master that guards it.
    """

    def __init__(self, objects: Objects, nmt_states: NmtStates, emergencies: Emergencies, node_id: int) -> None:
        self._objects, self._nmt, self._emergencies, self._node_id = objects, nmt_states, emergencies, node_id
        self.own = ERROR_CONTROL_BASE + node_id
        self._consumer, self._guarding = nmt.HeartbeatConsumer(), nmt.NodeGuarding()
        self._next_heartbeat = inf
        self._beating = False

    @property
    def next(self) -> float:
        """Time at which something is due, infinite if nothing is."""
        return min(self._next_heartbeat, self._consumer.next, self._guarding.next)

    @property
    def ears(self) -> dict[int | None, Ear]:
        """What it does with each COB-ID: the heartbeats that it waits for."""
        return dict.fromkeys(self._consumer.identifiers, self._receive)

    @property
    def remote_ears(self) -> dict[int, Ear]:
        """What it does with remote frames: it is guarded, if the file has 0x100C."""
        is_guarded = standard.GUARD_TIME[0] in self._objects.dictionary.members
        return {self.own: self._answer_guard} if is_guarded else {}

    def configure(self) -> None:
        """Follow the objects as they are now."""
        self._consumer.configure(self._entries())
        self._guarding.configure(self._life_time())

    def _entries(self) -> list[int]:
        count = self._objects.raw((standard.CONSUMED_HEARTBEATS, 0))
        return [self._objects.raw((standard.CONSUMED_HEARTBEATS, subindex)) for subindex in range(1, count + 1)]

    def _life_time(self) -> float:
        """Return how long a guarding master may be silent; 0.0 for ever, or if heartbeats are used instead."""
        factor = 0 if self._objects.raw(standard.HEARTBEAT_TIME) else self._objects.raw(standard.LIFE_TIME_FACTOR)
        return self._objects.raw(standard.GUARD_TIME) / 1000 * factor

    # The own heartbeat

    def start(self, now: float) -> None:
        """Begin the heartbeats, after a boot-up."""
        self._beating = False
        self._plan(now)

    def set_period(self, address: Address, value: Value, now: float) -> None:
        """Write 0x1017: the heartbeat has another period from now on."""
        self._objects.put(address, value)
        # Not when the rest of the old period is over, which may take a minute.
        self._plan(now)
        self._guarding.configure(self._life_time())

    def _plan(self, now: float) -> None:
        period = self._objects.raw(standard.HEARTBEAT_TIME)
        self._next_heartbeat = now + period / 1000 if period else inf

    def first_heartbeat(self) -> list[Frame]:
        """Return a heartbeat to send now, if there are heartbeats and none has been sent since the boot-up."""
        if self._beating or self._next_heartbeat == inf:
            return []
        return self._heartbeat()

    def due(self, now: float) -> list[Frame]:
        """Return the heartbeat if it is due."""
        if now < self._next_heartbeat:
            return []
        # From its planned time, or each late call would put off all later heartbeats.
        self._plan(caught_up(self._next_heartbeat, now))
        return self._heartbeat()

    def _heartbeat(self) -> list[Frame]:
        self._beating = True
        return [nmt.error_control(self._node_id, self._nmt.state)]

    # Those of others

    def watch(self, address: Address, value: Value) -> None:
        """Write 0x1016: watch another node's heartbeat; no node may be watched twice (CiA 301, 7.5.2.19)."""
        node_id, time = nmt.heartbeat_entry(value if isinstance(value, int) else 0)
        entries = enumerate(self._entries(), 1)
        others = [nmt.heartbeat_entry(entry) for subindex, entry in entries if subindex != address[1]]
        # With two times, one node would be lost by one of them and still there by the other.
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
        """Report what has fallen silent: return the node-IDs, and whether a master that guards this node is one."""
        lost, unguarded = tuple(self._consumer.overdue(now)), self._guarding.overdue(now)
        for node_id in lost:
            self._emergencies.raised(ErrorCode.HEARTBEAT_LOST, (nmt.HeartbeatConsumer, node_id), bytes([node_id]))
        if unguarded:
            self._emergencies.raised(ErrorCode.HEARTBEAT_LOST, nmt.NodeGuarding)
        return lost, bool(unguarded)

    def _answer_guard(self, _: Frame, now: float) -> Reaction:
        """Answer that the device is there; a device that sends heartbeats is not guarded (CiA 301, 7.2.8.2.2)."""
        if self._objects.raw(standard.HEARTBEAT_TIME):
            return Reaction([])
        if self._guarding.missed:
            self._emergencies.cleared(nmt.NodeGuarding)
        return Reaction([self._guarding.answer(self._node_id, self._nmt.state, now)])
