"""A CAN controller on the simulated bus, between two attempts to send.

Rule of this file: what lasts from one frame to the next stands here; what a controller does within a frame is in
`access`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from eurobot_od.bus.simulated.confinement import FRESH, RECOVERY_SEQUENCES, Counters, CountingRule, ErrorState
from eurobot_od.frame import Frame


class FrameSource(Protocol):
    """Where a controller's frames come from; `gatekeeper.Mailboxes` is one."""

    def urgent(self) -> Frame | None:
        """Return the frame to be sent first, None without one; asked as often as anybody likes."""

    def complete(self, frame: Frame) -> object:
        """Take note that a frame is through."""


class Nothing:
    """The source of a controller that only listens."""

    def urgent(self) -> Frame | None:
        return None

    def complete(self, frame: Frame) -> None:
        """Do nothing: nothing was sent."""


@dataclass
class Babble:
    """The source of a node that babbles: the same frame again and again."""

    frame: Frame

    def urgent(self) -> Frame | None:
        return self.frame

    def complete(self, frame: Frame) -> None:
        """Do nothing: there is always one more."""


@dataclass(eq=False)
class Controller:
    """A controller that takes its frames from `source`. Times are seconds.

    It takes no part in the bus before `silent_until`, and begins to send not before `suspended_until`. When it is
    bus-off, it waits for `recovery` more sequences of recessive bits.
    """

    source: FrameSource
    silent_until: float = 0.0
    suspended_until: float = 0.0
    counters: Counters = FRESH
    recovery: int = 0

    @property
    def state(self) -> ErrorState:
        """What it may do."""
        return self.counters.state

    def may_send(self, now: float) -> bool:
        """Tell whether it may begin to send if the bus is free."""
        return self.silent_until <= now >= self.suspended_until and not self.recovery

    def count(self, rule: CountingRule) -> None:
        """Count an event by a rule of the standard."""
        self.counters = self.counters.after(rule)
        if self.counters.state is ErrorState.OFF:
            # At once, without asking its program, as many controllers can be set to do.
            self.recovery = RECOVERY_SEQUENCES

    def recovers(self, sequences: int) -> bool:
        """Count sequences of recessive bits, and tell whether they have brought it back."""
        self.recovery = max(self.recovery - sequences, 0)
        # Back from bus-off, both counters begin at 0 (ISO 11898-1).
        if not self.recovery:
            self.counters = FRESH
        return not self.recovery
