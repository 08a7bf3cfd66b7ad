"""Stations on a simulated CAN bus: arbitration, bit times, what goes wrong on demand, and the order of all events.

Rule of this file: one event after the other, each at its time. The lowest COB-ID in all mailboxes wins the bus; frames
that are equal to the bit go out as one.

A frame's way: its node leaves it to the mailboxes; it wins the arbitration; after its bits it has ended. At that moment
the mailboxes of its senders are free and the observers are told, whatever becomes of it next. Then `disturb` says when
it reaches the stations that hear now, and each of them looks at it after its own `processing` time. Who is silent at
either of these two times has lost it.

What is to come stands in one queue: looks, starts, and the moments at which somebody may send again. Only the end of
the frame on the bus, which `cut` may take back, and the nodes' own wake-ups, which they may change at any time, are
asked for each time. Ties go: the bus, the queue in the order of planning, the stations in the order of attaching.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf
from random import Random
from typing import NamedTuple, TypeAlias

from eurobot_od.device.node import Node
from eurobot_od.device.station import Station
from eurobot_od.frame import Frame
from eurobot_od.gatekeeper import Report
from eurobot_od.simulation.bits import frame_bits

PROCESSING_TIMES = (50e-6, 100e-6, 150e-6, 200e-6)
"""How long a node may take until it looks at a frame, s: about as long as a frame takes at 500 kbit/s.

Two nodes that give the same answer to one message, as the robot's drive and navigation confirm a start configuration,
are two frames on the bus if their times differ, and one merged frame if not. With so few times both are frequent, and
who asks learns to live with either."""

ON_TIME = (0.0,)
"""What `Network.disturb` says for a frame that reaches everyone as it should."""

Disturb: TypeAlias = Callable[[float, Frame], Sequence[float]]
"""Says for a frame that has ended at a time, s, after which delays, s, it reaches the receivers: once for each."""


def processing_time(seed: int, name: str) -> float:
    """Return how long a node takes until it looks at a frame, in seconds, from the seed of all chance."""
    return Random(f"{seed} processing {name}").choice(PROCESSING_TIMES)


class Sending(NamedTuple):
    """A frame on the bus, who sends it, and when it is through."""

    frame: Frame
    senders: tuple[Station, ...]
    end: float


@dataclass
class Place:
    """A station's place on the bus; it is silent before its start and while it is frozen. Times are seconds."""

    station: Station
    processing: float
    silent_until: float = inf


class Network:
    """A simulated bus at `bitrate` bit/s with its stations; `now` is the simulated time in seconds.

    `reports` are the gatekeepers' reports. `observers` are called with each frame and the time, in seconds, at which
    its transmission ended. `disturb` may be set to lose, double and delay frames.
    """

    def __init__(self, bitrate: int = 500_000) -> None:
        self.bitrate = bitrate
        self.now = 0.0
        self.observers: list[Callable[[float, Frame], None]] = []
        self.reports: list[Report] = []
        self.disturb: Disturb = lambda _now, _frame: ON_TIME
        self._places: dict[Station, Place] = {}
        self._queue: list[tuple[float, int, Callable[[], None]]] = []
        self._order = itertools.count()
        self._sending: Sending | None = None
        self._off_until = 0.0

    # Stations and their lives

    def attach(self, node: Node, start: float = 0.0, processing: float = 0.0) -> Station:
        """Connect a node that is switched on at `start` and looks at a frame `processing` after it came, in seconds."""
        station = Station(node, report=self.reports.append, clock=lambda: self.now)
        station.gatekeeper.start()
        self._places[station] = Place(station, processing)
        self._plan(start, partial(self._start, station))
        return station

    def detach(self, station: Station) -> None:
        """End a station's life: it neither receives, ticks nor sends any more. A frame of it on the wire ends."""
        del self._places[station]

    def freeze(self, station: Station, until: float) -> None:
        """Have a station neither receive, tick nor send until a time in seconds; what comes meanwhile is lost for it.

        A frame of it on the wire ends. Afterwards it goes on with what it had, its mailboxes as well.
        """
        place = self._places[station]
        place.silent_until = max(place.silent_until, until)
        self._plan(until, _look_around)

    def cut(self, until: float) -> None:
        """Switch the bus off until a time in seconds: a frame on the wire is lost, and begins anew afterwards."""
        self._sending = None
        self._off_until = max(self._off_until, until)
        self._plan(until, _look_around)

    def _start(self, station: Station) -> None:
        if station in self._places:
            self._places[station].silent_until = self.now
            station.start(self.now)

    # Time

    @property
    def next_event(self) -> float:
        """Time of the next event, infinite if nothing will ever happen."""
        return self._next_event(self._wakeups())

    def _wakeups(self) -> list[float]:
        return [max(place.station.next_wakeup, place.silent_until) for place in self._places.values()]

    def _next_event(self, wakeups: list[float]) -> float:
        times = [*wakeups, *(time for time, _, _ in self._queue[:1])]
        if self._sending:
            times.append(self._sending.end)
        elif self._is_on and any(each.gatekeeper.mailboxes.next_expiry is not None for each in self._awake()):
            times.append(self.now)  # a frame submitted from outside, between two events
        return max(min(times, default=inf), self.now)

    def advance(self, until: float) -> bool:
        """Run the next event if it is due by `until`; otherwise let the time pass and return False."""
        wakeups = self._wakeups()
        event = self._next_event(wakeups)
        if event > until or event == inf:
            self.now = max(self.now, until)
            return False
        self.now = event
        changed = [self._end_sending(), self._do_planned()]
        for place, wakeup in zip(list(self._places.values()), self._wakeups() if any(changed) else wakeups):
            if wakeup <= self.now:
                place.station.tick(self.now)
        self._arbitrate()
        return True

    def run(self, until: float) -> None:
        """Run all events up to a time."""
        while self.advance(until):
            pass

    def _plan(self, time: float, action: Callable[[], None]) -> None:
        heapq.heappush(self._queue, (time, next(self._order), action))

    def _do_planned(self) -> bool:
        """Do what is due, also what becomes due meanwhile; tell whether there was any."""
        found = False
        while self._queue and self._queue[0][0] <= self.now:
            heapq.heappop(self._queue)[-1]()
            found = True
        return found

    # The bus

    @property
    def _is_on(self) -> bool:
        return self._off_until <= self.now

    def _awake(self) -> Iterator[Station]:
        """Give the stations that take part, in the order they were attached."""
        return (station for station, place in self._places.items() if place.silent_until <= self.now)

    def _end_sending(self) -> bool:
        """Let the frame on the bus end if it is through, and plan when who looks at it; tell whether it was."""
        if self._sending is None or self._sending.end > self.now:
            return False
        (frame, senders, _), self._sending = self._sending, None
        for station in senders:
            station.gatekeeper.mailboxes.complete(frame)
        for observer in self.observers:
            observer(self.now, frame)
        for delay in self.disturb(self.now, frame):
            for station in self._awake():
                if station not in senders:
                    look = self.now + delay + self._places[station].processing
                    self._plan(look, partial(self._look, station, frame))
        return True

    def _look(self, station: Station, frame: Frame) -> None:
        """Have a station look at a frame that has come, if it still can."""
        if station in self._awake():
            station.gatekeeper.receive(frame, self.now)

    def _arbitrate(self) -> None:
        """Let the most urgent frame of all mailboxes have the bus, if it is free."""
        offers = [(frame, s) for s in self._awake() if (frame := s.gatekeeper.mailboxes.next(self.now)) is not None]
        if offers and self._sending is None and self._is_on:
            winner = min(frame for frame, _ in offers)
            senders = tuple(station for frame, station in offers if frame == winner)
            self._sending = Sending(winner, senders, self.now + frame_bits(winner) / self.bitrate)


def _look_around() -> None:
    """Do nothing but be an event: after each one the bus is arbitrated, and now someone may send again."""
