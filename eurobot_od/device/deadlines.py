"""Deadlines: what has to come again and again, and does not.

Rule of this file: a thing is missed from its first coming on, never before; times are in seconds.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from math import inf
from typing import Generic, TypeVar

Awaited = TypeVar("Awaited", bound=Hashable)


class Deadlines(Generic[Awaited]):
    """What is awaited, and within which time; `missed` is what has not come in time.

    A device has them for its RPDOs (CiA 301, 7.5.2.35: event timer of an RPDO) and for the heartbeats of other nodes.
    """

    def __init__(self) -> None:
        self.times: Mapping[Awaited, float] = {}
        self._deadlines: dict[Awaited, float] = {}
        self.missed: set[Awaited] = set()

    def restart(self, times: Mapping[Awaited, float]) -> None:
        """Begin anew with these; none is awaited before it has come once."""
        self.times = times
        self._deadlines.clear()
        self.missed.clear()

    def change(self, times: Mapping[Awaited, float]) -> None:
        """Take over other times; what does not change goes on."""
        kept = {each for each in times if times[each] == self.times.get(each)}
        self.times = times
        # To their old deadlines: otherwise each write to 0x1016 would give all other nodes more time.
        self._deadlines = {each: self._deadlines[each] for each in kept & self._deadlines.keys()}
        self.missed &= kept

    def awaits(self, what: Awaited) -> bool:
        """Tell whether it has come, and has to come again in time."""
        return what in self._deadlines

    def heard(self, what: Awaited, now: float) -> bool:
        """Note that it has come; return whether it had been missed."""
        if what not in self.times:
            return False
        self._deadlines[what] = now + self.times[what]
        return self.back(what)

    def back(self, what: Awaited) -> bool:
        """Note that it is there, without a new deadline; return whether it had been missed."""
        was_missed = what in self.missed
        self.missed.discard(what)
        return was_missed

    @property
    def next(self) -> float:
        """When the next one will be late, infinite if none is awaited."""
        return min(self._deadlines.values(), default=inf)

    def overdue(self, now: float) -> list[Awaited]:
        """Return what has not come in time by now, each once."""
        late = [each for each, deadline in self._deadlines.items() if deadline <= now]
        for each in late:
            del self._deadlines[each]  # reported once; when it comes again the watch begins anew
            self.missed.add(each)
        return late
