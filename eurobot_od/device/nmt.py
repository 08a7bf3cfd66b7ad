"""Network management: NMT states and commands, boot-up, heartbeat, heartbeat consumer, node guarding.

CiA 301, 7.2.8 and 7.3.2. There is no clock and no bus in this module; times are in s. A watched node, or a guarding
master, can be lost only after it was heard once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import IntEnum
from math import inf
from typing import NamedTuple

from eurobot_od.device.broadcasts import Emergencies
from eurobot_od.device.objects import Objects
from eurobot_od.device.reaction import FrameHandler, Reaction
from eurobot_od.device.timers import Deadlines, caught_up
from eurobot_od.errors import look_up
from eurobot_od.frame import Frame
from eurobot_od.od import standard
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import ALL_NODES, ERROR_CONTROL_BASE, NMT_COB_ID, NODE_IDS, Address, Value
from eurobot_od.sdo.wire import Abort, Reason


class NmtState(IntEnum):
    """NMT states; the value is the one in the heartbeat (CiA 301, 7.2.8.3.2.2)."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


STATE_NAMES: Mapping[int, str] = {each: each.name.lower().replace("_", "-") for each in NmtState} | {0: "boot-up"}
"""Names of the states in a heartbeat; one with INITIALISING is the boot-up message."""


class Services(NamedTuple):
    """Services that are available in an NMT state (CiA 301, 7.3.2.2.4)."""

    nmt: bool = False
    emcy: bool = False
    sdo: bool = False
    pdo: bool = False


SERVICES = {
    NmtState.INITIALISING: Services(),
    NmtState.PRE_OPERATIONAL: Services(nmt=True, emcy=True, sdo=True),
    NmtState.OPERATIONAL: Services(nmt=True, emcy=True, sdo=True, pdo=True),
    NmtState.STOPPED: Services(nmt=True),
}


class NmtStates:
    """The NMT state machine of a device: its `state`, and the services in that state (CiA 301, 7.3.2.2.4).

    The flags are: `listens` (receives frames), `reports` (SYNC, TIME, EMCY), `serves` (SDO), `operational` (PDOs).
    """

    def __init__(self) -> None:
        self.state = NmtState.INITIALISING

    @property
    def state(self) -> NmtState:
        """The NMT state."""
        return self._state

    @state.setter
    def state(self, state: NmtState) -> None:
        self._state = state
        self.listens, self.reports, self.serves, self.operational = SERVICES[state]


class NmtCommand(IntEnum):
    """NMT commands; the value is the command specifier (CiA 301, 7.2.8.2.1)."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


RESETS = (NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION)

COMMAND_NAMES: Mapping[int, str] = {
    NmtCommand.START: "start",
    NmtCommand.STOP: "stop",
    NmtCommand.ENTER_PRE_OPERATIONAL: "pre-operational",
    NmtCommand.RESET_NODE: "reset",
    NmtCommand.RESET_COMMUNICATION: "reset communication",
}
"""Names of the commands on the command line, in suites and in logs."""


TARGET = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
}
"""States after commands other than resets, from every state but INITIALISING."""

CANOPEN_COMMANDS: Mapping[str, NmtCommand] = {
    **{STATE_NAMES[state].upper(): command for command, state in TARGET.items()},
    "INITIALISING": NmtCommand.RESET_NODE,
    "RESET": NmtCommand.RESET_NODE,
    "RESET COMMUNICATION": NmtCommand.RESET_COMMUNICATION,
}
"""Commands by the states that users of the canopen package set."""


def command_to(state: str) -> NmtCommand:
    """Return the command for a state as in the canopen package; raises UnknownName."""
    return look_up("NMT state", state, CANOPEN_COMMANDS)


def canopen_state(state: NmtState | None) -> str:
    """Return a state's name in the canopen package: after a boot-up it is PRE-OPERATIONAL."""
    return "UNKNOWN" if state is None else STATE_NAMES[state or NmtState.PRE_OPERATIONAL].upper()


STAY_PRE_OPERATIONAL = 1 << 2
"""Bit of NMT startup 0x1F80: the node waits for a master's start command (CiA 302-2)."""


def command_in(frame: Frame, node_id: int) -> NmtCommand | None:
    """Return the NMT command for this node in a frame, or None."""
    # Malformed commands are ignored, because NMT has no answers (CiA 301, 7.2.8.2.1).
    if frame.cob_id != NMT_COB_ID or len(frame.data) != 2 or frame.data[1] not in (ALL_NODES, node_id):
        return None
    return NmtCommand(frame.data[0]) if frame.data[0] in set(NmtCommand) else None


def boot_state(nmt_startup: Value) -> NmtState:
    """Return the state after the boot-up, by 0x1F80; without it the node waits for a master."""
    waits = not isinstance(nmt_startup, int) or nmt_startup & STAY_PRE_OPERATIONAL
    return NmtState.PRE_OPERATIONAL if waits else NmtState.OPERATIONAL


def error_control(node_id: int, state: NmtState) -> Frame:
    """Return the heartbeat frame, or with INITIALISING the boot-up message."""
    return Frame(ERROR_CONTROL_BASE + node_id, bytes([state]))


# Heartbeats of other nodes


def heartbeat_entry(entry: int) -> tuple[int, float]:
    """Return node-ID and time in s of an entry of 0x1016 (CiA 301, Figure 60); 0.0 if it is unused."""
    node_id = entry >> 16 & 0xFF
    milliseconds = entry & 0xFFFF
    return node_id, milliseconds / 1000 if node_id in NODE_IDS else 0.0


class HeartbeatConsumer(Deadlines[int]):
    """Watches the heartbeats listed in 0x1016; `missed` are the node-IDs of lost nodes."""

    def configure(self, entries: Iterable[int]) -> None:
        """Set the entries of 0x1016."""
        # This runs at any change of a communication object, and must not restart unchanged entries.
        self.change({node_id: time for node_id, time in map(heartbeat_entry, entries) if time})

    @property
    def identifiers(self) -> set[int]:
        """COB-IDs of the watched heartbeats."""
        return {ERROR_CONTROL_BASE + node_id for node_id in self.times}

    def booted(self, node_id: int, now: float) -> bool:
        """Note a boot-up message; return whether its node was lost."""
        # A boot-up message does not start watching a node that may not send heartbeats.
        return self.heard(node_id, now) if self.awaits(node_id) else self.back(node_id)


# Node guarding


TOGGLE = 1 << 7
"""Toggle bit of an answer to node guarding."""


MASTER = "master"
"""Key of the guarding master among the deadlines."""


class NodeGuarding(Deadlines[str]):
    """The guarded side of node guarding: supervises the master once it has sent a request."""

    def __init__(self) -> None:
        super().__init__()
        self._toggle = 0

    def configure(self, life_time: float) -> None:
        """Set the life time in s, 0.0 for infinite; a change takes effect at the next request."""
        self.change({MASTER: life_time} if life_time else {})

    def answer(self, node_id: int, state: NmtState, now: float) -> Frame:
        """Return the answer to a guarding request."""
        data = bytes([self._toggle | state])
        # Only a reset, which makes a new object, restarts the bit at 0.
        self._toggle ^= TOGGLE
        self.heard(MASTER, now)
        return Frame(ERROR_CONTROL_BASE + node_id, data)


class ErrorControl:
    """Error control of a device from one reset to the next; all times are in s.

    `own` is the COB-ID of its heartbeat, boot-up message, and answers to node guarding.
    """

    def __init__(self, objects: Objects, nmt_states: NmtStates, emergencies: Emergencies, node_id: int) -> None:
        self._objects = objects
        self._nmt = nmt_states
        self._emergencies = emergencies
        self._node_id = node_id
        self.own = ERROR_CONTROL_BASE + node_id
        self._consumer, self._guarding = HeartbeatConsumer(), NodeGuarding()
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
        return [error_control(self._node_id, self._nmt.state)]

    # Heartbeats of other nodes

    def watch(self, address: Address, value: Value) -> None:
        """Write 0x1016; a node must not be watched twice (CiA 301, 7.5.2.19)."""
        node_id, time = heartbeat_entry(value if isinstance(value, int) else 0)
        entries = enumerate(self._entries(), 1)
        others = [heartbeat_entry(entry) for subindex, entry in entries if subindex != address[1]]
        # Two time-outs for one node would contradict each other.
        if time and any(node_id == other and others_time for other, others_time in others):
            raise Abort(Reason.WATCHED_TWICE)
        self._objects.put(address, value)

    def _receive(self, frame: Frame, now: float) -> Reaction:
        node_id = frame.cob_id - ERROR_CONTROL_BASE
        boot_up = frame == error_control(node_id, NmtState.INITIALISING)
        if (self._consumer.booted if boot_up else self._consumer.heard)(node_id, now):
            self._emergencies.cleared((HeartbeatConsumer, node_id))
        return Reaction([], booted=node_id if boot_up else None)

    def overdue(self, now: float) -> tuple[tuple[int, ...], bool]:
        """Report lost nodes by EMCY; return their node-IDs, and whether a guarding master is lost."""
        lost = tuple(self._consumer.overdue(now))
        unguarded = self._guarding.overdue(now)
        for node_id in lost:
            self._emergencies.raised(ErrorCode.HEARTBEAT_LOST, (HeartbeatConsumer, node_id), bytes([node_id]))
        if unguarded:
            self._emergencies.raised(ErrorCode.HEARTBEAT_LOST, NodeGuarding)
        return lost, bool(unguarded)

    def _answer_guard(self, _: Frame, now: float) -> Reaction:
        """Answer node guarding, unless the device sends heartbeats (CiA 301, 7.2.8.2.2)."""
        if self._objects.raw(standard.HEARTBEAT_TIME):
            return Reaction([])
        if self._guarding.missed:
            self._emergencies.cleared(NodeGuarding)
        return Reaction([self._guarding.answer(self._node_id, self._nmt.state, now)])
