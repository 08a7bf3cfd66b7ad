"""Faults of devices on demand: each is a mixin class for a node; and the functions that make such classes.

A mixin comes before the node's class and overrides methods of `Node`: `handle`, `reset`, `setting`, `receive`; frames
to send go through `Leaving.outgoing`. The node's own class does not change. With several mixins, received frames pass
the first one first, frames to send the last one.

Every fault names the step of a suite that finds it. Here are the faults of any device, and of drives (CiA 402). Faults
of the nodes of one network, such as the robot's, are with those nodes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from functools import partial
from itertools import count
from typing import Any, ClassVar, NamedTuple, TypeAlias, TypeVar

from eurobot_od.device.nmt import TOGGLE, NmtCommand, NmtState
from eurobot_od.device.node import Node
from eurobot_od.device.profiles import SimulatedDrive
from eurobot_od.device.profiles.axis import DriveAxis
from eurobot_od.device.profiles.modes import Homing
from eurobot_od.device.profiles.motion import STEP
from eurobot_od.frame import Frame
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import DriveCommand, State, Transition
from eurobot_od.od.standard import EMCY, IDENTITY, SYNC, ErrorCode
from eurobot_od.od.values import BASE_IDENTIFIER, ERROR_CONTROL_BASE, NMT_COB_ID, Address
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import Message
from eurobot_od.sdo import wire
from eurobot_od.support import texts

NodeT = TypeVar("NodeT", bound=Node)


class Caught(NamedTuple):
    """The step of a suite that finds a fault."""

    suite: str
    step: str

    def fault(self, text: str, mixin: Mixin) -> Fault:
        """Return a fault that this step finds."""
        return Fault(text, mixin, self)


class Fault(NamedTuple):
    """A fault of a node.

    `mixin` is the class before the node's class; `text` describes the fault.
    """

    text: str
    mixin: Mixin
    caught_by: Caught

    def given_to(self, role: type[NodeT]) -> type[NodeT]:
        """Return a node's class with this fault."""
        return type(role.__name__, (self.mixin, role), {})


# Faults of messages


class Wrong(NamedTuple):
    """A kind of fault for any message: description, with `{}` for the message, and function that makes the mixin."""

    text: str
    mixin: Callable[[type[Message]], Mixin]


def _reversed(content: bytes) -> bytes:
    return content[::-1]


NOT_SENT = Wrong("sends no {}", lambda message: leaving(message, lost))
NOT_ANSWERED = Wrong("answers no {}", lambda message: arriving(message, lost))
NOT_HEARD = Wrong("does not hear {}", lambda message: arriving(message, lost))
TWICE = Wrong("sends {} twice", lambda message: leaving(message, twice))
MOVED = Wrong("sends {} one identifier too high", lambda message: leaving(message, moved(1)))
REVERSED = Wrong("sends the bytes of {} the wrong way round", lambda message: leaving(message, data(_reversed)))
READ_REVERSED = Wrong("reads the bytes of {} the wrong way round", lambda message: arriving(message, data(_reversed)))

OF_SENDER = {"not-sent": NOT_SENT, "sent-twice": TWICE, "moved": MOVED}
OF_RECEIVER = {"not-heard": NOT_HEARD}
"""Faults of every message in its sender, and in its receivers, by the suffix of the fault's name."""

NO_STEP = Caught("", "")
"""For a fault that the shipped suites need not find."""


def sent_late(seconds: float) -> Wrong:
    """Return the fault of a message that is delayed by `seconds`."""
    return Wrong(f"sends {{}} {texts.text(seconds)} late", lambda message: late(message, seconds))


def words(message: type[Message]) -> str:
    """Return a message's name as in the document: `Goto XY`, `Enemy 1 Position Request`."""
    return re.sub(r"(?<=[a-z])(?=[A-Z0-9])|(?<=[0-9])(?=[A-Z])", " ", message.__name__)


def generated(binding: Binding, node: str) -> dict[str, Fault]:
    """Return the faults of a message in one of its nodes by name; the name has the node if there are several."""
    order = {"reversed": REVERSED} if binding.layout.length > 1 else {}  # one byte reversed is itself
    name = words(binding.type).lower().replace(" ", "-")
    made = {}
    for nodes, kinds in ((binding.senders, {**OF_SENDER, **order}), (binding.receivers, OF_RECEIVER)):
        if node not in nodes:
            continue
        for end, wrong in kinds.items():
            fault = NO_STEP.fault(wrong.text.format(words(binding.type)), wrong.mixin(binding.type))
            # With the node's name, because the command line has only the fault's name.
            made[f"{name}-{end}-by-{node}" if len(nodes) > 1 else f"{name}-{end}"] = fault
    return made


Mixin: TypeAlias = type[Node]
"""A class that comes before a node's class."""

FrameChange: TypeAlias = Callable[[Any, Frame], Iterable[Frame]]
"""Function from node and frame to the frames that replace it."""

ServiceCobId: TypeAlias = "Callable[[Node], int | None]"
"""Function from a node to the COB-ID of one of its services, or None."""

Which: TypeAlias = "type[Message] | ServiceCobId"
"""Selection of frames: those of a message, or of a service."""

React: TypeAlias = Callable[[Any, Any, Callable[[Any], None]], object]
"""Handler of a message: called with node, message, and the node's normal handler."""


def heartbeat(node: Node) -> int:
    """Return the COB-ID of boot-up and heartbeat."""
    return ERROR_CONTROL_BASE + node.device.node_id


def emcy(node: Node) -> int | None:
    """Return the COB-ID of EMCY."""
    return node.device.objects.cob_id(EMCY)


def sdo_answer(node: Node) -> int:
    """Return the COB-ID of the SDO server's answers."""
    return node.device.sdo_service.answers


def sdo_request(node: Node) -> int:
    """Return the COB-ID of requests to the SDO server."""
    return node.device.sdo_service.requests


def sync(node: Node) -> int:
    """Return the COB-ID of SYNC."""
    return node.device.objects.raw(SYNC) & BASE_IDENTIFIER


def nmt(_node: Node) -> int:
    """Return the COB-ID of NMT."""
    return NMT_COB_ID


def _cob_id(node: Node, which: Which) -> int | None:
    return node.device.protocol.cob_id(which) if isinstance(which, type) else which(node)


# Hooks


class Leaving(Node):
    """A node whose frames to send all go through `outgoing`."""

    def outgoing(self, frames: list[Frame]) -> list[Frame]:
        """Return the frames that are really sent."""
        return frames

    def start(self, now: float) -> list[Frame]:
        return self.outgoing(super().start(now))

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        return self.outgoing(super().receive(frame, now))

    def requested(self, cob_id: int, now: float) -> list[Frame]:
        return self.outgoing(super().requested(cob_id, now))

    def tick(self, now: float) -> list[Frame]:
        return self.outgoing(super().tick(now))

    def restart(self, now: float) -> list[Frame]:
        return self.outgoing(super().restart(now))

    def bus_lost(self, now: float) -> list[Frame]:
        return self.outgoing(super().bus_lost(now))

    def failed(self, error: BaseException, now: float) -> list[Frame]:
        return self.outgoing(super().failed(error, now))


def leaving(which: Which, change: FrameChange) -> Mixin:
    """Return the mixin that applies `change` to frames to send."""

    class Changed(Leaving):
        def outgoing(self, frames: list[Frame]) -> list[Frame]:
            return _changed(super().outgoing(frames), _cob_id(self, which), lambda frame: change(self, frame))

    return Changed


def numbered(which: Which, change: Callable[[int], FrameChange]) -> Mixin:
    """Return the mixin that changes frames to send by their number, from 1 on after each start or reset."""

    class Numbered(Leaving):
        def reset(self) -> None:
            super().reset()
            self._numbers = count(1)

        def outgoing(self, frames: list[Frame]) -> list[Frame]:
            numbered = super().outgoing(frames)
            return _changed(numbered, _cob_id(self, which), lambda frame: change(next(self._numbers))(self, frame))

    return Numbered


def late(which: Which, seconds: float) -> Mixin:
    """Return the mixin that delays frames to send by `seconds`."""

    class Late(Leaving):
        def reset(self) -> None:
            super().reset()
            self._due: list[Frame] = []

        def outgoing(self, frames: list[Frame]) -> list[Frame]:
            in_time = _changed(super().outgoing(frames), _cob_id(self, which), self._hold)
            # The timer in `_hold` makes the node send at that time.
            due = self._due
            self._due = []
            return in_time + due

        def _hold(self, frame: Frame) -> Iterable[Frame]:
            self.at(self.now + seconds, lambda _: self._due.append(frame))
            return ()

    return Late


def arriving(which: Which, change: FrameChange) -> Mixin:
    """Return the mixin that applies `change` to frames before the node receives them."""

    class Arriving(Node):
        def receive(self, frame: Frame, now: float) -> list[Frame]:
            # For each frame, because a master may change COB-IDs.
            arrived = change(self, frame) if frame.cob_id == _cob_id(self, which) else [frame]
            return [answer for each in arrived for answer in super(Arriving, self).receive(each, now)]

    return Arriving


def handling(message_type: type[Message], react: React) -> Mixin:
    """Return the mixin that handles a message by `react`."""

    class Handling(Node):
        def handle(self, message: Message) -> None:
            if isinstance(message, message_type):
                react(self, message, super().handle)
            else:
                super().handle(message)

    return Handling


def preset(setting: str, value: int) -> Mixin:
    """Return the mixin with another value of a setting than the object dictionary's."""

    class Preset(Node):
        def setting(self, name: str) -> float:
            return value if name == setting else super().setting(name)

    return Preset


def asked(answer: Callable[[Node, int, float], list[Frame] | None]) -> Mixin:
    """Return the mixin that answers remote frames; `answer` returns None to leave one to the node."""

    class Asked(Node):
        def requested(self, cob_id: int, now: float) -> list[Frame]:
            answers = answer(self, cob_id, now)
            return super().requested(cob_id, now) if answers is None else answers

    return Asked


def after_reset(action: Callable[[Any], object]) -> Mixin:
    """Return the mixin that calls `action` with the node after its start and each reset."""

    class AfterReset(Node):
        def reset(self) -> None:
            super().reset()
            action(self)

    return AfterReset


def other_value(choose: Callable[[Node], Address | None]) -> Mixin:
    """Return the mixin with another value of an object after power-on than the file's."""

    def change(node: Node) -> None:
        address = choose(node)
        if address is not None:
            # Inverting the lowest bit is valid for any whole number.
            node.device.objects.values[address] = node.device.objects.raw(address) ^ 1

    return after_reset(change)


def every(seconds: float, action: Callable[[Any], object]) -> Mixin:
    """Return the mixin that calls `action` with the node periodically from its start on."""

    def again(node: Node, now: float) -> None:
        action(node)
        node.at(now + seconds, partial(again, node))

    return after_reset(lambda node: node.at(node.now + seconds, partial(again, node)))


def _changed(frames: Iterable[Frame], cob_id: int | None, change: Callable[[Frame], Iterable[Frame]]) -> list[Frame]:
    """Return the frames, with those of one COB-ID replaced by `change`."""
    found: list[Frame] = []
    for frame in frames:
        found += change(frame) if frame.cob_id == cob_id else [frame]
    return found


# Changes


def kept(_node: Node, frame: Frame) -> Iterable[Frame]:
    """Keep the frame."""
    return (frame,)


def lost(_node: Node, _frame: Frame) -> Iterable[Frame]:
    """Lose the frame."""
    return ()


def twice(_node: Node, frame: Frame) -> Iterable[Frame]:
    """Double the frame."""
    return frame, frame


def only(wanted: Callable[[bytes], bool]) -> FrameChange:
    """Return the change that loses frames whose data is not `wanted`."""
    return lambda _, frame: [frame] if wanted(frame.data) else []


def without(start: int | bytes) -> FrameChange:
    """Return the change that loses frames whose data begins like this."""
    return only(lambda data: not data.startswith(bytes([start]) if isinstance(start, int) else start))


def data(change: Callable[[bytes], bytes]) -> FrameChange:
    """Return the change of a frame's data."""
    return lambda _, frame: [Frame(frame.cob_id, change(frame.data))]


def moved(offset: int) -> FrameChange:
    """Return the change that adds `offset` to the COB-ID."""
    return lambda _, frame: [Frame(frame.cob_id + offset, frame.data)]


def unawaited(answer: Message) -> FrameChange:
    """Return the change that makes the node handle the answer to a request at once, without waiting for it."""

    def changed(node: Node, frame: Frame) -> Iterable[Frame]:
        node.soon(lambda _: node.handle(answer))  # later, because the node is just sending the request
        return [frame]

    return changed


# Faults of any device: NMT, heartbeat, guarding, EMCY, SDO, TPDOs and SYNC


MADE = "conformance"
"""Name of the suites that are made from a device's file."""

BOOT_UP = NmtState.INITIALISING

BOOTED = 1
"""Number of the boot-up message among the heartbeats."""


class AlwaysOperational(Node):
    """Works in every NMT state."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        state = self.device.state
        # NMT commands and heartbeat are not affected.
        if frame.cob_id == NMT_COB_ID or state is NmtState.INITIALISING:
            return super().receive(frame, now)
        self.device.state = NmtState.OPERATIONAL
        answers = super().receive(frame, now)
        self.device.state = state
        return answers


class WritesForgotten(Node):
    """Confirms writes by SDO without effect."""

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        is_request = frame.cob_id == sdo_request(self) and len(frame.data) == wire.LENGTH
        if is_request and frame.data[0] >> 5 == wire.ClientCommand.DOWNLOAD:
            address = wire.Initiate.of(frame.data).address
            return [Frame(sdo_answer(self), wire.initiate(wire.ServerCommand.DOWNLOAD << 5, address))]
        return super().receive(frame, now)


class NoTpdos(Leaving):
    """Sends no TPDO."""

    def outgoing(self, frames: list[Frame]) -> list[Frame]:
        sent = {each.cob_id for each in self.device.protocol.bindings if self.name in each.senders}
        return [each for each in super().outgoing(frames) if each.cob_id not in sent]


def _operational(node: Node) -> None:
    node.device.state = NmtState.OPERATIONAL


def _babble(node: Node) -> None:
    # A lasting error would be reported only once.
    node.raise_error(ErrorCode.PDO_TOO_LONG, "babble")
    node.clear_error("babble")


def _to_this_node(node: Node, frame: Frame) -> list[Frame]:
    return [Frame(frame.cob_id, frame.data[:1] + bytes([node.device.node_id]))]


def _always_operational(content: bytes) -> bytes:
    # The boot-up message has the same COB-ID.
    return content if content[0] == BOOT_UP else bytes([NmtState.OPERATIONAL])


def _abort_general(content: bytes) -> bytes:
    is_abort = content[0] == wire.ABORT
    return wire.aborted(wire.Initiate.of(content).address, wire.AbortCode.GENERAL) if is_abort else content


def _wrong_crc(content: bytes) -> bytes:
    # Bytes 1 and 2 of the end are the CRC; the initiate has the same specifier (CiA 301, 7.2.4.3.14).
    is_end = content[0] >> 5 == wire.ServerCommand.BLOCK_UPLOAD and content[0] & 3 == wire.Block.END
    return bytes([content[0], content[1] ^ 1]) + content[2:] if is_end else content


def found_by(suite: str, *rows: tuple[str, str, str, Mixin]) -> dict[str, Fault]:
    """Return the faults that one suite finds; a row has the fault's name, its description, the step, and the mixin."""
    return {name: Caught(suite, step).fault(text, mixin) for name, text, step, mixin in rows}


AFTER_RESET, PERIOD = "7.2.8.3.3 NMT: boot-up after a reset", "7.2.8.3.2 Heartbeat: every second"
TOO_SHORT, NO_OBJECT = "7.2.7 EMCY: a frame that is too short", "7.2.4.3.17 SDO: an object that is not there"

FAULTS = {
    **found_by(
        "canopen",
        ("boot-up-missing", "sends no boot-up message", AFTER_RESET, leaving(heartbeat, without(BOOT_UP))),
        ("reset-ignored", "ignores the command to reset", AFTER_RESET, arriving(nmt, without(NmtCommand.RESET_NODE))),
        ("heartbeat-missing", "sends no heartbeat", "7.2.8.3.2 Heartbeat: OPERATIONAL by itself, as 0x1F80 says",
         leaving(heartbeat, only(lambda data: data[0] == BOOT_UP))),
        ("heartbeat-stops", "sends two heartbeats and then no more", PERIOD,
         numbered(heartbeat, lambda number: kept if number <= BOOTED + 2 else lost)),
        ("heartbeat-every-other", "sends only every other heartbeat", PERIOD,
         numbered(heartbeat, lambda number: kept if number == BOOTED or number % 2 == 0 else lost)),
        ("heartbeat-of-another-node", "sends boot-up and heartbeat under the next node's identifier", AFTER_RESET,
         leaving(heartbeat, moved(1))),
        ("heartbeat-always-operational", "says OPERATIONAL in every state", "7.2.8.3.2 Heartbeat: PRE-OPERATIONAL",
         leaving(heartbeat, data(_always_operational))),
        ("nmt-ignored", "hears no NMT command", AFTER_RESET, arriving(nmt, lost)),
        ("nmt-stop-ignored", "does not hear the NMT command Stop", "7.2.8.3.2 Heartbeat: STOPPED",
         arriving(nmt, without(NmtCommand.STOP))),
        ("nmt-of-others-heeded", "carries out the NMT commands of other nodes",
         "7.2.8.2.1 NMT: another node's command does not matter",
         arriving(nmt, _to_this_node)),
        ("works-when-stopped", "answers messages in every NMT state", "7.3.2.2.4 NMT: no PDOs in PRE-OPERATIONAL",
         AlwaysOperational),
        ("emcy-missing", "sends no EMCY", TOO_SHORT, leaving(emcy, lost)),
        ("emcy-twice", "sends each EMCY twice", "7.2.7 EMCY: an error is reported once", leaving(emcy, twice)),
        ("emcy-code-wrong", "sends the bytes of the emergency error code the wrong way round", TOO_SHORT,
         leaving(emcy, data(lambda data: data[1::-1] + data[2:]))),
        ("emcy-not-cleared", "does not say that an error is gone", "7.2.7 EMCY: the error is gone",
         leaving(emcy, without(ErrorCode.NO_ERROR.to_bytes(2, "little")))),
        ("sdo-not-answered", "answers no SDO request", "7.5.2.1 SDO: the device type is readable",
         arriving(sdo_request, lost)),
        # Bytes 4 to 7 are the value of an expedited answer, padded with zeros: 1000 becomes 0xE8030000.
        ("sdo-value-reversed", "sends the bytes of values the wrong way round",
         "7.5.2.20 SDO: the heartbeat time is 1000 ms",
         leaving(sdo_answer, data(lambda data: data[:4] + data[:3:-1]))),
        ("sdo-write-forgotten", "confirms what is written and forgets it",
         "7.2.4.2.3 SDO: what is written is read back", WritesForgotten),
        ("sdo-abort-general", "refuses everything with the code for a general error", NO_OBJECT,
         leaving(sdo_answer, data(_abort_general))),
        ("sdo-abort-silent", "does not answer a request that it refuses", NO_OBJECT,
         leaving(sdo_answer, without(wire.ABORT))),
        ("babbling", "sends emergencies all the time", "7.2.7 EMCY: none without an error", every(0.001, _babble)),
    ),
    **found_by(
        MADE,
        ("error-from-the-start", "has a hardware error as soon as it runs", "7.5.2.2 Error register",
         after_reset(lambda node: node.raise_error(ErrorCode.HARDWARE, "from the start"))),
        ("operational-by-itself", "enters OPERATIONAL without a master's command",
         "7.3.2.2 NMT state: after a reset", after_reset(_operational)),
        ("identity-wrong", "has another product code than its file", "7.5.2.21 Identity",
         other_value(lambda _: (IDENTITY, 2))),
        ("block-crc-wrong", "has a wrong CRC at the end of a block transfer", "7.2.4.3.12 SDO block upload",
         leaving(sdo_answer, data(_wrong_crc))),
        ("tpdos-missing", "sends no TPDO", "7.5.2.37 TPDO transmission", NoTpdos),
        ("sync-ignored", "hears no SYNC", "7.2.2.2 TPDO transmission", arriving(sync, lost)),
        ("guarding-not-answered", "does not answer the remote frames of node guarding",
         "7.2.8.3.2.1 Node guarding",
         asked(lambda node, cob_id, _: [] if cob_id == heartbeat(node) else None)),
        ("guarding-toggle-stuck", "answers node guarding with the same toggle bit each time",
         "7.2.8.3.2.1 Node guarding",
         leaving(heartbeat, data(lambda data: bytes([data[0] & ~TOGGLE])))),
    ),
}  # fmt: skip


# Faults of drives: motor, encoder, commands; found by `check --profile 402`


OVERCURRENT, ENCODER = 0x2310, 0x7305
"""Error codes of continuous over-current, and of sensor 1 (CiA 402-1)."""

HOLDS = 0.2
"""Time with torque before the over-current, in s."""


class BlockedAxis(DriveAxis):
    """The motor is blocked."""

    def step(self) -> None:
        place = self.motor.position
        super().step()
        self.motor.position = place
        self.motor.velocity = 0.0


class OvercurrentAxis(DriveAxis):
    """The current is too high for the power stage."""

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
    """The encoder fails after a quarter turn."""

    def step(self) -> None:
        super().step()
        if self.state is State.ENABLED and abs(self.motor.position - self.motor.origin) > self.motor.turn / 4:
            self.fault(ENCODER)


class NeverEnablesAxis(DriveAxis):
    """The drive stays in Switched on."""

    def take(self, arrow: Transition) -> None:
        if arrow.after is not State.ENABLED:
            super().take(arrow)


class HomingStuckAxis(DriveAxis):
    """Homing starts and does not move."""

    def lead(self) -> None:
        if not isinstance(self._mode, Homing):
            super().lead()


class QuickStopIgnoredAxis(DriveAxis):
    """The drive ignores quick stop."""

    def arrow(self, command: DriveCommand | None) -> Transition | None:
        return None if command is DriveCommand.QUICK_STOP else super().arrow(command)


class ResetIgnoredAxis(DriveAxis):
    """The drive cannot leave Fault."""

    def take(self, arrow: Transition) -> None:
        if arrow.before is not State.FAULT:
            super().take(arrow)


class NeverReachedAxis(DriveAxis):
    """The drive never reports that it has reached its target."""

    @property
    def statusword(self) -> int:
        return super().statusword & ~cia402.TARGET_REACHED


class HastyAxis(DriveAxis):
    """The drive enables operation without being switched on first."""

    def arrow(self, command: DriveCommand | None) -> Transition | None:
        if self.state is State.DISABLED and command is DriveCommand.ENABLE:
            return Transition(0, State.DISABLED, command, State.ENABLED)
        return super().arrow(command)


def _with(axis: type[DriveAxis]) -> Mixin:
    class WithAxis(SimulatedDrive):
        AXIS: ClassVar[type[DriveAxis]] = axis

    return WithAxis


HOMING = "11.1 Homing: present position is home"
MOVE = "10.1 Profile position: there and back"

DRIVE_FAULTS = found_by(
    "profile-402",
    ("following-error", "its motor is blocked", MOVE, _with(BlockedAxis)),
    ("overcurrent", "its current is too high soon after it is enabled", HOMING, _with(OvercurrentAxis)),
    ("encoder-lost", "loses its encoder as it turns", MOVE, _with(EncoderLostAxis)),
    ("never-enables", "stays in Switched on",
     "8.1 States with torque: Enable operation in Ready to switch on: Operation enabled", _with(NeverEnablesAxis)),
    ("homing-stuck", "starts homing and never gets on with it", HOMING, _with(HomingStuckAxis)),
    ("quick-stop-ignored", "does not hear the quick stop",
     "8.1 States: Quick stop in Ready to switch on: Switch on disabled [reversible]", _with(QuickStopIgnoredAxis)),
    ("fault-reset-ignored", "cannot leave Fault", "8.4 Connection: a lost heartbeat, and its reset",
     _with(ResetIgnoredAxis)),
    ("target-never-reached", "never says that a target is reached", HOMING, _with(NeverReachedAxis)),
    ("enables-at-once", "enables from Switch on disabled",
     "8.1 States: Enable operation in Switch on disabled: stays [reversible]", _with(HastyAxis)),
)  # fmt: skip
