"""Statistics of a bus: load, gaps, jitter and response times, beside their promised bounds.

There is no clock in here: frames go in with their times. Memory grows with the identifiers, not with the frames.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, islice
from operator import sub
from typing import Any, NamedTuple

from eurobot_od.bus import bits_together, frame_bits
from eurobot_od.frame import Frame, identifier_text
from eurobot_od.pdo.binding import Binding
from eurobot_od.sdo.wire import code_and_reason
from eurobot_od.support.texts import amount, columns, one_line, text
from eurobot_od.traffic.decoding import Clock, Output, Rows, TextOutput, Write
from eurobot_od.traffic.entries import Batch, Damage, Raw
from eurobot_od.traffic.load import MICROSECONDS, BoundRow, MessageSet, load_report
from eurobot_od.traffic.meaning import Meaning, SdoTransfer
from eurobot_od.traffic.services import HEARTBEAT, SDO

NOTHING = MessageSet(())

MANY = 1 << 13
"""Number of frames of a message whose bits are counted together."""


@dataclass
class SeenMessage:
    """Frames of one identifier: their number, their bits with stuff bits, and the gaps between them in s.

    `period` is the promised one and `bound` that of its response time, s; None if they are not known. `answered` is the
    longest time from the end of the latest request to the end of its answer. A gap that is negative is not one: of
    those `backwards` is the number. The bits of data frames are counted when there are MANY, or they are asked for.
    """

    identifier: int
    name: str
    node: str
    period: float | None = None
    bound: float | None = None
    count: int = 0
    last: float | None = None
    shortest: float | None = None
    longest: float | None = None
    answered: float | None = None
    backwards: int = 0
    _bits: int = 0
    _data: list[bytes] = field(default_factory=list)

    @property
    def bits(self) -> int:
        """Bits of all its frames."""
        self._bits += bits_together(self.identifier, self._data)
        self._data.clear()
        return self._bits

    def take(self, times: Sequence[float], bits: int, data: Sequence[bytes]) -> None:
        """Count frames that ended at these times, with `bits` in addition to those of `data`."""
        self._data += data
        if len(self._data) >= MANY:
            self._bits = self.bits
        marks = times if self.last is None else [self.last, *times]
        gaps = list(map(sub, islice(marks, 1, None), marks))
        if gaps and min(gaps) < 0:
            self.backwards += sum(gap < 0 for gap in gaps)
            gaps = [gap for gap in gaps if gap >= 0]
        if gaps:
            self.shortest = min(gaps) if self.shortest is None else min(self.shortest, *gaps)
            self.longest = max(gaps) if self.longest is None else max(self.longest, *gaps)
        self.count = self.count + len(times)
        self._bits = self._bits + bits
        self.last = times[-1]

    @property
    def jitter(self) -> float | None:
        """Maximum deviation of a gap from the promised period, in s; None without a gap or a promise."""
        if self.period is None or self.shortest is None or self.longest is None:
            return None
        return max(abs(self.longest - self.period), abs(self.shortest - self.period))


class SeenTraffic:
    """Traffic on a bus of `bit_rate` bit/s, and `promised` bounds and `answers` by identifier.

    `messages` are by identifier and whether they are remote frames: those have another sender. `asking` are the
    identifiers of messages that answer others, and of those.
    """

    def __init__(self, bit_rate: int, promised: MessageSet = NOTHING) -> None:
        self.bit_rate = bit_rate
        self.messages: dict[tuple[int, bool], SeenMessage] = {}
        self.promised: dict[int, BoundRow] = {}
        self.answers: dict[int, set[int]] = {}
        rows = load_report(promised, bit_rate).rows
        identifiers = {row.message.name: row.message.identifier for row in rows}
        for row in sorted(rows, key=lambda each: each.response or 0):  # of several senders the one that may be latest
            self.promised[row.message.identifier] = row
            if row.message.answers in identifiers:
                self.answers.setdefault(identifiers[row.message.answers], set()).add(row.message.identifier)
        self.asking = frozenset(self.answers).union(*self.answers.values())
        self._asked: dict[int, float] = {}
        self.begin: float | None = None
        self.end = float("-inf")

    def take(self, time: float, frame: Frame, name: str, node: str) -> int:
        """Count a frame of `node` that ended at a time in s; return its bits."""
        bits = frame_bits(frame)
        self.take_all(frame.cob_id, [time], name, node, bits, is_remote=frame.is_remote)
        if not frame.is_remote and frame.cob_id in self.asking:
            self.take_asked([(time, frame.cob_id)])
        return bits

    def take_all(
        self,
        identifier: int,
        times: Sequence[float],
        name: str,
        node: str,
        bits: int = 0,
        data: Sequence[bytes] = (),
        is_remote: bool = False,
    ) -> None:
        """Count frames of one identifier in order, by their `bits` or data, but not as answers."""
        key = identifier, is_remote
        seen = self.messages.get(key)
        if seen is None:
            row = None if is_remote else self.promised.get(identifier)
            seen = self.messages[key] = SeenMessage(identifier, name, row.message.node if row else node)
            if row is not None:
                seen.period = row.message.period / MICROSECONDS
                # Only for answers, as other frames do not show when they fell due.
                seen.bound = row.response / MICROSECONDS if row.message.answers and row.response is not None else None
        seen.take(times, bits, data)
        self.begin = min(times) if self.begin is None else min(self.begin, *times)
        self.end = max(self.end, *times)

    def take_asked(self, frames: Iterable[tuple[float, int]]) -> None:
        """Process the end times and identifiers of counted frames of `asking`, in order."""
        asked = self._asked
        answers = self.answers
        longest = dict[int, float]()
        for time, identifier in frames:
            if identifier in asked:
                took = time - asked.pop(identifier)
                if identifier not in longest or took > longest[identifier]:
                    longest[identifier] = took
            if identifier in answers:
                for answer in answers[identifier]:
                    asked[answer] = time
        for identifier, took in longest.items():
            seen = self.messages[identifier, False]
            seen.answered = took if seen.answered is None else max(took, seen.answered)

    def load(self, bits: int) -> float:
        """Return the share of the bus that a number of bits took; 0 before any time has passed."""
        span = 0.0 if self.begin is None else self.end - self.begin
        return bits / span / self.bit_rate if span > 0 else 0.0


TIMES = ("worst gap", "period", "jitter", "response", "bound")
HEADINGS = ("ID", "message", "from", "count", "load", *(f"{each}, ms" for each in TIMES))


def table(seen: SeenTraffic) -> Iterator[str]:
    """Yield a line for each message, with times in ms, and the load of each node and of all."""
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
    if backwards := sum(each.backwards for each in messages):
        yield f"time runs backwards: {amount(backwards, 'frame')} with a time before the last one's; not in the gaps"
    yield one_line(f"load of {seen.bit_rate / 1000:g} kbit/s: {', '.join([*parts, whole])}")


def tables(buses: Mapping[str, SeenTraffic]) -> Iterator[str]:
    """Yield the table of each bus, under its channel if there are several."""
    for channel, seen in sorted(buses.items()):
        if len(buses) > 1:
            yield one_line(f"{channel}:")
        yield from table(seen)


# Output format with a table of the traffic after each log, and no lines of entries


class CountedRow(NamedTuple):
    """What is counted of a frame: the message's name, its sender, and the transfer that it ends."""

    name: str
    sender: str
    transfer: SdoTransfer | None = None


class TrafficOutput(Output):
    """Load, gaps, jitter and response times of each bus in a log, at `bit_rate` in bit/s, beside the promised ones.

    With `several` logs the name of the log is above its tables, with several buses the channel above each.
    """

    def __init__(self, bit_rate: int, promised: MessageSet, several: bool = False) -> None:
        self._bit_rate, self._promised, self._several = bit_rate, promised, several
        self._text = TextOutput()

    def row(self, meaning: Meaning) -> CountedRow | None:
        counted = CountedRow(meaning.name or "?", meaning.sender, meaning.transfer)
        return counted if isinstance(meaning.raw, Frame) or meaning.raw.damage is Damage.FD else None

    def rows_of(self, binding: Binding) -> Rows:
        row = CountedRow(binding.name, next(iter(binding.senders), ""))
        texts_of = self._text.rows_of(binding)

        def rows(data: Sequence[bytes]) -> Sequence[CountedRow | None]:
            texts = texts_of(data)  # None for frames with defects
            if None not in texts:
                return [row] * len(data)
            return [None if text is None else row for text in texts]

        return rows

    def writer(self, log: str) -> Write:
        self._heading = [one_line(f"{log}:")] if self._several else []
        self._seen: dict[str, SeenTraffic] = {}
        self._transfers = TransferCounts()
        self._fd = Counter[str]()

        def write(batch: Batch, rows: Sequence[CountedRow | None], clock: Clock) -> str:
            times = list(batch.times if clock is float else map(clock, batch.times))
            is_whole = batch.is_of_one_channel and None not in rows and None not in times
            channels = batch.channels[:1] if is_whole else list(dict.fromkeys(batch.channels))
            for channel in channels:
                places: Sequence[int] = range(len(rows))
                if not is_whole:
                    wanted = zip(places, batch.channels, rows, times)
                    places = [place for place, each, *known in wanted if each == channel and None not in known]
                self._take(batch, channel, batch.grouped(places), rows, times)
            return ""

        return write

    def _take(
        self, batch: Batch, channel: str, groups: Mapping[int | Raw, list[int]], rows: Sequence[Any], times: list[Any]
    ) -> None:
        """Count the frames of a channel, with the rows and times at the same places of the batch."""
        seen = self._seen.get(channel)
        if seen is None:
            seen = self._seen[channel] = SeenTraffic(self._bit_rate, self._promised)
        for head, places in groups.items():
            ended = [times[place] for place in places]
            first = rows[places[0]]
            if isinstance(head, int):
                seen.take_all(head, ended, first.name, first.sender, data=[batch.data[place] for place in places])
            elif isinstance(head, Frame):
                bits = len(places) * frame_bits(head)
                seen.take_all(head.cob_id, ended, first.name, first.sender, bits, is_remote=head.is_remote)
            else:
                self._fd[first.name] += len(places)
            if first.name in (SDO, HEARTBEAT):
                for transfer in filter(None, (rows[place].transfer for place in places)):
                    self._transfers.add(transfer)
        asking = sorted(chain.from_iterable(groups[head] for head in groups.keys() & seen.asking))
        heads = map(batch.heads.__getitem__, asking)
        seen.take_asked(zip(map(times.__getitem__, asking), heads))  # type: ignore[arg-type]  # data frames

    def cut(self, transfer: SdoTransfer) -> None:
        self._transfers.add(transfer)

    def footer(self) -> str:
        buses = self._seen or {"": SeenTraffic(self._bit_rate, self._promised)}
        # The duration of a CAN FD frame depends on its own bit rate, which no log has.
        names = ", ".join(f"{number} x {name}" for name, number in sorted(self._fd.items()))
        others = [one_line(f"not in the load, CAN FD: {names}")] if names else []
        lines = (*self._heading, *tables(buses), *others, *self._transfers.report())
        return "".join(f"{line}\n" for line in lines)


class TransferCounts:
    """Counts of SDO transfers by direction, kind and end, with sizes and durations."""

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
        """Yield the lines of a report, none without a transfer."""
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
