"""How a motion ends: frames that stop an axis of CiA 402 again and again, until it is seen to stand.

Rule of this file: no clock and no bus. Frames and the time in seconds go in, frames come out. Nothing in here waits for
another request: a stop is written without a read before it, past whatever else is asked of the drive, and is repeated
whether or not it was answered. Whoever has the bus calls `due` at the time `next`, and `hear` with every frame.

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
"""Time between two stops of an axis that is not known to stand, in s."""

ANSWER = 0.025
"""Time after which the answer to a request of a stop counts as lost, and another one is asked, in s."""

STEADY = 0.05
"""How long the velocity has to be 0 before an axis counts as standing, in s."""

UNMOVED = 0.2
"""How long the position has to stay, for an axis without a velocity, in s."""

NOISE = 2
"""Units by which the position of an axis that stands may change."""

BEGINS = 0.4
"""How long a drive has to say that a motion has ended before it counts as ended, in s: it may not have begun."""

LAST_STEP = 1.0
"""When a stop without effect becomes disable voltage and NMT stop, in s after its start."""

MOST_ASKED = 32
"""Most requests whose answers may still come late."""

GIVE_UP = 2.0
"""When a program that has to end, or a call, gives up a stop without effect, in s after its start."""

SLOW = 0.5
"""Time between two stops after that, in s."""

INTEGER8, INTEGER16, INTEGER32 = (DATA_TYPES[number] for number in (0x02, 0x03, 0x04))

TYPES: Mapping[int, DataType] = {
    **dict.fromkeys((cia402.ERROR_CODE, cia402.CONTROLWORD, cia402.STATUSWORD), UNSIGNED16),
    **dict.fromkeys((cia402.MODE, cia402.MODE_DISPLAY, cia402.HOMING_METHOD), INTEGER8),
    **dict.fromkeys((cia402.POSITION, cia402.TARGET_POSITION, cia402.VELOCITY, cia402.TARGET_VELOCITY), INTEGER32),
    **dict.fromkeys((cia402.TARGET_TORQUE, cia402.TORQUE_OFFSET, cia402.ABORT_CONNECTION), INTEGER16),
    **dict.fromkeys((cia402.POSITION_OFFSET, cia402.VELOCITY_OFFSET), INTEGER32),
    **dict.fromkeys((cia402.TARGET_VL_VELOCITY, cia402.VL_VELOCITY), INTEGER16),
    cia402.PROFILE_VELOCITY: UNSIGNED32,
}
"""The data types that CiA 402 gives the objects, for a drive without a file."""

RESTING = (cia402.TARGET_VELOCITY, cia402.TARGET_VL_VELOCITY, cia402.TARGET_TORQUE)
"""Targets that are 0 at rest, in every mode of operation."""

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
    """The objects of an axis as single frames; without a file it has those that CiA 402 defines."""

    def __init__(self, address: AxisAddress, channel: SdoChannel, dictionary: Dictionary | None) -> None:
        self.address, self.channel, self._dictionary = address, channel, dictionary

    def has(self, index: int) -> bool:
        """Return whether the file has an object of the axis, by its index on the first one; without a file it may."""
        return self._dictionary is None or self._dictionary.variable((index + self.address.offset, 0)) is not None

    def type_of(self, index: int) -> DataType:
        """Return the data type of an object, as the file says, or else as CiA 402 does."""
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
        """Return what a frame answers about an object of the axis; None if it is no such answer."""
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
    """An SDO answer: the object's index on the first axis, what kind it is, and the value that was read."""

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
"""The controlword that is written from a time on, in s after the start of a stop."""


@dataclass(frozen=True)
class AxisRequest:
    """A request of a stop: the object's index on the first axis, and the value to write, None to read it."""

    index: int
    value: int | None = None

    @property
    def command(self) -> ServerCommand:
        """The command of its answer."""
        return ServerCommand.UPLOAD if self.value is None else ServerCommand.DOWNLOAD


class Held:
    """How long something was so: `span` is the time between the first and the last look since it has been, in s."""

    def __init__(self) -> None:
        self._since: float | None = None
        self.span = -inf

    def take(self, is_so: bool, now: float) -> None:
        """Take in a look."""
        self._since = (now if self._since is None else self._since) if is_so else None
        self.span = -inf if self._since is None else now - self._since


class Evidence:
    """What an axis has answered since it was told to stop."""

    def __init__(self) -> None:
        self.heard: float | None = None
        self.state: State | None = None
        self.word: int | None = None
        self.velocity: int | None = None
        self.position: int | None = None
        self._still, self._unmoved, self._reached = Held(), Held(), Held()

    def take(self, index: int, value: int, now: float) -> None:
        """Take in the value of an object."""
        self.heard = now
        if index == cia402.STATUSWORD:
            self.word, self.state = value, State.of(value)
            self._reached.take(self.is_without_torque or bool(value & cia402.TARGET_REACHED), now)
        elif index in (cia402.VELOCITY, cia402.VL_VELOCITY):
            self.velocity = value
            self._still.take(value == 0, now)
        elif index == cia402.POSITION:
            if self.position is None or abs(value - self.position) > NOISE:
                self._unmoved, self.position = Held(), value
            self._unmoved.take(True, now)

    @property
    def stands(self) -> bool:
        """Whether the axis stood when it was last heard: its velocity was 0, or its position did not change."""
        if self._still.span >= STEADY:
            return True
        # Some drives show a few units of velocity where they stand: halted, they say "target reached" then.
        is_quiet = self._reached.span >= UNMOVED
        if self.position is not None and (self.velocity is None or is_quiet):
            return self._unmoved.span >= UNMOVED
        return self.velocity is None and is_quiet

    @property
    def is_without_torque(self) -> bool:
        """Whether the drive says that its motor has no torque."""
        return self.state is not None and self.state not in cia402.POWERED

    def text(self, now: float) -> str:
        """Describe what was heard last, and when."""
        if self.heard is None:
            return "nothing was heard of it since: whether it stands is not known"
        values = {"velocity": self.velocity, "position": self.position}
        known = [self.state.words if self.state else "", *(f"{k} {v}" for k, v in values.items() if v is not None)]
        return f"heard {now - self.heard:.1f} s ago: {', '.join(filter(None, known))}"


class AxisStop:
    """One axis that is being stopped; `done` once it stands, with its targets at rest.

    `controlword` is the one that was last sent to it, None if that is not known: a halt is then a quick stop, which
    needs to know nothing. `refused` are targets that the drive did not let write.
    """

    def __init__(
        self, axis: AxisObjects, now: float, kind: StopKind = StopKind.HALT, controlword: int | None = None
    ) -> None:
        is_enabled = controlword is not None and cia402.command_of(controlword) is DriveCommand.ENABLE
        self.axis, self.since = axis, now
        self.kind = StopKind.QUICK_STOP if kind is StopKind.HALT and not is_enabled else kind
        self.evidence, self.refused = Evidence(), set[int]()
        self.done, self.next, self._again = False, now, now
        self.word = LADDERS[self.kind][0][1]
        self._confirmed = self._is_stopped_by_nmt = self._follows = False
        self._asked: list[AxisRequest] = []
        """Requests without an answer; one that comes late still counts."""
        self._last: AxisRequest | None = None
        self._left = 0
        writes = [AxisRequest(each, 0) for each in RESTING if axis.has(each)]
        reads = [AxisRequest(each) for each in (cia402.STATUSWORD, cia402.VELOCITY, cia402.POSITION) if axis.has(each)]
        # Once: which further targets would move the axis is said by its mode.
        mode = [AxisRequest(cia402.MODE_DISPLAY)] if axis.has(cia402.MODE_DISPLAY) else []
        self._open = deque([*mode, *writes, *reads])

    # Time and frames

    def due(self, now: float) -> list[Frame]:
        """Return the frames of this time: the controlword; further requests follow as they are answered."""
        if self.done or now < self.next:
            return []
        if self._last is not None:  # its answer is late or lost: the others get their turn first
            self._put_back(self._last)
        if now < self._again:
            frames = self._go_on()
            self.next = min(self._again, now + ANSWER) if frames else self._again
            return frames
        self._again = now + (REPEAT if now - self.since < GIVE_UP else SLOW)
        self.next, self._left = min(self._again, now + ANSWER), len(self._open)
        if not self.evidence.stands:  # one that stands keeps the torque that it has
            self.word = [word for after, word in LADDERS[self.kind] if now - self.since >= after][-1]
        return [*self._commanding(), *self._nmt(now)]

    def _commanding(self) -> list[Frame]:
        # A drive without torque is not commanded any more: "enable operation" with halt could take it out of Ready.
        if self._confirmed and self.word == HALTED and self.evidence.is_without_torque:
            return self._go_on()
        self._ask(AxisRequest(cia402.CONTROLWORD, self.word))
        return [self.axis.writing(cia402.CONTROLWORD, self.word)]

    def _nmt(self, now: float) -> list[Frame]:
        """Return NMT stop for an axis that may have torque; one period late, so that the controlword is heard."""
        is_last = LAST_STEP + REPEAT <= now - self.since < GIVE_UP
        if not is_last or self.evidence.is_without_torque or self.evidence.stands:
            return []
        self._is_stopped_by_nmt = True
        return [Frame(NMT_COB_ID, bytes([NmtCommand.STOP, self.axis.address.node_id]))]

    def hear(self, frame: Frame, now: float) -> list[Frame] | None:
        """Take in a frame and return the next requests; None if it does not answer a request of this stop."""
        answer = self.axis.answer(frame)
        if self.done or answer is None:
            return None
        if answer.value is not None and self._confirmed:
            self.evidence.take(answer.index, answer.value, now)
        request = next((each for each in self._asked if answer.is_to(each)), None)
        if request is None:
            return None
        self._asked.remove(request)
        is_last, self._last = request == self._last, None if request == self._last else self._last
        self._take(request, answer)
        if now - self.since >= GIVE_UP:  # it was told often enough
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

    def _put_back(self, request: AxisRequest) -> None:
        self._last = None
        if request.index != cia402.CONTROLWORD:
            self._open.append(request)

    @property
    def _unwritten(self) -> bool:
        under_way = [self._last] if self._last is not None else []
        return any(each.value is not None or each.index == cia402.MODE_DISPLAY for each in [*self._open, *under_way])

    # In words

    def has_failed(self, now: float) -> bool:
        """Return whether halt and quick stop have had no effect that was seen."""
        return not self.done and now - self.since >= LAST_STEP

    def text(self, now: float) -> str:
        """Describe what was sent, and what is known."""
        ways = {HALTED: "halt", QUICK: "quick stop", OFF: "disable voltage"}
        words = [ways[word] for after, word in LADDERS[self.kind] if now - self.since >= after]
        sent = [*words, *(["NMT stop"] if self._is_stopped_by_nmt else [])]
        confirmed = "" if self._confirmed else ", none confirmed"
        return f"{', '.join(sent)} sent for {now - self.since:.1f} s{confirmed}; {self.evidence.text(now)}"


class NodeStop:
    """One node that is stopped by NMT, again and again until its heartbeat says so."""

    def __init__(self, node_id: int, now: float) -> None:
        self.node_id, self.since, self.next = node_id, now, now
        self.state: NmtState | None = None
        self.done = False

    def due(self, now: float) -> list[Frame]:
        """Return the command of this time; none after `GIVE_UP` seconds."""
        if self.done or now < self.next:
            return []
        self.next = now + REPEAT if now - self.since < GIVE_UP else inf
        return [Frame(NMT_COB_ID, bytes([NmtCommand.STOP, self.node_id]))]

    def hear(self, frame: Frame, _: float) -> None:
        """Take in a frame, which may be the node's heartbeat."""
        if frame.cob_id == ERROR_CONTROL_BASE + self.node_id and len(frame.data) == 1:
            said = frame.data[0] & 0x7F
            self.state = NmtState(said) if said in set(NmtState) else None
            self.done = self.state is NmtState.STOPPED

    def has_failed(self, now: float) -> bool:
        """Return whether it has not confirmed within the time."""
        return not self.done and now - self.since >= GIVE_UP

    def text(self, now: float) -> str:
        """Describe what is known."""
        if self.state is None:
            return f"NMT stop sent for {now - self.since:.1f} s; it has sent no heartbeat since: not confirmed"
        return f"NMT stop sent for {now - self.since:.1f} s; its heartbeat says {STATE_NAMES[self.state]}"


class MotionEnd:
    """Watches a motion that ends by itself, a move or a homing, until the drive says that it has ended."""

    def __init__(self, axis: AxisObjects, now: float, homing: bool) -> None:
        self._axis, self._homing, self.next, self.done = axis, homing, now + REPEAT, False
        self._ended = Held()

    def due(self, now: float) -> list[Frame]:
        """Return the read of the statusword, at its times."""
        if self.done or now < self.next:
            return []
        self.next = now + REPEAT
        return [self._axis.reading(cia402.STATUSWORD)]

    def hear(self, frame: Frame, now: float) -> bool:
        """Take in a frame; return whether it answers a read of the statusword."""
        answer = self._axis.answer(frame)
        if answer is None or answer.index != cia402.STATUSWORD or answer.value is None:
            return False
        word, reached = answer.value, bool(answer.value & cia402.TARGET_REACHED)
        is_there = reached and not word & cia402.BIT_12
        # Of a homing bit 12 says "attained", bit 13 "error" (CiA 402-2, clause 11).
        has_homed = reached and bool(word & (cia402.BIT_12 | cia402.BIT_13))
        # For a while: until a drive begins to move, its bits may still be about the motion before.
        self._ended.take(has_homed if self._homing else is_there, now)
        self.done = State.of(word) is not State.ENABLED or self._ended.span >= BEGINS
        return True
