"""Frames that came while the process stood still (SIGSTOP, a suspended computer): too old to be acted on.

Only after a standstill can a frame be old, until one is fresh or none is waiting. So setting the computer's clock makes
no node deaf.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

OLD = 1.0
"""Seconds that a frame may have waited in the driver's queue."""


class Backlog:
    """Finds old frames by the driver's time stamps; `ended` gets their number after each standstill.

    `longest` is the longest time in seconds that a running reader takes from one call to the next.
    """

    def __init__(self, longest: float, ended: Callable[[int], object]) -> None:
        self._longest, self._ended = longest, ended
        self._last, self._usual = inf, inf
        self._waits, self._count = False, 0

    def is_old(self, now: float, stamp: float) -> bool:
        """Return whether a frame read `now` has waited too long; `stamp` is 0.0 if the driver gives none."""
        self._waits = self._waits or now - self._last > self._longest
        self._last = now
        if self._waits and stamp:
            if now - stamp > self._usual + OLD:
                self._count += 1
                return True
            self._end()
        self._usual = now - stamp
        return False

    def is_empty(self, now: float) -> None:
        """Note that no frame is waiting."""
        stood_still = now - self._last > self._longest
        self._last = now
        if stood_still:
            self._waits = True  # the wait for a frame has run out meanwhile: those that have come are still to be read
        elif self._waits:
            self._end()

    def _end(self) -> None:
        self._waits, count, self._count = False, self._count, 0
        if count:
            self._ended(count)
