"""The soonest time that a node has planned for.

After each frame the thread that receives compares one number, instead of asking every timer of the node, to tell
whether the thread that keeps the time has to be woken.

Rule of this file: never later than the first thing that is due. Sooner is allowed, as a plan may be dropped: that costs
one look in vain.
"""

from __future__ import annotations

from math import inf


class Plan:
    """Timers note their times with `at`; the time's keeper compares `soonest`, and sets it when it asks the node."""

    __slots__ = ("soonest",)

    def __init__(self) -> None:
        self.soonest = inf

    def at(self, time: float) -> None:
        """Note that something is due at a time in seconds."""
        if time < self.soonest:
            self.soonest = time
