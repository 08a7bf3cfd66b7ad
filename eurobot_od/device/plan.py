"""The soonest time that has been planned for, so that nobody has to look at all plans after each frame.

Rule of this file: never later than the first thing that is due; sooner is allowed, as what was planned may be dropped.
"""

from __future__ import annotations

from math import inf


class Plan:
    """Who makes plans notes them with `at`; who keeps the time looks at `soonest`, and sets it when it has looked."""

    __slots__ = ("soonest",)

    def __init__(self) -> None:
        self.soonest = inf

    def at(self, time: float) -> None:
        """Note that something is due at a time in seconds."""
        if time < self.soonest:
            self.soonest = time
