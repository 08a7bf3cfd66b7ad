"""The CAN controller of a node: which frames it receives, which frame it sends next, and its reports of errors.

The controller of any device receives the COB-IDs of its listeners (receive filters), and has one queue of frames to
send, by priority and without a limit. A robot may give its nodes a controller with more rules.

The caller has the bus, the threads and the clock: `bus/live` and `bus/simulated` pass frames and times. Only a program
that reads a `MessageQueue` may wait, for as long as it says. No frame, and no listener, makes `receive` raise: errors
are counted and reported.
"""

from __future__ import annotations

import logging
import time
from bisect import insort
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum, IntEnum, auto
from inspect import signature
from math import inf
from queue import Empty, SimpleQueue
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeAlias, TypeVar

from eurobot_od.errors import FrameLengthError, ListenerError, StateError
from eurobot_od.frame import HIGHEST_IDENTIFIER, Data, Frame
from eurobot_od.pdo.kinds import Message, MessageT
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.support.texts import amount, described, one_line

if TYPE_CHECKING:
    from can.typechecking import CanFilter

# Reports


class Event(Enum):
    """The kind of a report."""

    LISTENER_FAILED = "listener failed"
    LISTENER_SLOW = "listener slow"
    LISTENER_STUCK = "listener stuck"
    QUEUE_OVERFLOW = "queue overflow"
    FRAME_REFUSED = "frame refused"
    FRAME_DROPPED = "frame dropped"
    BUS_FAILED = "bus failed"
    BUS_OFF = "bus off"
    BUS_BACK = "bus back"
    BUS_SILENT = "bus silent"
    FRAMES_LOST = "frames lost"
    END_FAILED = "end failed"
    NODE_ALARM = "node alarm"
    NODE_FAILED = "node failed"


@dataclass(frozen=True)
class Report:
    """One event: the `name` of a listener, message, COB-ID or bus, what happened, and when, in s.

    `timestamp` is that of the frame; `error` is the exception, for a caller that wants its traceback. `str()` is one
    line.
    """

    event: Event
    name: str
    text: str
    timestamp: float
    error: BaseException | None = None

    def __str__(self) -> str:
        return one_line(f"{self.event.value}: {self.name}: {' '.join(self.text.split())}")


Reporter: TypeAlias = Callable[[Report], object]
"""Called with a report, on the thread where it happened; it must neither raise nor wait."""

CONTROLLER_LOG = logging.getLogger("eurobot_od.controller")

REPORTS_KEPT = 1000
"""Maximum number of reports that are kept until they are read."""


def has_doubled(count: int) -> bool:
    """Return whether a lasting condition is reported at this count: at 1, 2, 4, 8, ..."""
    # A power of two has one bit set. A million losses make twenty reports.
    return count.bit_count() == 1


# Listeners

T = TypeVar("T")

Function: TypeAlias = Callable[[T, float], object]
"""Called with a frame or message, and its time in s by the bus's clock."""

SLOW_AFTER = 0.010
"""Time after which a call counts as slow, in s; meanwhile 500 kbit/s carry about forty full frames."""


class ListenerStatistics(NamedTuple):
    """A listener's counts: messages delivered and lost, calls that failed, and calls that delayed the others."""

    name: str
    delivered: int
    lost: int
    failed: int = 0
    slow: int = 0


class FunctionListener(Generic[T]):
    """A function with its name and counts; calls longer than `slow_after` s are reported."""

    def __init__(
        self, name: str, function: Function[T], report: Reporter, clock: Callable[[], float], slow_after: float
    ) -> None:
        self.name = name
        self.delivered = self.lost = self.failed = self.slow = 0
        self._function = function
        self._report = report
        self._clock = clock
        self._slow_after = slow_after

    def call(self, message: T, timestamp: float) -> None:
        """Call the function; its exceptions are reported and do not propagate."""
        # Not the message's timestamp, as the frame may have waited.
        begin = self._clock()
        try:
            self._function(message, timestamp)
        except (Exception, SystemExit) as error:  # the other listeners still get their message
            self.has_failed(error, timestamp)
        self.delivered += 1
        seconds = self._clock() - begin
        if seconds > self._slow_after:
            self.slow += 1
            if has_doubled(self.slow):
                text = f"held up the others for {seconds * 1000:.1f} ms, {amount(self.slow, 'time')} so far"
                self._report(Report(Event.LISTENER_SLOW, self.name, text, timestamp))

    def has_failed(self, error: BaseException, timestamp: float) -> None:
        """Report that a call raised an exception."""
        self.failed += 1
        text = described(error)
        self._report(Report(Event.LISTENER_FAILED, self.name, text, timestamp, error))

    def has_lost(self, timestamp: float) -> None:
        """Count a message that was dropped before the function could be called with it."""
        self.lost += 1
        if has_doubled(self.lost):
            text = f"too many calls wait, {amount(self.lost, 'message')} lost so far; the newest are kept"
            self._report(Report(Event.QUEUE_OVERFLOW, self.name, text, timestamp))

    def statistics(self) -> ListenerStatistics:
        """Return the counts so far."""
        return ListenerStatistics(self.name, self.delivered, self.lost, self.failed, self.slow)


class Received(NamedTuple, Generic[T]):
    """A message in a queue, with its time in s by the bus's clock."""

    message: T
    timestamp: float


class MessageQueue(Generic[T]):
    """A FIFO of received messages, at most `maxsize` (0: no limit). One thread puts, any number may get.

    When the queue is full, the oldest message is dropped: only the newest position or goto matters.
    """

    def __init__(self, name: str, maxsize: int, report: Reporter) -> None:
        self.name = name
        self.maxsize = maxsize
        self.delivered = self.lost = 0
        self._report = report
        # Its `put` is reentrant and never waits, so that a program cannot block the bus's thread.
        self._items: SimpleQueue[tuple[T, float]] = SimpleQueue()

    def __len__(self) -> int:
        return self._items.qsize()

    def put(self, message: T, timestamp: float) -> None:
        """Append a message, without waiting."""
        # Full, unless a reader has just taken a message.
        if 0 < self.maxsize <= self._items.qsize() and self.get_nowait() is not None:
            self.lost += 1
            if has_doubled(self.lost):
                text = f"full with {self.maxsize} messages, {self.lost} lost so far; the newest are kept"
                self._report(Report(Event.QUEUE_OVERFLOW, self.name, text, timestamp))
        self._items.put((message, timestamp))  # the reader makes the Received, to save time on the bus's thread
        self.delivered += 1

    def get(self, timeout: float | None = None) -> Received[T] | None:
        """Take the oldest message, waiting up to `timeout` s (None: for ever); None if none came."""
        try:
            return Received(*self._items.get(timeout=None if timeout is None else max(timeout, 0)))
        except Empty:
            return None

    def get_nowait(self) -> Received[T] | None:
        """Take the oldest message, None if there is none."""
        return self.get(timeout=0.0)

    def drain(self) -> list[Received[T]]:
        """Take all messages that are waiting, the oldest first."""
        return list(iter(self.get_nowait, None))

    def statistics(self) -> ListenerStatistics:
        """Return the counts so far."""
        return ListenerStatistics(self.name, self.delivered, self.lost)


CallFunction: TypeAlias = Callable[[FunctionListener[Any], Any, float], object]
"""Calls a listener's function with a frame or message and its timestamp, now or later."""


# Sending


class Stay(Enum):
    """How long a frame may wait to be sent."""

    SHORT = auto()
    """As long as the controller allows for any frame."""
    PERIODIC = auto()
    """Until the next frame with its COB-ID replaces it: a heartbeat, of which only the newest matters."""
    TRANSFER = auto()
    """Without a limit, after all other frames: part of an SDO transfer, which would fail without it."""
    LASTING = auto()
    """Without a limit, even while the bus is lost: a stop."""


class Waiting(NamedTuple):
    """A waiting frame; tuples sort in the order of sending.

    `sequence` numbers the submitted frames, so that equal ranks stay in order.
    """

    rank: int
    sequence: int
    frame: Frame
    stay: Stay
    deadline: float = inf


class TransmitStatistics(NamedTuple):
    """Numbers of frames: submitted = completed + dropped + waiting + loaded.

    A periodic frame that is replaced by the next one counts as dropped.
    """

    submitted: int
    completed: int
    dropped: int
    waiting: int
    loaded: int = 0


class TransmitQueue:
    """The frames to send, without a limit: `waiting` has them in the order of sending.

    A frame on the wire waits until it is complete. If it is withdrawn meanwhile, such as an outdated heartbeat, it is
    sent all the same, and counts as dropped.
    """

    def __init__(self) -> None:
        self.waiting: list[Waiting] = []
        self._submitted = self._completed = self._dropped = 0
        self._away: int | None = None
        """Number of frames dropped before the bus was lost; None while the bus works."""

    def submit(self, frame: Frame, now: float, stay: Stay = Stay.SHORT) -> None:
        """Add a frame in its place; while the bus is lost, it is dropped unless it is LASTING."""
        sequence = self._submitted
        self._submitted += 1
        if self._away is not None and stay is not Stay.LASTING:
            self._dropped += 1
            return
        if stay is Stay.PERIODIC:
            # The next heartbeat replaces a waiting one.
            self._withdraw(lambda each: each.stay is Stay.PERIODIC and each.frame.cob_id == frame.cob_id)
        insort(self.waiting, self._placed(frame, sequence, stay, now))

    def _placed(self, frame: Frame, sequence: int, stay: Stay, _: float) -> Waiting:
        """Return a frame with its rank."""
        # A heartbeat has the highest COB-ID of a device. Behind all segments of a block it would come too late for its
        # consumers, so everything is sent before a transfer.
        return Waiting(HIGHEST_IDENTIFIER + 1 if stay is Stay.TRANSFER else frame.cob_id, sequence, frame, stay)

    def load(self, now: float) -> object:
        """Load frames into the controller; here, everything that waits counts as loaded."""

    def urgent(self) -> Frame | None:
        """Return the next frame to send, None if there is none."""
        return self.waiting[0].frame if self.waiting else None

    def next(self, now: float) -> Frame | None:
        """Load frames, and return the next one to send, None if there is none.

        For a caller that plays the controller, as the sender of a live bus does.
        """
        if self.waiting:
            self.load(now)
        return self.urgent()

    def complete(self, frame: Frame) -> bool:
        """Note that a frame was sent (transmit-complete); return whether it was waiting."""
        return self._taken(self.waiting, frame)

    def _taken(self, place: list[Waiting], frame: Frame) -> bool:
        # Equal frames are in order, so the first one was sent first.
        for number, each in enumerate(place):
            if each.frame == frame:
                del place[number]
                self._completed += 1
                return True
        return False

    def leave(self) -> None:
        """Note that the bus is lost: waiting and further frames are dropped unless they are LASTING.

        They are counted, not reported: `come_back` returns their number.
        """
        if self._away is None:
            self._away = self._dropped
        self._withdraw(lambda each: each.stay is not Stay.LASTING)

    def come_back(self) -> int:
        """Note that the bus works again; return how many frames were dropped meanwhile."""
        # One report for all, as a second without a bus at full load drops thousands.
        before, self._away = self._away, None
        return 0 if before is None else self._dropped - before

    def withdraw(self, cob_id: int) -> None:
        """Drop the waiting frames with a COB-ID, as nobody needs them any more."""
        if self.waiting:
            self._withdraw(lambda each: each.frame.cob_id == cob_id)

    def _withdraw(self, over: Callable[[Waiting], bool]) -> None:
        before = len(self.waiting)
        self.waiting = [each for each in self.waiting if not over(each)]
        self._dropped += before - len(self.waiting)

    def holds(self, frame: Frame) -> bool:
        """Return whether an equal frame is waiting."""
        return any(each.frame == frame for each in self.waiting)

    @property
    def next_expiry(self) -> float:
        """Time in s at which the first waiting frame expires; infinite if none ever will."""
        return inf

    def statistics(self) -> TransmitStatistics:
        """Return the counts so far."""
        return TransmitStatistics(self._submitted, self._completed, self._dropped, len(self.waiting))


# Listeners; a registration has a function for the COB-IDs, which a master may change


class ListenerKind(IntEnum):
    """Kinds of listeners in the order in which they are called; the first two get frames, the others messages.

    Nodes come first, as other nodes wait for their answers.
    """

    NODE = 0
    FRAME_FUNCTION = 1
    QUEUE = 2
    FUNCTION = 3


Deliver: TypeAlias = Callable[[Any, float], object]
"""Takes a frame or message and its timestamp; it neither raises nor waits."""


class Registration(NamedTuple):
    """A listener, its kind, a function for its COB-IDs, and the function that delivers to it."""

    listener: FunctionListener[Any] | MessageQueue[Any]
    kind: ListenerKind
    cob_ids: Callable[[], Iterable[int]]
    deliver: Deliver


class Delivery(NamedTuple):
    """How the frames of one COB-ID are delivered: as frames, and as the messages that they `decode` to."""

    frames: tuple[Deliver, ...]
    messages: tuple[Deliver, ...]
    decode: Callable[[Data], Any] | None


def deliveries_to(registrations: Iterable[Registration], protocol: Protocol) -> dict[int, Delivery]:
    """Return the deliveries by the current COB-IDs of the listeners, by kind, then in order of registration."""
    heard: dict[int, list[Registration]] = {}
    # The sort is stable, so registrations of one kind keep their order.
    for each in sorted(registrations, key=lambda each: each.kind):
        # A set, so that a node whose EDS uses a COB-ID twice gets each frame once.
        for cob_id in set(each.cob_ids()):
            heard.setdefault(cob_id, []).append(each)
    deliveries = {}
    for cob_id, those in heard.items():
        frames = tuple(each.deliver for each in those if each.kind < ListenerKind.QUEUE)
        messages = tuple(each.deliver for each in those if each.kind >= ListenerKind.QUEUE)
        deliveries[cob_id] = Delivery(frames, messages, protocol.binding_of(cob_id).decode if messages else None)
    return deliveries


class Statistics(NamedTuple):
    """Counts so far: listeners, refused frames, frames without a listener, and frames sent."""

    listeners: tuple[ListenerStatistics, ...]
    refused: int
    unheard: int
    transmit: TransmitStatistics


ALL_MESSAGES = "all messages"
"""Message name of a listener to all messages."""


class Controller:
    """The listeners of one bus, their receive filters, and the `queue` of frames to send.

    Calls longer than `slow_after` s by `clock` are reported. Reports go to `report`; without it, they are logged as
    warnings, and the latest ones are kept in `reports`. If `report` raises, such as for a closed pipe, it is not called
    again: its exception is `report_failure`, and reports are kept. One thread receives; the bus's owner sends.

    `call_function` decides where functions run: in place, in the order of their registration, until a `Live` gives them
    a thread of their own. `rerouted` is called at the start, and on the receiving thread when the receive filters have
    changed.
    """

    def __init__(
        self,
        protocol: Protocol,
        *,
        slow_after: float = SLOW_AFTER,
        report: Reporter | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.reports: deque[Report] = deque(maxlen=REPORTS_KEPT)
        self.report_failure: Exception | None = None
        self.queue = TransmitQueue()
        self.call_function: CallFunction = FunctionListener.call
        self.rerouted: Callable[[], object] = lambda: None
        self.clock = clock
        self._report = report
        self._protocol = protocol
        self._slow_after = slow_after
        self._registrations: list[Registration] = []
        self._routes: dict[int, Delivery] = {}
        self._started = False
        self._refused = self._unheard = 0

    def report(self, report: Report) -> None:
        """Pass on a report, from any thread; never raises."""
        if self._report is None or self.report_failure is not None:
            CONTROLLER_LOG.warning("%s", report)
            self.reports.append(report)
            return
        try:
            self._report(report)
        # The receiving thread must not raise, and a reporter that has failed is not called again.
        except Exception as error:
            self.report_failure = error
            self.reports.append(report)

    # Registration; raises ListenerError after the start

    def add_queue(
        self, message_type: type[MessageT] | None, maxsize: int = 0, name: str | None = None
    ) -> MessageQueue[MessageT]:
        """Return a queue that gets every message of a type, or all messages (None); see MessageQueue.

        Args:
            message_type: the message's class; None: all messages
            maxsize: maximum number of unread messages; the oldest make room. 0: no limit
            name: name of the queue in reports

        Raises:
            UnknownName: no message has this type
        """
        message = self._name(message_type)
        queue = MessageQueue[MessageT](name or f"queue of {message}", maxsize, self.report)
        self._register(Registration(queue, ListenerKind.QUEUE, self._cob_ids(message), queue.put))
        return queue

    def add_function(
        self, message_type: type[MessageT] | None, function: Function[MessageT], name: str | None = None
    ) -> None:
        """Register a function that is called with the messages of a type, or all messages (None), and their timestamps.

        Functions are called one after the other; for one message, in the order of their registration.

        Args:
            message_type: the message's class; None: all messages
            function: called with the message and the time in s at which it was received
            name: name of the function in reports; default: its own

        Raises:
            ListenerError: the function cannot be called with two arguments
            UnknownName: no message has this type
        """
        self._add_function(ListenerKind.FUNCTION, self._cob_ids(self._name(message_type)), function, name)

    def add_frames(
        self, cob_ids: Callable[[], Iterable[int]], function: Function[Frame], name: str | None = None
    ) -> None:
        """Register a function that is called with frames and their timestamps, including frames that are too short.

        Args:
            cob_ids: returns the identifiers; called at the start, and whenever the protocol has changed
            function: called with the frame and the time in s at which it was received
            name: name of the function in reports; default: its own
        """
        self._add_function(ListenerKind.FRAME_FUNCTION, cob_ids, function, name)

    def add_node(
        self, cob_ids: Callable[[], Iterable[int]], receive: Function[Frame], name: str
    ) -> FunctionListener[Frame]:
        """Register a CANopen node, which gets its frames always on the receiving thread; return its listener.

        Otherwise as `add_frames`.
        """
        return self._add_function(ListenerKind.NODE, cob_ids, receive, name)

    def _add_function(
        self, kind: ListenerKind, cob_ids: Callable[[], Iterable[int]], function: Function[Any], name: str | None
    ) -> FunctionListener[Any]:
        name = name or getattr(function, "__qualname__", None) or repr(function)
        try:
            signature(function).bind(None, 0.0)
        except TypeError as error:
            raise ListenerError(f"{name}: {error}; it is called with what has come, and its timestamp") from None
        except ValueError:  # a function of C, which does not say what it takes
            pass
        listener = FunctionListener(name, function, self.report, self.clock, self._slow_after)

        def deliver(message: Any, timestamp: float) -> None:
            # looked up at each call, as a Live replaces it after the registration
            self.call_function(listener, message, timestamp)

        in_place = kind is ListenerKind.NODE
        self._register(Registration(listener, kind, cob_ids, listener.call if in_place else deliver))
        return listener

    def _register(self, registration: Registration) -> None:
        if self._started:
            # The bus's thread reads the routes without a lock, so they must not change.
            name = registration.listener.name
            raise ListenerError(f"{name}: the controller has started; listeners are registered before")
        self._registrations.append(registration)

    def _name(self, message_type: type[Any] | None) -> str:
        """Return the name of a message, or of all messages for None; raises UnknownName."""
        return ALL_MESSAGES if message_type is None else self._protocol.name(message_type)

    def _cob_ids(self, name: str) -> Callable[[], Iterable[int]]:
        """Return a function for the current COB-IDs of a message.

        It is found by name, as a changed protocol may have a new type. There may be none for a while, as a master may
        make a PDO not valid.
        """
        return lambda: [each.cob_id for each in self._protocol.bindings if name in (ALL_MESSAGES, each.name)]

    def start(self) -> list[CanFilter]:
        """End the registration and return the receive filters for python-can's `set_filters`.

        They accept only the COB-IDs of listeners; without listeners the list is empty, which means "everything" to
        python-can. Raises StateError when called again.
        """
        if self._started:
            raise StateError("the controller has started already")
        self._started = True
        return self.reroute(self._protocol)

    def reroute(self, protocol: Protocol) -> list[CanFilter]:
        """Switch to a changed protocol, and return the receive filters as `start` does.

        Called on the receiving thread when a master has changed a node's PDOs, SDO or heartbeat COB-IDs.
        """
        self._protocol = protocol
        # Replaced by one assignment, as the receiving thread reads it without a lock.
        self._routes = deliveries_to(self._registrations, protocol)
        self.rerouted()
        return self.filters()

    def filters(self) -> list[CanFilter]:
        """Return the current receive filters, as new objects."""
        # the mask compares all 11 bits
        return [
            {"can_id": cob_id, "can_mask": HIGHEST_IDENTIFIER, "extended": False} for cob_id in sorted(self._routes)
        ]

    def hears(self, cob_id: int) -> bool:
        """Return whether the receive filters accept frames with this COB-ID."""
        return cob_id in self._routes

    # Receiving

    def receive(self, frame: Frame, timestamp: float) -> None:
        """Deliver a frame, received at `timestamp` in s, to its listeners."""
        self.receive_data(*frame, timestamp)

    def receive_data(self, cob_id: int, data: Data, timestamp: float) -> None:
        """Receive a frame whose data is a driver's buffer, which may change after this returns."""
        try:
            to_frames, to_messages, decode = self._routes[cob_id]
        # Cheaper than testing first, as drivers with receive filters pass few other frames.
        except KeyError:
            self._unheard += 1
            return
        if to_frames:
            # Copied only for listeners to frames; a message has its values from the driver's buffer.
            frame = Frame(cob_id, bytes(data))
            for deliver in to_frames:
                deliver(frame, timestamp)
        if decode is None:
            return
        try:
            message = decode(data)
        # Refused as a whole; the 2014 robot read the rest of a short frame from left-over bytes.
        except FrameLengthError as error:
            self._refused += 1
            self.report(Report(Event.FRAME_REFUSED, f"0x{error.cob_id:03X}", str(error), timestamp))
            return
        for deliver in to_messages:
            deliver(message, timestamp)

    def acts_always(self, cob_id: int) -> bool:
        """Return whether a COB-ID belongs to a message that must be acted on however late it comes: a stop."""
        # After the process was suspended, an old goto must not be carried out, but a stop must.
        return any(each.always and each.cob_id == cob_id for each in self._protocol.bindings)

    # Sending

    def send(self, message: Message, now: float) -> None:
        """Encode a message and put it into the queue, without waiting. Raises FieldError."""
        frame = self._protocol.encode(message)
        # A stop never expires.
        stop = self._protocol.binding(type(message)).always
        self.queue.submit(frame, now, Stay.LASTING if stop else Stay.SHORT)

    # Counts

    def statistics(self) -> Statistics:
        """Return the counts so far."""
        listeners = tuple(each.listener.statistics() for each in self._registrations)
        return Statistics(listeners, self._refused, self._unheard, self.queue.statistics())
