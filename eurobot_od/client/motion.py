"""Ends motions: repeats the frames that stop an axis of CiA 402 until it is seen to stand.

Rule of this file: no clock and no bus. Frames and the time in seconds go in, frames come out. Nothing in here waits for
another request: a stop is written without a read before it, past whatever else is asked of the drive, and is repeated
whether or not it was answered. Whoever has the bus calls `due` at the time `next`, and `receive` with every frame.

Theory of operation. A stop is a ladder (`LADDERS`): halt, then quick stop, then disable voltage and NMT stop, each
after a time without evidence that the axis stands. The evidence is what the drive answers after it has confirmed a
stop: a velocity of 0 for `STEADY` seconds, or a position that has not changed. Beside the controlword, the targets are
written to rest, so that nothing turns when the axis is enabled the next time. This is not a safety function: it takes a
program, a bus and a drive that work.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from math import inf
from typing import NamedTuple

from eurobot_od.device.nmt import STATE_NAMES, NmtCommand, NmtState
from eurobot_od.frame import Frame
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import DriveCommand, Mode, State
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import data_type
from eurobot_od.od.sdo_channels import SdoChannel
from eurobot_od.od.values import DATA_TYPES, ERROR_CONTROL_BASE, NMT_COB_ID, UNSIGNED16, UNSIGNED32, DataType
from eurobot_od.sdo import wire
from eurobot_od.sdo.wire import ClientCommand, Initiate, ServerCommand

REPEAT = 0.08
"""Interval between two stops of an axis that may still move, in s."""

ANSWER = 0.025
"""Timeout of an answer during a stop, in s."""

STEADY = 0.05
"""Minimum time of velocity 0 before an axis counts as standing, in s."""

UNMOVED = 0.2
"""Minimum time without a change of position, for an axis without a velocity, in s."""

NOISE = 2
"""Maximum change of position of a standing axis, in its units."""

BEGINS = 0.4
"""Minimum time that a drive must report the end of a motion, in s, as the motion may not have begun."""

LAST_STEP = 1.0
"""Time after which a stop without effect becomes disable voltage and NMT stop, in s."""

MOST_ASKED = 32
"""Maximum number of requests whose late answers still count."""

GIVE_UP = 2.0
"""Time after which a call, or a program that has to end, abandons a stop without effect, in s."""

SLOW = 0.5
"""Interval between two stops after `GIVE_UP`, in s."""

INTEGER8, INTEGER16, INTEGER32 = (DATA_TYPES[number] for number in (0x02, 0x03, 0x04))

TYPES: Mapping[int, DataType] = {
    **dict.fromkeys((cia402.ERROR_CODE, cia402.CONTROLWORD, cia402.STATUSWORD), UNSIGNED16),
    **dict.fromkeys((cia402.MODE, cia402.MODE_DISPLAY, cia402.HOMING_METHOD), INTEGER8),
    **dict.fromkeys((cia402.POSITION, cia402.TARGET_POSITION, cia402.VELOCITY, cia402.TARGET_VELOCITY), INTEGER32),
    **dict.fromkeys((cia402.TARGET_TORQUE, cia402.TORQUE_OFFSET, cia402.ABORT_CONNECTION), INTEGER16),
    **dict.fromkeys((cia402.POSITION_OFFSET, cia402.VELOCITY_OFFSET), INTEGER32),
    **dict.fromkeys((cia402.TARGET_VL_VELOCITY, cia402.VL_VELOCITY), INTEGER16),
    **dict.fromkeys((cia402.PROFILE_VELOCITY, cia402.POSITION_WINDOW, cia402.DIGITAL_INPUTS), UNSIGNED32),
}
"""Data types of the objects in CiA 402, for a drive without a file."""

RESTING = (cia402.TARGET_VELOCITY, cia402.TARGET_VL_VELOCITY, cia402.TARGET_TORQUE)
"""Targets that are 0 at rest in every mode of operation."""

OFFSETS: Mapping[int | None, int] = {
    Mode.CYCLIC_VELOCITY: cia402.VELOCITY_OFFSET,
    Mode.CYCLIC_TORQUE: cia402.TORQUE_OFFSET,
}
"""Offsets that move an axis whose target is 0, by the mode of operation (CiA 402-2, clauses 16 and 17)."""

FOLLOWING = (Mode.INTERPOLATED_POSITION, Mode.CYCLIC_POSITION)
"""Modes that follow the target position without a new set-point: at rest it is the actual position."""


class AxisAddress(NamedTuple):
    """An axis of a drive, by its node-ID and its number from 1 on."""

    node_id: int
    number: int

    @property
    def offset(self) -> int:
        """The difference of its objects' indices from those of the first axis."""
        return (self.number - 1) * cia402.AXIS_STEP


class AxisObjects:
    """The objects of an axis as single frames; without a file, those that CiA 402 defines."""

    def __init__(self, address: AxisAddress, channel: SdoChannel, dictionary: Dictionary | None) -> None:
        self.address, self.channel, self._dictionary = address, channel, dictionary

    def has(self, index: int) -> bool:
        """Return whether the axis may have an object, by its index on the first axis."""
        return self._dictionary is None or self._dictionary.variable((index + self.address.offset, 0)) is not None

    def type_of(self, index: int) -> DataType:
        """Return the data type of an object from the file, or else from CiA 402."""
        variable = self._dictionary.variable((index + self.address.offset, 0)) if self._dictionary else None
        return TYPES[index] if variable is None else data_type(variable)

    def writing(self, index: int, value: int) -> Frame:
        """Return the request that writes an object of up to 4 bytes."""
        data = wire.carrying(ClientCommand.DOWNLOAD, (index + self.address.offset, 0), self.type_of(index).write(value))
        return Frame(self.channel.requests, data)

    def reading(self, index: int) -> Frame:
        """Return the request that reads an object."""
        data = wire.initiate(ClientCommand.UPLOAD << 5, (index + self.address.offset, 0))
        return Frame(self.channel.requests, data)

    def answer(self, frame: Frame) -> AxisAnswer | None:
        """Return the SDO answer in a frame about an object of the axis, None for other frames."""
        if frame.cob_id != self.channel.answers or len(frame.data) != wire.LENGTH:
            return None
        answer = Initiate.of(frame.data)
        index = answer.address[0] - self.address.offset
        if answer.address[1] or index not in TYPES:
            return None
        if answer.command >> 5 != ServerCommand.UPLOAD or not answer.command & wire.EXPEDITED:
            return AxisAnswer(index, ServerCommand(answer.command >> 5) if answer.command >> 5 < 7 else None, None)
        value = self.type_of(index).read(answer.rest[: self.type_of(index).size])
        return AxisAnswer(index, ServerCommand.UPLOAD, value if isinstance(value, int) else None)


@dataclass(frozen=True)
class AxisAnswer:
    """An SDO answer: the object's index on the first axis, its command, and the value read."""

    index: int
    command: ServerCommand | None
    value: int | None

    def is_to(self, request: AxisRequest) -> bool:
        """Return whether it is the answer to a request, or its abort."""
        return self.index == request.index and self.command in (request.command, ServerCommand.ABORT)


class StopKind(Enum):
    """How a stop begins."""

    HALT = "halt"
    QUICK_STOP = "quick stop"
    DISABLE = "disable voltage"


QUICK, OFF = DriveCommand.QUICK_STOP.bits, DriveCommand.DISABLE_VOLTAGE.bits
HALTED = DriveCommand.ENABLE.bits | cia402.HALT

LADDERS: Mapping[StopKind, tuple[tuple[float, int], ...]] = {
    StopKind.HALT: ((0.0, HALTED), (0.5, QUICK), (LAST_STEP, OFF)),
    StopKind.QUICK_STOP: ((0.0, QUICK), (LAST_STEP, OFF)),
    StopKind.DISABLE: ((0.0, OFF),),
}
"""Controlwords of a stop, each with the time in s from which it is written."""


@dataclass(frozen=True)
class AxisRequest:
    """A request of a stop: the object's index on the first axis, and the value to write, None to read."""

    index: int
    value: int | None = None

    @property
    def command(self) -> ServerCommand:
        """Command of its answer."""
        return ServerCommand.UPLOAD if self.value is None else ServerCommand.DOWNLOAD


class Held:
    """Duration of a condition: `span` is the time between the first and the last time it was seen true, in s."""

    def __init__(self) -> None:
        self._since: float | None = None
        self.span = -inf

    def take(self, is_so: bool, now: float) -> None:
        """Update with the present value of the condition."""
        if not is_so:
            self._since = None
            self.span = -inf
            return
        if self._since is None:
            self._since = now
        self.span = now - self._since


class Evidence:
    """Values that an axis has reported since it was told to stop."""

    def __init__(self) -> None:
        self.heard: float | None = None
        self.state: State | None = None
        self.word: int | None = None
        self.velocity: int | None = None
        self.position: int | None = None
        self._still, self._unmoved, self._reached = Held(), Held(), Held()

    def take(self, index: int, value: int, now: float) -> None:
        """Process the value of an object."""
        self.heard = now
        if index == cia402.STATUSWORD:
            self.word = value
            self.state = State.of(value)
            self._reached.take(self.is_without_torque or bool(value & cia402.TARGET_REACHED), now)
        elif index in (cia402.VELOCITY, cia402.VL_VELOCITY):
            self.velocity = value
            self._still.take(value == 0, now)
        elif index == cia402.POSITION:
            if self.position is None or abs(value - self.position) > NOISE:
                self._unmoved = Held()
                self.position = value
            self._unmoved.take(True, now)

    @property
    def stands(self) -> bool:
        """Whether the axis stood when last heard: its velocity was 0, or its position did not change."""
        if self._still.span >= STEADY:
            return True
        # Some standing drives show a few units of velocity, but also "target reached" when halted.
        is_quiet = self._reached.span >= UNMOVED
        if self.position is not None and (self.velocity is None or is_quiet):
            return self._unmoved.span >= UNMOVED
        return self.velocity is None and is_quiet

    @property
    def is_without_torque(self) -> bool:
        """Whether the drive reports a state without torque."""
        return self.state is not None and self.state not in cia402.POWERED

    def text(self, now: float) -> str:
        """Return the last reported values, and their age."""
        if self.heard is None:
            return "nothing was heard of it since: whether it stands is not known"
        values = {"velocity": self.velocity, "position": self.position}
        known = [self.state.words if self.state else "", *(f"{k} {v}" for k, v in values.items() if v is not None)]
        return f"heard {now - self.heard:.1f} s ago: {', '.join(filter(None, known))}"


class AxisStop:
    """A stop of one axis; `done` once it stands with its targets at rest.

    `controlword` is the one that was last sent to it, None if that is not known: a halt is then a quick stop, which
    needs to know nothing. `refused` are targets that the drive did not let write.
    """

    def __init__(
        self, axis: AxisObjects, now: float, kind: StopKind = StopKind.HALT, controlword: int | None = None
    ) -> None:
        is_enabled = controlword is not None and cia402.command_of(controlword) is DriveCommand.ENABLE
        self.axis, self.since = axis, now
        self.kind = StopKind.QUICK_STOP if kind is StopKind.HALT and not is_enabled else kind
        self.evidence = Evidence()
        self.refused = set[int]()
        self.done = False
        self.next = now
        self._again = now
        self.word = LADDERS[self.kind][0][1]
        self._confirmed = self._is_stopped_by_nmt = self._follows = False
        self._asked: list[AxisRequest] = []
        """Requests that wait for an answer, even a late one."""
        self._last: AxisRequest | None = None
        self._left = 0
        writes = [AxisRequest(each, 0) for each in RESTING if axis.has(each)]
        reads = [AxisRequest(each) for each in (cia402.STATUSWORD, cia402.VELOCITY, cia402.POSITION) if axis.has(each)]
        # Read once: the mode determines which further targets would move the axis.
        mode = [AxisRequest(cia402.MODE_DISPLAY)] if axis.has(cia402.MODE_DISPLAY) else []
        self._open = deque([*mode, *writes, *reads])

    # Time and frames

    def due(self, now: float) -> list[Frame]:
        """Return the frames that are due: the controlword first, then further requests."""
        if self.done or now < self.next:
            return []
        if self._last is not None:  # without an answer so far: other requests come first
            if self._last.index != cia402.CONTROLWORD:
                self._open.append(self._last)
            self._last = None
        if now < self._again:
            frames = self._go_on()
            self.next = min(self._again, now + ANSWER) if frames else self._again
            return frames
        self._again = now + (REPEAT if now - self.since < GIVE_UP else SLOW)
        self.next = min(self._again, now + ANSWER)
        self._left = len(self._open)
        if not self.evidence.stands:  # a standing axis keeps its torque
            self.word = [word for after, word in LADDERS[self.kind] if now - self.since >= after][-1]
        return [*self._commanding(), *self._nmt(now)]

    def _commanding(self) -> list[Frame]:
        # A drive without torque gets no more commands: "enable operation" with halt could take it out of Ready.
        if self._confirmed and self.word == HALTED and self.evidence.is_without_torque:
            return self._go_on()
        self._ask(AxisRequest(cia402.CONTROLWORD, self.word))
        return [self.axis.writing(cia402.CONTROLWORD, self.word)]

    def _nmt(self, now: float) -> list[Frame]:
        """Return NMT stop for an axis that may have torque, one period late so that the controlword comes first."""
        is_last = LAST_STEP + REPEAT <= now - self.since < GIVE_UP
        if not is_last or self.evidence.is_without_torque or self.evidence.stands:
            return []
        self._is_stopped_by_nmt = True
        return [Frame(NMT_COB_ID, bytes([NmtCommand.STOP, self.axis.address.node_id]))]

    def receive(self, frame: Frame, now: float) -> list[Frame] | None:
        """Process a frame and return the next requests; None if it does not answer this stop."""
        answer = self.axis.answer(frame)
        if self.done or answer is None:
            return None
        if answer.value is not None and self._confirmed:
            self.evidence.take(answer.index, answer.value, now)
        request = next((each for each in self._asked if answer.is_to(each)), None)
        if request is None:
            return None
        self._asked.remove(request)
        is_last = request == self._last
        self._last = None if request == self._last else self._last
        self._take(request, answer)
        if now - self.since >= GIVE_UP:  # remaining writes count as refused
            self.refused |= {each.index for each in self._open if each.value is not None}
            self._open = deque(each for each in self._open if each.value is None and each.index != cia402.MODE_DISPLAY)
        stands = self._confirmed and not self._unwritten and self.evidence.stands
        if stands and self._follows and self.evidence.position is not None:
            self._follows = False
            self._open.appendleft(AxisRequest(cia402.TARGET_POSITION, self.evidence.position))
        else:
            self.done = stands
        if self.done or not is_last:
            return []
        self.next = min(self._again, now + ANSWER)
        return self._go_on()

    def _take(self, request: AxisRequest, answer: AxisAnswer) -> None:
        self._open = deque(each for each in self._open if each != request)
        is_refused = answer.command is ServerCommand.ABORT
        if request.index == cia402.CONTROLWORD:
            self._confirmed |= not is_refused
        elif is_refused and request.value is not None:
            self.refused.add(request.index)
        elif request.index == cia402.MODE_DISPLAY:
            self._add_targets_of(answer.value)
        elif request.value is None and not is_refused:
            self._open.append(request)

    def _add_targets_of(self, mode: int | None) -> None:
        self._follows = mode in FOLLOWING and self.axis.has(cia402.TARGET_POSITION)
        offset = OFFSETS.get(mode)
        if offset is not None and self.axis.has(offset):
            self._open.appendleft(AxisRequest(offset, 0))

    def _go_on(self) -> list[Frame]:
        if not self._open or self._left <= 0:
            return []
        self._left -= 1
        request = self._open.popleft()
        self._ask(request)
        if request.value is None:
            return [self.axis.reading(request.index)]
        return [self.axis.writing(request.index, request.value)]

    def _ask(self, request: AxisRequest) -> None:
        self._last = request
        self._asked = [*self._asked[-MOST_ASKED:], request]

    @property
    def _unwritten(self) -> bool:
        under_way = [self._last] if self._last is not None else []
        return any(each.value is not None or each.index == cia402.MODE_DISPLAY for each in [*self._open, *under_way])

    # In words

    def has_failed(self, now: float) -> bool:
        """Return whether halt and quick stop had no visible effect."""
        return not self.done and now - self.since >= LAST_STEP

    def text(self, now: float) -> str:
        """Return what was sent and what is known, as text."""
        ways = {HALTED: "halt", QUICK: "quick stop", OFF: "disable voltage"}
        words = [ways[word] for after, word in LADDERS[self.kind] if now - self.since >= after]
        sent = [*words, *(["NMT stop"] if self._is_stopped_by_nmt else [])]
        confirmed = "" if self._confirmed else ", none confirmed"
        return f"{', '.join(sent)} sent for {now - self.since:.1f} s{confirmed}; {self.evidence.text(now)}"


class NodeStop:
    """A stop of one node by NMT, repeated until its heartbeat reports STOPPED."""

    def __init__(self, node_id: int, now: float) -> None:
        self.node_id, self.since, self.next = node_id, now, now
        self.state: NmtState | None = None
        self.done = False

    def due(self, now: float) -> list[Frame]:
        """Return the command if it is due; none after `GIVE_UP` seconds."""
        if self.done or now < self.next:
            return []
        self.next = now + REPEAT if now - self.since < GIVE_UP else inf
        return [Frame(NMT_COB_ID, bytes([NmtCommand.STOP, self.node_id]))]

    def receive(self, frame: Frame, _: float) -> None:
        """Process a frame, which may be the node's heartbeat."""
        if frame.cob_id == ERROR_CONTROL_BASE + self.node_id and len(frame.data) == 1:
            said = frame.data[0] & 0x7F
            self.state = NmtState(said) if said in set(NmtState) else None
            self.done = self.state is NmtState.STOPPED

    def has_failed(self, now: float) -> bool:
        """Return whether the node has not confirmed in time."""
        return not self.done and now - self.since >= GIVE_UP

    def text(self, now: float) -> str:
        """Return what is known, as text."""
        if self.state is None:
            return f"NMT stop sent for {now - self.since:.1f} s; it has sent no heartbeat since: not confirmed"
        return f"NMT stop sent for {now - self.since:.1f} s; its heartbeat says {STATE_NAMES[self.state]}"


class MotionEnd:
    """Watches a move or a homing until the drive reports its end."""

    def __init__(self, axis: AxisObjects, now: float, homing: bool) -> None:
        self._axis = axis
        self._homing = homing
        self.next = now + REPEAT
        self.done = False
        self._ended = Held()

    def due(self, now: float) -> list[Frame]:
        """Return the read of the statusword if it is due."""
        if self.done or now < self.next:
            return []
        self.next = now + REPEAT
        return [self._axis.reading(cia402.STATUSWORD)]

    def receive(self, frame: Frame, now: float) -> bool:
        """Process a frame; return whether it answers a read of the statusword."""
        answer = self._axis.answer(frame)
        if answer is None or answer.index != cia402.STATUSWORD or answer.value is None:
            return False
        word = answer.value
        reached = bool(answer.value & cia402.TARGET_REACHED)
        is_there = reached and not word & cia402.BIT_12
        # Of a homing bit 12 says "attained", bit 13 "error" (CiA 402-2, clause 11).
        has_homed = reached and bool(word & (cia402.BIT_12 | cia402.BIT_13))
        # For a minimum time, as until a drive moves, its bits may belong to the motion before.
        self._ended.take(has_homed if self._homing else is_there, now)
        self.done = State.of(word) is not State.ENABLED or self._ended.span >= BEGINS
        return True
