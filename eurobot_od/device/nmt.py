"""The NMT slave: states, commands, boot-up and heartbeat (CiA 301, 7.2.8 and 7.3.2).

Rule of this file: no clock and no bus; the state machine is one table, and its result says who resets what.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple

from eurobot_od.frame import Frame
from eurobot_od.od.values import ERROR_CONTROL_BASE, NMT_COB_ID, Value

ALL_NODES = 0


class NmtState(IntEnum):
    """NMT states; the value is the one in the heartbeat (CiA 301, 7.2.8.3.2.2)."""

    INITIALISING = 0
    STOPPED = 4
    OPERATIONAL = 5
    PRE_OPERATIONAL = 127


STATE_NAMES: Mapping[int, str] = {each: each.name.lower().replace("_", "-") for each in NmtState} | {0: "boot-up"}
"""What a heartbeat says, by the state in it: of INITIALISING nothing is ever heard but the boot-up message."""


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


class NmtCommand(IntEnum):
    """NMT commands; the value is the command specifier (CiA 301, 7.2.8.2.1)."""

    START = 1
    STOP = 2
    ENTER_PRE_OPERATIONAL = 128
    RESET_NODE = 129
    RESET_COMMUNICATION = 130


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

STAY_PRE_OPERATIONAL = 1 << 2
"""Bit of NMT startup 0x1F80: set, the node waits for a master's start (CiA 302-2)."""


def command_in(frame: Frame, node_id: int) -> NmtCommand | None:
    """Return the NMT command a frame has for this node, None for any other frame."""
    # NMT has no answers (CiA 301, 7.2.8.2.1), so there is nobody to tell of a command that is malformed or unknown.
    if frame.cob_id != NMT_COB_ID or len(frame.data) != 2 or frame.data[1] not in (ALL_NODES, node_id):
        return None
    return NmtCommand(frame.data[0]) if frame.data[0] in set(NmtCommand) else None


def boot_state(nmt_startup: Value) -> NmtState:
    """Return the state a node enters after its boot-up by 0x1F80; one without it waits for a master."""
    waits = not isinstance(nmt_startup, int) or nmt_startup & STAY_PRE_OPERATIONAL
    return NmtState.PRE_OPERATIONAL if waits else NmtState.OPERATIONAL


def error_control(node_id: int, state: NmtState) -> Frame:
    """Return the heartbeat frame; with INITIALISING it is the boot-up message."""
    return Frame(ERROR_CONTROL_BASE + node_id, bytes([state]))
