"""A node: a CANopen device with an application, which has timers and a table of message handlers.

There is no clock and no bus in this module: `receive`, `requested` and `tick` take the time in s and return the frames
to send, and `next_wakeup` is the time for the next `tick`. A message with a value out of range is never handled.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Hashable, Mapping
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import partial
from math import inf
from typing import Any, ClassVar

from eurobot_od.controller import Controller, Reporter
from eurobot_od.device import node_class
from eurobot_od.device.bound import Application, BoundObject, names_of
from eurobot_od.device.device import Device
from eurobot_od.device.lss import LssSlave
from eurobot_od.device.objects import Store
from eurobot_od.device.reaction import Reaction
from eurobot_od.device.timers import LATE, Call, Timer, TimerAction, Timers
from eurobot_od.errors import Cause, Refused, StateError
from eurobot_od.frame import Frame
from eurobot_od.od import fingerprints
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import Value
from eurobot_od.pdo.kinds import NOTHING, Catalogue, Message, is_flagged


class NodeHooks:
    """Methods for events of a node; by default they do nothing."""

    def halted(self) -> None:
        """Called when the node has left OPERATIONAL."""

    def cut_off(self) -> None:
        """The bus is lost, so that nobody can command the node; by default the same as `halted`."""
        self.halted()

    def heartbeat_lost(self, node_id: int) -> None:
        """The heartbeat of another node is lost."""

    def booted(self, node_id: int) -> None:
        """A watched node has booted, and so has lost its state."""

    def answered(self, frame: Frame) -> None:
        """Another node has answered one of our SDO requests."""

    def leave(self) -> Call[Any] | None:
        """Start the last actions before the node is switched off; return their call, or None.

        The caller waits for the call before it ends the node. It may be called from any thread.
        """
        return None

    def switched_off(self) -> None:
        """Cancel all pending calls: `receive` and `tick` will not be called again."""


class Node(NodeHooks):
    """A node, made from its EDS.

    Subclasses have tables: `CATALOGUE` has the message types. `HANDLERS` has a handler for each message type: it
    returns the answer or None, and raises Refused if the node refuses the message. `OBJECTS` binds objects, by
    ParameterName: reading one reads the node; writing its last sub-index by SDO acts like a received message.
    `MEASURED` has functions for single objects that are in no message. Settings are attributes (see `bound`). Mistakes
    in these tables raise NodeClassError when the class, or a node, is created. This class itself handles no message.

    `ignored` is the number of messages with values out of range, `withheld` the number of messages that were not sent
    because of the NMT state or an invalid TPDO. A program with several threads sets `guard` to its lock, and `wake` to
    a function that makes it call `tick` soon; `wake` is called with the guard held, and never during `receive` or
    `tick`. `alarm` is called with sentences that a person has to read.

    Args:
        dictionary: the device's dictionary
        store: keeps the settings over a restart; default: they last while the node runs
        lss: LSS slave, by which a master can set the node-ID
    """

    CATALOGUE: ClassVar[Catalogue] = NOTHING
    HANDLERS: ClassVar[Mapping[type[Message], Callable[[Any, Any], Message | None]]] = {}
    OBJECTS: ClassVar[Mapping[str, BoundObject]] = {}
    MEASURED: ClassVar[Mapping[str, Callable[[Any], Value]]] = {}

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        node_class.check(cls, Node)

    def __init__(self, dictionary: Dictionary, *, store: Store | None = None, lss: LssSlave | None = None) -> None:
        node_class.check_file(type(self), dictionary)
        self._addresses = {name: dictionary.address(name) for name in names_of(type(self))}
        self.device = Device(dictionary, store, self.CATALOGUE, self._application(dictionary), lss)
        self.name = dictionary.name
        self.now = 0.0
        self.ignored = self.withheld = 0
        self.guard: AbstractContextManager[object] = nullcontext()
        self.wake: Callable[[], object] = lambda: None
        self.alarm: Callable[[str], object] = lambda _: None
        self._operational = self._attended = False
        self._soon: deque[TimerAction] = deque()
        self._timers = Timers(self.device.plan.at)
        self._out: list[Frame] = []

    def _application(self, dictionary: Dictionary) -> Application:
        """Return the bindings of the node's objects; called before the device is created."""
        readers = {name: partial(each.read, self) for name, each in self.OBJECTS.items() if each.read}
        writers = {name: each.write for name, each in self.OBJECTS.items() if each.write}
        measured = {dictionary.address(name): partial(read, self) for name, read in self.MEASURED.items()}
        subs = dictionary.members.get(fingerprints.FINGERPRINTS, {})
        measured |= {(fingerprints.FINGERPRINTS, sub): partial(self._fingerprint, sub) for sub in subs if sub}
        return Application(readers, writers, self._obey, measured=measured)

    def _fingerprint(self, sub: int) -> Value:
        """Return a fingerprint of the present mappings (see `od.fingerprints`)."""
        return fingerprints.at(sub, self.device.dictionary, self.device.objects.value)

    def controller(self, report: Reporter | None, clock: Callable[[], float]) -> Controller:
        """Return a CAN controller for the node, with listeners and mailboxes; subclasses may override it."""
        return Controller(self.device.protocol, report=report, clock=clock)

    # For the caller that runs the node

    @property
    def next_wakeup(self) -> float:
        """Time for the next `tick`, infinite if nothing is planned."""
        return min(self._timers.next, self.device.next_wakeup, self.now if self._out or self._soon else inf)

    def start(self, now: float) -> list[Frame]:
        """Switch the node on, and return the frames to send."""
        self.now = now
        for what in self.device.storage.refused:
            self.alarm(what)
        self._out += self.device.start(now)
        self.reset()
        node_class.check_attributes(self, Node)
        self._operational = self.device.operational
        return self._flush()

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        """Handle a frame, and return the frames to send."""
        return self._attend(lambda: self.device.receive(frame, now), now)

    def requested(self, cob_id: int, now: float) -> list[Frame]:
        """Handle a remote frame, and return the frames to send."""
        return self._attend(lambda: self.device.requested(cob_id, now), now)

    def tick(self, now: float) -> list[Frame]:
        """Do all due actions, and return the frames to send.

        After a standstill, missed periodic actions are done once, and `alarm` is called.
        """
        # `plan.soonest` is a quick lower bound.
        late = now - self.device.plan.soonest
        if late > LATE and (late := now - min(self._timers.next, self.device.next_wakeup)) > LATE:
            self.alarm(f"stood still for {late:.1f} s; what was due meanwhile is skipped")

        def do_due() -> Reaction:
            for _ in range(len(self._soon)):  # actions that these add are for the next tick
                self._soon.popleft()(now)
            for action, time in self._timers.due(now):
                action(time)
            return self.device.tick(now)

        return self._attend(do_due, now)

    def _attend(self, step: Callable[[], Reaction], now: float) -> list[Frame]:
        """Run a step of the device without calling `wake`, and return the frames to send."""
        self.now = now
        self._attended = True
        try:
            self._react(step())
        finally:
            self._attended = False
        return self._flush()

    def bus_error(self, code: ErrorCode, now: float) -> None:
        """Note an error of the CAN controller, such as an overrun; `tick` sends the EMCY."""
        self.device.emergencies.happened(code, now)
        self._call()

    def bus_lost(self, now: float) -> list[Frame]:
        """Note that the bus is lost, and return the frames to send once it is back."""

        def cut_off() -> Reaction:
            self.device.sdo_service.forget()
            self.cut_off()
            return Reaction([])

        return self._attend(cut_off, now)

    def failed(self, error: BaseException, now: float) -> list[Frame]:
        """Stop after an exception of the node, and return the frames to send: stop messages and an EMCY.

        Afterwards only `restart` may be called.
        """
        self.now = now
        for stop in (self.cut_off, self.reset):
            with suppress(Exception):  # it may fail again
                stop()
        code = ErrorCode.HARDWARE if isinstance(error, OSError) else ErrorCode.INTERNAL_SOFTWARE
        self.device.emergencies.raised(code, Node.failed)
        return self._flush()

    def restart(self, now: float) -> list[Frame]:
        """Reset the node as by an NMT command, in any state, and return the frames to send."""
        return self._attend(lambda: self.device.restart(now), now)

    def _react(self, reaction: Reaction) -> None:
        self._out += reaction.frames
        if self._operational is not self.device.operational:
            self._operational = self.device.operational
            if not self._operational:
                self.halted()
        if reaction.reset:
            self.reset()
        for node_id in reaction.lost:
            self.heartbeat_lost(node_id)
        if reaction.booted is not None:
            self.booted(reaction.booted)
        if reaction.message is not None:
            self.handle(reaction.message)
        for each in reaction.synchronous:
            self.handle(each)
        if reaction.answer is not None:
            self.answered(reaction.answer)

    def _call(self) -> None:
        """Call `wake`, unless the caller is working on the node."""
        if not self._attended:
            self.wake()

    # For subclasses, beside `NodeHooks`

    def reset(self) -> None:
        """Return to the state after power-on; subclasses extend it."""
        self._timers.clear()
        self._soon.clear()

    def soon(self, action: TimerAction) -> None:
        """Call `action` with the time at the next `tick`, for callers that do not know the time."""
        self._soon.append(action)
        self.device.plan.at(self.now)
        self._call()

    def send(self, message: Message) -> None:
        """Add a message to the frames to send, and call `wake`; may be called from any thread.

        Raises StateError if the node has no TPDO for it or its NMT state does not allow it, FieldError for a value.
        """
        with self.guard:
            self._send(message)

    def _send(self, message: Message) -> None:
        self._out += self.device.pdo_service.send(message, self.now)
        self._call()

    def put(self, frame: Frame) -> None:
        """Add any frame to those to send, and call `wake`."""
        self._out.append(frame)
        self._call()

    def offer(self, message: Message) -> None:
        """Send a message if it may be sent now; else count and drop it."""
        try:
            self._send(message)
        except StateError:
            node_class.check_answer(self, message)
            self.withheld += 1

    def at(self, time: float, action: TimerAction) -> Timer:
        """Plan a call, and return the timer, which can be cancelled.

        Args:
            time: when, in s by the clock of `now`
            action: called with the time at which it was due
        """
        return self._timers.at(time, action)

    def raise_error(self, code: int, what: Hashable) -> None:
        """Report an error by EMCY, once until `clear_error`.

        Args:
            code: emergency error code (CiA 301, 7.2.7.1)
            what: identifies the error for `clear_error`
        """
        self.device.emergencies.raised(code, what)

    def clear_error(self, what: Hashable) -> None:
        """Report by EMCY that an error is gone."""
        self.device.emergencies.cleared(what)

    # Messages

    def setting(self, name: str) -> float:
        """Return the present number of a setting by its ParameterNames; a float for a REAL. Raises DictionaryError."""
        return self.device.objects.quantity(self._addresses.get(name) or self.device.dictionary.address(name))

    def handle(self, message: Message) -> None:
        """Handle a message, unless its values are out of range or the node refuses it.

        An invalid message is counted, and reported by EMCY once until a valid one of its type comes.
        """
        emergencies = self.device.emergencies
        what = (Node.doubt, type(message))
        doubt = self.doubt(message)
        if doubt is not None:
            self.ignored += 1
            emergencies.raised(doubt, what, self.device.protocol.cob_id(type(message)).to_bytes(2, "little"))
            return
        # The message is valid again, which an EMCY with error code 0x0000 reports.
        if what in emergencies.errors:
            emergencies.cleared(what)
        with suppress(Refused):
            self._act(message)

    def doubt(self, message: Message) -> int | None:
        """Return the error code for a message that must not be handled, else None; stop messages always are."""
        flagged = message and is_flagged(message) and type(message) not in self.CATALOGUE.always
        return ErrorCode.VALUE_OUT_OF_RANGE if flagged else None

    def _obey(self, command: Message) -> None:
        """Handle the message of a written object; raises Refused."""
        if self.doubt(command) is not None:
            raise Refused(Cause.VALUES, "its values are out of range")
        self._act(command)

    def _act(self, message: Message) -> None:
        """Handle a valid message, and send the answer; raises Refused."""
        answer = self.answer_to(message)
        if answer is not None:
            self.offer(answer)

    def answer_to(self, message: Message) -> Message | None:
        """Handle a message, and return the answer or None; raises Refused without any effect."""
        handler = self.HANDLERS.get(type(message))
        return handler(self, message) if handler is not None else None

    def _flush(self) -> list[Frame]:
        frames = self._out
        self._out = []
        if not self.device.emergencies.quiet:
            frames += self.device.emergency_frames(self.now)
        return frames
