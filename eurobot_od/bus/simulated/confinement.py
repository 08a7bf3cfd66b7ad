"""Fault confinement: the error counters of a controller, and what they make of it (ISO 11898-1, fault confinement).

Rule of this file: what each rule of the standard counts stands in one table. Values are frozen.
"""

from __future__ import annotations

from enum import Enum
from functools import cache
from typing import NamedTuple

PASSIVE_ABOVE = 127
OFF_ABOVE = 255

RECOVERY_SEQUENCES, RECOVERY_BITS = 128, 11
"""A controller that is bus-off comes back after 128 sequences of 11 recessive bits."""

RECEIVE_LIMIT = 255
"""The receive counter goes no further: it has eight bits, and above 127 its value means nothing more."""


class ErrorState(Enum):
    """What a controller may do: all, all but disturb the others, nothing."""

    ACTIVE = "error active"
    PASSIVE = "error passive"
    OFF = "bus-off"


class CountingRule(Enum):
    """What is counted, by the standard's letters of its rules."""

    RECEIVER_ERROR = "a: a receiver finds an error, but none in a flag of its own"
    RECEIVER_DOMINANT_AFTER_FLAG = "b: the first bit after a receiver's error flag is dominant"
    TRANSMITTER_ERROR = "c: a transmitter sends an error flag"
    TRANSMITTER_FLAG_ERROR = "d: a transmitter finds a bit error in a flag of its own"
    RECEIVER_FLAG_ERROR = "e: a receiver finds a bit error in a flag of its own"
    TRANSMITTER_STUCK = "f: eight more dominant bits behind a transmitter's flag"
    RECEIVER_STUCK = "f: eight more dominant bits behind a receiver's flag"
    TRANSMITTED = "g: a frame is transmitted"
    RECEIVED = "h: a frame is received"


class Increment(NamedTuple):
    """What is added to the transmit and to the receive error counter."""

    transmit: int
    receive: int


STEPS = {
    # 1 for a receiver, 8 for a transmitter: a sender that nobody can read should be the first to fall silent.
    CountingRule.RECEIVER_ERROR: Increment(0, 1),
    CountingRule.RECEIVER_DOMINANT_AFTER_FLAG: Increment(0, 8),
    CountingRule.TRANSMITTER_ERROR: Increment(8, 0),
    CountingRule.TRANSMITTER_FLAG_ERROR: Increment(8, 0),
    CountingRule.RECEIVER_FLAG_ERROR: Increment(0, 8),
    CountingRule.TRANSMITTER_STUCK: Increment(8, 0),
    CountingRule.RECEIVER_STUCK: Increment(0, 8),
    # A good frame takes back 1: with more than one error to eight of them the counter rises in the long run.
    CountingRule.TRANSMITTED: Increment(-1, 0),
    CountingRule.RECEIVED: Increment(0, -1),
}


class Counters(NamedTuple):
    """The transmit and the receive error counter of a controller."""

    transmit: int = 0
    receive: int = 0

    @property
    def state(self) -> ErrorState:
        """What a controller with these counters may do."""
        # Only by the transmit counter: a receiver that is error passive has recessive flags, which disturb nobody.
        if self.transmit > OFF_ABOVE:
            return ErrorState.OFF
        # By either counter: one that sees errors nobody else sees must not go on destroying good frames.
        return ErrorState.PASSIVE if max(self) > PASSIVE_ABOVE else ErrorState.ACTIVE

    @cache  # noqa: B019 (they are values: of each pair, at most 256 by 256, there is one)
    def after(self, rule: CountingRule) -> Counters:
        """Return the counters after an event; a frame received makes a receive counter above 127 one of 127."""
        step = STEPS[rule]
        # The standard leaves open to which value between 119 and 127 it goes back.
        received = min(self.receive, PASSIVE_ABOVE + 1) if step.receive < 0 else self.receive
        return Counters(max(self.transmit + step.transmit, 0), min(max(received + step.receive, 0), RECEIVE_LIMIT))


FRESH = Counters()
"""The counters of a controller that has just been switched on."""
