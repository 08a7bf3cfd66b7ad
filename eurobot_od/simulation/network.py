"""Stations on a simulated CAN bus: arbitration, bit times, and the order of all events.

Rule of this file: one event after the other, each at its time; ties go bus first, then stations in the order they
were attached. The lowest COB-ID in all mailboxes wins the bus; frames that are equal to the bit go out as one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import inf
from typing import NamedTuple

from eurobot_od.device.node import Node
from eurobot_od.device.station import Station
from eurobot_od.frame import Frame
from eurobot_od.gatekeeper import Report
from eurobot_od.simulation.bits import frame_bits


class Sending(NamedTuple):
    """A frame on the bus, who sends it, and when it is through."""

    frame: Frame
    senders: tuple[Station, ...]
    end: float


class Network:
    """A simulated bus at `bitrate` bit/s with its stations; `now` is the simulated time in seconds.

    `reports` are the gatekeepers' reports. `observers` are called with each frame and the time, in seconds, at which
    its transmission ended.
    """

    def __init__(self, bitrate: int = 500_000) -> None:
        self.bitrate = bitrate
        self.now = 0.0
        self.observers: list[Callable[[float, Frame], None]] = []
        self.reports: list[Report] = []
        self._stations: list[Station] = []
        self._starting: list[tuple[float, Station]] = []
        self._sending: Sending | None = None

    def attach(self, node: Node, start: float = 0.0) -> Station:
        """Connect a node that is switched on at `start` seconds."""
        station = Station(node, report=self.reports.append, clock=lambda: self.now)
        station.gatekeeper.start()
        self._starting.append((start, station))
        return station

    @property
    def next_event(self) -> float:
        """Time of the next event, infinite if nothing will ever happen."""
        return self._next_event(self._wakeups())

    def _wakeups(self) -> list[float]:
        return [station.next_wakeup for station in self._stations]

    def _next_event(self, wakeups: Iterable[float]) -> float:
        times = [*wakeups, *(time for time, _ in self._starting)]
        if self._sending:
            times.append(self._sending.end)
        elif any(station.gatekeeper.mailboxes.next_expiry is not None for station in self._stations):
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
        changed = [self._end_sending(), self._start_stations()]
        for station, wakeup in zip(self._stations, self._wakeups() if any(changed) else wakeups):
            if wakeup <= self.now:
                station.tick(self.now)
        self._arbitrate()
        return True

    def run(self, until: float) -> None:
        """Run all events up to a time."""
        while self.advance(until):
            pass

    def _start_stations(self) -> bool:
        """Switch on what is due; tell whether there was any."""
        due = [each for each in self._starting if each[0] <= self.now]
        for each in due:
            self._starting.remove(each)
            self._stations.append(each[1])
            each[1].start(self.now)
        return bool(due)

    def _end_sending(self) -> bool:
        """Deliver the frame on the bus if it is through; tell whether it was."""
        if self._sending is None or self._sending.end > self.now:
            return False
        (frame, senders, _), self._sending = self._sending, None
        for station in self._stations:
            if station in senders:
                station.gatekeeper.mailboxes.complete(frame)
        for observer in self.observers:
            observer(self.now, frame)
        for station in self._stations:
            if station not in senders:
                station.gatekeeper.receive(frame, self.now)
        return True

    def _arbitrate(self) -> None:
        """Let the most urgent frame of all mailboxes have the bus, if it is free."""
        for station in self._stations:
            station.gatekeeper.mailboxes.load(self.now)
        if self._sending is not None:
            return
        offers = [(frame, s) for s in self._stations if (frame := s.gatekeeper.mailboxes.urgent()) is not None]
        if offers:
            winner = min(frame for frame, _ in offers)
            senders = tuple(station for frame, station in offers if frame == winner)
            self._sending = Sending(winner, senders, self.now + frame_bits(winner) / self.bitrate)
