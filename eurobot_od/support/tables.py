"""Texts in columns, as a terminal shows them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from eurobot_od.support.escaping import one_line

GAP = "  "
"""Between two columns."""


def columns(rows: Iterable[Sequence[str]], align: str = "") -> Iterator[str]:
    """Write a line for each row; a column is as wide as its longest text.

    `align` has a letter for each column, `l` or `r` for flush left or right; columns without one are flush left.
    """
    lines = [[*map(one_line, row)] for row in rows]
    widths = [max(map(len, column)) for column in zip(*lines)]
    places = [str.rjust if letter == "r" else str.ljust for letter in align.ljust(len(widths), "l")]
    for line in lines:
        yield GAP.join(place(text, width) for place, text, width in zip(places, line, widths)).rstrip()
