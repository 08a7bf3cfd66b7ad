"""The live table's cells as text, the same for every terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from eurobot_od.frame import identifier_text
from eurobot_od.support.texts import GAP, columns, one_line
from eurobot_od.traffic.meaning import with_defects
from eurobot_od.traffic.monitor.traffic import MonitorRow, NodeHealth

HEADINGS = ("ID", "Message", "Count", "Period ms", "Age s", "Last values")
ALIGN = "llrrrl"

DROPPED = ("Age s", "Count", "Period ms")
"""The columns that a narrow terminal drops, the least important first."""

ROOM = 24
"""Characters for the last values; columns are dropped to keep them."""


def fitting(lines: Sequence[Sequence[str]], width: int) -> list[int]:
    """Return the numbers of the columns that fit into `width` characters; `lines` are the cells of all columns."""
    widths = [max(map(len, column)) for column in zip(HEADINGS, *lines)]
    shown = list(range(len(HEADINGS)))
    for dropped in map(HEADINGS.index, DROPPED):
        # The last values get what the others leave, so their own width does not count.
        if sum(widths[each] + len(GAP) for each in shown[:-1]) + ROOM <= width:
            break
        shown.remove(dropped)
    return shown


def cells(row: MonitorRow, now: float) -> tuple[str, ...]:
    """Write a row, one text for each heading."""
    identifier = "" if row.identifier is None else identifier_text(row.identifier)
    period = row.period
    every = f"{period.mean * 1000:.1f} ± {period.jitter * 1000:.1f}" if period else ""
    age = f"{max(now - row.last, 0.0):.1f}"  # the clocks of driver and computer do not run alike
    return identifier, one_line(row.name), str(row.count), every, age, one_line(values(row))


def values(row: MonitorRow) -> str:
    """Write the last values and what is wrong with them."""
    return with_defects(row.meaning) if row.meaning.defects else row.meaning.text


def health(name: str, node: NodeHealth, now: float) -> str:
    """Write the state of a node."""
    state = "not heard" if node.pulse.heard is None else "LOST" if node.pulse.lost(now) else node.state
    return one_line(f"{name} {state} ({node.emergency})" if node.emergency else f"{name} {state}")


def plain_table(rows: list[MonitorRow], now: float) -> Iterator[str]:
    """Write the table without colours, one line a row."""
    return columns([HEADINGS, *(cells(row, now) for row in rows)], ALIGN)
