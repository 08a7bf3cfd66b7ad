"""Logs to lines of output, each the shortest way there is for what is asked.

Rule of this file: the ways give the same text. Text of all messages comes from the tables of `rows`, from a candump log
in pieces, from others in batches of entries; whatever else is asked for takes the meaning of each frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from io import BufferedReader, BytesIO
from typing import TypeAlias

from eurobot_od.logs import formats
from eurobot_od.logs.batch import MOST, Batches
from eurobot_od.logs.bulk import Bulk
from eurobot_od.logs.filters import Wanted, Window
from eurobot_od.logs.meaning import Decoder
from eurobot_od.logs.output import Output, Text, showing, written
from eurobot_od.logs.rows import rows_of
from eurobot_od.logs.statistics import Tally

EVERYTHING = Window()

Log: TypeAlias = BufferedReader | BytesIO
"""An open log."""


class Decoding:
    """What is asked for: the `output`, the entries `wanted` (None: all), their times; `tally` counts what is wrong."""

    def __init__(
        self, decoder: Decoder, output: Output, wanted: Wanted | None = None, window: Window = EVERYTHING
    ) -> None:
        self.tally = Tally()
        self._output, self._window = output, window
        self._show = showing(decoder, wanted, output)
        self._rows = rows_of(decoder.protocol, output) if wanted is None and isinstance(output, Text) else {}

    def texts(self, file: Log, log: str, form: str | None = None) -> Iterator[str]:
        """Yield the output for an open log named `log`, a line or many at once; errors as `formats.form_of`."""
        if not isinstance(self._output, Text) or not self._rows:
            return written(formats.read(file, form), self._show, log, self._output, self.tally, self._window.clock())
        if self._window == EVERYTHING and formats.form_of(file, form) == (formats.CANDUMP, False):
            return Bulk(self._rows, self._show, self._output, log, self.tally).texts(file)
        batches = Batches(self._rows, self._show, self._output, log, self.tally, self._window.clock())
        return batches.texts(formats.read(file, form), MOST if file.seekable() else 1)
