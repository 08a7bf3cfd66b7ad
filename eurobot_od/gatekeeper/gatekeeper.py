"""The gatekeeper: every received frame to its listeners, every message to be sent to the mailboxes.

Rule of this file: a frame is delivered at the cost of its own listeners, whoever else listens, and nothing that comes
from the wire raises: it is counted and reported.

Queues are served before functions, so that no function delays them. When a call of a function does not return, another
thread takes the rest of the listeners out of the call, and goes on with them; the thread in that call, once it is back,
finds them gone.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from eurobot_od.errors import RemoteError, UnknownName
from eurobot_od.frame import Frame
from eurobot_od.gatekeeper.listeners import REST, Aside, Call, FunctionListener, in_place
from eurobot_od.gatekeeper.mailboxes import MAILBOX_WAIT, MAILBOXES, Mailboxes, TransmitStatistics
from eurobot_od.gatekeeper.queues import ListenerStatistics, MessageQueue, Received
from eurobot_od.gatekeeper.reports import Event, Report, Reporter
from eurobot_od.gatekeeper.routes import Functions, ListenerTable, Registration, Route, routes_to
from eurobot_od.messages import Message, MessageT
from eurobot_od.protocol import Binding, Protocol

if TYPE_CHECKING:
    from can.typechecking import CanFilter

SLOW_AFTER = 0.010
"""Seconds after which a call counts as slow: meanwhile 500 kbit/s bring some forty full frames."""

REPORTS_KEPT = 1000
"""Reports kept when nobody takes them."""

EXACT = 0x7FF
"""Filter mask: all 11 bits of an identifier count."""


class Running(NamedTuple):
    """A call under way: its `listener`, `since` when by the gatekeeper's clock, and all `listeners` of what it got."""

    listener: FunctionListener[Any]
    since: float
    received: Received[Any]
    listeners: Functions
    call: Call

    @property
    def behind(self) -> Functions:
        """The listeners whose turn has not come."""
        return self.listeners[self.listeners.index(self.listener) + 1 :]

    @property
    def name(self) -> str:
        """The listener's name."""
        return self.listener.name


class Statistics(NamedTuple):
    """Counts so far: each listener's, frames refused, frames that nobody listens to, and the transmit side's."""

    listeners: tuple[ListenerStatistics, ...]
    refused: int
    unheard: int
    transmit: TransmitStatistics


class Gatekeeper:
    """Listeners and mailboxes of one bus.

    `table_size` is the number of listeners that may be registered (0: any number; 20 in the 2014 robot). A function
    that takes longer than `slow_after` seconds of `clock` is set aside: from then on `aside` has it called. Reports
    go to `report`, or without one to `reports`. One thread receives, but for `take_over`; whoever owns the bus sends.
    `generation` counts how often the receive filters have changed since the start.
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
        self._report = self.reports.append if report is None else report
        self.mailboxes = Mailboxes(self._report, mailboxes, mailbox_wait)
        self._protocol, self._aside, self.clock, self._slow_after = protocol, aside, clock, slow_after
        self._table = ListenerTable(table_size)
        self.generation = 0
        self._listeners: tuple[Registration, ...] = ()
        self._routes: dict[int, Route] = {}
        self._refused = self._unheard = 0
        self._call: Call = []

    # Registration, before the start: raises ListenerError afterwards, and when the table is full

    def add_queue(
        self, message_type: type[MessageT], maxsize: int = 0, name: str | None = None
    ) -> MessageQueue[MessageT]:
        """Return a queue that gets every message of a type, see MessageQueue; UnknownName if there is no such type."""
        queue = MessageQueue[MessageT](name or f"queue of {self._binding(message_type).name}", maxsize, self._report)
        self._add(queue.name, message_type, Route(queues=(queue,)))
        return queue

    def add_function(
        self, message_type: type[MessageT], function: Callable[[Received[MessageT]], object], name: str | None = None
    ) -> None:
        """Have a function called with every message of a type, under its own name unless another is given.

        Functions are called in the order of their registration. Raises UnknownName if there is no such type.
        """
        self._binding(message_type)
        listener = FunctionListener(name or _name_of(function), function, self._report, self._aside)
        self._add(listener.name, message_type, Route(functions=(listener,)))

    def _add(self, name: str, message_type: type[MessageT], route: Route) -> None:
        self._table.add(name, Registration(lambda: self._cob_ids(message_type), route, decoded=True))

    def _binding(self, message_type: type[MessageT]) -> Binding:
        return self._protocol.binding(cast("type[Message]", message_type))

    def _cob_ids(self, message_type: type[MessageT]) -> tuple[int, ...]:
        """Return a message's COB-ID as the protocol has it now, none if its PDO is not valid."""
        try:
            return (self._binding(message_type).cob_id,)
        except UnknownName:
            return ()

    def add_frames(
        self, cob_ids: Callable[[], Iterable[int]], function: Callable[[Frame, float], object], name: str | None = None
    ) -> None:
        """Have a function called with frames and their timestamps, as a CANopen node wants them; too short ones too.

        `cob_ids` is asked at the start. A node that is slow is reported, but stays with the thread that receives.
        """

        def unpacked(received: Received[None]) -> None:
            function(received.frame, received.timestamp)

        listener = FunctionListener(name or _name_of(function), unpacked, self._report, in_place)
        route = Route(functions=(listener,), nodes=(listener,))
        self._table.add(listener.name, Registration(cob_ids, route, decoded=False))

    def start(self) -> list[CanFilter]:
        """End the registration and return the receive filters for python-can's `set_filters`.

        They let through what is listened to and nothing else; without any listener the list is empty, which python-can
        takes for "everything". Raises StateError when called again.
        """
        self._listeners = self._table.close()
        return self.reroute(self._protocol)

    def reroute(self, protocol: Protocol) -> list[CanFilter]:
        """Take over a changed protocol, ask all listeners again, and return the receive filters as `start` does.

        For the thread that receives: a master has changed a node's PDOs, SDO or heartbeat identifiers.
        """
        self._protocol = protocol
        self._routes = routes_to(self._listeners, protocol)
        self.generation += 1
        return self.filters()

    def filters(self) -> list[CanFilter]:
        """Return the receive filters as of now, made anew: nothing but the bus keeps them (document section 6)."""
        return [{"can_id": cob_id, "can_mask": EXACT, "extended": False} for cob_id in sorted(self._routes)]

    # Receiving

    def receive(self, frame: Frame, timestamp: float) -> bool:
        """Deliver a frame, received at `timestamp` in seconds, to its listeners.

        False if another thread has taken over meanwhile; then this one has to stop receiving.
        """
        return self.receive_data(*frame, timestamp, self.clock())

    def receive_data(self, cob_id: int, data: bytes, timestamp: float, since: float) -> bool:
        """Do what `receive` does; `since` is the time by the gatekeeper's own `clock`."""
        route = self._routes.get(cob_id)
        if route is None:
            self._unheard += 1
            return True
        decode, queues, functions, nodes = route
        try:
            message = decode(data) if decode else None
        except RemoteError as error:
            self._refuse(cob_id, error, timestamp)
            functions, queues, message = nodes, (), None
        received: Received[Any] = tuple.__new__(Received, (message, cob_id, timestamp, data))
        for queue in queues:
            queue.put(received)
        return self._deliver(functions, received, since)

    def _refuse(self, cob_id: int, error: RemoteError, timestamp: float) -> None:
        self._refused += 1
        self._report(Report(Event.FRAME_REFUSED, f"0x{cob_id:03X}", str(error), timestamp))

    def _deliver(self, listeners: Functions, received: Received[Any], since: float) -> bool:
        clock = self.clock
        for listener in listeners:
            self._call = call = [listener, since, received, listeners]
            try:
                listener.deliver(received)
            except Exception as error:  # whatever it is, the other listeners get their message
                listener.has_failed(error, received.timestamp)
            listener.delivered += 1
            try:
                call.pop(REST)
            except IndexError:
                listener.come_back()
                return False
            now = clock()
            if now - since > self._slow_after:
                listener.was_slow(now - since, received.timestamp)
            since = now
        return True

    # A function that does not return

    def running(self) -> Running | None:
        """Return the call under way, None between calls; for a watchdog on another thread."""
        call = self._call
        entries = tuple(call)  # in one go: the call may end meanwhile
        return Running._make((*entries, call)) if len(entries) > REST else None

    def take_over(self, stuck: Running) -> bool:
        """Go on in this thread behind a call that does not return, with the other listeners of its frame.

        True if it is this thread that receives from now on, False if the call has returned after all. The thread in
        that call gets False from `receive` when it comes back, after it has caught up with that listener's messages.
        """
        left = stuck.listener.leave(stuck.call, stuck.received.timestamp)
        return left and self._deliver(stuck.behind, stuck.received, self.clock())

    # Sending

    def send(self, message: Message, now: float) -> None:
        """Encode a message and leave it to the mailboxes; never waits. Raises FieldError for values out of range."""
        self.send_frame(self._protocol.encode(message), now)

    def send_frame(self, frame: Frame, now: float, lasting: bool = False) -> None:
        """Leave a frame to the mailboxes; never waits. A `lasting` one is not dropped, see Mailboxes."""
        self.mailboxes.submit(frame, now, lasting)

    # Counts

    def statistics(self) -> Statistics:
        """Return the counts so far; listeners appear from the start on."""
        heard = (listener for route in self._routes.values() for listener in route.listeners)
        listeners = tuple(listener.statistics() for listener in dict.fromkeys(heard))
        return Statistics(listeners, self._refused, self._unheard, self.mailboxes.statistics())


def _name_of(function: Callable[..., object]) -> str:
    return getattr(function, "__qualname__", None) or repr(function)
