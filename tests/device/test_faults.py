"""Faults of any device: each does on a device from anybody's file what it says."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from eurobot_od.device.faults import FAULTS
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame
from tests.device.io_module import NODE_ID, module
from tests.device.master import NodeWire

HEARTBEATS, EMERGENCIES, ANSWERS, CHANGED, CYCLIC = (base + NODE_ID for base in (0x700, 0x080, 0x580, 0x180, 0x280))
PRODUCT = Frame(0x600 + NODE_ID, bytes.fromhex("4018100200000000"))
REQUEST = Frame(0x600 + NODE_ID, bytes.fromhex("4000200100000000"))
UNKNOWN = Frame(0x600 + NODE_ID, bytes.fromhex("4000400000000000"))
SHORT, COMMAND = (Frame(0x200 + NODE_ID, bytes(length)) for length in (1, 2))


def started(wire: NodeWire) -> None:
    wire.run(0.35)


def command(command: NmtCommand, node_id: int = 0) -> Callable[[NodeWire], None]:
    def act(wire: NodeWire) -> None:
        wire.command(command, node_id)
        wire.run(0.15)

    return act


def say(*frames: Frame) -> Callable[[NodeWire], None]:
    def act(wire: NodeWire) -> None:
        wire.command(NmtCommand.START)
        for frame in frames:
            wire.send(frame)

    return act


def write(wire: NodeWire) -> None:
    wire.send(Frame(REQUEST.cob_id, bytes.fromhex("2b00210009000000")))
    wire.send(Frame(REQUEST.cob_id, bytes.fromhex("4000210000000000")))


def read_in_blocks(wire: NodeWire) -> None:
    for request in ("a40020047f000000", "a300000000000000", "a2017f0000000000"):
        wire.send(Frame(REQUEST.cob_id, bytes.fromhex(request)))


def guard(wire: NodeWire) -> None:
    wire.write(0x1017, 0, 0, size=2)
    for _ in range(2):
        wire.heard += wire.node.requested(HEARTBEATS, wire.now)


class Case(NamedTuple):
    """What is done, and what the module then has sent with a COB-ID: healthy, and with the fault."""

    act: Callable[[NodeWire], object]
    cob_id: int
    healthy: str
    faulty: str


SHORT_EMCY, FINE = "1082110502010000", "0000000000000000"
BLOCK = "c600200407000000 8176616c76652041"
TAKEN, ABORTED = "6000210000000000", "8000400000000206"

CASES = {
    "boot-up-missing": Case(started, HEARTBEATS, "00 7f 7f 7f", "7f 7f 7f"),
    "reset-ignored": Case(command(NmtCommand.RESET_NODE), HEARTBEATS, "00 00 7f", "00 7f"),
    "heartbeat-missing": Case(started, HEARTBEATS, "00 7f 7f 7f", "00"),
    "heartbeat-stops": Case(started, HEARTBEATS, "00 7f 7f 7f", "00 7f 7f"),
    "heartbeat-every-other": Case(started, HEARTBEATS, "00 7f 7f 7f", "00 7f 7f"),
    "heartbeat-of-another-node": Case(started, HEARTBEATS, "00 7f 7f 7f", ""),
    "heartbeat-always-operational": Case(started, HEARTBEATS, "00 7f 7f 7f", "00 05 05 05"),
    "nmt-ignored": Case(command(NmtCommand.START), HEARTBEATS, "00 05", "00 7f"),
    "nmt-stop-ignored": Case(command(NmtCommand.STOP), HEARTBEATS, "00 04", "00 7f"),
    "nmt-of-others-heeded": Case(command(NmtCommand.START, NODE_ID + 1), HEARTBEATS, "00 7f", "00 05"),
    "works-when-stopped": Case(lambda wire: wire.send(SHORT), EMERGENCIES, "", SHORT_EMCY),
    "emcy-missing": Case(say(SHORT), EMERGENCIES, SHORT_EMCY, ""),
    "emcy-twice": Case(say(SHORT), EMERGENCIES, SHORT_EMCY, f"{SHORT_EMCY} {SHORT_EMCY}"),
    "emcy-code-wrong": Case(say(SHORT), EMERGENCIES, SHORT_EMCY, "8210110502010000"),
    "emcy-not-cleared": Case(say(SHORT, COMMAND), EMERGENCIES, f"{SHORT_EMCY} {FINE}", SHORT_EMCY),
    "sdo-not-answered": Case(say(REQUEST), ANSWERS, "4b002001fbff0000", ""),
    "sdo-value-reversed": Case(say(REQUEST), ANSWERS, "4b002001fbff0000", "4b0020010000fffb"),
    "sdo-write-forgotten": Case(write, ANSWERS, f"{TAKEN} 4b00210009000000", f"{TAKEN} 4b00210000000000"),
    "sdo-abort-general": Case(say(UNKNOWN), ANSWERS, ABORTED, "8000400000000008"),
    "sdo-abort-silent": Case(say(UNKNOWN), ANSWERS, ABORTED, ""),
    "error-from-the-start": Case(started, EMERGENCIES, "", "0050010000000000"),
    "operational-by-itself": Case(started, HEARTBEATS, "00 7f 7f 7f", "00 05 05 05"),
    "identity-wrong": Case(say(PRODUCT), ANSWERS, "4318100207000000", "4318100206000000"),
    "block-crc-wrong": Case(read_in_blocks, ANSWERS, f"{BLOCK} c17fe60000000000", f"{BLOCK} c17ee60000000000"),
    "tpdos-missing": Case(say(), CHANGED, "fbff0000", ""),
    "sync-ignored": Case(say(Frame(0x080)), CYCLIC, "0000c03f01", ""),
    "guarding-not-answered": Case(guard, HEARTBEATS, "00 7f ff", "00"),
    "guarding-toggle-stuck": Case(guard, HEARTBEATS, "00 7f ff", "00 7f 7f"),
    "babbling": Case(lambda wire: wire.run(0.0015), EMERGENCIES, "", f"2082110000000000 {FINE}"),
}


def sent(case: Case, kind: type[SimulatedDevice]) -> str:
    given: dict[Any, Any] = {(0x1017, 0): 100}
    wire = module(kind, given=given)
    case.act(wire)
    return " ".join(frame.data.hex() for frame in wire.heard if frame.cob_id == case.cob_id)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_does_what_it_says(name: str) -> None:
    case = CASES[name]
    assert sent(case, SimulatedDevice) == case.healthy
    assert sent(case, FAULTS[name].given_to(SimulatedDevice)) == case.faulty
