"""Deadlines of RPDOs: what has to come again and again, and does not (CiA 301, 7.5.2.35: event timer of an RPDO).

Rule of this file: an RPDO is missed from its first frame on, never before; times are in seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import inf

from eurobot_od.pdo.binding import Binding


class Deadlines:
    """The RPDOs with a deadline; `time_of` gives it, 0.0 for none. `missed` are those that have not come in time."""

    def __init__(self, time_of: Callable[[Binding], float]) -> None:
        self._time_of = time_of
        self._times: dict[Binding, float] = {}
        self._deadlines: dict[Binding, float] = {}
        self.missed: set[Binding] = set()

    def restart(self, received: Iterable[Binding]) -> None:
        """Begin anew with these RPDOs, and with their deadlines as they are now."""
        self._times = {each: time for each in received if (time := self._time_of(each))}
        self._deadlines.clear()
        self.missed.clear()

    def heard(self, binding: Binding, now: float) -> bool:
        """Note that an RPDO has come; return whether it had been missed."""
        if binding not in self._times:
            return False
        self._deadlines[binding] = now + self._times[binding]
        was_missed = binding in self.missed
        self.missed.discard(binding)
        return was_missed

    @property
    def next(self) -> float:
        """When the next one will be late, infinite if none is awaited."""
        return min(self._deadlines.values(), default=inf)

    def overdue(self, now: float) -> list[Binding]:
        """Return the RPDOs that have not come in time by now, each once."""
        late = [binding for binding, deadline in self._deadlines.items() if deadline <= now]
        for binding in late:
            del self._deadlines[binding]  # reported once; its next frame starts the watch again
            self.missed.add(binding)
        return late
