"""The gatekeeper: every received frame to its listeners, every message to be sent to the mailboxes.

Rule of this file: a frame is delivered at the cost of its own listeners, whoever else listens, and nothing that comes
from the wire raises: it is counted and reported.

Nodes are served first, then queues, then functions. When a call does not return, another thread takes the baton out of
it and goes on with the listeners behind; the thread in that call, once it is back, finds the baton gone.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from eurobot_od.errors import FrameLengthError, UnknownName
from eurobot_od.frame import Data, Frame
from eurobot_od.gatekeeper.baton import Baton, Call
from eurobot_od.gatekeeper.listeners import Aside, Function, FunctionListener, QueueListener, in_place
from eurobot_od.gatekeeper.mailboxes import MAILBOX_WAIT, MAILBOXES, Mailboxes, TransmitStatistics
from eurobot_od.gatekeeper.queues import ListenerStatistics, MessageQueue
from eurobot_od.gatekeeper.reports import Event, Report, Reporter
from eurobot_od.gatekeeper.routes import Kind, Listener, ListenerTable, Registration, Route, routes_to
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.message import Message, MessageT
from eurobot_od.pdo.protocol import Protocol

if TYPE_CHECKING:
    from can.typechecking import CanFilter

SLOW_AFTER = 0.010
"""Seconds after which a call counts as slow: meanwhile 500 kbit/s bring some forty full frames."""

REPORTS_KEPT = 1000
"""Reports kept when nobody takes them."""

EXACT = 0x7FF
"""Filter mask: all 11 bits of an identifier count."""

IDENTIFIERS = EXACT + 1
"""Number of COB-IDs that there are: a list with a place for each is read sooner than a dictionary."""


class Running(NamedTuple):
    """A call under way: of which `listener`, `since` when by the gatekeeper's clock, and all that it takes to go on."""

    listener: Listener
    since: float
    message: Any
    timestamp: float
    cob_id: int
    data: Data
    rest: Route
    call: Call
    baton: Baton

    @property
    def behind(self) -> Route:
        """The listeners whose turn has not come."""
        return self.rest[[listener for _, listener in self.rest].index(self.listener) + 1 :]

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
    `rerouted` is called when the receive filters have changed, in the thread that receives; at the start, too.
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
        self.rerouted: Callable[[], object] = lambda: None
        self._listeners: tuple[Registration, ...] = ()
        self._routes: list[Route] = [()] * IDENTIFIERS
        self._refused = self._unheard = 0
        self._baton = Baton()

    # Registration, before the start: raises ListenerError afterwards, and when the table is full

    def add_queue(
        self, message_type: type[MessageT], maxsize: int = 0, name: str | None = None
    ) -> MessageQueue[MessageT]:
        """Return a queue that gets every message of a type, see MessageQueue; UnknownName if there is no such type."""
        queue = MessageQueue[MessageT](name or f"queue of {self._binding(message_type).name}", maxsize, self._report)
        self._add(message_type, Kind.QUEUE, QueueListener(queue, self._report))
        return queue

    def add_function(self, message_type: type[MessageT], function: Function[MessageT], name: str | None = None) -> None:
        """Have a function called with every message of a type and its timestamp; `name` is for reports.

        Functions are called in the order of their registration. Raises UnknownName if there is no such type.
        """
        self._binding(message_type)
        listener = FunctionListener(name or _name_of(function), function, self._report, self._aside)
        self._add(message_type, Kind.FUNCTION, listener)

    def _add(self, message_type: type[MessageT], kind: Kind, listener: Listener) -> None:
        self._table.add(Registration(lambda: self._cob_ids(message_type), kind, listener))

    def _binding(self, message_type: type[MessageT]) -> Binding:
        return self._protocol.binding(cast("type[Message]", message_type))

    def _cob_ids(self, message_type: type[MessageT]) -> tuple[int, ...]:
        """Return a message's COB-ID as the protocol has it now, none if its PDO is not valid."""
        try:
            return (self._binding(message_type).cob_id,)
        except UnknownName:
            return ()

    def add_frames(
        self, cob_ids: Callable[[], Iterable[int]], function: Function[Frame], name: str | None = None
    ) -> None:
        """Have a function called with frames and their timestamps, as a CANopen node wants them; too short ones too.

        `cob_ids` is asked at the start. A node that is slow is reported, but stays with the thread that receives.
        """

        listener = FunctionListener(name or _name_of(function), function, self._report, in_place)
        self._table.add(Registration(cob_ids, Kind.NODE, listener))

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
        routes = routes_to(self._listeners, protocol)
        self._routes = [routes.get(cob_id, ()) for cob_id in range(IDENTIFIERS)]
        self.rerouted()
        return self.filters()

    def filters(self) -> list[CanFilter]:
        """Return the receive filters as of now, made anew: nothing but the bus keeps them (document section 6)."""
        heard = (cob_id for cob_id, route in enumerate(self._routes) if route)
        return [{"can_id": cob_id, "can_mask": EXACT, "extended": False} for cob_id in heard]

    # Receiving

    def receive(self, frame: Frame, timestamp: float) -> bool:
        """Deliver a frame, received at `timestamp` in seconds, to its listeners.

        False if another thread has taken over meanwhile; then this one has to stop receiving.
        """
        return self.receive_data(*frame, timestamp, self.clock())

    def receive_data(
        self,
        cob_id: int,
        data: Data,
        timestamp: float,
        since: float | None = None,
        rest: Route | None = None,
        message: Any = None,
    ) -> bool:
        """Do what `receive` does; `since` is the time by the gatekeeper's own `clock`, the timestamp if that is its.

        Given the `rest` of a route, go on there; `message` is what the listener before got.
        """
        # in one piece on purpose: every frame comes through here, and each call would be 2 % of its way
        if since is None:
            since = timestamp
        if rest is None:
            try:
                rest = self._routes[cob_id]
            except IndexError:  # a sender in this process that does not check its identifiers
                rest = ()
            if not rest:
                self._unheard += 1
        baton, clock = self._baton, self.clock
        for make, listener in rest:
            if make is not None:
                try:
                    message = make(data)
                except FrameLengthError as error:
                    self._refuse(error, timestamp)
                    return True
            deliver = listener.deliver  # in a step of its own: as a method of one instance it takes twice the time
            baton.call = listener, since, message, timestamp, cob_id, data, rest
            try:
                deliver(message, timestamp)
            except Exception as error:  # whatever it is, the other listeners get their message
                listener.has_failed(error, timestamp)
            listener.delivered += 1
            baton.call = None
            if baton.claimed and baton.lost():
                listener.come_back()
                return False
            now = clock()
            if now - since > self._slow_after:
                listener.was_slow(now - since, timestamp)
            since = now
        return True

    def _refuse(self, error: FrameLengthError, timestamp: float) -> None:
        self._refused += 1
        self._report(Report(Event.FRAME_REFUSED, f"0x{error.cob_id:03X}", str(error), timestamp))

    # A function that does not return

    def running(self) -> Running | None:
        """Return the call under way, None between calls; for a watchdog on another thread."""
        baton = self._baton
        call = baton.call
        return Running._make((*call, call, baton)) if call else None

    def take_over(self, stuck: Running) -> bool:
        """Go on in this thread behind a call that does not return, with the other listeners of its frame.

        True if it is this thread that receives from now on, False if the call has returned after all. The thread in
        that call gets False from `receive` when it comes back, after it has caught up with that listener's messages.
        """
        if not stuck.listener.leave(stuck.baton, stuck.call, stuck.timestamp):
            return False
        self._baton = Baton()
        _, _, message, timestamp, cob_id, data, *_ = stuck
        return self.receive_data(cob_id, data, timestamp, self.clock(), stuck.behind, message)

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
        heard = (listener for route in self._routes for _, listener in route)
        listeners = tuple(listener.statistics() for listener in dict.fromkeys(heard))
        return Statistics(listeners, self._refused, self._unheard, self.mailboxes.statistics())


def _name_of(function: Callable[..., object]) -> str:
    return getattr(function, "__qualname__", None) or repr(function)
