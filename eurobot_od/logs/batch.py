"""Entries of a log in any format to text, some hundred at once.

Rule of this file: nothing is decided here. Rows come from the tables or the long way, times from the clock.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice, repeat

from eurobot_od.logs.output import LINE, Clock, Show, Text
from eurobot_od.logs.raw import Entries, Entry
from eurobot_od.logs.rows import Rows, complete, from_tables
from eurobot_od.logs.statistics import Tally

MOST = 500
"""Entries taken at once from what needs not be waited for; more are slower, as the garbage collector walks them."""


class Batches:
    """Turns the entries of one log into text and counts what is wrong in it."""

    def __init__(
        self, rows: Mapping[int, Rows], show: Show, output: Text, log: str, tally: Tally, clock: Clock
    ) -> None:
        self._tables = {cob_id: each.of_data for cob_id, each in rows.items()}
        self._show, self._output, self._log, self._tally, self._clock = show, output, log, tally, clock

    def texts(self, entries: Entries, most: int = MOST) -> Iterator[str]:
        """Yield the text of a log, at most so many entries at once."""
        while batch := list(islice(entries, most)):
            yield self._text(batch)

    def _text(self, batch: Sequence[Entry]) -> str:
        numbers, times, channels, raws = zip(*batch)
        rows = from_tables(self._tables, *zip(*raws))
        for place, wrong in complete(rows, lambda place: self._show(raws[place])):
            self._tally.add(self._log, numbers[place], wrong)
        start, shown = self._output.start(self._log), map(self._clock, times)
        lines = zip(repeat(start), shown, channels, rows)
        return "".join([LINE % line for line in lines if line[1] is not None])
