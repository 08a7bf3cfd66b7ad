"""SYNC and TIME: how a device sends them, and what it does with those it hears (CiA 301, 7.2.5 and 7.2.6).

There is no clock in here. The device's own time comes in, in seconds; for TIME only the difference is kept. When
several frames of one PDO wait for a SYNC the newest counts, and nothing is kept beyond the next SYNC.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from datetime import datetime, timedelta
from math import inf
from typing import NamedTuple

from eurobot_od.device.timers import caught_up
from eurobot_od.od.time_of_day import DAY, EPOCH, TimeOfDay
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.message import Message

# SYNC: producer, synchronous TPDOs, RPDOs that wait (7.2.2.3, 7.5.2.5, 7.5.2.22)


COUNTERS = (0, *range(2, 241))
"""Values that 0x1019 may have: 1 would count nothing, and all others are reserved (CiA 301, 7.5.2.22)."""

ACYCLIC = 0
"""Transmission type of a TPDO that goes with the next SYNC; with type n it goes with every n-th one (CiA 301, Tables 68
and 72)."""


class SyncProducer:
    """Sends SYNC; `next` is the time of the next one, infinite if none is sent."""

    def __init__(self) -> None:
        self.next = inf
        self._period = 0.0
        self._overflow = self._count = 0

    def restart(self, period: float, overflow: int, now: float) -> None:
        """Start over: the first SYNC comes after `period` seconds (0.0: none), and the counter starts at 1."""
        self.next = now + period if period else inf  # within one period (CiA 301, 7.5.2.5)
        self._period, self._overflow, self._count = period, overflow, 0

    def due(self, now: float) -> list[bytes]:
        """Return the data of the SYNC that is due, in a list of one or none."""
        if now < self.next:
            return []
        self.next = caught_up(self.next, now) + self._period
        if not self._overflow:
            return [b""]
        self._count = self._count % self._overflow + 1
        return [bytes([self._count])]


class Arrival(NamedTuple):
    """A received PDO that takes effect with the next SYNC."""

    binding: Binding
    data: bytes
    message: Message


class Synchronous:
    """The PDOs that follow SYNC.

    `type_of` gives the transmission type of a PDO, None if it does not follow SYNC. `start_of` gives the number of the
    SYNC that a TPDO starts with, 0 for any.
    """

    def __init__(self, type_of: Callable[[Binding], int | None], start_of: Callable[[Binding], int]) -> None:
        self._type_of, self._start_of = type_of, start_of
        self._types: dict[Binding, int] = {}
        self._counts: dict[Binding, int] = {}
        self._starts: dict[Binding, int] = {}
        self._asked: set[Binding] = set()
        self._arrived: dict[Binding, Arrival] = {}

    def restart(self, sent: Iterable[Binding], received: Iterable[Binding]) -> None:
        """Start over with these PDOs and their present types; what was waiting is dropped."""
        self._types = {each: n for each in (*sent, *received) if (n := self._type_of(each)) is not None}
        self._counts = {each: 0 for each in sent if each in self._types}
        self._starts = {each: start for each in self._counts if (start := self._start_of(each))}
        self._asked.clear()
        self._arrived.clear()

    def __contains__(self, binding: Binding) -> bool:
        return binding in self._types

    def ask(self, binding: Binding) -> None:
        """Note that the application has sent a TPDO; one of transmission type 0 goes with the next SYNC."""
        self._asked.add(binding)

    def hold(self, arrival: Arrival) -> None:
        """Keep a received PDO until the next SYNC."""
        self._arrived[arrival.binding] = arrival

    def due(self, number: int | None) -> list[Binding]:
        """Count a SYNC, and return the TPDOs that go with it; `number` is its counter, None if it has none."""
        self._starts = {binding: start for binding, start in self._starts.items() if start != number}
        self._counts |= {binding: count + 1 for binding, count in self._counts.items() if binding not in self._starts}
        periods = self._types
        due = [
            each
            for each, count in self._counts.items()
            if each not in self._starts
            and (each in self._asked if periods[each] == ACYCLIC else count % periods[each] == 0)
        ]
        self._asked.clear()
        return due

    def arrived(self) -> list[Arrival]:
        """Return the PDOs that take effect now, and forget them."""
        arrived, self._arrived = self._arrived, {}
        return list(arrived.values())


# TIME (7.1.6.6, 7.5.2.15)


TIME_CONSUMER, TIME_PRODUCER = 1 << 31, 1 << 30
"""Bits of 0x1012: the device sets its clock by TIME, or sends TIME."""

TIME_PERIOD = 1.0
"""Seconds between two TIME messages; CiA 301 has no object for it."""

TIME_LENGTH = 6
MILLISECONDS = (1 << 28) - 1
"""Bits of the first four bytes that hold the milliseconds after midnight; the others are reserved."""

MOST_DAYS = 0xFFFF


class Clock:
    """The device's clock, at day 0 until it is set. `next` is when TIME is sent again, infinite if it is not sent."""

    def __init__(self) -> None:
        self.next = inf
        self._ahead = 0.0

    def at(self, now: float) -> datetime:
        """Return the time that the clock shows."""
        return EPOCH + timedelta(seconds=self._ahead + now)

    def set(self, time: datetime, now: float) -> None:
        """Set the clock."""
        self._ahead = (time - EPOCH).total_seconds() - now

    def hear(self, data: bytes, now: float) -> None:
        """Set the clock by a TIME message; one that has another length, or is not a time of day, is ignored."""
        milliseconds = int.from_bytes(data[:4], "little") & MILLISECONDS
        if len(data) == TIME_LENGTH and milliseconds < DAY:
            self._ahead = int.from_bytes(data[4:], "little") * (DAY // 1000) + milliseconds / 1000 - now

    def told(self, now: float) -> bytes:
        """Return the data of a TIME message."""
        days, milliseconds = divmod(round((self._ahead + now) * 1000), DAY)
        return TimeOfDay(days & MOST_DAYS, milliseconds).data

    def produce(self, now: float) -> None:
        """Start sending the time."""
        self.next = now + TIME_PERIOD

    def rest(self) -> None:
        """Stop sending the time."""
        self.next = inf

    def due(self, now: float) -> list[bytes]:
        """Return the data of the TIME that is due, in a list of one or none."""
        if now < self.next:
            return []
        self.next = caught_up(self.next, now) + TIME_PERIOD
        return [self.told(now)]
