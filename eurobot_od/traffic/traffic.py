"""A form of output that writes no lines of entries, but after each log a table of its traffic."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from eurobot_od.frame import Frame
from eurobot_od.sdo.wire import code_and_reason
from eurobot_od.support.durations import text
from eurobot_od.support.texts import amount, one_line
from eurobot_od.traffic.load.message_set import MessageSet
from eurobot_od.traffic.load.seen import SeenTraffic, table
from eurobot_od.traffic.meaning import Meaning, SdoTransfer
from eurobot_od.traffic.output import Output, WriteLine


class TrafficOutput(Output):
    """Load, gaps, jitter and response times of each log, at `bit_rate` in bit/s, beside what is `promised`.

    With `several` logs the name of the log is above its table.
    """

    def __init__(self, bit_rate: int, promised: MessageSet, several: bool = False) -> None:
        self._bit_rate, self._promised, self._several = bit_rate, promised, several

    def row(self, meaning: Meaning) -> Meaning | None:
        return meaning if isinstance(meaning.raw, Frame) else None

    def writer(self, log: str) -> WriteLine:
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
