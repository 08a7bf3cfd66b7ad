"""The gatekeeper: every received frame to its listeners, every message to be sent to the mailboxes.

Rule of this file: listeners are registered first, then `start` turns them into one table by COB-ID, and from there
on nothing but that table is looked at. What comes from the wire never raises here: it is counted and reported.

A frame's delivery is an iterator of calls yet to be made. If a listener does not return, another thread takes the
iterator over and goes on behind that listener; the thread that was stuck finds its call's baton gone.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from eurobot_od.errors import ListenerError, RemoteError, StateError
from eurobot_od.frame import Frame
from eurobot_od.gatekeeper.listeners import Aside, Baton, FunctionListener, in_place
from eurobot_od.gatekeeper.mailboxes import MAILBOX_WAIT, MAILBOXES, Mailboxes, TransmitStatistics
from eurobot_od.gatekeeper.queues import ListenerStatistics, MessageQueue, Received
from eurobot_od.gatekeeper.reports import Event, Report, Reporter
from eurobot_od.messages import Message, MessageT
from eurobot_od.protocol import Protocol

if TYPE_CHECKING:
    from can.typechecking import CanFilter

SLOW_AFTER = 0.010
"""Seconds after which a call counts as slow: at 500 kbit/s the bus brings some forty frames meanwhile."""

REPORTS_KEPT = 1000
"""Reports kept when nobody takes them."""

EXACT = 0x7FF
"""Filter mask: all 11 bits of an identifier count."""


class Route(NamedTuple):
    """Who hears one COB-ID: queues, functions, and those functions that take frames which cannot be decoded too.

    `decode` is None where nobody wants the message.
    """

    decode: Callable[[int, bytes], Message] | None = None
    queues: tuple[MessageQueue[Any], ...] = ()
    functions: tuple[FunctionListener[Any], ...] = ()
    nodes: tuple[FunctionListener[Any], ...] = ()

    def joined(self, other: Route) -> Route:
        """Return a route to the listeners of both, these first."""
        lists = (mine + theirs for mine, theirs in zip(self[1:], other[1:]))
        return Route(self.decode or other.decode, *lists)


class Registration(NamedTuple):
    """A listener before the start: where to ask then for its COB-IDs, and the way to it."""

    cob_ids: Callable[[], Iterable[int]]
    route: Route


class Running(NamedTuple):
    """The call under way: the `listener` with its `name`, `since` when by the gatekeeper's clock, and how to go on."""

    listener: FunctionListener[Any]
    since: float
    received: Received[Any]
    baton: Baton

    @property
    def name(self) -> str:
        return self.listener.name


class Statistics(NamedTuple):
    """Counts so far: each listener's, frames refused, frames that nobody listens to, and the transmit side's."""

    listeners: tuple[ListenerStatistics, ...]
    refused: int
    unheard: int
    transmit: TransmitStatistics


class Gatekeeper:
    """Listeners and mailboxes of one bus.

    `table_size` is the number of listeners that may be registered (0: any number; 20 in the 2014 robot), `slow_after`
    the seconds by `clock` after which a function listener is set aside for `aside` to run. Without a `report`
    function the reports are collected in `reports`.
    One thread receives, except for `take_over`; sending is for whoever owns the bus.
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
        aside: Aside = in_place,
    ) -> None:
        self.reports: deque[Report] = deque(maxlen=REPORTS_KEPT)
        self._report = report or self.reports.append
        self.mailboxes = Mailboxes(self._report, mailboxes, mailbox_wait)
        self._protocol, self._table_size, self._slow_after = protocol, table_size, slow_after
        self._clock, self._aside = clock, aside
        self._registrations: list[Registration] = []
        self._routes: dict[int, Route] = {}
        self._started = False
        self._refused = self._unheard = 0
        self._running: Running | None = None

    # Registration

    def add_queue(
        self, message_type: type[MessageT], maxsize: int = 0, name: str | None = None
    ) -> MessageQueue[MessageT]:
        """Return a queue that gets every message of a type; see MessageQueue.

        Raises ListenerError after the start and when the table is full, UnknownName for a type the protocol lacks.
        """
        name = name or f"queue of {self._protocol.name(message_type)}"
        queue: MessageQueue[MessageT] = MessageQueue(name, maxsize, self._report)
        self._register(name, self._only(message_type), Route(self._protocol.decode, queues=(queue,)))
        return queue

    def add_function(
        self, message_type: type[MessageT], function: Callable[[Received[MessageT]], object], name: str | None = None
    ) -> None:
        """Have a function called with every message of a type; its name is that of the function, unless given.

        Raises ListenerError after the start and when the table is full, UnknownName for a type the protocol lacks.
        """
        listener = FunctionListener(name or _name_of(function), function, self._report, self._aside)
        self._register(listener.name, self._only(message_type), Route(self._protocol.decode, functions=(listener,)))

    def add_frames(
        self,
        cob_ids: Callable[[], Iterable[int]],
        function: Callable[[Frame, float], object],
        name: str | None = None,
    ) -> None:
        """Have a function called with every frame of the COB-IDs and its timestamp, as a whole CANopen node wants it.

        `cob_ids` is asked at the start. Frames come before typed messages, and also when they are too short to be
        decoded. Raises ListenerError after the start and when the table is full.
        """

        def unpacked(received: Received[Frame]) -> None:
            function(received.frame, received.timestamp)

        listener = FunctionListener(name or _name_of(function), unpacked, self._report, self._aside)
        self._register(listener.name, cob_ids, Route(functions=(listener,), nodes=(listener,)))

    def _only(self, message_type: type[Message]) -> Callable[[], Iterable[int]]:
        cob_id = self._protocol.cob_id(message_type)
        return lambda: (cob_id,)

    def _register(self, name: str, cob_ids: Callable[[], Iterable[int]], route: Route) -> None:
        if self._started:
            raise ListenerError(f"{name}: the gatekeeper has started; register listeners before")
        if 0 < self._table_size <= len(self._registrations):
            raise ListenerError(f"{name}: the listener table is full; its size is {self._table_size}")
        self._registrations.append(Registration(cob_ids, route))

    def start(self) -> list[CanFilter]:
        """Close the registration and return the receive filters, for python-can's `set_filters`.

        The filters are computed and handed out once and no list of registrations is kept (document section 6, first
        improvement). Raises StateError when called again.
        """
        if self._started:
            raise StateError("the gatekeeper has started already")
        self._started = True
        for cob_ids, route in self._registrations:
            for cob_id in set(cob_ids()):
                self._routes[cob_id] = self._routes.get(cob_id, Route()).joined(route)
        self._registrations.clear()
        return [{"can_id": cob_id, "can_mask": EXACT, "extended": False} for cob_id in sorted(self._routes)]

    # Receiving

    def receive(self, frame: Frame, timestamp: float) -> bool:
        """Deliver a frame to its listeners; `timestamp` in seconds.

        Returns False if another thread has taken over meanwhile: the caller's reading ends there.
        """
        cob_id, data = frame
        route = self._routes.get(cob_id)
        if route is None:
            self._unheard += 1
            return True
        decode, queues, functions, nodes = route
        try:
            message = decode(cob_id, data) if decode else None
        except RemoteError as error:
            self._refuse(frame, error, timestamp)
            return self._deliver(iter(nodes), Received(None, cob_id, timestamp, frame))
        received = tuple.__new__(Received, (message, cob_id, timestamp, frame))
        for queue in queues:
            queue.put(received)
        return self._deliver(iter(functions), received)

    def _refuse(self, frame: Frame, error: RemoteError, timestamp: float) -> None:
        self._refused += 1
        self._report(Report(Event.FRAME_REFUSED, f"0x{frame.cob_id:03X}", str(error), timestamp))

    def _deliver(self, listeners: Iterator[FunctionListener[Any]], received: Received[Any]) -> bool:
        clock = self._clock
        for listener in listeners:
            baton = [listeners]
            started = clock()
            self._running = listener, started, received, baton
            listener.deliver(received)
            try:
                baton.pop()
            except IndexError:
                listener.work()
                return False
            taken = clock() - started
            if taken > self._slow_after:
                listener.was_slow(taken, received.timestamp)
        return True

    # A listener that does not return

    def running(self) -> Running | None:
        """Return the function listener that is being called, None between calls; for a watchdog on any thread."""
        running = self._running
        return running if running is not None and running.baton else None

    def take_over(self, stuck: Running) -> bool:
        """Go on in this thread behind a call that does not return, with the frame's other listeners.

        True if this thread is the one that receives from now on; False if the call has returned after all. The
        thread in the stuck call gets False from `receive` when it comes back.
        """
        return stuck.listener.leave(stuck.baton, stuck.received.timestamp) and self._deliver(stuck.calls)

    # Sending

    def send(self, message: Message, now: float) -> None:
        """Encode a message and leave it to the mailboxes; never waits. Raises FieldError for values out of range."""
        self.send_frame(self._protocol.encode(message), now)

    def send_frame(self, frame: Frame, now: float) -> None:
        """Leave a frame to the mailboxes; never waits."""
        self.mailboxes.submit(frame, now)

    # Counts

    def statistics(self) -> Statistics:
        """Return the counts so far; listeners appear from the start on."""
        heard = (listener for route in self._routes.values() for group in route for listener in group)
        listeners = tuple(listener.statistics() for listener in dict.fromkeys(heard))
        return Statistics(listeners, self._refused, self._unheard, self.mailboxes.statistics())


def _name_of(function: Callable[..., object]) -> str:
    return getattr(function, "__qualname__", None) or repr(function)
