"""Timers, which call a node's functions at a time; deadlines, by which something has to come; and a node's plan.

There is no clock in here: the time, in seconds, is what the caller says it is. Timers that are due at the same time are
called in the order in which they were set. Otherwise a simulated match would not be the same twice.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Callable, Hashable, Iterator, Mapping
from math import inf
from typing import Generic, TypeAlias, TypeVar

TimerAction: TypeAlias = Callable[[float], None]
"""What to do when a timer is due; gets the time it was set for."""


LATE = 1.0
"""Seconds by which a node may be late and still catch up; what is later was missed, as the process stood still."""


def caught_up(due: float, now: float) -> float:
    """Return the time from which to plan what follows something `due`: that time, or now if it was missed.

    So one late call does not delay the next, and a node that has stood still for minutes does not do everything at once
    that it has missed.
    """
    return due if now - due <= LATE else now


class Timer:
    """A function waiting for its time; after `cancel` it is never called."""

    __slots__ = ("action", "time")

    def __init__(self, time: float, action: TimerAction) -> None:
        self.time = time
        self.action: TimerAction | None = action

    def cancel(self) -> None:
        """Forget the function; the heap drops the timer once it is at the top, which is cheaper than a search."""
        self.action = None


class Timers:
    """The timers of one node, soonest first; `planned` gets the time of each new one."""

    def __init__(self, planned: Callable[[float], object] = lambda _: None) -> None:
        self._planned = planned
        self._heap: list[tuple[float, int, Timer]] = []
        self._order = itertools.count()

    def at(self, time: float, action: TimerAction) -> Timer:
        """Have `action` called when the time comes."""
        timer = Timer(time, action)
        # The number keeps timers of the same time in order, and keeps the heap from comparing timers, which it cannot.
        heapq.heappush(self._heap, (time, next(self._order), timer))
        self._planned(time)
        return timer

    @property
    def next(self) -> float:
        """Time of the soonest timer, infinite if there is none."""
        while self._heap and self._heap[0][2].action is None:
            heapq.heappop(self._heap)
        return self._heap[0][0] if self._heap else inf

    def due(self, now: float) -> Iterator[tuple[TimerAction, float]]:
        """Yield what is due, each with the time it was set for, including what becomes due meanwhile.

        A late node gets the planned times, so that what repeats itself by adding a period to them does not drift. What
        it has missed (see `caught_up`) it gets once, with the present time.
        """
        while self.next <= now:
            time, _, timer = heapq.heappop(self._heap)
            if timer.action is not None:
                yield timer.action, caught_up(time, now)

    def clear(self) -> None:
        """Forget all timers."""
        self._heap.clear()


class Plan:
    """The soonest of all times that a node has planned; timers note theirs with `at`.

    After each frame the receiving thread compares this one number, instead of asking every timer of the node, to see
    whether the thread that keeps the time has to be woken. It is never later than the first thing that is due. It may
    be sooner, as a plan may be dropped: that costs one needless look. The keeper of the time sets `soonest` when it
    asks the node.
    """

    __slots__ = ("soonest",)

    def __init__(self) -> None:
        self.soonest = inf

    def at(self, time: float) -> None:
        """Note that something is due at a time in seconds."""
        if time < self.soonest:
            self.soonest = time


# Deadlines


Awaited = TypeVar("Awaited", bound=Hashable)


class Deadlines(Generic[Awaited]):
    """Things that have to come again within their times; `missed` are those that have not come in time.

    A device has deadlines for its RPDOs (CiA 301, 7.5.2.35: event timer of an RPDO) and for other nodes' heartbeats.
    """

    def __init__(self) -> None:
        self.times: Mapping[Awaited, float] = {}
        self._deadlines: dict[Awaited, float] = {}
        self.missed: set[Awaited] = set()

    def restart(self, times: Mapping[Awaited, float]) -> None:
        """Start over with these times; nothing is awaited before it has come once."""
        self.times = times
        self._deadlines.clear()
        self.missed.clear()

    def change(self, times: Mapping[Awaited, float]) -> None:
        """Take over other times; whatever does not change goes on."""
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
        """Time at which the next one is late, infinite if none is awaited."""
        return min(self._deadlines.values(), default=inf)

    def overdue(self, now: float) -> list[Awaited]:
        """Return what has not come in time by now, each once."""
        late = [each for each, deadline in self._deadlines.items() if deadline <= now]
        for each in late:
            del self._deadlines[each]  # reported once; when it comes again the watch starts over
            self.missed.add(each)
        return late
