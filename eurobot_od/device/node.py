"""A node: a CANopen device with an application, which has timers and a table of what each message does.

There is no clock and no bus in here: `receive`, `requested` and `tick` take the time in seconds and return the frames
to send, and `next_wakeup` says when to call `tick`. A message with a value out of range is never acted on.
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
from eurobot_od.device.hooks import NodeHooks
from eurobot_od.device.lss import LssSlave
from eurobot_od.device.objects import Store
from eurobot_od.device.reaction import Reaction
from eurobot_od.device.timers import LATE, Timer, TimerAction, Timers
from eurobot_od.errors import Cause, Refused, StateError
from eurobot_od.frame import Frame
from eurobot_od.od import fingerprints
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import Value
from eurobot_od.pdo.kinds import NOTHING, Catalogue, Message, is_flagged


class Node(NodeHooks):
    """A node, made from its EDS; `store` keeps its settings over a restart, without one they last while it runs.

    With `lss` a master finds it by LSS, and may give it its node-ID.

    `CATALOGUE` has its message types. `HANDLERS` has a handler for each message type: it returns the message to answer
    with, or None, and raises Refused if the node does not act on the message. What is wrong with these tables is raised
    as NodeClassError when the class, or a node of it, is made. `OBJECTS` says, by ParameterName, which
    objects are read from the node, and which stand for a message when they are written by SDO: once the last sub-index
    is written, the node acts as if the frame had come. `MEASURED` gives the values of single objects that are in no
    message, by ParameterNames like those of a setting; settings are attributes (see `settings`). The class itself does
    nothing with messages: it runs anybody's device.

    `ignored` counts messages that were not acted on because of their values, `withheld` those that were not sent
    because of the NMT state or because their TPDO is not valid. A program that runs the node from several threads sets
    `guard` to its lock, and `wake` to a function that makes it call `tick` soon; `wake` is called with the guard held,
    and never during `receive` or `tick`, whose caller looks at the node afterwards anyway. `alarm` takes a sentence
    that a person has to read.
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
        """Return what the node's objects are bound to; called before the device is made."""
        readers = {name: partial(each.read, self) for name, each in self.OBJECTS.items() if each.read}
        writers = {name: each.write for name, each in self.OBJECTS.items() if each.write}
        measured = {dictionary.address(name): partial(read, self) for name, read in self.MEASURED.items()}
        subs = dictionary.members.get(fingerprints.FINGERPRINTS, {})
        measured |= {(fingerprints.FINGERPRINTS, sub): partial(self._fingerprint, sub) for sub in subs if sub}
        return Application(readers, writers, self._obey, measured=measured)

    def _fingerprint(self, sub: int) -> Value:
        """Return a fingerprint by how messages are mapped now, whatever the file says (see `od.fingerprints`)."""
        return fingerprints.at(sub, self.device.dictionary, self.device.objects.value)

    def controller(self, report: Reporter | None, clock: Callable[[], float]) -> Controller:
        """Return a CAN controller for the node, with the listeners and mailboxes of its kind; a hook for subclasses."""
        return Controller(self.device.protocol, report=report, clock=clock)

    # From outside

    @property
    def next_wakeup(self) -> float:
        """Time at which `tick` wants to be called, infinite if nothing is planned."""
        return min(self._timers.next, self.device.next_wakeup, self.now if self._out or self._soon else inf)

    def start(self, now: float) -> list[Frame]:
        """Switch the node on: boot-up, and everything that follows."""
        self.now = now
        for what in self.device.storage.refused:
            self.alarm(what)
        self._out += self.device.start(now)
        self.reset()
        node_class.check_attributes(self, Node)
        self._operational = self.device.operational
        return self._flush()

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        """Take in one frame and return the frames to send."""
        return self._attend(lambda: self.device.receive(frame, now), now)

    def requested(self, cob_id: int, now: float) -> list[Frame]:
        """Take in one remote frame and return the frames to send."""
        return self._attend(lambda: self.device.requested(cob_id, now), now)

    def tick(self, now: float) -> list[Frame]:
        """Do what is due by now and return the frames to send.

        A node that has stood still does only once what it has missed, and says so.
        """
        # What was planned is never before the plan's soonest, which is at hand.
        late = now - self.device.plan.soonest
        if late > LATE and (late := now - min(self._timers.next, self.device.next_wakeup)) > LATE:
            self.alarm(f"stood still for {late:.1f} s; what was due meanwhile is skipped")

        def do_due() -> Reaction:
            for _ in range(len(self._soon)):  # anything that these plan in turn is for the next tick
                self._soon.popleft()(now)
            for action, time in self._timers.due(now):
                action(time)
            return self.device.tick(now)

        return self._attend(do_due, now)

    def _attend(self, step: Callable[[], Reaction], now: float) -> list[Frame]:
        """Let the device take a step, and return the frames to send; nobody has to be woken meanwhile."""
        self.now = now
        self._attended = True
        try:
            self._react(step())
        finally:
            self._attended = False
        return self._flush()

    def bus_error(self, code: ErrorCode, now: float) -> None:
        """Take in an error that the CAN controller reports, such as an overrun; `tick` sends the EMCY."""
        self.device.emergencies.happened(code, now)
        self._call()

    def bus_lost(self, now: float) -> list[Frame]:
        """Note that the bus is lost, and return the frames to send as soon as it is back."""

        def cut_off() -> Reaction:
            self.device.sdo_service.forget()
            self.cut_off()
            return Reaction([])

        return self._attend(cut_off, now)

    def failed(self, error: BaseException, now: float) -> list[Frame]:
        """Stop, and return the frames to send because the node has raised an exception: stops, and the EMCY.

        After that, only `restart` may be called.
        """
        self.now = now
        for stop in (self.cut_off, self.reset):
            with suppress(Exception):  # what has failed once may fail again; the rest must still be done
                stop()
        code = ErrorCode.HARDWARE if isinstance(error, OSError) else ErrorCode.INTERNAL_SOFTWARE
        self.device.emergencies.raised(code, Node.failed)
        return self._flush()

    def restart(self, now: float) -> list[Frame]:
        """Do what an NMT command to reset the node does, in any state, and return the frames to send."""
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
        """Wake whoever runs the node, unless they are at work on it already."""
        if not self._attended:
            self.wake()

    # For subclasses, beside `NodeHooks`

    def reset(self) -> None:
        """Go back to the state after power-on; subclasses add what is theirs."""
        self._timers.clear()
        self._soon.clear()

    def soon(self, action: TimerAction) -> None:
        """Have `action` called, with the time, at the next `tick`: a caller from outside does not know the time."""
        self._soon.append(action)
        self.device.plan.at(self.now)
        self._call()

    def send(self, message: Message) -> None:
        """Put a message among the frames to send, and wake whoever runs the node; may be called from any thread.

        Raises StateError if the node has no TPDO for it or if its NMT state does not allow it, FieldError for a value.
        """
        with self.guard:
            self._send(message)

    def _send(self, message: Message) -> None:
        self._out += self.device.pdo_service.send(message, self.now)
        self._call()

    def put(self, frame: Frame) -> None:
        """Put any frame among those to send, and wake whoever runs the node."""
        self._out.append(frame)
        self._call()

    def offer(self, message: Message) -> None:
        """Send a message that nobody waits for; if it may not be sent now, it is counted and dropped."""
        try:
            self._send(message)
        except StateError:
            node_class.check_answer(self, message)
            self.withheld += 1

    def at(self, time: float, action: TimerAction) -> Timer:
        """Have `action` called when the time comes."""
        return self._timers.at(time, action)

    def raise_error(self, code: int, what: Hashable) -> None:
        """Report an error by EMCY, once."""
        self.device.emergencies.raised(code, what)

    def clear_error(self, what: Hashable) -> None:
        """Report by EMCY that an error is gone."""
        self.device.emergencies.cleared(what)

    # What it does with messages

    def setting(self, name: str) -> float:
        """Return the number that a setting has now, by its ParameterNames; a node's class has them as attributes.

        It is an int, but of a REAL. Raises DictionaryError.
        """
        return self.device.objects.quantity(self._addresses.get(name) or self.device.dictionary.address(name))

    def handle(self, message: Message) -> None:
        """Take in a message, and act on it if it can be believed and the node does not refuse it.

        One that cannot be believed is counted, and reported by EMCY once until a message of its type can be believed
        again.
        """
        emergencies, what = self.device.emergencies, (Node.doubt, type(message))
        doubt = self.doubt(message)
        if doubt is not None:
            self.ignored += 1
            emergencies.raised(doubt, what, self.device.protocol.cob_id(type(message)).to_bytes(2, "little"))
            return
        # It can be believed again, which an EMCY with the error code 0x0000 reports.
        if what in emergencies.errors:
            emergencies.cleared(what)
        with suppress(Refused):
            self._act(message)

    def doubt(self, message: Message) -> int | None:
        """Return the error code for a message that must not be acted on, None for any other.

        A stop is acted on whatever it contains: this is not the time to be particular.
        """
        flagged = message and is_flagged(message) and type(message) not in self.CATALOGUE.always
        return ErrorCode.VALUE_OUT_OF_RANGE if flagged else None

    def _obey(self, command: Message) -> None:
        """Act on the message that a written object stands for; raises Refused."""
        if self.doubt(command) is not None:
            raise Refused(Cause.VALUES, "it cannot be believed")
        self._act(command)

    def _act(self, message: Message) -> None:
        """Act on a message that is believed, and offer the answer; raises Refused."""
        answer = self.answer_to(message)
        if answer is not None:
            self.offer(answer)

    def answer_to(self, message: Message) -> Message | None:
        """Carry out a message, and return the answer without sending it, None if there is none.

        Raises Refused, and has done nothing then.
        """
        handler = self.HANDLERS.get(type(message))
        return handler(self, message) if handler is not None else None

    def _flush(self) -> list[Frame]:
        frames, self._out = self._out, []
        if not self.device.emergencies.quiet:
            frames += self.device.emergency_frames(self.now)
        return frames
