"""Decoded entries as text.

Rule of this file: what does not depend on time and place in the log (`row`) is written once for each distinct frame;
`line` only puts the rest before it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, TypeAlias

from eurobot_od.logs.meaning import Finding, Meaning
from eurobot_od.logs.raw import Entries, Raw, Understand
from eurobot_od.logs.tally import Tally
from eurobot_od.messages import TYPES

if TYPE_CHECKING:
    from eurobot_od.logs.filters import Wanted

NAME_WIDTH = max(len(each.__name__) for each in TYPES) + 2
"""Width of the column with the messages' names: longer than the type names by their spaces."""

TIME_WIDTH = 13
"""Width of the column with the times."""

GAP = "  "
"""Between the columns."""


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
        return f"{self.start(log)}{time:{TIME_WIDTH}.6f}{GAP}{channel}{GAP}{row}\n"


class TextOfSeveral(Text):
    """Text with the name of the log before each line, as grep does."""

    def start(self, log: str) -> str:
        return f"{log}:"


# Entries to lines


Shown: TypeAlias = "tuple[str | None, tuple[Finding, ...]]"
"""What became of a frame: its row, None if it is not wanted, and what is wrong with it."""


Clock: TypeAlias = "Callable[[float], float | None]"


def showing(decode: Callable[[Raw], Meaning], wanted: Wanted | None, output: Output) -> Understand[Shown]:
    """Return what a log reader is to make of each frame; `wanted` is None if every frame is."""

    def show(raw: Raw) -> Shown:
        meaning = decode(raw)
        return output.row(meaning) if wanted is None or wanted(meaning) else None, meaning.findings

    return show


def written(
    entries: Entries[Shown], log: str, output: Output, tally: Tally, clock: Clock | None = None
) -> Iterator[str]:
    """Yield the lines of a log's wanted entries; what is wrong is counted, wanted or not.

    `clock` turns an entry's time into the one that is shown, None for an entry that is not wanted.
    """
    write = output.line
    for number, time, channel, (row, findings) in entries:
        if findings:
            tally.add(log, number, findings)
        shown = time if clock is None else clock(time)
        if row is not None and shown is not None:
            yield write(log, number, shown, channel, row)
