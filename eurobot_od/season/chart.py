"""Answers as pictures: bars, lines, histograms, as SVG.

Rule of this file: a picture shows what the rows say; nothing is smoothed or left out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import ceil, floor, log10
from typing import Any, NamedTuple

import polars as pl

from eurobot_od.errors import LocalError
from eurobot_od.season.reports import Chart, ChartKind
from eurobot_od.support import svg

FONT = "Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif"
INK, PALE, GRID, PAPER = "#22262b", "#6b7178", "#e6e3d8", "#ffffff"
COLOURS = ("#2f8fd0", "#c62828", "#2e7d32", "#8e5bb5", "#b26a00")
TEXT, TITLE = 13, 17

LEFT, TOP, PLOT, HEIGHT, RIGHT, BOTTOM = 70, 60, 720, 320, 30, 60
"""Margins, width and height of the plot; one unit is a pixel of a screen."""

NAMES, ROW, BAR = 320, 20, 12
"""Width for the names of bars, height of a row, and of its bar."""

TICKS = 6
CLASSES = 40
"""About so many lines of a scale, and at most so many classes of a histogram."""


class Scale(NamedTuple):
    """From a value to a place: `low` is at `start`, `high` at `end`."""

    low: float
    high: float
    start: float
    end: float

    def at(self, value: float) -> float:
        """Return the place of a value."""
        return self.start + (self.end - self.start) * (value - self.low) / (self.high - self.low)

    def ticks(self) -> Iterator[float]:
        """Give round values from `low` to `high`."""
        step = round_step((self.high - self.low) / TICKS)
        return (number * step for number in range(ceil(self.low / step - 1e-9), floor(self.high / step + 1e-9) + 1))


def round_step(least: float) -> float:
    """Return the first of 1, 2, 5, 10, 20, ... (or 0.5, 0.2, ...) that is not less."""
    power = 10.0 ** floor(log10(least))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= least * (1 - 1e-9))


def draw(rows: pl.DataFrame, chart: Chart, title: str) -> str:
    """Return a picture of rows as an SVG document; raises LocalError for rows that it cannot show."""
    complete = rows.drop_nulls()
    if not any(column.dtype.is_numeric() for column in rows):
        raise LocalError(f"nothing to draw: none of the columns {', '.join(rows.columns)} has numbers")
    content, width, height = DRAWN[chart.kind](complete, chart) if len(complete) else _nothing()
    return svg.element(
        "svg",
        svg.title(title),
        svg.rectangle((0, 0), width, height, fill=PAPER),
        svg.text((20, 30), title, font_size=TITLE, font_weight="bold", fill=INK),
        *content,
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {width} {height}",
        width=width,
        height=height,
        font_family=FONT,
    )


Drawn = tuple[list[str], int, int]
"""Elements, width and height of a picture."""


def chart_of(rows: pl.DataFrame) -> Chart:
    """Return how rows of any query are drawn: a number first is drawn along, anything else names bars."""
    first = rows.columns[0]
    if len(rows.columns) == 1:
        return Chart(ChartKind.HISTOGRAM, first, "rows")
    kind = ChartKind.LINES if rows[first].dtype.is_numeric() else ChartKind.BARS
    return Chart(kind, first, ", ".join(rows.columns[1:]))


def _nothing() -> Drawn:
    return [svg.text((LEFT, TOP), "no rows", font_size=TEXT, fill=PALE)], LEFT + PLOT, TOP + BOTTOM


# Bars: a row for each


def _bars(rows: pl.DataFrame, chart: Chart) -> Drawn:
    column = next(name for name in rows.columns[1:] or rows.columns if rows[name].dtype.is_numeric())
    names, values = rows[rows.columns[0]].cast(pl.String).to_list(), rows[column].cast(pl.Float64).to_list()
    bottom = TOP + ROW * len(values)
    scale = Scale(min(0.0, *values), max(0.0, *values) or 1.0, NAMES, NAMES + PLOT)
    content = list(_grid_down(scale, bottom, chart.up))
    for number, (name, value) in enumerate(zip(names, values)):
        content.append(_bar(name, value, scale, TOP + ROW * number))
    return content, NAMES + PLOT + RIGHT + 40, bottom + BOTTOM


def _bar(name: str, value: float, scale: Scale, y: float) -> str:
    low, high = sorted((scale.at(0), scale.at(value)))
    shown = f"{value:.6g}"
    return svg.group(
        svg.title(f"{name}: {shown}"),
        svg.text((NAMES - 10, y + BAR - 1), name, font_size=TEXT, fill=INK, text_anchor="end"),
        svg.rectangle((low, y), max(high - low, 1.0), BAR, fill=COLOURS[0]),
        svg.text((high + 6, y + BAR - 1), shown, font_size=TEXT, fill=PALE),
    )


def _grid_down(scale: Scale, bottom: float, label: str) -> Iterator[str]:
    for value in scale.ticks():
        x = scale.at(value)
        yield svg.line((x, TOP - 6), (x, bottom + 4), stroke=GRID, stroke_width=1)
        yield svg.text((x, bottom + 20), f"{value:g}", font_size=TEXT, fill=PALE, text_anchor="middle")
    middle = (scale.start + scale.end) / 2
    yield svg.text((middle, bottom + 42), label, font_size=TEXT, fill=INK, text_anchor="middle")


# Lines and histograms: both have two scales


def _axes(across: Scale, up: Scale, chart: Chart) -> Iterator[str]:
    yield from _grid_down(across, TOP + HEIGHT, chart.along)
    for value in up.ticks():
        y = up.at(value)
        yield svg.line((LEFT, y), (LEFT + PLOT, y), stroke=GRID, stroke_width=1)
        yield svg.text((LEFT - 8, y + 4), f"{value:g}", font_size=TEXT, fill=PALE, text_anchor="end")
    yield svg.text((LEFT, TOP - 12), chart.up, font_size=TEXT, fill=INK)


def _scales(across: Sequence[float], up: Sequence[float]) -> tuple[Scale, Scale]:
    low, high = min(across), max(across)
    most = max(0.0, *up) or 1.0
    return (
        Scale(low, high if high > low else low + 1, LEFT, LEFT + PLOT),
        Scale(min(0.0, *up), most, TOP + HEIGHT, TOP),
    )


def _lines(rows: pl.DataFrame, chart: Chart) -> Drawn:
    first, *others = rows.columns
    series: Mapping[str, list[Any]] = {
        name: rows[name].cast(pl.Float64).to_list() for name in others if rows[name].dtype.is_numeric()
    }
    along = rows[first].cast(pl.Float64).to_list()
    across, up = _scales(along, [value for values in series.values() for value in values])
    content = list(_axes(across, up, chart))
    for number, (name, values) in enumerate(series.items()):
        colour, places = COLOURS[number % len(COLOURS)], zip(map(across.at, along), map(up.at, values))
        content.append(svg.polyline(places, fill="none", stroke=colour, stroke_width=1.5))
        content.append(svg.text((LEFT + PLOT - 150, TOP + 16 * number - 24), name, font_size=TEXT, fill=colour))
    return content, LEFT + PLOT + RIGHT, TOP + HEIGHT + BOTTOM


def _histogram(rows: pl.DataFrame, chart: Chart) -> Drawn:
    values = rows[rows.columns[0]].cast(pl.Float64)
    low, high = float(values.min() or 0), float(values.max() or 0)  # type: ignore[arg-type]  # numbers
    width = round_step((high - low) / CLASSES) if high > low else 1.0
    classes = (values / width).floor().value_counts(name="count").sort("index" if not values.name else values.name)
    begins = [number * width for number in classes[:, 0].to_list()]
    counts = classes["count"].to_list()
    across, up = _scales([*begins, begins[-1] + width], counts)
    content = list(_axes(across, up, chart))
    for begin, count in zip(begins, counts):
        x, y = across.at(begin), up.at(count)
        bar = svg.rectangle((x, y), across.at(begin + width) - x - 1, up.start - y, fill=COLOURS[0])
        content.append(svg.group(svg.title(f"{begin:g} to {begin + width:g}: {count}"), bar))
    return content, LEFT + PLOT + RIGHT, TOP + HEIGHT + BOTTOM


DRAWN: Mapping[ChartKind, Callable[[pl.DataFrame, Chart], Drawn]] = {
    ChartKind.BARS: _bars,
    ChartKind.LINES: _lines,
    ChartKind.HISTOGRAM: _histogram,
}
