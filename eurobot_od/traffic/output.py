"""The forms of output: text for a person here, data for other programs in `records`.

A line has two parts. The `row` depends on the frame alone and is made once for each distinct frame; what stands before
it, place and time, is new in every line.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, TypeAlias

from eurobot_od.support.texts import one_line
from eurobot_od.traffic.meaning import Meaning, SdoTransfer, with_defects

NAME_WIDTH = 29
"""Width of the column with the messages' names; a longer name pushes its fields to the right."""

LINE = "%s%13.6f  %s  %s\n"
"""Name of the log, time, channel, row. An f-string would take half as long again for the time."""

WriteLine: TypeAlias = Callable[[int, float, str, Any], str]
"""Makes a line, with its end, from an entry's line number, its time in s, its channel, and the row of its frame."""


class Output:
    """A form of output, with a `header` before the first line."""

    header = ""

    def row(self, meaning: Meaning) -> Any:
        """Write what depends on the frame alone; None for no line."""
        raise NotImplementedError

    def writer(self, log: str) -> WriteLine:
        """Return the function that writes the lines of a log with this name."""
        raise NotImplementedError

    def cut(self, transfer: SdoTransfer) -> None:
        """Take in an SDO transfer that the end of a log cuts off."""

    def footer(self) -> str:
        """Return what comes after the lines of a log."""
        return ""


class TextOutput(Output):
    """Aligned columns for a person: time in s, channel, message, fields with units; `!` before what is wrong.

    With `several` logs each line starts with the name of its log, as grep does it.
    """

    def __init__(self, several: bool = False) -> None:
        self._several = several

    def row(self, meaning: Meaning) -> str:
        name, text = meaning.name, meaning.text
        if meaning.defects:
            name, text = name or "?", with_defects(meaning)
        return one_line(f"{name.ljust(NAME_WIDTH)} {text}" if text else name)

    def writer(self, log: str) -> WriteLine:
        start, shown = one_line(f"{log}:") if self._several else "", lru_cache(one_line)
        return lambda _, time, channel, row: LINE % (start, time, shown(channel), row)
