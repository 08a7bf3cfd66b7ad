"""The CAN controller of a node: which frames it lets in, which frame leaves next, and who is told what goes wrong.

The controller of any device lets in what its listeners have asked for (receive filters), and has one queue of frames to
send, by priority and without a limit. A robot may give its nodes a controller with more rules.

Rule of this file: bus, threads and clock are the caller's; `bus/live` and `bus/simulated` bring the frames, the time
and the threads. Only a program that reads a `MessageQueue` may wait, for as long as it says. Nothing that comes from
the wire, and nothing that a listener does, raises out of `receive`: it is counted and reported.
"""

from __future__ import annotations

import time
from bisect import insort
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import Enum, IntEnum, auto
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
    """What happened."""

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
    """One event: the `name` of a listener, message, identifier or bus, what happened to it, and when in seconds.

    `timestamp` is that of the frame concerned; `error` is the exception, for a caller that wants its traceback. `str()`
    is one line for a person.
    """

    event: Event
    name: str
    text: str
    timestamp: float
    error: BaseException | None = None

    def __str__(self) -> str:
        return one_line(f"{self.event.value}: {self.name}: {' '.join(self.text.split())}")


Reporter: TypeAlias = Callable[[Report], object]
"""Takes a report, on the thread where it happened; it must neither raise nor wait."""

REPORTS_KEPT = 1000
"""Most reports that are kept while nobody takes them."""


def has_doubled(count: int) -> bool:
    """Return whether the count of a lasting condition has to be reported: at 1, 2, 4, 8, ..."""
    # A power of two has one bit set: a million losses make twenty reports.
    return count.bit_count() == 1


# Listeners

T = TypeVar("T")

Function: TypeAlias = Callable[[T, float], object]
"""Gets what it listens to, and the time of that in the bus's seconds."""

SLOW_AFTER = 0.010
"""Time after which a call counts as slow, in s; in that time, 500 kbit/s bring about forty full frames."""


class ListenerStatistics(NamedTuple):
    """A listener's counts: messages delivered and lost, calls that failed, and calls that held up the others."""

    name: str
    delivered: int
    lost: int
    failed: int = 0
    slow: int = 0


class FunctionListener(Generic[T]):
    """A function with its name and counts; a call that takes longer than `slow_after` seconds is reported."""

    def __init__(
        self, name: str, function: Function[T], report: Reporter, clock: Callable[[], float], slow_after: float
    ) -> None:
        self.name = name
        self.delivered = self.lost = self.failed = self.slow = 0
        self._function, self._report, self._clock, self._slow_after = function, report, clock, slow_after

    def call(self, message: T, timestamp: float) -> None:
        """Call the function; an exception of its own ends here."""
        # Not the message's timestamp: that is when the frame came, and it may have waited.
        begin = self._clock()
        try:
            self._function(message, timestamp)
        except (Exception, SystemExit) as error:  # whatever it is, the other listeners get their message
            self.has_failed(error, timestamp)
        self.delivered += 1
        seconds = self._clock() - begin
        if seconds > self._slow_after:
            self.slow += 1
            if has_doubled(self.slow):
                text = f"held up the others for {seconds * 1000:.1f} ms, {amount(self.slow, 'time')} so far"
                self._report(Report(Event.LISTENER_SLOW, self.name, text, timestamp))

    def has_failed(self, error: BaseException, timestamp: float) -> None:
        """Note that a call raised an exception."""
        self.failed += 1
        text = described(error)
        self._report(Report(Event.LISTENER_FAILED, self.name, text, timestamp, error))

    def has_lost(self, timestamp: float) -> None:
        """Note that a message was dropped before the function could be called with it."""
        self.lost += 1
        if has_doubled(self.lost):
            text = f"too many calls wait, {amount(self.lost, 'message')} lost so far; the newest are kept"
            self._report(Report(Event.QUEUE_OVERFLOW, self.name, text, timestamp))

    def statistics(self) -> ListenerStatistics:
        """Return the counts so far."""
        return ListenerStatistics(self.name, self.delivered, self.lost, self.failed, self.slow)


class Received(NamedTuple, Generic[T]):
    """A message in a queue, with its time in the bus's seconds."""

    message: T
    timestamp: float


class MessageQueue(Generic[T]):
    """A FIFO of received messages, at most `maxsize` (0: any number). One thread puts, any number may get.

    When the queue is full, the oldest message makes room: the newest position or goto is the one that counts.
    """

    def __init__(self, name: str, maxsize: int, report: Reporter) -> None:
        self.name, self.maxsize = name, maxsize
        self.delivered = self.lost = 0
        self._report = report
        # Its `put` never waits, and may be interrupted by another one: a program must never hold up the bus's thread.
        self._items: SimpleQueue[tuple[T, float]] = SimpleQueue()

    def __len__(self) -> int:
        return self._items.qsize()

    def put(self, message: T, timestamp: float) -> None:
        """Append a message, without waiting."""
        # Full, unless a reader has made room meanwhile.
        if 0 < self.maxsize <= self._items.qsize() and self.get_nowait() is not None:
            self.lost += 1
            if has_doubled(self.lost):
                text = f"full with {self.maxsize} messages, {self.lost} lost so far; the newest are kept"
                self._report(Report(Event.QUEUE_OVERFLOW, self.name, text, timestamp))
        self._items.put((message, timestamp))  # the reading program makes a Received of it, not the bus's thread
        self.delivered += 1

    def get(self, timeout: float | None = None) -> Received[T] | None:
        """Take the oldest message, waiting up to `timeout` seconds (None: for ever); None if none came."""
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
"""Has a function called with what it listens to and the timestamp, now or later."""


# What is to be sent


class Stay(Enum):
    """How long a frame waits to be sent."""

    SHORT = auto()
    """As long as the controller lets any frame wait."""
    PERIODIC = auto()
    """Until the next frame of its identifier takes its place: a heartbeat, of which only the newest counts."""
    TRANSFER = auto()
    """As long as it takes: part of an SDO transfer, which would fail without it. It lets a heartbeat go first."""
    LASTING = auto()
    """As long as it takes, even while the bus is away: a stop."""


class Waiting(NamedTuple):
    """A frame on its way; tuples compare from the left, so they sort in the order in which they leave.

    `sequence` counts the submitted frames: it keeps equal ranks in order, and comparisons never go beyond it.
    """

    rank: int
    sequence: int
    frame: Frame
    stay: Stay
    deadline: float = inf


class TransmitStatistics(NamedTuple):
    """Numbers of frames: submitted = completed + dropped + waiting + loaded.

    A periodic frame counts as dropped if the next one has come before it could leave.
    """

    submitted: int
    completed: int
    dropped: int
    waiting: int
    loaded: int = 0


class TransmitQueue:
    """The frames to send, the most urgent first, in any number: `waiting` has them in their order.

    A frame on the wire waits until it is complete. One that is withdrawn meanwhile, such as an outdated heartbeat,
    leaves all the same, and counts as dropped.
    """

    def __init__(self) -> None:
        self.waiting: list[Waiting] = []
        self._submitted = self._completed = self._dropped = 0
        self._away: int | None = None
        """How many frames had been dropped when the bus was lost; None while the bus is there."""

    def submit(self, frame: Frame, now: float, stay: Stay = Stay.SHORT) -> None:
        """Put a frame in its place among those that wait; a frame that does not outlast a lost bus is dropped then."""
        sequence = self._submitted
        self._submitted += 1
        if self._away is not None and stay is not Stay.LASTING:
            self._dropped += 1
            return
        if stay is Stay.PERIODIC:
            # A waiting heartbeat is outdated once the next one comes.
            self._withdraw(lambda each: each.stay is Stay.PERIODIC and each.frame.cob_id == frame.cob_id)
        insort(self.waiting, self._placed(frame, sequence, stay, now))

    def _placed(self, frame: Frame, sequence: int, stay: Stay, _: float) -> Waiting:
        """Return a frame with its place in the order, when it is submitted."""
        # A heartbeat has the highest identifier that a device sends. Behind one segment of a block after the other its
        # consumers would take the device for dead, so a transfer lets everything else go first.
        return Waiting(HIGHEST_IDENTIFIER + 1 if stay is Stay.TRANSFER else frame.cob_id, sequence, frame, stay)

    def load(self, now: float) -> object:
        """Give the controller what it may send: here everything that waits."""

    def urgent(self) -> Frame | None:
        """Return the frame that the controller sends first, None without any."""
        return self.waiting[0].frame if self.waiting else None

    def next(self, now: float) -> Frame | None:
        """Load frames, and return the one to send first, None without any.

        For a caller that plays the controller, as the sender of a live bus does.
        """
        if self.waiting:
            self.load(now)
        return self.urgent()

    def complete(self, frame: Frame) -> bool:
        """Note that a frame was sent (transmit-complete); False if it does not wait any more."""
        return self._taken(self.waiting, frame)

    def _taken(self, place: list[Waiting], frame: Frame) -> bool:
        # The first of equal frames: they are kept in order, so it is the one that left first.
        for number, each in enumerate(place):
            if each.frame == frame:
                del place[number]
                self._completed += 1
                return True
        return False

    def leave(self) -> None:
        """Note that the bus is away: what waits, or is submitted from now on, is dropped unless it is LASTING.

        It is counted and not reported: `come_back` returns the number.
        """
        if self._away is None:
            self._away = self._dropped
        self._withdraw(lambda each: each.stay is not Stay.LASTING)

    def come_back(self) -> int:
        """Note that the bus is back; return how many frames were dropped meanwhile."""
        # They make one report, not one each: a second without a bus at full load would make thousands.
        before, self._away = self._away, None
        return 0 if before is None else self._dropped - before

    def withdraw(self, cob_id: int) -> None:
        """Drop the waiting frames of an identifier, as whatever they answer is over."""
        if self.waiting:
            self._withdraw(lambda each: each.frame.cob_id == cob_id)

    def _withdraw(self, over: Callable[[Waiting], bool]) -> None:
        before = len(self.waiting)
        self.waiting = [each for each in self.waiting if not over(each)]
        self._dropped += before - len(self.waiting)

    def holds(self, frame: Frame) -> bool:
        """Return whether an equal frame is still to be sent."""
        return any(each.frame == frame for each in self.waiting)

    @property
    def next_expiry(self) -> float:
        """Time in s when the first waiting frame will have waited too long; infinite if none ever will."""
        return inf

    def statistics(self) -> TransmitStatistics:
        """Return the counts so far."""
        return TransmitStatistics(self._submitted, self._completed, self._dropped, len(self.waiting))


# Who hears which COB-ID: a registration has a function for the identifiers, which a master may change


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


class Statistics(NamedTuple):
    """Counts so far: of each listener, refused frames, frames that nobody listens to, and the transmit side."""

    listeners: tuple[ListenerStatistics, ...]
    refused: int
    unheard: int
    transmit: TransmitStatistics


ALL_MESSAGES = "all messages"
"""The name of what a listener without a message type listens to."""


class Controller:
    """The listeners of one bus, their receive filters, and the `queue` of frames to send.

    A call that takes longer than `slow_after` seconds of `clock` is reported. Reports go to `report`; without it, the
    latest are kept in `reports`. A `report` that raises, as for a pipe that nobody reads any more, is not called again:
    its exception is the `report_failure`, and reports are kept from then on. One thread receives; the bus's owner
    sends.

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
        self._report, self._protocol, self._slow_after = report, protocol, slow_after
        self._registrations: list[Registration] = []
        self._routes: dict[int, Delivery] = {}
        self._started = False
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

    # Registration, before the start: raises ListenerError afterwards

    def add_queue(
        self, message_type: type[MessageT] | None, maxsize: int = 0, name: str | None = None
    ) -> MessageQueue[MessageT]:
        """Return a queue that gets every message of a type, or without a type (None) every message; see MessageQueue.

        Raises UnknownName for an unknown type.
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
        reports. Raises UnknownName for an unknown type.
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
        return self._add_function(ListenerKind.NODE, cob_ids, receive, name)

    def _add_function(
        self, kind: ListenerKind, cob_ids: Callable[[], Iterable[int]], function: Function[Any], name: str | None
    ) -> FunctionListener[Any]:
        name = name or getattr(function, "__qualname__", None) or repr(function)
        listener = FunctionListener(name, function, self.report, self.clock, self._slow_after)

        def deliver(message: Any, timestamp: float) -> None:
            # looked up at each call, as a Live replaces it after registration
            self.call_function(listener, message, timestamp)

        in_place = kind is ListenerKind.NODE
        self._register(Registration(listener, kind, cob_ids, listener.call if in_place else deliver))
        return listener

    def _register(self, registration: Registration) -> None:
        if self._started:
            # The bus's thread reads the routes without a lock, so the table is closed before it runs.
            name = registration.listener.name
            raise ListenerError(f"{name}: the controller has started; listeners are registered before")
        self._registrations.append(registration)

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
            raise StateError("the controller has started already")
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
        """Return the present receive filters, newly made: only the bus keeps them."""
        # the mask: all 11 bits of an identifier count
        return [
            {"can_id": cob_id, "can_mask": HIGHEST_IDENTIFIER, "extended": False} for cob_id in sorted(self._routes)
        ]

    def hears(self, cob_id: int) -> bool:
        """Return whether the receive filters let frames with this COB-ID through."""
        return cob_id in self._routes

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
        """Return whether a COB-ID is that of a message that acts whenever it comes: a stop."""
        # Asked for frames that waited while the process stood still: an old goto must not be carried out, a stop may.
        return any(each.always and each.cob_id == cob_id for each in self._protocol.bindings)

    # Sending

    def send(self, message: Message, now: float) -> None:
        """Encode a message and leave it to the queue, without waiting. Raises FieldError."""
        # A stop never expires.
        stop = self._protocol.binding(type(message)).always
        self.queue.submit(self._protocol.encode(message), now, Stay.LASTING if stop else Stay.SHORT)

    # Counts

    def statistics(self) -> Statistics:
        """Return the counts so far."""
        listeners = tuple(each.listener.statistics() for each in self._registrations)
        return Statistics(listeners, self._refused, self._unheard, self.queue.statistics())
