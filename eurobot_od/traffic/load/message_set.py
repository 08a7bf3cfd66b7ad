"""What is sent on a bus: its messages with their periods, and what is given of nodes and errors.

Times are whole microseconds; the analysis takes the same messages with their times in bit times.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from eurobot_od.bus.bits import longest_frame

MICROSECONDS = 1_000_000
"""Microseconds of a second."""


class PeriodicMessage(NamedTuple):
    """A message that one node sends; `bits` are those of its longest frame, with `length` bytes of data.

    It falls due every `period`, is in a mailbox at most `jitter` later, and has to be through after `deadline`. One
    that `answers` another, by its name, is due with it, and its `jitter` is what the node takes to answer. `reason`
    says why it is sent so often. The period is 0 where it is not known yet.
    """

    identifier: int
    bits: int
    period: int = 0
    deadline: int = 0
    jitter: int = 0
    node: str = ""
    name: str = ""
    length: int = 0
    answers: str = ""
    reason: str = ""

    @classmethod
    def of(cls, name: str, identifier: int, length: int, node: str = "", answers: str = "") -> PeriodicMessage:
        """Return a message with `length` bytes of data, without a period."""
        return cls(identifier, longest_frame(length), node=node, name=name, length=length, answers=answers)

    def every(self, period: int, reason: str = "") -> PeriodicMessage:
        """Return the message with a period, and with that for a deadline."""
        return self._replace(period=period, deadline=period, reason=reason)


class ErrorRate(NamedTuple):
    """At most `number` bit errors in any time as long as `interval`."""

    number: int = 0
    interval: int = MICROSECONDS

    def within(self, time: int) -> int:
        """Return how many errors there can be in a time."""
        return self.number * -(-time // self.interval)


NO_ERRORS = ErrorRate()


class MessageSet(NamedTuple):
    """All that is sent on a bus; `mailboxes` of nodes that have a limited number, `bit_rate` in bit/s if it is said.

    `messages` come in the order of their urgency. `offered` are the bit rates that the EDS files of all devices have.
    """

    messages: tuple[PeriodicMessage, ...]
    mailboxes: Mapping[str, int] = MappingProxyType({})
    errors: ErrorRate = NO_ERRORS
    bit_rate: int | None = None
    offered: tuple[int, ...] = ()
