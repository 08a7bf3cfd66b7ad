"""Turns logs into lines of output, entry by entry, whatever the format of the log and of the output."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, BinaryIO

from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import LARGEST, REMEMBERED, Raw
from eurobot_od.traffic.filters import Wanted, Window
from eurobot_od.traffic.following import Follower, is_followed
from eurobot_od.traffic.meaning import Decoder, Defect, Meaning
from eurobot_od.traffic.output import Output
from eurobot_od.traffic.statistics import DamageCounts

EVERYTHING = Window()


class Decoding:
    """What is asked for: the `output`, the entries `wanted` (None: all), their times; `damage` counts what is wrong."""

    def __init__(
        self, decoder: Decoder, output: Output, wanted: Wanted | None = None, window: Window = EVERYTHING
    ) -> None:
        self.damage = DamageCounts()
        self._output, self._window = output, window

        def row(meaning: Meaning) -> Any:
            return output.row(meaning) if wanted is None or wanted(meaning) else None

        # Most frames on a bus are requests and confirms without data: what is made from them is kept.
        @lru_cache(REMEMBERED)
        def known(raw: Raw) -> tuple[Any, tuple[Defect, ...], Meaning | None]:
            meaning = decoder(raw)
            return row(meaning), meaning.defects, meaning if is_followed(meaning) else None

        self._decoder, self._row, self._known = decoder, row, known

    def lines(self, file: BinaryIO, log: str, form: str | None = None, largest: int = LARGEST) -> Iterator[str]:
        """Yield the lines of output for an open log named `log`; errors as `formats.read`.

        What is wrong in the log is counted, whether it is wanted or not.
        """
        known, shown_time, write = self._known, self._window.clock(), self._output.writer(log)
        follow = Follower(self._decoder)
        for number, time, channel, raw in formats.read(file, form, largest):
            row, defects, followed = known(raw)
            if followed and (said := follow(time, channel, followed)) is not followed:
                row, defects = self._row(said), said.defects
            if defects:
                self.damage.add(log, number, defects)
            shown = shown_time(time)
            if row is not None and shown is not None:
                yield write(number, shown, channel, row)
        for last, transfer in follow.unfinished():
            if self._row(last) is not None:
                self._output.cut(transfer)
        if footer := self._output.footer():
            yield footer
