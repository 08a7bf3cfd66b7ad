"""Faults that any device can have, and those of drives (CiA 402).

A device's are in network management, heartbeat, guarding, emergencies, SDO, TPDOs and SYNC. A drive's are in its motor,
its encoder, or in what it makes of its commands; the step that finds each is one of `check --profile 402`.
"""

from __future__ import annotations

from typing import ClassVar

from eurobot_od.device import faults as hooks
from eurobot_od.device.faults import Caught, Mixin
from eurobot_od.device.nmt import TOGGLE, NmtCommand, NmtState
from eurobot_od.device.node import Node
from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.device.profiles.axis import DriveAxis
from eurobot_od.device.profiles.modes import Homing
from eurobot_od.device.profiles.motion import STEP
from eurobot_od.frame import Frame
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import DriveCommand, State, Transition
from eurobot_od.od.standard import IDENTITY, ErrorCode
from eurobot_od.od.values import NMT_COB_ID
from eurobot_od.sdo import wire

MADE = "conformance"
"""The suites that are made from a device's file."""

BOOT_UP = NmtState.INITIALISING

BOOTED = 1
"""The number of the boot-up message among the heartbeats; the first heartbeat is the next one."""


class AlwaysOperational(Node):
    """Goes on with its work in every NMT state."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        state = self.device.state
        # It hears commands and says its true state: what is wrong is only what it does in that state.
        if frame.cob_id == NMT_COB_ID or state is NmtState.INITIALISING:
            return super().receive(frame, now)
        self.device.state = NmtState.OPERATIONAL
        answers = super().receive(frame, now)
        self.device.state = state
        return answers


class WritesForgotten(Node):
    """Confirms what is written by SDO and forgets it."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        is_request = frame.cob_id == hooks.sdo_request(self) and len(frame.data) == wire.LENGTH
        if is_request and frame.data[0] >> 5 == wire.ClientCommand.DOWNLOAD:
            address = wire.Initiate.of(frame.data).address
            return [Frame(hooks.sdo_answer(self), wire.initiate(wire.ServerCommand.DOWNLOAD << 5, address))]
        return super().receive(frame, now)


class OperationalByItself(Node):
    """Enters OPERATIONAL after each boot-up."""

    def reset(self) -> None:
        super().reset()
        self.device.state = NmtState.OPERATIONAL


class NoTpdos(Node):
    """Sends no TPDO."""

    def outgoing(self, frames: list[Frame]) -> list[Frame]:
        sent = {each.cob_id for each in self.device.protocol.bindings if self.name in each.senders}
        return [each for each in super().outgoing(frames) if each.cob_id not in sent]


class ErrorFromTheStart(Node):
    """Has an error as soon as it runs."""

    def reset(self) -> None:
        super().reset()
        self.raise_error(ErrorCode.HARDWARE, ErrorFromTheStart)


def _babble(node: Node) -> None:
    # an error that lasts is reported once; one that comes and goes, each time it comes and each time it goes
    node.raise_error(ErrorCode.PDO_TOO_LONG, "babble")
    node.clear_error("babble")


def _wrong_crc(content: bytes) -> bytes:
    # It is in bytes 1 and 2 of the end alone; the initiate has the same specifier (CiA 301, 7.2.4.3.14).
    is_end = content[0] >> 5 == wire.ServerCommand.BLOCK_UPLOAD and content[0] & 3 == wire.Block.END
    return bytes([content[0], content[1] ^ 1]) + content[2:] if is_end else content


FAULTS = {
    "boot-up-missing": Caught("canopen", "7.2.8.3.3 NMT: boot-up after a reset").fault(
        "sends no boot-up message", hooks.leaving(hooks.heartbeat, hooks.only(lambda data: data[0] != BOOT_UP))
    ),
    "reset-ignored": Caught("canopen", "7.2.8.3.3 NMT: boot-up after a reset").fault(
        "ignores the command to reset",
        hooks.arriving(hooks.nmt, hooks.only(lambda data: data[:1] != bytes([NmtCommand.RESET_NODE]))),
    ),
    "heartbeat-missing": Caught("canopen", "7.2.8.3.2 Heartbeat: OPERATIONAL by itself, as 0x1F80 says").fault(
        "sends no heartbeat", hooks.leaving(hooks.heartbeat, hooks.only(lambda data: data[0] == BOOT_UP))
    ),
    "heartbeat-stops": Caught("canopen", "7.2.8.3.2 Heartbeat: every second").fault(
        "sends two heartbeats and then no more",
        hooks.numbered(hooks.heartbeat, lambda number: hooks.kept if number <= BOOTED + 2 else hooks.lost),
    ),
    "heartbeat-every-other": Caught("canopen", "7.2.8.3.2 Heartbeat: every second").fault(
        "sends only every other heartbeat",
        hooks.numbered(
            hooks.heartbeat, lambda number: hooks.kept if number == BOOTED or number % 2 == 0 else hooks.lost
        ),
    ),
    "heartbeat-of-another-node": Caught("canopen", "7.2.8.3.3 NMT: boot-up after a reset").fault(
        "sends boot-up and heartbeat under the next node's identifier", hooks.leaving(hooks.heartbeat, hooks.moved(1))
    ),
    "heartbeat-always-operational": Caught("canopen", "7.2.8.3.2 Heartbeat: PRE-OPERATIONAL").fault(
        "says OPERATIONAL in every state",
        # the boot-up has the same COB-ID, and is another fault's
        hooks.leaving(
            hooks.heartbeat, hooks.data(lambda data: data if data[0] == BOOT_UP else bytes([NmtState.OPERATIONAL]))
        ),
    ),
    "nmt-ignored": Caught("canopen", "7.2.8.3.3 NMT: boot-up after a reset").fault(
        "hears no NMT command", hooks.arriving(hooks.nmt, hooks.lost)
    ),
    "nmt-stop-ignored": Caught("canopen", "7.2.8.3.2 Heartbeat: STOPPED").fault(
        "does not hear the NMT command Stop",
        hooks.arriving(hooks.nmt, hooks.only(lambda data: data[:1] != bytes([NmtCommand.STOP]))),
    ),
    "nmt-of-others-heeded": Caught("canopen", "7.2.8.2.1 NMT: another node's command does not matter").fault(
        "carries out the NMT commands of other nodes",
        hooks.arriving(
            hooks.nmt, lambda node, frame: [Frame(frame.cob_id, frame.data[:1] + bytes([node.device.node_id]))]
        ),
    ),
    "works-when-stopped": Caught("canopen", "7.3.2.2.4 NMT: no PDOs in PRE-OPERATIONAL").fault(
        "answers messages in every NMT state", AlwaysOperational
    ),
    "emcy-missing": Caught("canopen", "7.2.7 EMCY: a frame that is too short").fault(
        "sends no EMCY", hooks.leaving(hooks.emcy, hooks.lost)
    ),
    "emcy-twice": Caught("canopen", "7.2.7 EMCY: an error is reported once").fault(
        "sends each EMCY twice", hooks.leaving(hooks.emcy, hooks.twice)
    ),
    "emcy-code-wrong": Caught("canopen", "7.2.7 EMCY: a frame that is too short").fault(
        "sends the bytes of the emergency error code the wrong way round",
        hooks.leaving(hooks.emcy, hooks.data(lambda data: data[1::-1] + data[2:])),
    ),
    "emcy-not-cleared": Caught("canopen", "7.2.7 EMCY: the error is gone").fault(
        "does not say that an error is gone",
        hooks.leaving(hooks.emcy, hooks.only(lambda data: data[:2] != ErrorCode.NO_ERROR.to_bytes(2, "little"))),
    ),
    "sdo-not-answered": Caught("canopen", "7.5.2.1 SDO: the device type is readable").fault(
        "answers no SDO request", hooks.arriving(hooks.sdo_request, hooks.lost)
    ),
    "sdo-value-reversed": Caught("canopen", "7.5.2.20 SDO: the heartbeat time is 1000 ms").fault(
        "sends the bytes of values the wrong way round",
        # bytes 4 to 7 are the value of an expedited answer, filled up with zeros: 1000 comes as 0xE8030000
        hooks.leaving(hooks.sdo_answer, hooks.data(lambda data: data[:4] + data[:3:-1])),
    ),
    "sdo-write-forgotten": Caught("canopen", "7.2.4.2.3 SDO: what is written is read back").fault(
        "confirms what is written and forgets it", WritesForgotten
    ),
    "sdo-abort-general": Caught("canopen", "7.2.4.3.17 SDO: an object that is not there").fault(
        "refuses everything with the code for a general error",
        hooks.leaving(
            hooks.sdo_answer,
            hooks.data(
                lambda data: (
                    wire.aborted(wire.Initiate.of(data).address, wire.AbortCode.GENERAL)
                    if data[0] == wire.ABORT
                    else data
                )
            ),
        ),
    ),
    "sdo-abort-silent": Caught("canopen", "7.2.4.3.17 SDO: an object that is not there").fault(
        "does not answer a request that it refuses",
        hooks.leaving(hooks.sdo_answer, hooks.only(lambda data: data[0] != wire.ABORT)),
    ),
    "babbling": Caught("canopen", "7.2.7 EMCY: none without an error").fault(
        "sends emergencies all the time", hooks.every(0.001, _babble)
    ),
    "error-from-the-start": Caught(MADE, "7.5.2.2 Error register").fault(
        "has a hardware error as soon as it runs", ErrorFromTheStart
    ),
    "operational-by-itself": Caught(MADE, "7.3.2.2 NMT state: after a reset").fault(
        "enters OPERATIONAL without a master's command", OperationalByItself
    ),
    "identity-wrong": Caught(MADE, "7.5.2.21 Identity").fault(
        "has another product code than its file", hooks.other_value(lambda _: (IDENTITY, 2))
    ),
    "block-crc-wrong": Caught(MADE, "7.2.4.3.12 SDO block upload").fault(
        "has a wrong CRC at the end of a block transfer", hooks.leaving(hooks.sdo_answer, hooks.data(_wrong_crc))
    ),
    "tpdos-missing": Caught(MADE, "7.5.2.37 TPDO transmission").fault("sends no TPDO", NoTpdos),
    "sync-ignored": Caught(MADE, "7.2.2.2 TPDO transmission").fault(
        "hears no SYNC", hooks.arriving(hooks.sync, hooks.lost)
    ),
    "guarding-not-answered": Caught(MADE, "7.2.8.3.2.1 Node guarding").fault(
        "does not answer the remote frames of node guarding",
        hooks.asked(lambda node, cob_id, _: [] if cob_id == hooks.heartbeat(node) else None),
    ),
    "guarding-toggle-stuck": Caught(MADE, "7.2.8.3.2.1 Node guarding").fault(
        "answers node guarding with the same toggle bit each time",
        hooks.leaving(hooks.heartbeat, hooks.data(lambda data: bytes([data[0] & ~TOGGLE]))),
    ),
}


# Drives
OVERCURRENT, ENCODER = 0x2310, 0x7305
"""Error codes: continuous over-current, and sensor 1 (CiA 402-1)."""

HOLDS = 0.2
"""Seconds with torque after which the over-current comes."""


class BlockedAxis(DriveAxis):
    """Its motor does not turn."""

    def step(self) -> None:
        place = self.motor.position
        super().step()
        self.motor.position, self.motor.velocity = place, 0.0


class OvercurrentAxis(DriveAxis):
    """Its current is too high for the power stage."""

    powered_for = 0.0

    @property
    def busy(self) -> bool:
        return super().busy or self.state in cia402.POWERED

    def step(self) -> None:
        super().step()
        self.powered_for = self.powered_for + STEP if self.state is State.ENABLED else 0.0
        if self.powered_for > HOLDS:
            self.fault(OVERCURRENT)


class EncoderLostAxis(DriveAxis):
    """Its encoder is lost as soon as it has turned a little."""

    def step(self) -> None:
        super().step()
        if self.state is State.ENABLED and abs(self.motor.position - self.motor.origin) > self.motor.turn / 4:
            self.fault(ENCODER)


class NeverEnablesAxis(DriveAxis):
    """It stays in Switched on."""

    def take(self, arrow: Transition) -> None:
        if arrow.after is not State.ENABLED:
            super().take(arrow)


class HomingStuckAxis(DriveAxis):
    """It starts homing and never gets on with it."""

    def lead(self) -> None:
        if not isinstance(self._mode, Homing):
            super().lead()


class QuickStopIgnoredAxis(DriveAxis):
    """It does not hear the quick stop."""

    def arrow(self, command: DriveCommand | None) -> Transition | None:
        return None if command is DriveCommand.QUICK_STOP else super().arrow(command)


class ResetIgnoredAxis(DriveAxis):
    """It cannot leave Fault."""

    def take(self, arrow: Transition) -> None:
        if arrow.before is not State.FAULT:
            super().take(arrow)


class NeverReachedAxis(DriveAxis):
    """It does not say that it has reached its target."""

    @property
    def statusword(self) -> int:
        return super().statusword & ~cia402.TARGET_REACHED


class HastyAxis(DriveAxis):
    """It enables without being commanded to switch on first."""

    def arrow(self, command: DriveCommand | None) -> Transition | None:
        if self.state is State.DISABLED and command is DriveCommand.ENABLE:
            return Transition(0, State.DISABLED, command, State.ENABLED)
        return super().arrow(command)


def _with(axis: type[DriveAxis]) -> Mixin:
    class WithAxis(SimulatedDrive):
        AXIS: ClassVar[type[DriveAxis]] = axis

    return WithAxis


SUITE = "profile-402"
"""What `check --profile 402` makes."""

HOMING = Caught(SUITE, "11.1 Homing: present position is home")
MOVE = Caught(SUITE, "10.1 Profile position: there and back")
TABLE = "8.1 States: {} [reversible]"
ENABLE = "8.1 States with torque: Enable operation in Ready to switch on: Operation enabled"

DRIVE_FAULTS = {
    "following-error": MOVE.fault("its motor is blocked", _with(BlockedAxis)),
    "overcurrent": HOMING.fault("its current is too high soon after it is enabled", _with(OvercurrentAxis)),
    "encoder-lost": MOVE.fault("loses its encoder as it turns", _with(EncoderLostAxis)),
    "never-enables": Caught(SUITE, ENABLE).fault("stays in Switched on", _with(NeverEnablesAxis)),
    "homing-stuck": HOMING.fault("starts homing and never gets on with it", _with(HomingStuckAxis)),
    "quick-stop-ignored": Caught(SUITE, TABLE.format("Quick stop in Ready to switch on: Switch on disabled")).fault(
        "does not hear the quick stop", _with(QuickStopIgnoredAxis)
    ),
    "fault-reset-ignored": Caught(SUITE, "8.4 Connection: a lost heartbeat, and its reset").fault(
        "cannot leave Fault", _with(ResetIgnoredAxis)
    ),
    "target-never-reached": HOMING.fault("never says that a target is reached", _with(NeverReachedAxis)),
    "enables-at-once": Caught(SUITE, TABLE.format("Enable operation in Switch on disabled: stays")).fault(
        "enables from Switch on disabled", _with(HastyAxis)
    ),
}
