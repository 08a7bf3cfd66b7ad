"""Stations on a simulated CAN bus: delivery of frames, faults on demand, and the order of all events.

Events happen one after the other, each at its time. Of all frames waiting for a `Bus`, the one with the lowest COB-ID
wins the arbitration; equal frames are sent as one.

The way of a frame: its node puts it into the queue; it wins the arbitration; it ends after its last bit. It then leaves
its senders' queues, the observers are called, and the bus is free after the intermission. `disturb` returns when it
reaches the receiving stations, and each of them processes it after its `processing` time. A station that is silent at
any of these times loses it.

Future events are in one queue: processing, starts, and times at which a station may send again. Two kinds are looked up
each time instead: the frame on the bus, which `cut` may cancel, and the nodes' wake-ups, which may change at any time.
The order of simultaneous events is: the bus, the queue in order of planning, the stations in order of attaching.

A bus that is cut in two is two buses (`split`) until they are joined.
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
from eurobot_od.controller import Report, Reporter, TransmitQueue
from eurobot_od.device.node import Node
from eurobot_od.device.station import OnError, Station
from eurobot_od.device.timers import Plan
from eurobot_od.frame import Frame


class FrameSource(Protocol):
    """Source of a transceiver's frames, such as `controller.TransmitQueue`."""

    def urgent(self) -> Frame | None:
        """Return the frame with the highest priority, or None, without removing it."""

    def complete(self, frame: Frame) -> object:
        """Note that a frame was sent."""


@dataclass
class Repeated:
    """A source of the same frame again and again, as of a babbling node; without a frame it only listens."""

    frame: Frame | None = None

    def urgent(self) -> Frame | None:
        return self.frame

    def complete(self, frame: Frame) -> None:
        """Do nothing, so that the frame is sent again."""


@dataclass(eq=False)
class Transceiver:
    """A CAN transceiver with frames from `source`; it is off the bus until `silent_until`, in s."""

    source: FrameSource
    silent_until: float = 0.0


class Attempt(NamedTuple):
    """A frame that is being sent, its senders (several may send equal frames), and its receivers."""

    frame: Frame
    senders: Sequence[Transceiver]
    receivers: Sequence[Transceiver]


Ended: TypeAlias = Callable[[Frame, Sequence[Transceiver], Sequence[Transceiver]], None]
"""Called with a frame that has ended, its senders and its receivers."""


class Bus:
    """Transceivers that hear each other, at `bitrate` bit/s; `ended` is called with each complete frame.

    All times are in s. `next_event` is the time for the next `advance`, infinite if no frame is being sent. Nothing is
    sent before `off_until`.
    """

    def __init__(self, bitrate: int, ended: Ended) -> None:
        self.bitrate = bitrate
        self.transceivers = list[Transceiver]()
        self.off_until = 0.0
        self.next_event = inf
        self._ended = ended
        self._attempt: Attempt | None = None  # None in the intermission

    def is_free(self, now: float) -> bool:
        """Return whether a frame may begin."""
        return self.next_event == inf and self.off_until <= now

    def arbitrate(self, now: float) -> None:
        """Begin the frame with the highest priority, if the bus is free."""
        if not self.is_free(now):
            return
        offers = {
            each: frame
            for each in self.transceivers
            if each.silent_until <= now and (frame := each.source.urgent()) is not None
        }
        if offers:
            here = [each for each in self.transceivers if each.silent_until <= now]
            # Frames compare by their identifier first, so the lowest one wins the arbitration.
            frame = min(offers.values())
            # Two nodes with the same identifier and data win together.
            senders = [each for each, offer in offers.items() if offer == frame]
            self._attempt = Attempt(frame, senders, [each for each in here if each not in senders])
            self.next_event = now + (frame_bits(frame) - INTERMISSION) / self.bitrate

    def advance(self, now: float) -> None:
        """End the frame that is complete by `now`, and free the bus after its intermission."""
        while self.next_event <= now:
            attempt = self._attempt
            self._attempt = None
            # Before observers are called, because they may cut the bus.
            self.next_event = inf if attempt is None else self.next_event + INTERMISSION / self.bitrate
            if attempt and attempt.receivers:  # an unacknowledged frame is repeated
                self._ended(*attempt)

    def drop(self) -> None:
        """Abort the present frame, which is sent again."""
        self._attempt = None
        self.next_event = inf


PROCESSING_TIMES = (50e-6, 100e-6, 150e-6, 200e-6)
"""Possible processing times of nodes in s, about the length of a frame at 500 kbit/s.

If two nodes give the same answer to a message, their frames merge if their times are equal. With so few times, both
cases are frequent, and the asking node must handle both.
"""

ON_TIME = (0.0,)
"""Result of `Simulation.disturb` for an undisturbed frame."""

Disturb: TypeAlias = Callable[[float, Frame], Sequence[float]]
"""Function from time in s and frame to the delays in s after which it reaches the receivers, once for each."""


def processing_time(seed: int, name: str) -> float:
    """Return a node's processing time in s, chosen by the seed."""
    return Random(f"{seed} processing {name}").choice(PROCESSING_TIMES)


@dataclass
class Attachment:
    """A station's place on the bus; it processes a frame `processing` s after its arrival."""

    station: Station
    plan: Plan
    queue: TransmitQueue
    transceiver: Transceiver
    processing: float

    @property
    def wakeup(self) -> float:
        """Earliest time of the station's next tick in s; not while it is silent."""
        return max(self.plan.soonest, self.transceiver.silent_until)

    def ask(self) -> float:
        """Ask the node for its next wake-up, which holds until a frame comes or it plans something earlier."""
        return self.station.next_wakeup


class Simulation:
    """A simulated bus at `bitrate` bit/s with its stations; `now` is the simulated time in seconds.

    `reports` are the stations' reports. `observers` are called with each frame and the time in s of its end. `disturb`
    may be set to lose, double and delay frames. A `monitored` bus has a transceiver that only listens and acknowledges,
    so that the first booting node is not alone; a node that is alone repeats its frame without end.
    """

    def __init__(self, bitrate: int = 500_000, *, monitored: bool = True) -> None:
        self.bitrate = bitrate
        self.now = 0.0
        self.observers: list[Callable[[float, Frame], None]] = []
        self.reports: list[Report] = []
        # For losses in a driver or program, which the sender does not notice.
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
        self,
        node: Node,
        start: float = 0.0,
        processing: float = 0.0,
        on_error: OnError | None = None,
        report: Reporter | None = None,
    ) -> Station:
        """Connect a node, and return its station.

        Args:
            node: the node
            start: time at which it is switched on, in s
            processing: time from the arrival of a frame until the node processes it, in s
            on_error: reaction to an exception of the node, which is then in the `reports`; None: it is raised
            report: function that gets the station's reports; default: they are kept in `reports`
        """
        report = report or self.reports.append
        station = Station(node, report=report, clock=lambda: self.now, on_error=on_error, is_logged=False)
        station.controller.start()
        node.wake = partial(station.plan.at, -inf)  # a call from outside may change its wake-up
        queue = station.controller.queue
        # Silent until its start, because a node without power does not acknowledge.
        transceiver = Transceiver(queue, silent_until=inf)
        self._places[station] = Attachment(station, station.plan, queue, transceiver, processing)
        self._stations[transceiver] = station
        self._whole.transceivers.append(transceiver)
        self.plan(start, partial(self._start, station))
        return station

    def detach(self, station: Station) -> None:
        """Remove a station, which neither receives, ticks nor sends any more; its frame on the bus is completed."""
        transceiver = self._places.pop(station).transceiver
        del self._stations[transceiver]
        self._remove(transceiver)

    def freeze(self, station: Station, until: float) -> None:
        """Freeze a station until a time in s: it neither receives, ticks nor sends, and loses all frames.

        Its frame on the bus is completed. Afterwards it continues with its state and queue.
        """
        transceiver = self._places[station].transceiver
        # With two overlapping freezes, the later end applies.
        transceiver.silent_until = max(transceiver.silent_until, until)
        self.plan(until, _look_around)

    def cut(self, until: float) -> None:
        """Switch the bus off until a time in s; a frame on the bus is lost, and sent again afterwards."""
        for bus in self._buses:
            bus.drop()
            bus.off_until = max(bus.off_until, until)
        self.plan(until, _look_around)

    def split(self, stations: Iterable[Station], until: float = inf) -> None:
        """Cut the bus in two until a time in s: these stations, and the others with the monitor.

        A frame on the bus is lost, and sent again. A single station is thereby unplugged, and plugged in again.
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
        """Add a transceiver that sends the same frame again and again until a time in s."""
        transceiver = Transceiver(Repeated(frame))
        self._whole.transceivers.append(transceiver)
        self.plan(self.now, _look_around)
        self.plan(until, partial(self._remove, transceiver))

    def join(self, source: FrameSource) -> Callable[[], None]:
        """Connect a source of frames other than a station; the returned function must be called for a new frame."""
        self._whole.transceivers.append(Transceiver(source))
        return lambda: self.plan(self.now, _look_around)

    def request(self, frame: Frame) -> None:
        """Deliver a remote frame to all stations, without arbitration, after its length on a free bus."""
        # Only the devices' answers matter, as CiA 301 advises against remote frames (7.2.2.5.2).
        heard = self.now + frame_bits(Frame(frame.cob_id)) / self.bitrate
        for station, place in self._places.items():
            self.plan(heard + place.processing, partial(self._reach, station, partial(station.requested, frame.cob_id)))

    def _add_bus(self) -> Bus:
        bus = Bus(self.bitrate, self._has_ended)
        # A part of a bus that is off is off, too.
        bus.off_until = max((each.off_until for each in self._buses), default=0.0)
        self._buses.append(bus)
        return bus

    def _join(self, part: Bus) -> None:
        """Rejoin a part of the bus with the whole."""
        self._buses.remove(part)
        self._whole.drop()
        self._whole.transceivers += part.transceivers
        # In the order of attaching, so that a cut does not change the order of later events.
        order = {each: number for number, each in enumerate(self._stations)}
        self._whole.transceivers.sort(key=lambda each: order.get(each, -1))

    def _remove(self, transceiver: Transceiver) -> None:
        for bus in self._buses:
            if transceiver in bus.transceivers:
                bus.transceivers.remove(transceiver)

    def _start(self, station: Station) -> None:
        if station in self._places:
            # It acknowledges from now on; before, its transceiver had no power.
            self._places[station].transceiver.silent_until = self.now
            station.start(self.now)
            self._places[station].ask()

    # Time

    @property
    def next_event(self) -> float:
        """Time of the next event, infinite if nothing will ever happen."""
        # One loop with few calls, because this runs at each event.
        soonest = self._queue[0][0] if self._queue else inf
        waiting = list[Attachment]()
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
            # A frame that was submitted between two events may be sent now.
            awake = [place.transceiver for place in waiting if place.transceiver.silent_until <= self.now]
            if bus.is_free(self.now) and not set(awake).isdisjoint(bus.transceivers):
                soonest = self.now
        return max(soonest, self.now)

    def advance(self, until: float) -> bool:
        """Run the next event if it is due by `until`; else advance to `until` and return False."""
        event = self.next_event
        if event > until or event == inf:
            self.now = max(self.now, until)
            return False
        self.now, stirred = event, False
        # A copy, because observers may split or join the bus.
        for bus in tuple(self._buses):
            if bus.next_event <= event:
                stirred = True
                bus.advance(event)
        while self._queue and self._queue[0][0] <= event:  # actions may plan others for now
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
        if stirred:  # most events are wake-ups of nodes that send nothing
            # Last, so that frames sent just now take part in the arbitration.
            for bus in self._buses:
                bus.arbitrate(event)
        return True

    def run(self, until: float) -> None:
        """Run all events up to a time."""
        while self.advance(until):
            pass

    def plan(self, time: float, action: Callable[[], None]) -> None:
        """Plan an action at a time in s, before the stations' wake-ups at that time."""
        # The number keeps the order of planning, so that functions are never compared.
        heapq.heappush(self._queue, (time, next(self._order), action))

    # The bus

    def _is_awake(self, station: Station) -> bool:
        """Return whether a station is on the bus and not silent."""
        return station in self._places and self._places[station].transceiver.silent_until <= self.now

    def _has_ended(self, frame: Frame, senders: Sequence[Transceiver], receivers: Sequence[Transceiver]) -> None:
        """Remove a complete frame from its senders' queues, and plan its processing by the receivers."""
        for transceiver in senders:
            # The frame is complete for each sender of equal frames.
            transceiver.source.complete(frame)
        for observer in self.observers:
            observer(self.now, frame)
        # Receive filters drop other frames.
        reached = (self._stations[each] for each in receivers if each in self._stations)
        stations = [each for each in reached if each.controller.hears(frame.cob_id)]
        # A receiver may be slow or frozen, which the senders do not notice.
        for delay in self.disturb(self.now, frame):
            for station in filter(self._is_awake, stations):
                look = self.now + delay + self._places[station].processing
                self.plan(look, partial(self._reach, station, partial(station.controller.receive, frame)))

    def _reach(self, station: Station, act: Callable[[float], object]) -> None:
        """Deliver a frame to a station, unless it was detached or frozen meanwhile."""
        if self._is_awake(station):
            act(self.now)
            self._places[station].ask()


def _look_around() -> None:
    """Do nothing; as an event, it triggers an arbitration."""
