"""Faults that any node can have: network management, heartbeat, emergencies, SDO, frames of a wrong length."""

from __future__ import annotations

from collections.abc import Iterable

from eurobot_od.device.emergency import ErrorCode
from eurobot_od.device.nmt import NmtCommand, NmtState, error_control
from eurobot_od.device.node import Node
from eurobot_od.frame import Frame
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.robot.faults.fault import Caught, Fault
from eurobot_od.robot.faults.hooks import (
    arriving,
    data,
    emcy,
    every,
    heartbeat,
    kept,
    leaving,
    lost,
    moved,
    nmt,
    numbered,
    only,
    sdo_answer,
    sdo_request,
    twice,
)
from eurobot_od.sdo.wire import ABORT, LENGTH, AbortCode, ClientCommand, Initiate, ServerCommand, aborted, initiate

BOOT_UP = NmtState.INITIALISING

BOOTED = 1
"""The number of the boot-up message among the heartbeats; the first heartbeat is the next one."""


class AlwaysOperational(Node):
    """Goes on with its work in every NMT state."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        state = self.device.state
        if frame.cob_id == NMT_COB_ID or state is NmtState.INITIALISING:
            return super().receive(frame, now)
        self.device.state = NmtState.OPERATIONAL
        answers = super().receive(frame, now)
        self.device.state = state
        return answers


class WritesForgotten(Node):
    """Confirms what is written by SDO and forgets it."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        is_request = frame.cob_id == sdo_request(self) and len(frame.data) == LENGTH
        if is_request and frame.data[0] >> 5 == ClientCommand.DOWNLOAD:
            return [Frame(sdo_answer(self), initiate(ServerCommand.DOWNLOAD << 5, Initiate.of(frame.data).address))]
        return super().receive(frame, now)


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


def _always_well(node: Node, frame: Frame) -> Iterable[Frame]:
    return [frame if frame.data[0] == BOOT_UP else error_control(node.device.node_id, NmtState.OPERATIONAL)]


def _to_us(node: Node, frame: Frame) -> Iterable[Frame]:
    return [Frame(frame.cob_id, frame.data[:1] + bytes([node.device.node_id]))]


def _general_abort(_: Node, frame: Frame) -> Iterable[Frame]:
    if frame.data[0] != ABORT:
        return [frame]
    return [Frame(frame.cob_id, aborted(Initiate.of(frame.data).address, AbortCode.GENERAL))]


def _babble(node: Node) -> None:
    node.raise_error(ErrorCode.PDO_TOO_LONG, "babble")
    node.clear_error("babble")


FAULTS = (
    Fault(
        "boot-up-missing",
        "sends no boot-up message",
        leaving(heartbeat, only(lambda data: data[0] != BOOT_UP)),
        Caught("canopen", "7.2.8.3.3 NMT: boot-up after a reset"),
    ),
    Fault(
        "reset-ignored",
        "goes on when it is told to reset",
        arriving(nmt, only(lambda data: data[:1] != bytes([NmtCommand.RESET_NODE]))),
        Caught("canopen", "7.2.8.3.3 NMT: boot-up after a reset"),
    ),
    Fault(
        "heartbeat-missing",
        "sends no heartbeat",
        leaving(heartbeat, only(lambda data: data[0] == BOOT_UP)),
        Caught("canopen", "7.2.8.3.2 Heartbeat: OPERATIONAL by itself, as 0x1F80 says"),
    ),
    Fault(
        "heartbeat-stops",
        "sends two heartbeats and then no more",
        numbered(heartbeat, lambda number: kept if number <= BOOTED + 2 else lost),
        Caught("canopen", "7.2.8.3.2 Heartbeat: every second"),
    ),
    Fault(
        "heartbeat-every-other",
        "sends only every other heartbeat",
        numbered(heartbeat, lambda number: kept if number == BOOTED or number % 2 == 0 else lost),
        Caught("canopen", "7.2.8.3.2 Heartbeat: every second"),
    ),
    Fault(
        "heartbeat-of-another-node",
        "sends boot-up and heartbeat under the next node's identifier",
        leaving(heartbeat, moved(1)),
        Caught("canopen", "7.2.8.3.3 NMT: boot-up after a reset"),
    ),
    Fault(
        "heartbeat-always-operational",
        "says OPERATIONAL in every state",
        leaving(heartbeat, _always_well),
        Caught("canopen", "7.2.8.3.2 Heartbeat: PRE-OPERATIONAL"),
    ),
    Fault(
        "nmt-ignored",
        "hears no NMT command",
        arriving(nmt, lost),
        Caught("canopen", "7.2.8.3.3 NMT: boot-up after a reset"),
    ),
    Fault(
        "nmt-stop-ignored",
        "does not hear the NMT command Stop",
        arriving(nmt, only(lambda data: data[:1] != bytes([NmtCommand.STOP]))),
        Caught("canopen", "7.2.8.3.2 Heartbeat: STOPPED"),
    ),
    Fault(
        "nmt-of-others-heeded",
        "carries out the NMT commands of other nodes",
        arriving(nmt, _to_us),
        Caught("canopen", "7.2.8.2.1 NMT: another node's command does not matter"),
    ),
    Fault(
        "works-when-stopped",
        "answers messages in every NMT state",
        AlwaysOperational,
        Caught("canopen", "7.3.2.2.4 NMT: no PDOs in PRE-OPERATIONAL"),
    ),
    Fault(
        "deaf-when-stopped",
        "heeds stops and shutdowns only in OPERATIONAL",
        DeafWhenStopped,
        Caught("canopen", "4.2.2 Emergency mushroom: acts in every NMT state"),
    ),
    Fault(
        "emcy-missing",
        "sends no EMCY",
        leaving(emcy, lost),
        Caught("canopen", "7.2.7 EMCY: a frame that is too short"),
    ),
    Fault(
        "emcy-twice",
        "sends each EMCY two times",
        leaving(emcy, twice),
        Caught("canopen", "7.2.7 EMCY: an error is reported once"),
    ),
    Fault(
        "emcy-code-wrong",
        "sends the bytes of the emergency error code the wrong way round",
        leaving(emcy, data(lambda data: data[1::-1] + data[2:])),
        Caught("canopen", "7.2.7 EMCY: a frame that is too short"),
    ),
    Fault(
        "emcy-not-cleared",
        "does not say that an error is gone",
        leaving(emcy, only(lambda data: data[:2] != ErrorCode.NO_ERROR.to_bytes(2, "little"))),
        Caught("canopen", "7.2.7 EMCY: the error is gone"),
    ),
    Fault(
        "short-frame-filled-up",
        "fills up short messages with left-over bytes and acts on them (2014 robot)",
        Padded,
        Caught("canopen", "7.2.7 EMCY: a frame that is too short"),
    ),
    Fault(
        "sdo-not-answered",
        "answers no SDO request",
        arriving(sdo_request, lost),
        Caught("canopen", "7.5.2.1 SDO: the device type is readable"),
    ),
    Fault(
        "sdo-value-reversed",
        "sends the bytes of values the wrong way round",
        leaving(sdo_answer, data(lambda data: data[:4] + data[:3:-1])),
        Caught("canopen", "7.5.2.20 SDO: the heartbeat time is 1000 ms"),
    ),
    Fault(
        "sdo-write-forgotten",
        "confirms what is written and forgets it",
        WritesForgotten,
        Caught("canopen", "7.2.4.2.3 SDO: what is written is read back"),
    ),
    Fault(
        "sdo-abort-general",
        "refuses everything with the code for a general error",
        leaving(sdo_answer, _general_abort),
        Caught("canopen", "7.2.4.3.17 SDO: an object that is not there"),
    ),
    Fault(
        "sdo-abort-silent",
        "does not answer a request that it refuses",
        leaving(sdo_answer, only(lambda data: data[0] != ABORT)),
        Caught("canopen", "7.2.4.3.17 SDO: an object that is not there"),
    ),
    Fault(
        "babbling",
        "sends emergencies all the time",
        every(0.001, _babble),
        Caught("canopen", "7.2.7 EMCY: none without an error"),
    ),
)
