"""Network management: NMT states and commands, boot-up, heartbeat, watching other nodes, node guarding.

CiA 301, 7.2.8 and 7.3.2. The state machine is one table, and its result says who resets what. There is no clock and no
bus in here: times are in seconds. A node that is watched, or a master that guards, counts as lost only after it was
heard once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from enum import IntEnum
from typing import NamedTuple

from eurobot_od.device.timers import Deadlines
from eurobot_od.errors import look_up
from eurobot_od.frame import Frame
from eurobot_od.od.values import ALL_NODES, ERROR_CONTROL_BASE, NMT_COB_ID, NODE_IDS, Value


class NmtState(IntEnum):
    """NMT states; the value is the one in the heartbeat (CiA 301, 7.2.8.3.2.2)."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


STATE_NAMES: Mapping[int, str] = {each: each.name.lower().replace("_", "-") for each in NmtState} | {0: "boot-up"}
"""What a heartbeat says, by the state in it; the only one ever heard with INITIALISING is the boot-up message."""


class Services(NamedTuple):
    """Which services a device has in an NMT state (CiA 301, 7.3.2.2.4)."""

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
    """The NMT state machine of a device: its `state`, and which services it has in it (CiA 301, 7.3.2.2.4).

    It `listens` to frames at all, `reports` by SYNC, TIME and EMCY, `serves` SDO, and is `operational`: has PDOs.
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
"""What a person calls each command: on the command line, in suites, in logs."""


TARGET = {
    NmtCommand.START: NmtState.OPERATIONAL,
    NmtCommand.STOP: NmtState.STOPPED,
    NmtCommand.ENTER_PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
}
"""State after a command that is not a reset; all three are allowed from every state but INITIALISING."""

CANOPEN_COMMANDS: Mapping[str, NmtCommand] = {
    **{STATE_NAMES[state].upper(): command for command, state in TARGET.items()},
    "INITIALISING": NmtCommand.RESET_NODE,
    "RESET": NmtCommand.RESET_NODE,
    "RESET COMMUNICATION": NmtCommand.RESET_COMMUNICATION,
}
"""The command for each state that users of the canopen package set."""


def command_to(state: str) -> NmtCommand:
    """Return the command that makes a node enter a state, as users of canopen write it; raises UnknownName."""
    return look_up("NMT state", state, CANOPEN_COMMANDS)


def canopen_state(state: NmtState | None) -> str:
    """Return a state as users of canopen read it: after a boot-up a node is PRE-OPERATIONAL."""
    return "UNKNOWN" if state is None else STATE_NAMES[state or NmtState.PRE_OPERATIONAL].upper()


STAY_PRE_OPERATIONAL = 1 << 2
"""Bit of NMT startup 0x1F80: set, the node waits for a master's start (CiA 302-2)."""


def command_in(frame: Frame, node_id: int) -> NmtCommand | None:
    """Return the NMT command that a frame has for this node, None for any other frame."""
    # NMT has no answers (CiA 301, 7.2.8.2.1), so nobody can be told of a malformed or unknown command.
    if frame.cob_id != NMT_COB_ID or len(frame.data) != 2 or frame.data[1] not in (ALL_NODES, node_id):
        return None
    return NmtCommand(frame.data[0]) if frame.data[0] in set(NmtCommand) else None


def boot_state(nmt_startup: Value) -> NmtState:
    """Return the state that a node enters after its boot-up, by 0x1F80; without that object it waits for a master."""
    waits = not isinstance(nmt_startup, int) or nmt_startup & STAY_PRE_OPERATIONAL
    return NmtState.PRE_OPERATIONAL if waits else NmtState.OPERATIONAL


def error_control(node_id: int, state: NmtState) -> Frame:
    """Return the heartbeat frame; with INITIALISING it is the boot-up message."""
    return Frame(ERROR_CONTROL_BASE + node_id, bytes([state]))


# The heartbeats of other nodes


def heartbeat_entry(entry: int) -> tuple[int, float]:
    """Return node-ID and time in seconds of an entry of 0x1016 (CiA 301, Figure 60); 0.0 if it is not used."""
    node_id, milliseconds = entry >> 16 & 0xFF, entry & 0xFFFF
    return node_id, milliseconds / 1000 if node_id in NODE_IDS else 0.0


class HeartbeatConsumer(Deadlines[int]):
    """Watches the heartbeats that 0x1016 names; `missed` are the node-IDs that are silent now."""

    def configure(self, entries: Iterable[int]) -> None:
        """Take over the entries of 0x1016."""
        # Any change of a communication object ends up here, and must not interrupt the watch over the other nodes.
        self.change({node_id: time for node_id, time in map(heartbeat_entry, entries) if time})

    @property
    def identifiers(self) -> set[int]:
        """COB-IDs of the heartbeats that are watched."""
        return {ERROR_CONTROL_BASE + node_id for node_id in self.times}

    def booted(self, node_id: int, now: float) -> bool:
        """Note a boot-up message; return whether its node had been lost."""
        # A node without heartbeats boots, too. That does not start a watch, but it ends the loss of a node that is
        # watched.
        return self.heard(node_id, now) if self.awaits(node_id) else self.back(node_id)


# Node guarding


TOGGLE = 1 << 7
"""The bit of an answer that toggles, from 0 on, so that a repeated answer can be told from a new one."""


MASTER = "master"
"""Whom a guarded node awaits."""


class NodeGuarding(Deadlines[str]):
    """The guarded side: the master must not be silent for too long, once it has asked."""

    def __init__(self) -> None:
        super().__init__()
        self._toggle = 0

    def configure(self, life_time: float) -> None:
        """Set how long the master may be silent, 0.0 for ever; a changed time counts from the next request on."""
        self.change({MASTER: life_time} if life_time else {})

    def answer(self, node_id: int, state: NmtState, now: float) -> Frame:
        """Return the answer to a guarding request."""
        data = bytes([self._toggle | state])
        # Only a reset, which makes a new object, starts at 0 again; a silent master does not.
        self._toggle ^= TOGGLE
        self.heard(MASTER, now)
        return Frame(ERROR_CONTROL_BASE + node_id, data)
