"""Drives of CiA 402 on the page: their data, the orders to them, and the end of each motion.

Theory of operation. An order, such as a jog or a move, is carried out on a thread that waits for the drive, one order
after the other. A stop never waits for that: it begins at once, on any thread, and a thread of its own (`MotionThread`)
sends its frames, again and again until the axis stands (`client.motion`). From the begin of a stop on, the order under
way on that axis sends no more frames, and older orders are refused when their turn comes. A motion goes on only while
its page confirms it: when the page is closed, hidden or hangs, the drive is halted. The same thread sends the heartbeat
that the drives watch (`client.lifeline`).

This is not a safety function: it takes a server, a bus and a drive that work.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from math import inf
from types import MappingProxyType
from typing import Any, TypeAlias

from eurobot_od.client.drive402 import Drive402
from eurobot_od.client.lifeline import GOES_ON, PERIOD, Lifeline, arm, disarm, free_id, heartbeat, holds
from eurobot_od.client.master import Master
from eurobot_od.client.motion import (
    GIVE_UP,
    LAST_STEP,
    AxisAddress,
    AxisObjects,
    AxisStop,
    MotionEnd,
    NodeStop,
    StopKind,
)
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.errors import BusError, EurobotError, LocalError, RemoteError, look_up
from eurobot_od.frame import Frame
from eurobot_od.od import cia402
from eurobot_od.od.cia402 import MODE_WORDS, TRANSITIONS, DriveCommand, State
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.objects import Range, limits
from eurobot_od.od.values import (
    ALL_NODES,
    DATA_TYPES,
    NMT_COB_ID,
    NODE_IDS,
    Address,
    label,
)
from eurobot_od.od.words import profile_of

HELD = 0.5
"""How long a motion goes on after its page last confirmed it, in s."""

SILENT = 3.0
"""How long a raw frame of a page may move a drive after the page's last message, in s; no button is held for it."""

LOOK = 0.01
"""Time between two steps of the stops, in s."""

IDLE = 0.1
"""The same while nothing may move, in s."""

STALE = 2.0
"""Longest time between an order and its turn, in s; an older order is refused."""

SHOWN_FOR = 15.0
"""How long the page shows that a stop has succeeded, in s."""

SENDERS = (0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700)
"""Function codes of the frames that a node sends by default: EMCY, TPDOs, SDO answers, heartbeats (CiA 301, 7.3.3)."""

SHOWN: Mapping[str, int] = {
    "statusword": cia402.STATUSWORD,
    "mode": cia402.MODE_DISPLAY,
    "position": cia402.POSITION,
    "velocity": cia402.VELOCITY,
    "torque": cia402.TORQUE,
    "following error": cia402.FOLLOWING_ERROR,
    "error": cia402.ERROR_CODE,
}
"""The objects of an axis on the page, which polls those that come in no PDO."""

Numbers: TypeAlias = Mapping[str, int]

ORDERS: Mapping[str, Callable[[Drive402, Numbers], object]] = {
    "enable": lambda drive, _: drive.enable(),
    "fault reset": lambda drive, _: drive.fault_reset(),
    # None of them waits for the end of the motion, so that a halt need not wait for it, either.
    "home": lambda drive, said: drive.begin_home(said.get("method")),
    "move": lambda drive, said: drive.begin_move(said["position"], said.get("velocity")),
    "move by": lambda drive, said: drive.begin_move(said["distance"], said.get("velocity"), relative=True),
}

STOPS: Mapping[str, StopKind] = {
    "halt": StopKind.HALT,
    "quick stop": StopKind.QUICK_STOP,
    "disable": StopKind.DISABLE,
}
"""Commands that end a motion; they do not wait."""

MOVES = ("home", "move", "move by")
"""Orders that move an axis to a place."""

JOGS: Mapping[str, Callable[[Drive402, int], None]] = {
    "velocity": lambda drive, value: setattr(drive, "velocity", value),
    "torque": Drive402.begin_torque,
}
"""The jog of a drive while a button is held, by its target."""

LARGEST: Mapping[str, tuple[int, Address | None]] = {
    "velocity": (cia402.TARGET_VELOCITY, (cia402.MAX_PROFILE_VELOCITY, 0)),
    "torque": (cia402.TARGET_TORQUE, (cia402.MAX_TORQUE, 0)),
    "position": (cia402.TARGET_POSITION, None),
}
"""The object of each target, and the object with its largest value."""


UNBOUNDED = DATA_TYPES[0x04]
"""INTEGER32: the type of a target without a smaller one in the file."""

MOVING = (
    *(cia402.CONTROLWORD, cia402.TARGET_VL_VELOCITY, cia402.TARGET_TORQUE, cia402.TARGET_POSITION),
    *(cia402.TARGET_VELOCITY, cia402.INTERPOLATION_DATA, cia402.MODE),
    *(cia402.POSITION_OFFSET, cia402.VELOCITY_OFFSET, cia402.TORQUE_OFFSET, cia402.DIGITAL_OUTPUTS),
)
"""Objects of the first axis whose new value may move something; the outputs have the brake."""


def moves(address: Address) -> bool:
    """Return whether a new value of an object may move a drive."""
    above = address[0] - cia402.FIRST_AXIS.start
    return above >= 0 and cia402.FIRST_AXIS.start + above % cia402.AXIS_STEP in MOVING


def axes_of(dictionary: Dictionary) -> list[AxisAddress]:
    """Return the axes of a device that is a drive by its 0x1000; an empty list for any other device."""
    if profile_of(dictionary.objects) != cia402.PROFILE:
        return []
    all_of_them = (AxisAddress(dictionary.node_id, number) for number in range(1, cia402.MOST_AXES + 1))
    return [each for each in all_of_them if dictionary.variable((cia402.STATUSWORD + each.offset, 0))]


def drive_data(dictionary: Dictionary) -> dict[str, Any] | None:
    """Return the page's data of a drive before the first answer, None if the device is not a drive."""
    axes = axes_of(dictionary)
    if not axes:
        return None
    suggested = dictionary.variable((cia402.PROFILE_VELOCITY, 0))
    velocity = suggested.default if suggested else None  # None: an empty field, no invented velocity
    return {"axes": [_axis_data(dictionary, each) for each in axes], "velocity": velocity}


def _axis_data(dictionary: Dictionary, axis: AxisAddress) -> dict[str, Any]:
    places = {name: (index + axis.offset, 0) for name, index in SHOWN.items()}
    shown = {name: label(place) for name, place in places.items() if dictionary.variable(place)}
    allowed = {name: bounds(dictionary, axis, name) for name in LARGEST}
    return {"objects": shown, "bounds": allowed, "units": units(dictionary, axis)}


def bounds(dictionary: Dictionary, axis: AxisAddress, target: str) -> Range:
    """Return the range of a target: the limits of its object, and the largest value in the file."""
    index, most = LARGEST[target]
    variable = dictionary.variable((index + axis.offset, 0))
    known = variable and limits(variable)
    low, high = known or Range(UNBOUNDED.low, UNBOUNDED.high)
    largest = most and dictionary.number((most[0] + axis.offset, most[1]))
    return Range(max(low, -largest), min(high, largest)) if largest else Range(low, high)


def units(dictionary: Dictionary, axis: AxisAddress) -> Mapping[str, float]:
    """Return a unit of position in turns of the motor, and of velocity in turns a minute, if the file has them.

    That is in 0x608F, 0x6091 and 0x6092 for the position; a unit of velocity is one of position per second, or as in
    0x6096 or 0x60A9.
    """
    from eurobot_od.device.profiles.motion import AxisValues, Units, ratio_of  # and YAML: not for --help

    values = AxisValues(dictionary, axis.offset)
    if {ratio_of(values, each) for each in (cia402.ENCODER_RESOLUTION, cia402.FEED_CONSTANT)} <= {0, 1}:
        return {}  # a file without factors has 1
    turn, velocity = Units.of(values)
    return {"position": 1 / turn, "velocity": 60 * velocity / turn}


def machine_data() -> dict[str, Any]:
    """Return the state machine and the modes of operation as data."""
    arrows = {(each.number, each.before, each.after): None for each in TRANSITIONS}
    return {
        "states": [{"name": each.words, "mask": each.mask, "bits": each.bits} for each in State],
        "arrows": [{"number": number, "before": one.words, "after": two.words} for number, one, two in arrows],
        "modes": MODE_WORDS,
    }


class MayMove(LocalError):
    """Raised instead of sending a frame that may move something, until a person has confirmed it.

    The text is the question.
    """


class OrderMaster(Master):
    """A master whose frames all pass a `gate`, which a stop closes."""

    gate: Callable[[], AbstractContextManager[object]] = staticmethod(nullcontext)

    def send(self, cob_id: int, data: bytes) -> None:
        """Send a frame; raises BusError, and LocalError once the order is stopped."""
        with self.gate():
            super().send(cob_id, data)


@dataclass
class OrderedMotion:
    """A motion by an order, which goes on `until` a time in s; `end` detects the end of a move or a homing."""

    who: object
    until: float
    end: MotionEnd | None = None


class Drives:
    """The drives of a network and the orders to them.

    Orders (`command`, `jog`) wait for the drive and are carried out one after the other; all other methods return at
    once, on any thread. `send` sends a frame past all others; `clock` returns the time in seconds. `wanted_id` is the
    node-ID of our heartbeat. `wake` is called when `step` has work to do.
    """

    def __init__(
        self,
        master: Master,
        dictionaries: Iterable[Dictionary],
        clock: Callable[[], float],
        send: Callable[[Frame], object] | None = None,
        wanted_id: int = 127,
    ) -> None:
        self._master = master
        self._clock = clock
        self._wanted_id = wanted_id
        self._send = send or (lambda frame: master.send(*frame))
        self._dictionaries = {each.node_id: each for each in dictionaries}
        self.axes = [axis for each in self._dictionaries.values() for axis in axes_of(each)]
        self.wake: Callable[[], object] = lambda: None
        self._lock = threading.RLock()
        self._outbox: deque[Frame] = deque()
        self._motions: dict[AxisAddress, OrderedMotion] = {}
        self._stops: dict[AxisAddress, AxisStop] = {}
        self._nodes: dict[int, NodeStop] = {}
        self._counts: dict[AxisAddress, int] = {}
        self._held: dict[AxisAddress, tuple[object, float]] = {}
        self._pages: dict[object, float] = {}
        """When each page was last heard."""
        self._order: Sequence[AxisAddress] = ()
        self._is_revoked = False
        self._broadcast: float | None = None
        self._heard: set[int] = set()
        self._lines: dict[int, Lifeline] = {}
        self._accepted: set[int] = set()
        self.own: int | None = None
        self._beat = inf
        self._said: dict[str, tuple[float, str]] = {}
        if isinstance(master, OrderMaster):
            master.gate = self.gate

    def add(self, device: Dictionary) -> None:
        """Add a device that was not known, or was taken for another one."""
        self._dictionaries[device.node_id] = device
        self.axes = [axis for each in self._dictionaries.values() for axis in axes_of(each)]

    def axis(self, node_id: int, number: object) -> AxisAddress:
        """Return an axis; raises LocalError if there is none."""
        found = next((each for each in self.axes if (each.node_id, each.number) == (node_id, number)), None)
        if found is None:
            raise LocalError(f"node {node_id} has no axis {number} of CiA 402")
        return found

    def _drive(self, axis: AxisAddress) -> Drive402:
        return Drive402(self._master.node(axis.node_id), self._dictionaries[axis.node_id], axis.number)

    def _objects(self, axis: AxisAddress) -> AxisObjects:
        return AxisObjects(axis, self._master.sdo_server(axis.node_id), self._dictionaries[axis.node_id])

    def _name(self, axis: AxisAddress) -> str:
        several = sum(each.node_id == axis.node_id for each in self.axes) > 1
        return f"{self._dictionaries[axis.node_id].name}{f', axis {axis.number}' if several else ''}"

    def _node_name(self, node_id: int) -> str:
        return self._dictionaries[node_id].name if node_id in self._dictionaries else f"node {node_id}"

    # Orders

    def ticket(self, *axes: AxisAddress) -> int:
        """Return the number of an order that is made now: a stop after it makes it void."""
        with self._lock:
            return sum(self._counts.get(each, 0) for each in axes)

    def command(
        self,
        axis: AxisAddress,
        name: str,
        numbers: Numbers = MappingProxyType({}),
        who: object = None,
        ticket: int | None = None,
    ) -> None:
        """Carry out an order.

        Raises UnknownName, LocalError for a target out of bounds, DriveError, and the errors of SDO.
        """
        act = look_up("command of a drive", name, ORDERS)
        for target in LARGEST.keys() & numbers.keys():
            self._check(axis, target, numbers[target])
        with self._ordering((axis,), ticket):
            lacks = self._watch(axis)
            if name in MOVES:
                self._ask_once(axis, lacks)
            motion = OrderedMotion(who, self._clock() + HELD)
            if name in MOVES:
                self._enter(axis, motion)
            act(self._drive(axis), numbers)
            # Only now: before the drive has its set-point, "target reached" is about the one before.
            motion.end = MotionEnd(self._objects(axis), self._clock(), name == "home")

    def _check(self, axis: AxisAddress, target: str, value: int) -> None:
        low, high = bounds(self._dictionaries[axis.node_id], axis, target)
        if not low <= value <= high:
            raise LocalError(f"{target} = {value} is not allowed; allowed: {low}..{high}")

    def jog(
        self, axis: AxisAddress, value: int, target: str = "velocity", who: object = None, ticket: int | None = None
    ) -> None:
        """Turn with a velocity or torque in the drive's units while `hold` is called; LocalError if not enabled."""
        self._check(axis, target, value)
        if ticket is not None and self._held.get(axis, (who, -inf))[1] < self._clock() - HELD:
            raise LocalError("the button was released before the drive could be asked: not carried out")
        with self._ordering((axis,), ticket):
            drive = self._drive(axis)
            if (state := drive.state) is not State.ENABLED:
                raise LocalError(f"enable the drive first: it is in {state.words if state else 'an unknown state'}")
            self._ask_once(axis, self._watch(axis))
            # Entered before it turns: even if an answer is lost, it will be halted.
            self._enter(axis, OrderedMotion(who, self._clock() + HELD))
            JOGS[target](drive, value)

    def send_raw(
        self,
        axes: Sequence[AxisAddress],
        send: Callable[[], object],
        who: object,
        ticket: int | None = None,
        confirmed: object = None,
    ) -> None:
        """Send frames that move axes without an order; they count as a motion until the axes stop, or `who` is gone.

        `send` passes its frames through `gate`. `confirmed` is the question of MayMove that a person has confirmed.
        """
        with self._ordering(axes, ticket):
            for axis in axes:
                try:
                    lacks = self._watch(axis)
                except RemoteError as error:  # a node that cannot be asked may still obey
                    lacks = str(error)
                self._ask_once(axis, lacks, confirmed)
            for axis in axes:
                motion = self._motions.get(axis)
                if motion is None or motion.until == inf:  # one that has to be held stays so
                    self._enter(axis, OrderedMotion(who, inf))
            send()

    def is_raw(self, axes: Iterable[AxisAddress], who: object) -> bool:
        """Return whether axes may still move by raw frames of a page."""
        motions = [self._motions.get(each) for each in axes]
        return all(each is not None and each.who is who and each.until == inf for each in motions)

    @contextmanager
    def raw_gate(self, axes: Sequence[AxisAddress], who: object) -> Iterator[None]:
        """Pass a frame of a list; raises LocalError once an axis is stopped. No stop begins meanwhile."""
        with self._lock:
            if not self.is_raw(axes, who):
                raise LocalError("it was stopped")
            yield

    def end_raw(self, axes: Iterable[AxisAddress], who: object) -> None:
        """Stop the axes that may move by a page's repeated frames, which are no longer sent."""
        with self._lock:
            for axis in axes:
                if self.is_raw([axis], who):
                    self.stop(axis)

    @contextmanager
    def _ordering(self, axes: Sequence[AxisAddress], ticket: int | None) -> Iterator[None]:
        """Carry out an order on axes, unless one is being stopped; an order that fails ends with a halt."""
        with self._lock:
            if ticket is not None and ticket != self.ticket(*axes):
                raise LocalError("it was stopped meanwhile: not carried out")
            for axis in axes:
                if axis in self._stops:
                    still = self._stops[axis].text(self._clock())
                    raise LocalError(f"{self._name(axis)} is still being stopped: {still}")
            self._order = axes
            self._is_revoked = False
        try:
            yield
        except BaseException:
            for axis in axes:
                if axis in self._motions:
                    self.stop(axis)
            raise
        finally:
            with self._lock:
                self._order = ()

    @contextmanager
    def gate(self) -> Iterator[None]:
        """Pass a frame of an order; raises LocalError once the axis is being stopped. No stop begins meanwhile."""
        with self._lock:
            if self._order and self._is_revoked:
                raise LocalError("it was stopped meanwhile: not carried out")
            yield

    def _enter(self, axis: AxisAddress, motion: OrderedMotion) -> None:
        with self._lock:
            if self._is_revoked:
                raise LocalError("it was stopped meanwhile: not carried out")
            self._motions[axis] = motion
        self.wake()

    # The drive watches our heartbeat

    def _watch(self, axis: AxisAddress) -> str:
        """Make the drive watch our heartbeat; return why it does not, or not surely, empty if it does."""
        node = self._master.node(axis.node_id)
        line = self._lines.get(axis.node_id)
        if line is None or not holds(node, line, self._beating()):
            own = self._beating()
            offsets = [each.offset for each in self.axes if each.node_id == axis.node_id]
            former = line.former if line else ()
            line = arm(node, offsets, own)
            # The values before the first change are restored, also after a reset of the drive.
            self._lines[axis.node_id] = line._replace(former=former or line.former)
            if line.left:
                self._said[f"left {axis.node_id}"] = self._clock(), f"{self._name(axis)}: {line.left}"
        return line.lacks

    def _ask_once(self, axis: AxisAddress, lacks: str, confirmed: object = None) -> None:
        """Check that a person has accepted that a drive goes on without us, or confirms it now; raises MayMove."""
        question = f"{self._name(axis)}: {GOES_ON}: {lacks}"
        if lacks and axis.node_id not in self._accepted:
            if confirmed != question:
                raise MayMove(question)
            self.accept(axis.node_id)

    def _beating(self) -> int:
        with self._lock:
            if self.own is None:
                self.own = free_id({*self._heard, *self._dictionaries}, self._wanted_id)
                self._beat = self._clock()
            return self.own

    def accept(self, node_id: int) -> None:
        """Note that a person has accepted that a drive goes on if this program fails."""
        self._accepted.add(node_id)

    # A motion goes on while its page confirms it

    def hold(self, axis: AxisAddress, who: object = None) -> None:
        """Prolong a motion; one that has ended is not resumed, and other pages' motions are not prolonged."""
        with self._lock:
            self._held[axis] = who, self._clock()
            motion = self._motions.get(axis)
            # Not of what was sent raw: that goes on without being held.
            if motion is not None and motion.who is who and motion.until < inf:
                motion.until = self._clock() + HELD

    def hear_page(self, who: object) -> None:
        """Note a page's message, which prolongs its raw frames' motion."""
        self._pages[who] = self._clock()

    def is_silent(self, who: object) -> bool:
        """Return whether the last message of a page is too old."""
        now = self._clock()
        return now - self._pages.get(who, now) > SILENT

    def left(self, who: object) -> None:
        """Stop the motions of a page that is gone or hidden."""
        with self._lock:
            self._pages.pop(who, None)
            for axis in [axis for axis, motion in self._motions.items() if motion.who is who]:
                self.stop(axis)

    # Stops

    def stop(self, axis: AxisAddress, kind: StopKind = StopKind.HALT) -> None:
        """Begin to stop an axis, and void its orders; `step` sends the frames."""
        with self._lock:
            now = self._clock()
            self._counts[axis] = self._counts.get(axis, 0) + 1
            self._motions.pop(axis, None)
            self._is_revoked |= axis in self._order
            before = self._stops.get(axis)
            ranks = list(StopKind)
            if before is None or ranks.index(kind) > ranks.index(before.kind) or before.has_failed(now):
                known = self._master.controlwords.get(axis)
                self._stops[axis] = AxisStop(self._objects(axis), now, kind, known)
        self.wake()

    def stop_all(self) -> str:
        """Quick-stop all axes, and stop every known or received node by NMT; return what is done."""
        with self._lock:
            now = self._clock()
            drives = {each.node_id for each in self.axes}
            for axis in self.axes:
                self.stop(axis, StopKind.QUICK_STOP)
            unknown = self._heard - self._dictionaries.keys()
            others = sorted((self._dictionaries.keys() | unknown) - drives)
            self._nodes = {node_id: NodeStop(node_id, now) for node_id in others}
            # Once the axes stand: a drive in Stopped could no longer answer by SDO whether it does.
            self._broadcast = now if unknown or not self.axes else None
        self.wake()
        axes = f"quick stop to {', '.join(map(self._name, self.axes))}" if self.axes else ""
        nodes = f"NMT stop to {', '.join(map(self._node_name, others))}" if others else ""
        why = f", and to all: no file describes {', '.join(map(self._node_name, sorted(unknown)))}" if unknown else ""
        return "; ".join(filter(None, [axes, nodes + why])) or "NMT stop to all"

    def has_heard(self, node_id: int) -> bool:
        """Return whether a node has sent anything."""
        return node_id in self._heard

    def post(self, frames: Iterable[Frame]) -> None:
        """Send frames soon, past all others."""
        with self._lock:  # after what a list is just sending
            self._outbox.extend(frames)
        self.wake()

    def stopping(self, axis: AxisAddress) -> AxisStop | None:
        """Return the stop of an axis that is under way, None if there is none."""
        return self._stops.get(axis)

    @property
    def is_busy(self) -> bool:
        """Whether anything moves by our order, or is being stopped."""
        return bool(self._motions or self._stops or self._nodes or self._outbox or self._broadcast is not None)

    # Frames and time

    def hear(self, frame: Frame) -> bool:
        """Process a frame; return whether it answers only a request of a stop."""
        now = self._clock()
        is_taken = False
        node_id = frame.cob_id & 0x7F
        if node_id in NODE_IDS and frame.cob_id - node_id in SENDERS and node_id != self.own:
            self._heard.add(node_id)
        if not self.is_busy:
            return False
        with self._lock:
            for axis, stop in list(self._stops.items()):
                more = stop.receive(frame, now)
                is_taken |= more is not None
                self._outbox.extend(more or ())
                if stop.done:
                    self._ended(axis, stop, now)
            for node in list(self._nodes.values()):
                node.receive(frame, now)
            for motion in self._motions.values():
                is_taken |= motion.end is not None and motion.end.receive(frame, now)
        if self._outbox:
            self.wake()
        return is_taken

    def _ended(self, axis: AxisAddress, stop: AxisStop, now: float) -> None:
        del self._stops[axis]
        self._master.controlwords[axis] = stop.word
        kept = f", but it does not let {', '.join(f'0x{each:04X}' for each in sorted(stop.refused))} be written"
        words = f"{self._name(axis)} stands, {now - stop.since:.2f} s after the {stop.kind.value}"
        self._said[self._name(axis)] = now, words + (kept if stop.refused else "")

    def step(self) -> float:
        """Send what is due, and end motions that no page confirms; return the seconds until the next step."""
        with self._lock:
            now = self._clock()
            self._end_motions(now)
            frames = [*self._outbox, *(each for stop in self._stops.values() for each in stop.due(now))]
            self._outbox.clear()
            frames += self._broadcasts(now)
            frames += [each for node in self._nodes.values() for each in node.due(now)]
            frames += [each for m in self._motions.values() if m.end is not None for each in m.end.due(now)]
            if now >= self._beat:
                self._beat = max(self._beat + PERIOD, now)
                frames.append(heartbeat(self._beating()))
        for frame in frames:
            with suppress(BusError):  # the next one may go out; the page shows that the bus is in trouble
                self._send(frame)
        return LOOK if self.is_busy else min(IDLE, max(self._beat - self._clock(), 0.0))

    def _end_motions(self, now: float) -> None:
        for axis, motion in list(self._motions.items()):
            if motion.end is not None and motion.end.done:
                del self._motions[axis]
            elif motion.until <= now or self.is_silent(motion.who):
                self.stop(axis)

    def _broadcasts(self, now: float) -> list[Frame]:
        """Return the NMT stop of all nodes, once the axes stand or have had their time, and that of confirmed nodes."""
        for node_id, node in list(self._nodes.items()):
            if node.done:
                del self._nodes[node_id]
                self._said[self._node_name(node_id)] = now, f"{self._node_name(node_id)} is stopped (NMT)"
        if self._broadcast is None or (self._stops and now - self._broadcast < LAST_STEP):
            return []
        self._broadcast = None
        return [Frame(NMT_COB_ID, bytes([NmtCommand.STOP, ALL_NODES]))]

    # Data for the page

    def data(self) -> dict[str, Any]:
        """Return the motions by our orders, the axes that stand, and as wrong those not known to have stopped."""
        with self._lock:
            now = self._clock()
            self._said = {key: said for key, said in self._said.items() if now - said[0] < SHOWN_FOR}
            wrong = [
                f"{self._name(a)} is not known to stand: {s.text(now)}"
                for a, s in self._stops.items()
                if s.has_failed(now)
            ]
            for node_id, node in list(self._nodes.items()):
                if node.has_failed(now):
                    never = "it was never heard" if node_id not in self._heard else node.text(now)
                    wrong.append(f"{self._node_name(node_id)} is not known to be stopped: {never}")
                    if now - node.since > SHOWN_FOR:
                        del self._nodes[node_id]
            others = [
                f"another client is asking {self._node_name(n)}"
                for n, at in list(self._master.shared.items())
                if self._master.clock() - at < SHOWN_FOR
            ]
            return {
                "moving": [[self._dictionaries[each.node_id].name, each.number] for each in self._motions],
                "said": [text for _, text in self._said.values()] + others,
                "wrong": wrong,
            }

    # The end of the program

    def begin_end(self) -> None:
        """Begin to halt all motions by our orders, before the program ends."""
        with self._lock:
            enabled = [
                a for a, word in self._master.controlwords.items() if DriveCommand.of(word) is DriveCommand.ENABLE
            ]
            for axis in self.axes:
                if axis in self._motions or (axis in enabled and axis not in self._stops):
                    self.stop(axis)

    @property
    def may_end(self) -> bool:
        """Whether no motion of ours is left, or its stop has had its time."""
        now = self._clock()
        return not self._motions and all(now - each.since >= GIVE_UP for each in list(self._stops.values()))

    def put_back(self) -> None:
        """Restore the drives' settings for watching us; drives that do not answer keep them."""
        for node_id, line in self._lines.items():
            if any(axis.node_id == node_id for axis in self._stops):  # it stops as soon as our heartbeat ends
                continue
            with suppress(EurobotError):
                disarm(self._master.node(node_id), line)
        self._lines.clear()


class MotionThread:
    """Runs the steps of drives on a thread of its own, which waits for no node."""

    def __init__(self, drives: Drives) -> None:
        self._drives = drives
        self._woken = threading.Event()
        self._is_ended = False
        self._thread = threading.Thread(target=self._run, name="motion", daemon=True)

    def __enter__(self) -> MotionThread:
        self._drives.wake = self._woken.set
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_ended = True
        self._woken.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._is_ended:
            self._woken.wait(self._drives.step())
            self._woken.clear()
