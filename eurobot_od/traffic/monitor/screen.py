"""The live table for a terminal; colours show the group of a message, red whatever is wrong.

This is the only file that imports rich, which is an extra.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rich.console import Group, JustifyMethod, RenderableType
from rich.table import Table
from rich.text import Text

from eurobot_od.support.texts import GAP, amount
from eurobot_od.traffic.meaning import CANOPEN
from eurobot_od.traffic.monitor.traffic import (
    ALIGN,
    HEADINGS,
    HELP,
    Controls,
    MonitorRow,
    Traffic,
    cells,
    fitting,
    health,
    selected,
)

COLOURS = ("bright_cyan", "green", "yellow", "bright_blue", "bright_magenta")
"""Colours of the groups of messages, in the catalogue's order; further groups have none."""

SERVICE_COLOUR = "magenta"

WRONG, OLD = "bold red", "dim"
OLD_AFTER = 3.0
"""Periods after which a message is old, but at least a second."""

BAR_WIDTH = 20
HEAVY_LOAD = 0.8


class Size(NamedTuple):
    """Characters and lines of a terminal."""

    width: int
    height: int


def screen(
    traffic: Traffic, controls: Controls, now: float, load: tuple[float, float], size: Size, notes: Sequence[str] = ()
) -> RenderableType:
    """Return everything that is shown on a terminal of a size, with the last of the `notes`."""
    rows = selected(traffic.rows.values(), controls.sort, controls.part)
    room = max(size.height - 8, 1)
    top = controls.within(len(rows) - room)
    colours = {CANOPEN: SERVICE_COLOUR} | dict(zip(traffic.groups, COLOURS))
    table = _table(rows[top : top + room], now, colours, size.width)
    nodes = Text()
    for name, node in traffic.nodes.items():
        colour = OLD if node.pulse.heard is None else "green"
        bad = node.pulse.lost(now) or node.emergency
        nodes.append(f"● {health(name, node, now)}   ", WRONG if bad else colour)
    return Group(_top(traffic, load), nodes, table, _bottom(controls, len(rows) - room, notes))


def _top(traffic: Traffic, load: tuple[float, float]) -> Text:
    share, rate = load
    filled = min(round(share * BAR_WIDTH), BAR_WIDTH)
    colour = WRONG if share >= HEAVY_LOAD else "green"
    text = Text(f"{traffic.frames} frames  {rate:.0f}/s  load ", no_wrap=True, overflow="ellipsis")
    text.append(f"{share:.1%}", colour).append(f" of {traffic.bitrate // 1000} kbit/s ")
    text.append("█" * filled, colour).append("░" * (BAR_WIDTH - filled), OLD)
    if traffic.damage.total:
        kinds = ", ".join(f"{count.number} x {damage.value}" for damage, count in traffic.damage.counts.items())
        text.append(f"   {kinds}", WRONG)
    return text


def _table(rows: list[MonitorRow], now: float, colours: Mapping[str, str], width: int) -> Table:
    table = Table(box=None, pad_edge=False, header_style="bold", expand=True, padding=(0, len(GAP), 0, 0))
    lines = [cells(row, now) for row in rows]
    columns = fitting(lines, width)
    for column in columns:
        ratio = 1 if column == len(HEADINGS) - 1 else None
        justify: JustifyMethod = "right" if ALIGN[column] == "r" else "left"
        table.add_column(HEADINGS[column], justify=justify, no_wrap=True, ratio=ratio)
    for row, line in zip(rows, lines):
        colour, period = colours.get(row.meaning.group, ""), row.period
        old = period is not None and now - row.last > max(OLD_AFTER * period.mean, 1.0)
        style = WRONG if row.meaning.defects else f"{colour} {OLD}" if old else colour
        # Text, not str: rich would take brackets in a name or a value for its markup.
        table.add_row(*(Text(line[column]) for column in columns), style=style)
    return table


def _bottom(controls: Controls, hidden: int, notes: Sequence[str]) -> Text:
    text = Text("\n", no_wrap=True, overflow="ellipsis")
    if controls.paused:
        text.append("PAUSED", "bold reverse").append("   ")
    if notes:
        text.append(f"{notes[-1]}   ", WRONG)
    if hidden > 0:
        text.append(f"{amount(hidden, 'row')} more   ", OLD)
    typed = f"{controls.part}{'_' if controls.typing else ''}"
    return text.append(f"sort: {controls.sort}   filter: {typed}   {HELP}", OLD)
