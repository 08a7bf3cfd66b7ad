"""What was seen on a bus, compared with what is promised: load, gaps, jitter, and response times with their bounds.

There is no clock in here: frames go in with their times. Memory grows with the identifiers, not with the frames.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from eurobot_od.bus import frame_bits
from eurobot_od.frame import Frame, identifier_text
from eurobot_od.sdo.wire import code_and_reason
from eurobot_od.support.texts import amount, columns, one_line, text
from eurobot_od.traffic.decoding import Output, WriteLine
from eurobot_od.traffic.load import MICROSECONDS, BoundRow, MessageSet, load_report
from eurobot_od.traffic.meaning import Meaning, SdoTransfer

NOTHING = MessageSet(())


@dataclass
class SeenMessage:
    """The frames of one identifier: how many, their bits with stuff bits, and the gaps between them, s.

    `period` is the promised one and `bound` that of its response time, s; None if they are not known. `answered` is the
    longest time from the end of the latest request to the end of its answer.
    """

    identifier: int
    name: str
    node: str
    period: float | None = None
    bound: float | None = None
    count: int = 0
    bits: int = 0
    last: float | None = None
    shortest: float | None = None
    longest: float | None = None
    answered: float | None = None

    def take(self, time: float, bits: int, asked: float | None) -> None:
        """Count a frame; `asked` is when the request for it had ended, None without a request."""
        if self.last is not None:
            gap = time - self.last
            self.shortest = gap if self.shortest is None else min(self.shortest, gap)
            self.longest = gap if self.longest is None else max(self.longest, gap)
        if asked is not None:
            self.answered = max(self.answered or 0.0, time - asked)
        self.count, self.bits, self.last = self.count + 1, self.bits + bits, time

    @property
    def jitter(self) -> float | None:
        """How far a gap was from the promised period at most, s; None without a gap or a promise."""
        if self.period is None or self.shortest is None or self.longest is None:
            return None
        return max(abs(self.longest - self.period), abs(self.shortest - self.period))


class SeenTraffic:
    """What was seen on a bus of `bit_rate` bit/s, `promised` what should be.

    `messages` are by identifier and whether they are remote frames: those have another sender.
    """

    def __init__(self, bit_rate: int, promised: MessageSet = NOTHING) -> None:
        self.bit_rate = bit_rate
        self.messages: dict[tuple[int, bool], SeenMessage] = {}
        self._promised: dict[int, BoundRow] = {}
        self._answers: dict[int, set[int]] = {}
        rows = load_report(promised, bit_rate).rows
        identifiers = {row.message.name: row.message.identifier for row in rows}
        for row in sorted(rows, key=lambda each: each.response or 0):  # of several senders the one that may be latest
            self._promised[row.message.identifier] = row
            if row.message.answers in identifiers:
                self._answers.setdefault(identifiers[row.message.answers], set()).add(row.message.identifier)
        self._asked: dict[int, float] = {}
        self.begin: float | None = None
        self.end = 0.0

    def take(self, time: float, frame: Frame, name: str, node: str) -> int:
        """Count a frame that ended at a time in s, of a message of `node`; return how many bits it took."""
        identifier, bits = frame.cob_id, frame_bits(frame)
        key = identifier, frame.is_remote
        seen = self.messages.get(key)
        if seen is None:
            row = None if frame.is_remote else self._promised.get(identifier)
            seen = self.messages[key] = SeenMessage(identifier, name, row.message.node if row else node)
            if row is not None:
                seen.period = row.message.period / MICROSECONDS
                # Of an answer only: when another message fell due, its frame does not say.
                seen.bound = row.response / MICROSECONDS if row.message.answers and row.response is not None else None
        seen.take(time, bits, self._asked.pop(identifier, None))
        for answer in self._answers.get(identifier, ()):
            self._asked[answer] = time
        self.begin, self.end = time if self.begin is None else self.begin, time
        return bits

    def load(self, bits: int) -> float:
        """Return the share of the bus that a number of bits took; 0 before any time has passed."""
        span = 0.0 if self.begin is None else self.end - self.begin
        return bits / span / self.bit_rate if span > 0 else 0.0


HEADINGS = ("ID", "message", "from", "count", "load", "worst gap", "period", "jitter", "response", "bound")


def table(seen: SeenTraffic) -> Iterator[str]:
    """Write a line for each message, times in ms, and the load of each node and of all."""
    messages = sorted(seen.messages.values(), key=lambda each: each.identifier)
    lines: list[tuple[str, ...]] = [HEADINGS]
    for each in messages:
        times = (each.longest, each.period, each.jitter, each.answered, each.bound)
        texts = ("" if time is None else f"{time * 1000:.2f}" for time in times)
        share = f"{seen.load(each.bits):.2%}"
        lines.append((identifier_text(each.identifier), each.name, each.node, str(each.count), share, *texts))
    yield from columns(lines, "lllrrrrrrr")
    nodes: dict[str, int] = {}
    for each in messages:
        nodes[each.node or "?"] = nodes.get(each.node or "?", 0) + each.bits
    parts = [f"{node} {seen.load(bits):.2%}" for node, bits in sorted(nodes.items())]
    whole = f"all {seen.load(sum(nodes.values())):.2%}"
    yield one_line(f"load of {seen.bit_rate / 1000:g} kbit/s: {', '.join([*parts, whole])}")


# As a form of output: no lines of entries, but after each log a table of its traffic


class TrafficOutput(Output):
    """Load, gaps, jitter and response times of each log, at `bit_rate` in bit/s, beside what is `promised`.

    With `several` logs the name of the log is above its table.
    """

    def __init__(self, bit_rate: int, promised: MessageSet, several: bool = False) -> None:
        self._bit_rate, self._promised, self._several = bit_rate, promised, several

    def row(self, meaning: Meaning) -> Meaning | None:
        return meaning if isinstance(meaning.raw, Frame) else None

    def line_writer(self, log: str) -> WriteLine:
        self._heading = [one_line(f"{log}:")] if self._several else []
        self._seen = seen = SeenTraffic(self._bit_rate, self._promised)
        self._transfers = transfers = TransferCounts()

        def take(_line: int, time: float, _channel: str, meaning: Meaning) -> str:
            assert isinstance(meaning.raw, Frame)  # see `row`
            seen.take(time, meaning.raw, meaning.name or "?", meaning.sender)
            if meaning.transfer:
                transfers.add(meaning.transfer)
            return ""

        return take

    def cut(self, transfer: SdoTransfer) -> None:
        self._transfers.add(transfer)

    def footer(self) -> str:
        return "".join(f"{line}\n" for line in (*self._heading, *table(self._seen), *self._transfers.report()))


class TransferCounts:
    """Counts SDO transfers: which way, how, how they ended, how much and how long."""

    def __init__(self) -> None:
        self._ways: Counter[str] = Counter()
        self._hows: Counter[str] = Counter()
        self._aborts: Counter[int] = Counter()
        self._cut = self._bytes = 0
        self._longest: SdoTransfer | None = None

    def add(self, transfer: SdoTransfer) -> None:
        """Count a transfer that has ended."""
        self._ways["read" if transfer.is_upload else "write"] += 1
        self._bytes += transfer.size
        if not transfer.is_whole:
            self._cut += 1
        elif transfer.aborted is not None:
            self._aborts[transfer.aborted] += 1
        else:
            self._hows[transfer.how] += 1
            if self._longest is None or transfer.seconds > self._longest.seconds:
                self._longest = transfer

    def report(self) -> Iterator[str]:
        """Yield the lines of a report; none if there was no transfer."""
        if not self._ways:
            return
        ways = ", ".join(amount(number, way) for way, number in sorted(self._ways.items()))
        hows = ", ".join(f"{number} {how}" for how, number in sorted(self._hows.items()))
        ends = [f"{sum(self._aborts.values())} aborted", f"{self._cut} without an end", f"{self._bytes} bytes"]
        yield f"SDO transfers: {ways}; {', '.join(filter(None, (hows, *ends)))}"
        for code, number in self._aborts.most_common():
            yield f"  {number} x abort {code_and_reason(code)}"
        if self._longest:
            yield one_line(f"  longest: {self._longest.object}, {text(round(self._longest.seconds, 6))}")
