"""How far a set of messages is from its limits: the slowest bus, the most traffic, and how many more still fit.

What is searched holds up to some number and not beyond it, so that halving finds it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from eurobot_od.frame import MOST_BYTES
from eurobot_od.traffic.load.message_set import MessageSet, PeriodicMessage, analysed
from eurobot_od.traffic.load.report import LoadReport, load_report

KBIT = 1000
HIGHEST_BIT_RATE = 1000
"""kbit/s of classic CAN."""
MOST_TIMES, MOST_MORE = 100_000, 4096
"""Where the search ends: percent of the traffic, and messages or nodes."""


class LoadLimits(NamedTuple):
    """How far a set can go at `bit_rate` bit/s; None where it does not hold as it is.

    `slowest`: kbit/s of the slowest bus on which it holds, None if no classic CAN is fast enough. `percent`: of its
    traffic, `first_missed` the message whose deadline can be missed with one percent more. `messages`: further ones of
    8 bytes, less urgent than all others and each every `shortest_period`, us, that of the set's most frequent one.
    `nodes`: further ones that send what the `busiest` does, each frame just after its in urgency.
    """

    bit_rate: int
    slowest: int | None
    percent: int | None
    first_missed: str
    messages: int | None
    shortest_period: int
    nodes: int | None
    busiest: str


SEARCHES = 4
"""Number of limits to be found."""


def limits(messages: MessageSet, bit_rate: int, progress: Callable[[int], object] = lambda _: None) -> LoadLimits:
    """Search the limits of a set that has messages; `progress` is called with the number of SEARCHES done."""
    shortest = min(each.period for each in messages.messages)
    loads: dict[str, float] = {}
    for each in messages.messages:
        loads[each.node] = loads.get(each.node, 0.0) + each.bits / each.period
    busiest = max(loads, key=lambda node: loads[node])
    slowest = slowest_bus(messages)
    progress(1)
    percent = most_traffic(messages, bit_rate)
    beyond = load_report(messages.faster((percent or 0) + 1), bit_rate)  # one percent more than holds
    progress(2)
    more_messages = _most(lambda n: _holds(with_messages(messages, n, shortest), bit_rate), MOST_MORE)
    progress(3)
    more_nodes = _most(lambda n: _holds(with_nodes(messages, n, busiest), bit_rate), MOST_MORE)
    progress(4)
    return LoadLimits(
        bit_rate=bit_rate,
        slowest=slowest,
        percent=percent,
        first_missed=first_missed(beyond),
        messages=more_messages,
        shortest_period=shortest,
        nodes=more_nodes,
        busiest=busiest,
    )


def slowest_bus(messages: MessageSet) -> int | None:
    """Return the kbit/s of the slowest bus on which a set holds, None if it does on no classic CAN."""
    slower = _most(lambda n: _holds(messages, (HIGHEST_BIT_RATE - n) * KBIT), HIGHEST_BIT_RATE - 1)
    return None if slower is None else HIGHEST_BIT_RATE - slower


def most_traffic(messages: MessageSet, bit_rate: int) -> int | None:
    """Return how many percent of its traffic a set holds with, None if it does not as it is."""
    more = _most(lambda n: _holds(messages.faster(100 + n), bit_rate), MOST_TIMES)
    return None if more is None else 100 + more


def first_missed(report: LoadReport) -> str:
    """Return the message that misses its deadline, the most urgent of several; empty if none does."""
    return next((row.message.name for row in report.rows if not row.holds), "")


def _holds(messages: MessageSet, bit_rate: int) -> bool:
    return analysed(messages, bit_rate).holds


def _most(holds: Callable[[int], bool], most: int) -> int | None:
    """Return the highest number from 0 to `most` up to which something holds, None if it does not at 0."""
    # Doubled first: most limits are far below `most`, and the larger a set is, the longer its analysis takes.
    step, end = 1, most + 1
    while step < end and holds(step - 1):
        step *= 2
    low, high = step // 2, end if step >= end else step - 1  # of the first number at which it does not hold
    while low < high:
        middle = (low + high) // 2
        low, high = (middle + 1, high) if holds(middle) else (low, middle)
    return low - 1 if low else None


# More of it


def with_messages(messages: MessageSet, number: int, period: int) -> MessageSet:
    """Return the set with further messages of 8 bytes, less urgent than all others, each with a node of its own."""
    first = 1 + max(each.identifier for each in messages.messages)  # may be one that no frame can have, as below
    more = [
        PeriodicMessage(f"further {n}", first + n, MOST_BYTES, period, period, f"further {n}") for n in range(number)
    ]
    return messages._replace(messages=(*messages.messages, *more))


def with_nodes(messages: MessageSet, number: int, node: str) -> MessageSet:
    """Return the set with further nodes that send what `node` does, each frame just after it in urgency."""
    ranks = {each: n for n, each in enumerate(sorted({each.identifier for each in messages.messages}))}
    mailboxes = dict(messages.mailboxes)
    more: list[PeriodicMessage] = []
    for each in messages.messages:
        first = ranks[each.identifier] * (number + 1)  # with room behind it for those of the further nodes
        more.append(each._replace(identifier=first))
        for n in range(1, number + 1 if each.node == node else 1):
            name = f"{node} {n + 1}"
            mailboxes |= {name: mailboxes[node]} if node in mailboxes else {}
            more.append(each._replace(name=f"{each.name} of {name}", identifier=first + n, node=name, answers=""))
    return messages._replace(messages=tuple(more), mailboxes=mailboxes)


# As text


def sentences(found: LoadLimits) -> Iterator[str]:
    """Say the limits, a line each."""
    slowest = "on no classic CAN" if found.slowest is None else f"down to {found.slowest} kbit/s"
    yield f"all deadlines are met {slowest}"
    if found.percent is None or found.messages is None or found.nodes is None:
        yield f"at {found.bit_rate // KBIT} kbit/s nothing fits any more"
        return
    at = f"at {found.bit_rate // KBIT} kbit/s"
    yield f"{at}: with {found.percent / 100:.2f} times the traffic; with more, {found.first_missed} can be late"
    yield f"{at}: with {found.messages} more messages of 8 bytes, each every {found.shortest_period / KBIT:g} ms"
    yield f"{at}: with {found.nodes} more nodes like {found.busiest or 'the only one'}"
