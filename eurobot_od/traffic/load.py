"""How much a CAN bus carries, and how late each message can be: worst-case response times that are proved.

The file has the messages (`MessageSet`), the analysis in bit times, its results in usual units (`LoadReport`), and at
the end what makes a MessageSet of EDS files and a network file (`network_set`): a TPDO with an event timer or a SYNC
falls due by itself, no more often than its inhibit time; so do heartbeats (0x1017), SYNC (0x1006), and EMCY with an
inhibit time (0x1015). All else has a row in the network file's `traffic`. A message without a known period is refused,
as no bound holds without it.

Rule of this file: times are whole numbers, microseconds where people give them and bit times in the analysis, and
everything is rounded to the worse side: periods and deadlines down, jitter up.

Source: Davis, Burns, Bril, Lukkien, "Controller Area Network (CAN) schedulability analysis: refuted, revisited and
revised", Real-Time Systems 35, 2007. The test of 1994 looks at one instance of a message; as a frame cannot be
interrupted, a later instance in the same busy period can be later still, first of all that of the least urgent ones.

For a message m with longest frame C, period T and release jitter J:

    B    = max C(k) of the less urgent k                                          blocking
    t    = E(t) + B + sum over k as urgent as m, m itself too, of ceil((t + J(k)) / T(k)) C(k)      busy period
    w(q) = E(w + C) + B + q C + sum over the other k of ceil((w + J(k) + 1) / T(k)) C(k)     instance q = 0, 1, ...
    R    = max over the q with q T < t + J of  J + w(q) - q T + C                 response time

Each equation has the least value that solves it. `E(t)` is the time that errors cost (Tindell, Burns, Wellings 1995;
Broster 2003): `ErrorRate.within(t)` of them, each with the longest recovery and the longest frame as urgent as m, which
is sent again. R is counted from the moment the message falls due and ends with the intermission behind its frame.

Limited transmit mailboxes without abort (Khan, Davis, Navet 2011 treat the same case the same way, as jitter). While
all mailboxes of a node hold less urgent frames, m has to wait, and frames less urgent than m win the bus: priority
inversion. It ends for good with the first of these frames that is sent: from then on one of the node's mailboxes holds
m, or a frame that is more urgent. So the bus serves the messages in the order of their urgency, as the equations ask,
if m counts as released when that wait ends: as m with further jitter. The wait is no longer than k, the most urgent of
the frames in the mailboxes, is ready to be sent, which is at most w(q) - max(0, q T - J) + C for k: its instance q is
released neither before the busy period nor before it falls due. Nor is it longer than

    a = E(a + C(k)) + B(k) + sum over j of other nodes, as urgent as k, of ceil((a + R(j) + 1) / T(j)) C(j),

and C(k): what the node itself has that is more urgent waits for a mailbox, too, and of j only instances that fell due
less than R(j) before the wait can be sent in it. The lesser of the two counts. A message of which at most one instance
is on its way (R <= T) takes one mailbox; if any of the node's can be later than its next instance, every less urgent
one may fill them all.

An answer is released by the message that it answers, at the latest when that has its response time and the node its own
time (Tindell and Clark's holistic analysis, 1994): its jitter is the sum of both, and its response time is counted from
the moment the request fell due.

There are only bit times and whole numbers, and every sum grows with every jitter; so the loop over all of them starts
from the messages' own jitter and ends at the least solution. If there is none, there is "no bound": a bus that is full,
a time over `HORIZON`, more than `INSTANCES` in a busy period, and a jitter that still grows after `ROUNDS`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cached_property
from math import ceil, floor, lcm, log10
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

from eurobot_od.bus import longest_frame
from eurobot_od.errors import DictionaryError, FileError, LocalError
from eurobot_od.od import standard, values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.network import NetworkFile, TrafficEntry
from eurobot_od.od.pdos import Pdo
from eurobot_od.od.sdo_channels import SdoChannel
from eurobot_od.od.values import PdoDirection
from eurobot_od.support import svg, texts
from eurobot_od.support.texts import columns

# What is sent on a bus. Times are whole microseconds; the analysis takes the same messages with times in bit times.


MICROSECONDS = 1_000_000
"""Microseconds per second."""


class PeriodicMessage(NamedTuple):
    """A message of one node; `bits` are those of its longest frame, with `length` bytes of data.

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
        """Return the message with a period that is also its deadline."""
        return self._replace(period=period, deadline=period, reason=reason)


class ErrorRate(NamedTuple):
    """A maximum of `number` bit errors in any time of length `interval`."""

    number: int = 0
    interval: int = MICROSECONDS

    def within(self, time: int) -> int:
        """Return the maximum number of errors in a time."""
        return self.number * -(-time // self.interval)


NO_ERRORS = ErrorRate()


class MessageSet(NamedTuple):
    """All messages of a bus, the `mailboxes` of nodes with a limited number, and the bit rate in bit/s.

    `messages` come in the order of their urgency. `offered` are the bit rates that the EDS files of all devices have.
    """

    messages: tuple[PeriodicMessage, ...]
    mailboxes: Mapping[str, int] = MappingProxyType({})
    errors: ErrorRate = NO_ERRORS
    bit_rate: int | None = None
    offered: tuple[int, ...] = ()


RECOVERY_BITS = 31
"""The longest that an error keeps the bus busy besides the frame that is sent again: error flags that follow each other
(12), delimiter (8), intermission (3), and the 8 bits for which an error passive node suspends its transmission."""

HORIZON = 10**7
"""Length in bit times from which a busy period counts as endless; 10 s at 1 Mbit/s."""

INSTANCES = 1000
"""Number of instances of a message in one busy period from which it counts as endless."""

ROUNDS = 256
"""Number of iterations after which jitters are assumed to grow for ever."""

FULL = 1
"""Load from which no message is bounded."""

BIT = 1
"""A frame that is ready within the first bit of another's arbitration still takes part in it."""


class Bound(NamedTuple):
    """Proved bounds of a message, in bit times; None without a bound.

    `response` is counted from when the message falls due, `waiting` from its release, `busy` is the busy period.
    `blocking` is the place of the less urgent message that can hold the bus when it falls due, `inversion` that of the
    message of its own node that can fill the last mailbox; None if there is no such message.
    """

    response: int | None = None
    waiting: int | None = None
    busy: int | None = None
    blocking: int | None = None
    inversion: int | None = None


UNBOUND = Bound()


class Interference(NamedTuple):
    """Effect of the messages that are at least as urgent as one message on it.

    `load` is the share of the bus that they and the errors take, `load_of_others` without the message itself;
    `blocking` is the longest less urgent message and `blocked` its bits; `recovery` is what an error costs.
    """

    message: PeriodicMessage
    others: tuple[int, ...]
    blocking: int | None
    blocked: int
    load: Fraction
    load_of_others: Fraction
    recovery: int


Waits: TypeAlias = tuple[int, int, int]
"""A message that another waits for: its bits, period and jitter."""


@dataclass(frozen=True)
class Analysis:
    """The analysis of messages with times in bit times.

    `mailboxes` says how many a node has; a node that is not named has enough.
    """

    messages: Sequence[PeriodicMessage]
    errors: ErrorRate = NO_ERRORS
    mailboxes: Mapping[str, int] = field(default_factory=dict)

    @cached_property
    def load(self) -> Fraction:
        """Share of the bus that all messages take, errors not counted."""
        return self._share(self.messages)

    @cached_property
    def bounds(self) -> tuple[Bound, ...]:
        """Proved bounds of each message, in the order of the list."""
        late: frozenset[str] = frozenset()
        while True:  # at most once for each node
            solution = _Solution(self, late)
            if solution.late <= late:
                return solution.bounds()
            late |= solution.late

    @cached_property
    def levels(self) -> tuple[Interference, ...]:
        """Interference for each message."""
        return tuple(map(self._level, range(len(self.messages))))

    def _level(self, place: int) -> Interference:
        message = self.messages[place]
        # `<=`, as nodes that share an identifier wait for each other.
        urgent = [n for n, each in enumerate(self.messages) if each.identifier <= message.identifier]
        others = tuple(n for n in urgent if n != place)
        less = [n for n, each in enumerate(self.messages) if each.identifier > message.identifier]
        # At most one, begun before the message falls due, as the message wins the next arbitration.
        blocking = max(less, key=lambda n: self.messages[n].bits, default=None)
        blocked = 0 if blocking is None else self.messages[blocking].bits
        recovery = RECOVERY_BITS + max(self.messages[n].bits for n in urgent)
        load = Fraction(self.errors.number * recovery, self.errors.interval)
        load += self._share(self.messages[n] for n in others)
        return Interference(message, others, blocking, blocked, load + self._share([message]), load, recovery)

    def _share(self, messages: Iterable[PeriodicMessage]) -> Fraction:
        """Return the exact share of the bus that messages take, as FULL is a sharp limit."""
        return Fraction(sum(each.bits * (self._hyperperiod // each.period) for each in messages), self._hyperperiod)

    @cached_property
    def _hyperperiod(self) -> int:
        return lcm(*(each.period for each in self.messages))

    def rivals(self, place: int, late: bool) -> list[int]:
        """Return less urgent messages that can be the most urgent ones in their node's mailboxes.

        `late`: one message may take more than one mailbox.
        """
        node, identifier = self.messages[place].node, self.messages[place].identifier
        if node not in self.mailboxes:
            return []
        less = [n for n, each in enumerate(self.messages) if each.node == node and each.identifier > identifier]
        less.sort(key=lambda n: self.messages[n].identifier, reverse=True)
        # The most urgent of n frames in n mailboxes cannot be among the n - 1 least urgent that there are.
        return less if late else less[self.mailboxes[node] - 1 :]


def analysed(messages: MessageSet, bit_rate: int) -> Analysis:
    """Return the analysis of a set at a bit rate in bit/s."""

    def bits(time: int) -> int:
        return time * bit_rate // MICROSECONDS

    def in_bits(each: PeriodicMessage) -> PeriodicMessage:
        # Periods and deadlines are rounded down and jitters up, so that bounds hold for the exact times.
        return each._replace(period=max(bits(each.period), 1), deadline=bits(each.deadline), jitter=-bits(-each.jitter))

    errors = messages.errors._replace(interval=max(bits(messages.errors.interval), 1))
    return Analysis([in_bits(each) for each in messages.messages], errors, messages.mailboxes)


class _Solution:
    """The least jitters and times that satisfy all equations.

    `late` names the nodes in whose mailboxes there may be more than one instance of a message.
    """

    def __init__(self, analysis: Analysis, late: frozenset[str]) -> None:
        self._messages, self._levels, self._errors = analysis.messages, analysis.levels, analysis.errors
        self._places = {each.name: place for place, each in enumerate(self._messages)}
        self._rivals = [analysis.rivals(n, each.node in late) for n, each in enumerate(self._messages)]
        self._jitters: list[int | None] = [each.jitter for each in self._messages]
        self._solve()
        rounds = 0
        while (jitters := [self._jitter(n) for n in range(len(self._messages))]) != self._jitters:
            rounds += 1
            kept = [new if rounds <= ROUNDS or new == old else None for new, old in zip(jitters, self._jitters)]
            self._jitters = kept
            self._solve()

    def _solve(self) -> None:
        self._times = []
        for level, own in zip(self._levels, self._jitters):
            waits = self._waits(level, level.others, self._jitters)
            bounded = waits is not None and own is not None
            self._times.append(_times(level, own or 0, waits or [], self._errors) if bounded else UNBOUND)
        self._in_mailbox = {n: self._mailbox_time(n) for n in {each for rivals in self._rivals for each in rivals}}

    def _waits(self, level: Interference, places: Sequence[int], early: Sequence[int | None]) -> list[Waits] | None:
        """Return the messages that a message waits for; None if the bus is full or one of them has no bound."""
        others = [(self._messages[n], each) for n in places if (each := early[n]) is not None]
        waits = [(message.bits, message.period, each) for message, each in others]
        return waits if len(waits) == len(places) and level.load < FULL else None

    @property
    def late(self) -> frozenset[str]:
        """Nodes with a message that may still be queued when its next instance falls due."""
        pairs = zip(self._messages, self._times)
        return frozenset(m.node for m, times in pairs if times.response is None or times.response > m.period)

    def bounds(self) -> tuple[Bound, ...]:
        """Return the proved bounds."""
        return tuple(
            times._replace(blocking=level.blocking, inversion=max(rivals, key=self._waiting, default=None))
            for times, level, rivals in zip(self._times, self._levels, self._rivals)
        )

    def _jitter(self, place: int) -> int | None:
        """Return a message's jitter: its own, that of its request, and the wait for a mailbox."""
        if self._jitters[place] is None:  # jitters never decrease
            return None
        message = self._messages[place]
        answered = _or_never(self._times[self._places[message.answers]].response) if message.answers else 0
        jitter = message.jitter + answered + max(map(self._waiting, self._rivals[place]), default=0)
        return jitter if jitter <= HORIZON else None

    def _waiting(self, place: int) -> int:
        """Return the maximum time in its mailbox while its node has no more urgent frame in the others."""
        return min(_or_never(self._times[place].waiting), _or_never(self._in_mailbox[place]))

    def _mailbox_time(self, place: int) -> int | None:
        level = self._levels[place]
        outside = [n for n in level.others if self._messages[n].node != level.message.node]
        waits = self._waits(level, outside, [each.response for each in self._times])
        if waits is None:
            return None
        queued = _least(_queued(level, 0, waits, self._errors), level.blocked, 0, level.load)
        return None if queued is None else queued + level.message.bits


def _times(level: Interference, jitter: int, others: Sequence[Waits], errors: ErrorRate) -> Bound:
    """Solve the equations of one message."""
    bits, period = level.message.bits, level.message.period
    behind = sum(j * c // t for c, t, j in others)  # rounded down, so that no search starts beyond its solution

    def in_busy_period(time: int) -> int:
        work = sum(_ceil(time + j, t) * c for c, t, j in (*others, (bits, period, jitter)))
        return errors.within(time) * level.recovery + level.blocked + work

    busy = _least(in_busy_period, bits, level.blocked + behind, level.load)
    if busy is None or busy + jitter > INSTANCES * period:
        return UNBOUND
    response = waiting = queued = 0
    for instance in range(_ceil(busy + jitter, period)):
        ahead = instance * bits
        found = _least(
            _queued(level, ahead, others, errors), queued, level.blocked + ahead + behind, level.load_of_others
        )
        if found is None:
            return UNBOUND
        queued = found  # w grows with the instance, so the search for the next one starts here
        sent = queued + bits
        due = instance * period - jitter
        response = max(response, sent - due)
        waiting = max(waiting, sent - max(due, 0))
    return Bound(response, waiting, busy)


def _queued(level: Interference, ahead: int, others: Sequence[Waits], errors: ErrorRate) -> Callable[[int], int]:
    """Return the function whose least solution is the time until a message's frame is finally sent."""

    def until_sent(time: int) -> int:
        waits = sum(_ceil(time + j + BIT, t) * c for c, t, j in others)
        return errors.within(time + level.message.bits) * level.recovery + level.blocked + ahead + waits

    return until_sent


def _least(function: Callable[[int], int], start: int, least: int, load: Fraction) -> int | None:
    """Return the least solution of time = function(time), None beyond the horizon; `start` is a lower bound.

    As function(time) is at least `least` + `load` * time, no solution is earlier than `least` / (1 - `load`): to begin
    there keeps the loop short near a full bus.
    """
    time = max(start, least * load.denominator // (load.denominator - load.numerator))
    while time <= HORIZON:
        later = function(time)
        if later <= time:
            return time
        time = later
    return None


def _or_never(time: int | None) -> int:
    return HORIZON + 1 if time is None else time


def _ceil(dividend: int, divisor: int) -> int:
    return -(-dividend // divisor)


NO_BOUND = "no bound"
MISSED = "MISSED"


class BoundRow(NamedTuple):
    """A message and its proved bounds, in us; `response` is None without a bound.

    `blocking` names the less urgent message that can hold the bus, `inversion` the one of its own node that can keep it
    out of the mailboxes; empty if there is none.
    """

    message: PeriodicMessage
    response: int | None
    blocking: str
    inversion: str

    @property
    def margin(self) -> int | None:
        """Deadline minus response, in us; negative if it can be missed, None without a bound."""
        return None if self.response is None else self.message.deadline - self.response

    @property
    def holds(self) -> bool:
        """Whether the deadline is always met."""
        return self.margin is not None and self.margin >= 0


class LoadReport(NamedTuple):
    """Results at a bit rate in bit/s: the share `load`, and the longest `busy` period in us (None: endless)."""

    bit_rate: int
    load: Fraction
    busy: int | None
    rows: tuple[BoundRow, ...]

    @property
    def holds(self) -> bool:
        """Whether all deadlines are always met."""
        return all(row.holds for row in self.rows)


def load_report(messages: MessageSet, bit_rate: int) -> LoadReport:
    """Analyse a set at a bit rate in bit/s."""
    analysis = analysed(messages, bit_rate)

    def name(place: int | None) -> str:
        return "" if place is None else messages.messages[place].name

    def microseconds(bits: int | None) -> int | None:
        # Rounded up, so that the bound still holds.
        return None if bits is None else -(-bits * MICROSECONDS // bit_rate)

    rows = tuple(
        BoundRow(message, microseconds(bound.response), name(bound.blocking), name(bound.inversion))
        for message, bound in zip(messages.messages, analysis.bounds)
    )
    periods = [bound.busy for bound in analysis.bounds]
    longest = None if None in periods else max((each for each in periods if each is not None), default=0)
    return LoadReport(bit_rate, analysis.load, microseconds(longest), rows)


# As text

HEADINGS = ("ID", "message", "from", "period", "response", "deadline", "margin", "held up by")


def table(report: LoadReport) -> Iterator[str]:
    """Yield a line for each message, with times in ms, and a summary."""
    lines: list[tuple[str, ...]] = [HEADINGS]
    for row in report.rows:
        message, left = row.message, row.margin
        response = NO_BOUND if row.response is None else ms(row.response)
        margin = MISSED
        if left is not None:
            margin = f"{MISSED} {ms(left)}" if left < 0 else ms(left)
        held_up = ", ".join(filter(None, (row.blocking, row.inversion and f"{row.inversion} in the mailboxes")))
        times = ms(message.period), response, ms(message.deadline), margin
        lines.append((f"{message.identifier:03X}", message.name, message.node, *times, held_up))
    yield from columns(lines, "lllrrrr")
    yield ""
    yield summary(report)


def summary(report: LoadReport) -> str:
    """Return the load, and whether all deadlines are met, in one line."""
    missed = sum(not row.holds for row in report.rows)
    verdict = f"{missed} of {len(report.rows)} deadlines can be missed" if missed else "all deadlines are met"
    busy = "without end" if report.busy is None else f"at most {ms(report.busy)} ms at a stretch"
    return f"{report.bit_rate / 1000:g} kbit/s, load {float(report.load):.1%}, busy {busy}: {verdict}"


def too_slow(messages: MessageSet) -> Iterator[str]:
    """Yield a line for each offered bit rate at which deadlines can be missed."""
    for report in (load_report(messages, each) for each in messages.offered):
        if not report.holds:
            yield f"the EDS files offer a bit rate that is too slow: {summary(report)}"


def ms(microseconds: int) -> str:
    """Format microseconds as milliseconds."""
    return f"{microseconds / 1000:.2f}"


# As data


def as_data(report: LoadReport) -> dict[str, Any]:
    """Return the report as plain data; times in us."""
    return {
        "bit_rate": report.bit_rate,
        "load": round(float(report.load), 6),
        "busy_us": report.busy,
        "deadlines_met": report.holds,
        "messages": list(map(_row_data, report.rows)),
    }


def _row_data(row: BoundRow) -> dict[str, Any]:
    message = row.message
    said = {name: getattr(message, name) for name in ("name", "identifier", "node", "length", "bits", "reason")}
    said |= {f"{name}_us": getattr(message, name) for name in ("period", "jitter", "deadline")}
    said |= {"response_us": row.response, "margin_us": row.margin, "answers": message.answers or None}
    return said | {"blocking": row.blocking or None, "inversion": row.inversion or None}


# Chart with a bar for each message up to its bound, and a mark at its deadline, on a log scale

LEFT, TOP, ROW, PLOT, RIGHT, BOTTOM = 320, 76, 20, 620, 84, 44
"""Margins, height of a row and width of the plot, in pixels."""

BAR = 12

LEGEND = "bar: worst-case response time; upright mark: deadline"


def decades(report: LoadReport) -> range:
    """Return the powers of ten, in microseconds, that the chart spans."""
    times = [t for row in report.rows for t in (row.response, row.message.deadline) if t]
    low = floor(log10(min(times, default=1) / 2))  # so that the shortest bar can be seen
    return range(low, max(ceil(log10(max(times, default=1))), low + 1) + 1)


def chart(report: LoadReport, title: str) -> str:
    """Return the chart as an SVG document."""
    powers = decades(report)
    bottom = TOP + ROW * len(report.rows)
    scale = svg.Axis(powers[0], powers[-1], LEFT, LEFT + PLOT)
    return svg.document(
        title,
        svg.heading(title),
        svg.text((20, 50), summary(report), font_size=svg.TEXT, fill=svg.PALE),
        *svg.axis_across(((scale.at(power), f"{10**power / 1000:g} ms") for power in powers), TOP, bottom),
        svg.text((LEFT, bottom + 38), LEGEND, font_size=svg.TEXT, fill=svg.PALE),
        *(_row(row, scale, TOP + ROW * place) for place, row in enumerate(report.rows)),
        width=LEFT + PLOT + RIGHT,
        height=bottom + BOTTOM,
    )


def _row(row: BoundRow, scale: svg.Axis, y: int) -> str:
    message = row.message
    colour = svg.BLUE if row.holds else svg.RED
    end = LEFT + PLOT if row.response is None else scale.at(log10(row.response))  # without a bound to the right edge
    deadline = scale.at(log10(message.deadline))
    foot = y + BAR
    words = f"{message.identifier:03X}  {message.name}"
    response = NO_BOUND if row.response is None else f"{ms(row.response)} ms"
    return svg.group(
        svg.title(f"{words}: response {response}, deadline {ms(message.deadline)} ms"),
        svg.text((LEFT - 10, foot - 1), words, font_size=svg.TEXT, fill=svg.INK, text_anchor="end"),
        svg.rectangle((LEFT, y), max(end - LEFT, 1.0), BAR, fill=colour),
        svg.line((deadline, y - 3), (deadline, y + BAR + 3), stroke=svg.INK, stroke_width=2),
        svg.text((LEFT + PLOT + 8, foot - 1), response, font_size=svg.TEXT, fill=colour),
    )


SERVER_NODE_ID = 3
"""Sub-index of an SDO client's record (CiA 301, 7.5.2.34)."""
MAILBOXES = "Transmit.Mailboxes"
"""Object of a device with its number of mailboxes."""

MS, INHIBIT_UNIT = 1000, 100
"""Microseconds per millisecond, and per unit of inhibit times."""


def network_set(
    dictionaries: Iterable[Dictionary], names: Mapping[int, str], network: NetworkFile, file: str
) -> MessageSet:
    """Return the messages of devices; `names` are those of PDOs by COB-ID, `file` is the network file's name.

    Raises FileError for a row of the network file that does not hold, LocalError for messages without a period.
    """
    devices = tuple(dictionaries)
    reader = _Rows(devices, network.traffic, file)
    pdos = [_pdo(device, each, names) for device in devices for each in _sent_pdos(device)]
    services = [each for device in devices for each in _services(device, devices)]
    rows = [*((each.name, each) for each in pdos), *services]
    reader.refuse_unknown({row for row, _ in rows})
    by_itself = [each for device in devices for each in _by_itself(device, devices, names)]
    by_rows = [each for row, message in rows for each in reader.sent(row, message)]
    known = {(each.identifier, each.node) for each in (*by_itself, *by_rows)}
    missing = dict.fromkeys(each.name for each in pdos if (each.identifier, each.node) not in known)
    if missing:
        where = "`traffic` of the network file, or of the table that it is made from"
        raise LocalError(f"no period is known of {', '.join(missing)}; say it in {where}")
    mailboxes = {device.name: count for device in devices if (count := _setting(device, MAILBOXES))}
    bit_rate = None if network.bit_rate is None else network.bit_rate * 1000
    rates = [set(device.objects.device_information.allowed_baudrates) for device in devices]
    offered = tuple(sorted(set.intersection(*rates))) if rates else ()
    # Messages of the same name are distinguished by their node.
    sent = [each.name for each in by_rows]
    apart = [e._replace(name=f"{e.name} {e.node}") if sent.count(e.name) > 1 else e for e in by_rows]
    urgent_first = sorted([*by_itself, *apart], key=lambda each: each.identifier)
    return MessageSet(tuple(urgent_first), mailboxes, bit_rate=bit_rate, offered=offered)


def _setting(device: Dictionary, name: str) -> int | None:
    try:
        return device.number(device.address(name))
    except DictionaryError:  # the object is optional
        return None


# What the EDS files say


def _sent_pdos(device: Dictionary) -> Iterator[Pdo]:
    return (each for each in device.pdos if each.direction is PdoDirection.TPDO and each.valid)


def _pdo(device: Dictionary, pdo: Pdo, names: Mapping[int, str]) -> PeriodicMessage:
    name = names.get(pdo.cob_id, f"{device.name}.{pdo.name}")
    return PeriodicMessage.of(name, pdo.cob_id, pdo.length, device.name)


def _by_itself(
    device: Dictionary, devices: Iterable[Dictionary], names: Mapping[int, str]
) -> Iterator[PeriodicMessage]:
    """Yield messages that a device sends by timer or SYNC, or whenever its inhibit time allows."""
    cycle = next((number for each in devices if (number := each.number(standard.SYNC_PERIOD))), 0)
    for pdo in _sent_pdos(device):
        message = _pdo(device, pdo, names)
        inhibit = pdo.inhibit_time * INHIBIT_UNIT
        if pdo.is_synchronous and cycle:  # type 0 (next SYNC after a change) can be as frequent as type 1
            yield message.every(cycle * max(pdo.transmission_type, 1), f"transmission type {pdo.transmission_type}")
        elif inhibit:  # takes precedence, as the event timer only sets the lowest rate
            yield message.every(inhibit, "inhibit time")
        elif pdo.event_timer:
            yield message.every(pdo.event_timer * MS, "event timer")
    if heartbeat := device.number(standard.HEARTBEAT_TIME):
        identifier = values.ERROR_CONTROL_BASE + device.node_id
        message = PeriodicMessage.of(f"Heartbeat {device.name}", identifier, 1, device.name)
        yield message.every(heartbeat * MS, "0x1017")
    if (device.number(standard.SYNC) or 0) & standard.SYNC_PRODUCER and (own := device.number(standard.SYNC_PERIOD)):
        yield PeriodicMessage.of("SYNC", values.SYNC_COB_ID, 0, device.name).every(own, "0x1006")
    if pause := device.number(standard.EMCY_INHIBIT_TIME):
        yield _emcy(device).every(pause * INHIBIT_UNIT, "0x1015")


def _emcy(device: Dictionary) -> PeriodicMessage:
    identifier = device.cob_id(standard.EMCY, values.EMCY_BASE)
    return PeriodicMessage.of(f"EMCY {device.name}", identifier, 8, device.name)


def _services(device: Dictionary, devices: Iterable[Dictionary]) -> Iterator[tuple[str, PeriodicMessage]]:
    """Yield the services with their row names: EMCY without an inhibit time, and SDO if there is a client."""
    if not device.number(standard.EMCY_INHIBIT_TIME):
        yield "EMCY", _emcy(device)
    for client in devices:
        if any(client.number((index, SERVER_NODE_ID)) == device.node_id for index in standard.SDO_CLIENTS):
            at = SdoChannel.of(device)
            request = f"SDO request {device.name}"
            yield "SDO", PeriodicMessage.of(request, at.requests, 8, client.name)
            yield "SDO", PeriodicMessage.of(f"SDO answer {device.name}", at.answers, 8, device.name, request)


# What the network file says


class _Rows:
    """Rows of the network file's traffic, with the settings of the devices."""

    def __init__(self, devices: tuple[Dictionary, ...], rows: Mapping[str, TrafficEntry], file: str) -> None:
        self._devices, self._rows, self._file = devices, rows, file

    def refuse_unknown(self, known: set[str]) -> None:
        """Check that each row is of a message that a node sends."""
        for name in (each for each in self._rows if each not in known):
            raise self._error(name, f"traffic of {name!r}, which no node sends")

    def sent(self, name: str, message: PeriodicMessage) -> Iterator[PeriodicMessage]:
        """Yield a message with the values of its row, if there is one."""
        row = self._rows.get(name)
        if row is not None:
            sent = message.every(self._period(name, row), row.reason)
            yield sent._replace(
                deadline=self._time(row.deadline, message.node) if row.deadline else sent.period,
                jitter=self._time(row.jitter, message.node) if row.jitter else 0,
                answers=row.answers or message.answers,
            )

    def _period(self, name: str, row: TrafficEntry) -> int:
        met = {name}
        while row.answers:  # an answer has the period of its request; a cycle has none
            if row.answers in met or row.answers not in self._rows:
                raise self._error(row.answers, f"{name!r} answers {row.answers!r}, which has no period")
            met.add(row.answers)
            row = self._rows[row.answers]
        if not row.every:
            raise self._error(name, f"{name!r} has no period")
        if not (period := self._time(row.every, "")):
            raise self._error(row.every, f"{name!r} has a period of 0")
        return period

    def _time(self, text: str, node: str) -> int:
        """Return a duration in us, or a setting in ms converted; the node's own setting comes first."""
        if texts.is_duration(text):
            return texts.microseconds(text)
        for device in sorted(self._devices, key=lambda each: each.name != node):
            if (number := _setting(device, text)) is not None:
                return number * MS
        raise self._error(text, f"{text!r} is neither a duration nor a setting of a device")

    def _error(self, at: str, what: str) -> FileError:
        """Return an error at the place of a text in the network file."""
        known = next((name for name in self._rows if name == at), at)  # the file's own text, with its place
        place = getattr(at, "place", None) or getattr(known, "place", None)
        return FileError(f"{self._file}:{place.line}:{place.column}" if place else self._file, what)
