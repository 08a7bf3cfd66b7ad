"""Decoded entries as text.

Rule of this file: what does not depend on time and place in the log (`row`) is written once for each distinct frame;
`line` only puts the rest before it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache
from typing import TYPE_CHECKING, TypeAlias

from eurobot_od.logs.meaning import Finding, Meaning
from eurobot_od.logs.raw import REMEMBERED, Entries, Raw
from eurobot_od.logs.statistics import Tally

if TYPE_CHECKING:
    from eurobot_od.logs.filters import Wanted

NAME_WIDTH = 29
"""Width of the column with the messages' names; a longer name pushes its fields to the right."""

TIME_WIDTH, GAP = 13, "  "
"""Width of the column with the times, and what stands between the columns."""

LINE = f"%s%{TIME_WIDTH}.6f{GAP}%s{GAP}%s\n"
"""What a line begins with, time, channel and row."""


class Output:
    """A form of output: `header` before the first line, `row` of a meaning, `line` of an entry."""

    header = ""

    def row(self, meaning: Meaning) -> str:
        """Write what depends on the frame alone."""
        raise NotImplementedError

    def line(self, log: str, number: int, time: float, channel: str, row: str) -> str:
        """Write an entry, with the end of its line."""
        raise NotImplementedError


class Text(Output):
    """Aligned columns for a person: time in s, channel, message, fields with units; `!` before what is wrong."""

    def row(self, meaning: Meaning) -> str:
        if not meaning.findings:
            return self.plain_row(meaning.name, meaning.text)
        wrong = "; ".join(f"{damage.value}: {text}" for damage, text in meaning.findings)
        fields = f"{meaning.text}  " if meaning.message is not None else ""
        return self.plain_row(meaning.name or "?", f"{fields}! {wrong}")

    def plain_row(self, name: str, text: str) -> str:
        """Write a message's name and, in a column of their own, its fields."""
        return f"{name.ljust(NAME_WIDTH)} {text}" if text else name

    def start(self, log: str) -> str:
        """Return what a line of a log begins with."""
        return ""

    def line(self, log: str, number: int, time: float, channel: str, row: str) -> str:
        return LINE % (self.start(log), time, channel, row)


class TextOfSeveral(Text):
    """Text with the name of the log before each line, as grep does."""

    def start(self, log: str) -> str:
        return f"{log}:"


# Entries to lines


Shown: TypeAlias = "tuple[str | None, tuple[Finding, ...]]"
"""What became of a frame: its row, None if it is not wanted, and what is wrong with it."""


Show: TypeAlias = "Callable[[Raw], Shown]"
Clock: TypeAlias = "Callable[[float], float | None]"
"""From an entry's time to the one that is shown, None for an entry that is not wanted."""


def showing(decode: Callable[[Raw], Meaning], wanted: Wanted | None, output: Output) -> Show:
    """Return what is to become of each frame; `wanted` is None if every frame is. Distinct frames are asked once."""

    @lru_cache(REMEMBERED)
    def show(raw: Raw) -> Shown:
        meaning = decode(raw)
        return output.row(meaning) if wanted is None or wanted(meaning) else None, meaning.findings

    return show


def written(
    entries: Entries, show: Show, log: str, output: Output, tally: Tally, clock: Clock = float
) -> Iterator[str]:
    """Yield the lines of a log's wanted entries; what is wrong is counted, wanted or not."""
    write = output.line
    for number, time, channel, raw in entries:
        row, findings = show(raw)
        if findings:
            tally.add(log, number, findings)
        shown = clock(time)
        if row is not None and shown is not None:
            yield write(log, number, shown, channel, row)
