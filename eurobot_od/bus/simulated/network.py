"""Stations on a simulated CAN bus: who hears what and when, what goes wrong on demand, and the order of all events.

Events happen one after the other, each at its time. Of the frames that wait for a `Bus`, the lowest COB-ID of
all transceivers wins, and frames that are equal to the bit go out as one.

A frame's way: its node leaves it to the queue; it wins the arbitration; after its bits it has ended. At that moment
it has left its senders' queues and the observers are called, whatever becomes of it next; the bus is free after
the intermission. Then `disturb` says when it reaches the stations that have received it, and each of them looks at it
after its own `processing` time. A station that is silent at any of these times has lost it.

What is to come stands in one queue: looks, starts, and the moments at which somebody may send again. Only what is under
way on the bus, which `cut` may take back, and the nodes' own wake-ups, which stand in their plans and may change at any
time, are looked up each time. Ties go: the bus, the queue in the order of planning, the stations in the order of
attaching.

A bus that is cut in two is two buses (`split`) until they are joined; all other stations are on the whole one.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf
from random import Random
from typing import NamedTuple, Protocol, TypeAlias

from eurobot_od.bus import INTERMISSION, frame_bits
from eurobot_od.controller import Report, TransmitQueue
from eurobot_od.device.node import Node
from eurobot_od.device.station import OnError, Station
from eurobot_od.device.timers import Plan
from eurobot_od.frame import Frame


class FrameSource(Protocol):
    """Where a transceiver's frames come from; `controller.TransmitQueue` is one."""

    def urgent(self) -> Frame | None:
        """Return the frame to be sent first, None without one; asked as often as anybody likes."""

    def complete(self, frame: Frame) -> object:
        """Take note that a frame is through."""


@dataclass
class Repeated:
    """A source that has the same frame again and again, as a node that babbles; or none, for one that only listens."""

    frame: Frame | None = None

    def urgent(self) -> Frame | None:
        return self.frame

    def complete(self, frame: Frame) -> None:
        """Do nothing: there is always one more."""


@dataclass(eq=False)
class Transceiver:
    """A CAN transceiver that takes its frames from `source`; until `silent_until`, in s, it stays off the bus."""

    source: FrameSource
    silent_until: float = 0.0


class Attempt(NamedTuple):
    """A frame that is being sent: by whom (several may send the same bits), and who hears it."""

    frame: Frame
    senders: Sequence[Transceiver]
    receivers: Sequence[Transceiver]


Ended: TypeAlias = Callable[[Frame, Sequence[Transceiver], Sequence[Transceiver]], None]
"""Takes a frame that has ended: who has sent it, and whom it has reached."""


class Bus:
    """Transceivers that hear each other, at `bitrate` bit/s; `ended` is called with each frame that is through.

    All methods take the time in seconds. `next_event` is when `advance` has something to do, infinite if nothing is
    under way. Nothing is sent before `off_until`.
    """

    def __init__(self, bitrate: int, ended: Ended) -> None:
        self.bitrate, self.transceivers = bitrate, list[Transceiver]()
        self.off_until = 0.0
        self.next_event = inf
        self._ended = ended
        self._attempt: Attempt | None = None  # None in the intermission

    def is_free(self, now: float) -> bool:
        """Return whether an attempt may begin."""
        return self.next_event == inf and self.off_until <= now

    def arbitrate(self, now: float) -> None:
        """Let those who have frames begin, if the bus is free."""
        if not self.is_free(now):
            return
        offers = {
            each: frame
            for each in self.transceivers
            if each.silent_until <= now and (frame := each.source.urgent()) is not None
        }
        if offers:
            here = [each for each in self.transceivers if each.silent_until <= now]
            # Frames compare by their identifier first, so the least one wins the arbitration.
            frame = min(offers.values())
            # Two nodes with the same identifier and data win together, and nobody notices: their bits are equal.
            senders = [each for each, offer in offers.items() if offer == frame]
            self._attempt = Attempt(frame, senders, [each for each in here if each not in senders])
            self.next_event = now + (frame_bits(frame) - INTERMISSION) / self.bitrate

    def advance(self, now: float) -> None:
        """Do what is due by now: end the frame under way, and free the bus after the intermission behind it."""
        while self.next_event <= now:
            attempt, self._attempt = self._attempt, None
            # Before anybody is called: an observer may cut the bus.
            self.next_event = inf if attempt is None else self.next_event + INTERMISSION / self.bitrate
            if attempt and attempt.receivers:  # a frame that nobody acknowledges is sent again
                self._ended(*attempt)

    def drop(self) -> None:
        """Have what is under way come to nothing; it is sent again."""
        self._attempt, self.next_event = None, inf


PROCESSING_TIMES = (50e-6, 100e-6, 150e-6, 200e-6)
"""How long a node may take until it looks at a frame, s: about as long as a frame takes at 500 kbit/s.

Two nodes that give the same answer to one message, as the robot's drive and navigation confirm a start configuration,
are two frames on the bus if their times differ, and one merged frame if not. With so few times both are frequent, and
the node that asks has to cope with either."""

ON_TIME = (0.0,)
"""What `Simulation.disturb` says for a frame that reaches everyone as it should."""

Disturb: TypeAlias = Callable[[float, Frame], Sequence[float]]
"""Says for a frame that has ended at a time, s, after which delays, s, it reaches the receivers: once for each."""


def processing_time(seed: int, name: str) -> float:
    """Return how long a node takes until it looks at a frame, in seconds, from the seed of all chance."""
    return Random(f"{seed} processing {name}").choice(PROCESSING_TIMES)


@dataclass
class Attachment:
    """A station's place on the bus; it looks at a frame `processing` seconds after that came."""

    station: Station
    plan: Plan
    queue: TransmitQueue
    transceiver: Transceiver
    processing: float

    @property
    def wakeup(self) -> float:
        """When the station may want to tick, in seconds: not before it says, and not while it is silent."""
        return max(self.plan.soonest, self.transceiver.silent_until)

    def ask(self) -> float:
        """Ask the node when it wants to tick, which holds until something comes or it plans something sooner."""
        return self.station.next_wakeup


class Simulation:
    """A simulated bus at `bitrate` bit/s with its stations; `now` is the simulated time in seconds.

    `reports` are the transceivers' reports. `observers` are called with each frame and the time, in seconds, at which
    its transmission ended. `disturb` may be set to lose, double and delay frames. A `monitored` bus has a transceiver
    that only listens, and acknowledges what it hears, so that the first node that boots is not alone. Without it, one
    that is alone sends its frame again and again.
    """

    def __init__(self, bitrate: int = 500_000, *, monitored: bool = True) -> None:
        self.bitrate = bitrate
        self.now = 0.0
        self.observers: list[Callable[[float, Frame], None]] = []
        self.reports: list[Report] = []
        # What a driver or a program loses, of which the sender's transceiver knows nothing.
        self.disturb: Disturb = lambda _now, _frame: ON_TIME
        self._places: dict[Station, Attachment] = {}
        self._stations: dict[Transceiver, Station] = {}
        self._queue: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._buses: list[Bus] = []
        self._whole = self._add_bus()
        if monitored:
            self._whole.transceivers.append(Transceiver(Repeated()))

    # Stations and their lives

    def attach(
        self, node: Node, start: float = 0.0, processing: float = 0.0, on_error: OnError | None = None
    ) -> Station:
        """Connect a node that is switched on at `start` and looks at a frame `processing` after it came, in seconds.

        Without `on_error`, what the node raises in a timer is raised; else it is in the `reports`.
        """
        station = Station(node, report=self.reports.append, clock=lambda: self.now, on_error=on_error, is_logged=False)
        station.controller.start()
        node.wake = partial(station.plan.at, -inf)  # called from outside, it has its time asked for at once
        queue = station.controller.queue
        # Silent until it has started: a node that is off does not acknowledge either.
        transceiver = Transceiver(queue, silent_until=inf)
        self._places[station] = Attachment(station, station.plan, queue, transceiver, processing)
        self._stations[transceiver] = station
        self._whole.transceivers.append(transceiver)
        self.plan(start, partial(self._start, station))
        return station

    def detach(self, station: Station) -> None:
        """End a station's life: it neither receives, ticks nor sends any more. A frame of it on the wire ends."""
        transceiver = self._places.pop(station).transceiver
        del self._stations[transceiver]
        self._remove(transceiver)

    def freeze(self, station: Station, until: float) -> None:
        """Have a station neither receive, tick nor send until a time in seconds; what comes meanwhile is lost for it.

        A frame of it on the wire ends. Afterwards it goes on with what it had, its queue as well.
        """
        transceiver = self._places[station].transceiver
        # The longer one counts: a node that hangs twice at once is not back sooner for the second time.
        transceiver.silent_until = max(transceiver.silent_until, until)
        self.plan(until, _look_around)

    def cut(self, until: float) -> None:
        """Switch the bus off until a time in seconds: a frame on the wire is lost, and begins anew afterwards."""
        for bus in self._buses:
            bus.drop()
            bus.off_until = max(bus.off_until, until)
        self.plan(until, _look_around)

    def split(self, stations: Iterable[Station], until: float = inf) -> None:
        """Cut the bus in two until a time in seconds: these stations, and the others with the monitor.

        Neither part hears the other; a frame on the wire is lost, and begins anew. One station alone has been pulled
        off, and is plugged in again at that time.
        """
        moved = [self._places[station].transceiver for station in stations]
        for bus in self._buses:
            if not set(bus.transceivers).isdisjoint(moved):
                bus.drop()
                bus.transceivers[:] = [each for each in bus.transceivers if each not in moved]
        part = self._add_bus()
        part.transceivers += moved
        self.plan(self.now, _look_around)
        self.plan(until, partial(self._join, part))

    def babble(self, frame: Frame, until: float) -> None:
        """Have one more transceiver send the same frame again and again until a time in seconds."""
        transceiver = Transceiver(Repeated(frame))
        self._whole.transceivers.append(transceiver)
        self.plan(self.now, _look_around)
        self.plan(until, partial(self._remove, transceiver))

    def join(self, source: FrameSource) -> Callable[[], None]:
        """Connect a source of frames that is not a station; call what is returned when it has a new frame."""
        self._whole.transceivers.append(Transceiver(source))
        return lambda: self.plan(self.now, _look_around)

    def request(self, frame: Frame) -> None:
        """Have a remote frame reach all stations; it takes as long as on a free bus, and part in no arbitration."""
        # CiA 301 advises against remote frames (7.2.2.5.2), and few transceivers are alike in them; what a device
        # answers is what matters here, not who wins the bus against its question.
        heard = self.now + frame_bits(Frame(frame.cob_id)) / self.bitrate
        for station, place in self._places.items():
            self.plan(heard + place.processing, partial(self._reach, station, partial(station.requested, frame.cob_id)))

    def _add_bus(self) -> Bus:
        bus = Bus(self.bitrate, self._has_ended)
        # A part that is split off a bus without power has no power either.
        bus.off_until = max((each.off_until for each in self._buses), default=0.0)
        self._buses.append(bus)
        return bus

    def _join(self, part: Bus) -> None:
        """Have a part of the bus, and the whole, hear each other again."""
        self._buses.remove(part)
        self._whole.drop()
        self._whole.transceivers += part.transceivers
        # In the order of attaching, so that a cut leaves no trace in the order of later events.
        order = {each: number for number, each in enumerate(self._stations)}
        self._whole.transceivers.sort(key=lambda each: order.get(each, -1))

    def _remove(self, transceiver: Transceiver) -> None:
        for bus in self._buses:
            if transceiver in bus.transceivers:
                bus.transceivers.remove(transceiver)

    def _start(self, station: Station) -> None:
        if station in self._places:
            # From now on it acknowledges: until then its transceiver is without power, and one neighbour alone on the
            # bus repeats its boot-up message for ever.
            self._places[station].transceiver.silent_until = self.now
            station.start(self.now)
            self._places[station].ask()

    # Time

    @property
    def next_event(self) -> float:
        """Time of the next event, infinite if nothing will ever happen."""
        # Asked at each event, so in one loop, and without a call for each place that has nothing to do.
        soonest, waiting = self._queue[0][0] if self._queue else inf, list[Attachment]()
        for place in self._places.values():
            if place.plan.soonest < soonest:
                soonest = min(soonest, place.wakeup)
            if place.queue.waiting:
                waiting.append(place)
        for bus in self._buses:
            if bus.next_event < soonest:
                soonest = bus.next_event
            if not waiting:  # nearly always
                continue
            # A frame was submitted from outside, between two events, and may be sent now.
            awake = [place.transceiver for place in waiting if place.transceiver.silent_until <= self.now]
            if bus.is_free(self.now) and not set(awake).isdisjoint(bus.transceivers):
                soonest = self.now
        return max(soonest, self.now)

    def advance(self, until: float) -> bool:
        """Run the next event if it is due by `until`; otherwise let the time pass and return False."""
        event = self.next_event
        if event > until or event == inf:
            self.now = max(self.now, until)
            return False
        self.now, stirred = event, False
        # A copy: an observer of a frame that ends may split the bus, or join it.
        for bus in tuple(self._buses):
            if bus.next_event <= event:
                stirred = True
                bus.advance(event)
        while self._queue and self._queue[0][0] <= event:  # also what becomes due meanwhile
            stirred = True
            heapq.heappop(self._queue)[-1]()
        for place in tuple(self._places.values()):
            if place.plan.soonest <= event and place.wakeup <= event:
                place.station.tick(event)
                place.ask()
        for place in self._places.values():
            if place.queue.waiting and place.transceiver.silent_until <= event:
                stirred = True
                place.queue.load(event)
        if stirred:  # most events are a node's own, which sends nothing
            # Last of all, so that what the nodes have just sent takes part in this arbitration.
            for bus in self._buses:
                bus.arbitrate(event)
        return True

    def run(self, until: float) -> None:
        """Run all events up to a time."""
        while self.advance(until):
            pass

    def plan(self, time: float, action: Callable[[], None]) -> None:
        """Have something done at a time, in seconds, before what the stations do then."""
        # The number breaks ties by the order of planning, and keeps the heap from comparing functions.
        heapq.heappush(self._queue, (time, next(self._order), action))

    # The bus

    def _is_awake(self, station: Station) -> bool:
        """Return whether a station takes part."""
        return station in self._places and self._places[station].transceiver.silent_until <= self.now

    def _has_ended(self, frame: Frame, senders: Sequence[Transceiver], receivers: Sequence[Transceiver]) -> None:
        """Take a frame that has ended out of its senders' queues, and plan when who looks at it."""
        for transceiver in senders:
            # Several may have sent the same bits at once; for each of them it is transmit-complete.
            transceiver.source.complete(frame)
        for observer in self.observers:
            observer(self.now, frame)
        # What a station does not listen to stops at its receive filters.
        reached = (self._stations[each] for each in receivers if each in self._stations)
        stations = [each for each in reached if each.controller.hears(frame.cob_id)]
        # The frame is through for its senders, whatever the receivers then make of it: a program may be slow or frozen.
        for delay in self.disturb(self.now, frame):
            for station in filter(self._is_awake, stations):
                look = self.now + delay + self._places[station].processing
                self.plan(look, partial(self._reach, station, partial(station.controller.receive, frame)))

    def _reach(self, station: Station, act: Callable[[float], object]) -> None:
        """Have a station act on a frame that has come, if it still can: it may have been detached meanwhile."""
        if self._is_awake(station):
            act(self.now)
            self._places[station].ask()


def _look_around() -> None:
    """Do nothing but be an event: after each one the bus is arbitrated, and now someone may send again."""
