"""A simulated bus, or one of the parts it has been cut into: who sends next, and when its frame has ended.

The lowest identifier wins, and a frame takes its bits, stuff bits included. Nothing is spoiled on the wire: there are
no error frames and no error counters. Of two frames with one identifier and different data, which are an error on a
real bus, the lower one goes first.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple, Protocol, TypeAlias

from eurobot_od.bus.bits import INTERMISSION, frame_bits
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
    """A CAN controller that takes its frames from `source`; until `silent_until`, in s, it stays off the bus."""

    source: FrameSource
    silent_until: float = 0.0


class Attempt(NamedTuple):
    """A frame that is being sent: by whom (several may send the same bits), and who hears it."""

    frame: Frame
    senders: Sequence[Controller]
    receivers: Sequence[Controller]


Ended: TypeAlias = Callable[[Frame, Sequence[Controller], Sequence[Controller]], None]
"""Takes a frame that has ended: who has sent it, and whom it has reached."""


class Bus:
    """Controllers that hear each other, at `bitrate` bit/s; `ended` is called with each frame that is through.

    All methods take the time in seconds. `next_event` is when `advance` has something to do, infinite if nothing is
    under way. Nothing is sent before `off_until`.
    """

    def __init__(self, bitrate: int, ended: Ended) -> None:
        self.bitrate, self.controllers = bitrate, list[Controller]()
        self.off_until = 0.0
        self.next_event = inf
        self._ended = ended
        self._attempt: Attempt | None = None  # None in the intermission

    def is_free(self, now: float) -> bool:
        """Tell whether an attempt may begin."""
        return self.next_event == inf and self.off_until <= now

    def arbitrate(self, now: float) -> None:
        """Let those who have frames begin, if the bus is free."""
        if not self.is_free(now):
            return
        here = [each for each in self.controllers if each.silent_until <= now]
        offers = {each: frame for each in here if (frame := each.source.urgent()) is not None}
        if offers:
            # Frames compare by their identifier first, so the least one wins the arbitration.
            frame = min(offers.values())
            # Two nodes with the same identifier and data win together, and nobody notices: their bits are equal.
            senders = [each for each, offer in offers.items() if offer == frame]
            self._attempt = Attempt(frame, senders, [each for each in here if each not in senders])
            self.next_event = now + (frame_bits(frame) - INTERMISSION) / self.bitrate

    def advance(self, now: float) -> None:
        """Do what is due by now: end the frame under way, and free the bus after the intermission behind it."""
        while self.next_event <= now:
            attempt, self._attempt = self._attempt, None
            # Before anybody is called: an observer may cut the bus.
            self.next_event = inf if attempt is None else self.next_event + INTERMISSION / self.bitrate
            if attempt and attempt.receivers:  # a frame that nobody acknowledges is sent again
                self._ended(*attempt)

    def drop(self) -> None:
        """Have what is under way come to nothing; it is sent again."""
        self._attempt, self.next_event = None, inf
