"""A form of output that writes no lines of entries, but after each log a table of its traffic."""

from __future__ import annotations

from eurobot_od.frame import Frame
from eurobot_od.load.message_set import MessageSet
from eurobot_od.load.seen import SeenTraffic, table
from eurobot_od.logs.meaning import Meaning
from eurobot_od.logs.output import Output, WriteLine
from eurobot_od.support.escaping import one_line


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

        def take(_line: int, time: float, _channel: str, meaning: Meaning) -> str:
            assert isinstance(meaning.raw, Frame)  # see `row`
            seen.take(time, meaning.raw, meaning.name or "?", meaning.nodes[0] if meaning.nodes else "")
            return ""

        return take

    def footer(self) -> str:
        return "".join(f"{line}\n" for line in (*self._heading, *table(self._seen)))
