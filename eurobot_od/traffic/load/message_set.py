"""What is sent on a bus: its messages with their periods, and what is given of nodes and errors.

Times are whole microseconds here; `analysed` turns them into bit times of a bit rate.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from typing import NamedTuple

from eurobot_od.bus.bits import longest_frame
from eurobot_od.traffic.load.analysis import Analysis, BitErrors, Message

MICROSECONDS = 1_000_000
"""Microseconds of a second."""


class PeriodicMessage(NamedTuple):
    """A message that one node sends; `length` in bytes, times in us.

    It falls due every `period`, is in a mailbox at most `jitter` later, and has to be through after `deadline`. One
    that `answers` another is due with it, and its `jitter` is what the node takes to answer. `reason` says why it is
    sent so often.
    """

    name: str
    identifier: int
    length: int
    period: int
    deadline: int
    node: str = ""
    jitter: int = 0
    answers: str = ""
    reason: str = ""

    @property
    def bits(self) -> int:
        """The longest that its frame can be, in bits."""
        return longest_frame(self.length)


class ErrorRate(NamedTuple):
    """At most `number` bit errors `within` any such time, us."""

    number: int = 0
    within: int = MICROSECONDS


class MessageSet(NamedTuple):
    """All that is sent on a bus; `mailboxes` of nodes that have a limited number, `bit_rate` in bit/s if it is said.

    `messages` come in the order of their urgency. `offered` are the bit rates that the EDS files of all devices have.
    """

    messages: tuple[PeriodicMessage, ...]
    mailboxes: Mapping[str, int] = MappingProxyType({})
    errors: ErrorRate = ErrorRate()
    bit_rate: int | None = None
    offered: tuple[int, ...] = ()

    def faster(self, percent: int) -> MessageSet:
        """Return the set with a percentage of its traffic.

        Every period is that much shorter, and so is a deadline that is the period.
        """

        def scaled(each: PeriodicMessage) -> PeriodicMessage:
            period = max(each.period * 100 // percent, 1)  # 0 would be infinitely often
            return each._replace(period=period, deadline=period if each.deadline == each.period else each.deadline)

        return self._replace(messages=tuple(map(scaled, self.messages)))


def by_urgency(messages: Iterable[PeriodicMessage]) -> tuple[PeriodicMessage, ...]:
    """Return messages in the order of their urgency, the most urgent first."""
    return tuple(sorted(messages, key=lambda each: each.identifier))


def analysed(messages: MessageSet, bit_rate: int) -> Analysis:
    """Return the analysis of a set at a bit rate in bit/s."""

    def bits(time: int) -> int:
        return time * bit_rate // MICROSECONDS

    def bits_up(time: int) -> int:
        return -(-time * bit_rate // MICROSECONDS)

    names = {each.name: n for n, each in enumerate(messages.messages)}
    # Periods and deadlines are rounded down and jitters up: a bound has to hold for the exact times as well.
    return Analysis(
        [
            Message(
                each.identifier,
                each.bits,
                max(bits(each.period), 1),
                bits(each.deadline),
                bits_up(each.jitter),
                each.node,
                names[each.answers] if each.answers else None,
            )
            for each in messages.messages
        ],
        BitErrors(messages.errors.number, max(bits(messages.errors.within), 1)),
        messages.mailboxes,
    )
