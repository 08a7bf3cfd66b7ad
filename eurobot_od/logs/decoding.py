"""Logs to lines of output, one entry after the other, whatever the format of the log and of the output."""

from __future__ import annotations

from collections.abc import Iterator
from io import BufferedReader, BytesIO
from typing import TypeAlias

from eurobot_od.logs import formats
from eurobot_od.logs.filters import Wanted, Window
from eurobot_od.logs.meaning import Decoder
from eurobot_od.logs.output import Output, showing, written
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

    def texts(self, file: Log, log: str, form: str | None = None) -> Iterator[str]:
        """Yield the lines of output for an open log named `log`; errors as `formats.form_of`."""
        return written(formats.read(file, form), self._show, log, self._output, self.tally, self._window.clock())
