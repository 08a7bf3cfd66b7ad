"""The gatekeeper: takes every received frame to its listeners, and every message to be sent to the mailboxes.

Rule of this file: nothing that comes from the wire, and nothing that a listener does, raises out of `receive`; it is
counted and reported.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable
from enum import IntEnum
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from eurobot_od.errors import FrameLengthError, ListenerError, StateError
from eurobot_od.frame import HIGHEST_IDENTIFIER, Data, Frame
from eurobot_od.gatekeeper.listeners import (
    Event,
    Function,
    FunctionListener,
    ListenerStatistics,
    MessageQueue,
    Report,
    Reporter,
)
from eurobot_od.gatekeeper.mailboxes import MAILBOX_WAIT, MAILBOXES, Mailboxes, Stay, TransmitStatistics
from eurobot_od.pdo.catalogue import Message, MessageT
from eurobot_od.pdo.protocol import Protocol

if TYPE_CHECKING:
    from can.typechecking import CanFilter


# Who hears which COB-ID: a registration keeps the message, not its identifier, which a master may change


class ListenerKind(IntEnum):
    """Kinds of listeners in the order in which they are served; the first two get frames, the others messages.

    Nodes come first: other nodes wait for their answers.
    """

    NODE = 0
    FRAME_FUNCTION = 1
    QUEUE = 2
    FUNCTION = 3


Deliver: TypeAlias = Callable[[Any, float], object]
"""Takes a frame or message and its timestamp; it neither raises nor waits."""


class Registration(NamedTuple):
    """A listener, its kind, a function for its COB-IDs, and the function that it is called by."""

    listener: FunctionListener[Any] | MessageQueue[Any]
    kind: ListenerKind
    cob_ids: Callable[[], Iterable[int]]
    deliver: Deliver


class Delivery(NamedTuple):
    """How the frames of one COB-ID are delivered: as they are, or as the messages that they `decode` to."""

    frames: tuple[Deliver, ...]
    messages: tuple[Deliver, ...]
    decode: Callable[[Data], Any] | None


def deliveries_to(registrations: Iterable[Registration], protocol: Protocol) -> dict[int, Delivery]:
    """Return the deliveries by the present COB-IDs of the listeners, in the order of kind, then of registration."""
    heard: dict[int, list[Registration]] = {}
    # The sort is stable, so registrations of one kind keep their order.
    for each in sorted(registrations, key=lambda each: each.kind):
        # A set: a node whose EDS uses an identifier twice must hear each frame once.
        for cob_id in set(each.cob_ids()):
            heard.setdefault(cob_id, []).append(each)
    deliveries = {}
    for cob_id, those in heard.items():
        frames = tuple(each.deliver for each in those if each.kind < ListenerKind.QUEUE)
        messages = tuple(each.deliver for each in those if each.kind >= ListenerKind.QUEUE)
        deliveries[cob_id] = Delivery(frames, messages, protocol.binding_of(cob_id).decode if messages else None)
    return deliveries


SLOW_AFTER = 0.010
"""Seconds after which a call counts as slow; in that time, 500 kbit/s bring about forty full frames."""

REPORTS_KEPT = 1000
"""Most reports that are kept while nobody takes them."""

ALL_MESSAGES = "all messages"
"""The name of what a listener without a message type listens to."""

CallFunction: TypeAlias = Callable[[FunctionListener[Any], Any, float], object]
"""Has a function called with what it listens to and the timestamp, now or later."""


class Statistics(NamedTuple):
    """Counts so far: of each listener, refused frames, frames that nobody listens to, and the transmit side."""

    listeners: tuple[ListenerStatistics, ...]
    refused: int
    unheard: int
    transmit: TransmitStatistics


class Gatekeeper:
    """Listeners and mailboxes of one bus.

    `table_size` is how many listeners may be registered (0: any number; 20 in the 2014 robot). A call that takes longer
    than `slow_after` seconds of `clock` is reported. Reports go to `report`; without it, the latest are kept in
    `reports`. A `report` that raises, as for a pipe that nobody reads any more, is not called again: its exception is
    the `report_failure`, and reports are kept from then on. One thread receives; the bus's owner sends.

    `call_function` decides where functions run: in place, in the order of their registration, until a `Live` gives them
    a thread of their own. `rerouted` is called at the start, and on the receiving thread when the receive filters have
    changed.
    """

    def __init__(
        self,
        protocol: Protocol,
        *,
        table_size: int = 0,
        mailboxes: int = MAILBOXES,
        mailbox_wait: float = MAILBOX_WAIT,
        slow_after: float = SLOW_AFTER,
        report: Reporter | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.reports: deque[Report] = deque(maxlen=REPORTS_KEPT)
        self.report_failure: Exception | None = None
        self._report = report
        self.mailboxes = Mailboxes(self.report, mailboxes, mailbox_wait)
        self.call_function: CallFunction = FunctionListener.call
        self.rerouted: Callable[[], object] = lambda: None
        self.clock = clock
        self._protocol, self._slow_after = protocol, slow_after
        self._table_size, self._started = table_size, False
        self._registrations: list[Registration] = []
        self._routes: dict[int, Delivery] = {}
        self._refused = self._unheard = 0

    def report(self, report: Report) -> None:
        """Take a report from any thread; never raises."""
        if self._report is None or self.report_failure is not None:
            self.reports.append(report)
            return
        try:
            self._report(report)
        # Nothing may reach the receiving thread, and a reporter that has failed once is not called again.
        except Exception as error:
            self.report_failure = error
            self.reports.append(report)

    # Registration, before the start: raises ListenerError afterwards, and when the table is full

    def add_queue(
        self, message_type: type[MessageT] | None, maxsize: int = 0, name: str | None = None
    ) -> MessageQueue[MessageT]:
        """Return a queue that gets every message of a type, or without a type (None) every message; see MessageQueue.

        Raises UnknownName if there is no such type.
        """
        message = self._name(message_type)
        queue = MessageQueue[MessageT](name or f"queue of {message}", maxsize, self.report)
        self._register(Registration(queue, ListenerKind.QUEUE, self._cob_ids(message), queue.put))
        return queue

    def add_function(
        self, message_type: type[MessageT] | None, function: Function[MessageT], name: str | None = None
    ) -> None:
        """Have a function called with the messages of a type and their timestamps, or of all types (None).

        Functions are called one after the other; for one message, in the order of their registration. `name` is for
        reports. Raises UnknownName if there is no such type.
        """
        self._add_function(ListenerKind.FUNCTION, self._cob_ids(self._name(message_type)), function, name)

    def add_frames(
        self, cob_ids: Callable[[], Iterable[int]], function: Function[Frame], name: str | None = None
    ) -> None:
        """Have a function called with frames and their timestamps, including frames that are too short.

        `cob_ids` is asked at the start, and whenever the protocol has changed.
        """
        self._add_function(ListenerKind.FRAME_FUNCTION, cob_ids, function, name)

    def add_node(
        self, cob_ids: Callable[[], Iterable[int]], receive: Function[Frame], name: str
    ) -> FunctionListener[Frame]:
        """Have a CANopen node get its frames: like `add_frames`, but always on the receiving thread.

        Returns the listener.
        """
        listener = self._listener(receive, name)
        self._register(Registration(listener, ListenerKind.NODE, cob_ids, listener.call))
        return listener

    def _add_function(
        self, kind: ListenerKind, cob_ids: Callable[[], Iterable[int]], function: Function[Any], name: str | None
    ) -> None:
        listener = self._listener(function, name or getattr(function, "__qualname__", None) or repr(function))

        def deliver(message: Any, timestamp: float) -> None:
            # looked up at each call, as a Live replaces it after registration
            self.call_function(listener, message, timestamp)

        self._register(Registration(listener, kind, cob_ids, deliver))

    def _register(self, registration: Registration) -> None:
        name = registration.listener.name
        if self._started:
            # The bus's thread reads the routes without a lock, so the table is closed before it runs.
            raise ListenerError(f"{name}: the gatekeeper has started; listeners are registered before")
        # Bounded, as the 2014 robot had 20 places: an application that registers in a loop is found at its start, and
        # not by its use of memory.
        if 0 < self._table_size <= len(self._registrations):
            raise ListenerError(f"{name}: the listener table is full, it has {self._table_size} places")
        self._registrations.append(registration)

    def _listener(self, function: Function[Any], name: str) -> FunctionListener[Any]:
        return FunctionListener(name, function, self.report, self.clock, self._slow_after)

    def _name(self, message_type: type[Any] | None) -> str:
        """Return the name of a message, or of all messages for None; raises UnknownName."""
        return ALL_MESSAGES if message_type is None else self._protocol.name(message_type)

    def _cob_ids(self, name: str) -> Callable[[], Iterable[int]]:
        """Return a function for the COB-IDs of a message; it goes by name, as a changed protocol may make a new type.

        For a while there may be none: a master may make a PDO invalid, and valid again.
        """
        return lambda: [each.cob_id for each in self._protocol.bindings if name in (ALL_MESSAGES, each.name)]

    def start(self) -> list[CanFilter]:
        """End the registration and return the receive filters for python-can's `set_filters`.

        They let through only what is listened to; without any listener the list is empty, which python-can takes for
        "everything". Raises StateError when called again.
        """
        if self._started:
            raise StateError("the gatekeeper has started already")
        self._started = True
        return self.reroute(self._protocol)

    def reroute(self, protocol: Protocol) -> list[CanFilter]:
        """Take over a changed protocol, ask all listeners again, and return the receive filters as `start` does.

        For the receiving thread, when a master has changed a node's PDOs, SDO or heartbeat identifiers.
        """
        self._protocol = protocol
        # Made as a whole and put in place by one assignment: the receiving thread reads it without a lock.
        self._routes = deliveries_to(self._registrations, protocol)
        self.rerouted()
        return self.filters()

    def filters(self) -> list[CanFilter]:
        """Return the present receive filters, newly made: only the bus keeps them (document section 6)."""
        # the mask: all 11 bits of an identifier count
        return [
            {"can_id": cob_id, "can_mask": HIGHEST_IDENTIFIER, "extended": False} for cob_id in sorted(self._routes)
        ]

    # Receiving

    def receive(self, frame: Frame, timestamp: float) -> None:
        """Deliver a frame, received at `timestamp` in seconds, to its listeners."""
        self.receive_data(*frame, timestamp)

    def receive_data(self, cob_id: int, data: Data, timestamp: float) -> None:
        """Do what `receive` does, with data in a driver's buffer that may change as soon as this returns."""
        try:
            to_frames, to_messages, decode = self._routes[cob_id]
        # Cheaper than testing first: with receive filters in the driver, nearly every frame has a route.
        except KeyError:
            self._unheard += 1
            return
        if to_frames:
            # Copied only for those who keep the frame: a message takes its values out of the driver's buffer at once.
            frame = Frame(cob_id, bytes(data))
            for deliver in to_frames:
                deliver(frame, timestamp)
        if decode is None:
            return
        try:
            message = decode(data)
        # Never half-read: the 2014 robot took left-over bytes for the rest of a short frame.
        except FrameLengthError as error:
            self._refused += 1
            self.report(Report(Event.FRAME_REFUSED, f"0x{error.cob_id:03X}", str(error), timestamp))
            return
        for deliver in to_messages:
            deliver(message, timestamp)

    def acts_always(self, cob_id: int) -> bool:
        """Tell whether a COB-ID is that of a message that acts whenever it comes: a stop."""
        # Asked for frames that waited while the process stood still: an old goto must not be carried out, a stop may.
        return any(each.always and each.cob_id == cob_id for each in self._protocol.bindings)

    # Sending

    def send(self, message: Message, now: float) -> None:
        """Encode a message and leave it to the mailboxes, without waiting. Raises FieldError."""
        # A stop never expires: the document's 50 ms (section 6) are for frames that are repeated, or useless later.
        stop = self._protocol.binding(type(message)).always
        self.mailboxes.submit(self._protocol.encode(message), now, Stay.LASTING if stop else Stay.SHORT)

    # Counts

    def statistics(self) -> Statistics:
        """Return the counts so far."""
        listeners = tuple(each.listener.statistics() for each in self._registrations)
        return Statistics(listeners, self._refused, self._unheard, self.mailboxes.statistics())
