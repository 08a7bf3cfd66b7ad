"""Growing pauses between attempts: the first come at once, and what stays dead costs little."""

from __future__ import annotations

from math import inf

FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0
"""Seconds until the next try, doubled each time."""

STEADY = 10.0
"""Seconds without a failure after which the pauses start from the shortest again."""


class Backoff:
    """The pauses of one thing that fails now and then."""

    def __init__(self) -> None:
        self._pause, self._failed_at = 0.0, -inf

    def pause(self, now: float) -> float:
        """Return how many seconds to wait after a failure or a failed try at `now`."""
        # A loose plug fails again and again: a try that succeeds for a moment does not start from the beginning.
        again = now - self._failed_at < STEADY
        self._pause = min(2 * self._pause, LONGEST_PAUSE) if again else FIRST_PAUSE
        self._failed_at = now
        return self._pause
