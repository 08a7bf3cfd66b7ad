"""Answers of a season: aligned lines, CSV, JSON lines, or pictures of ready questions (`REPORTS`) and of any query.

Without a question, the answer lists the season's tables.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import polars as pl
import polars.selectors as cs

from eurobot_od.errors import LocalError
from eurobot_od.season.reports import Chart, ChartKind, SeasonReport
from eurobot_od.season.season import Season
from eurobot_od.support import svg
from eurobot_od.support.svg import Axis
from eurobot_od.support.texts import cell, columns

# Pictures: bars, lines and histograms of all rows, as SVG, without smoothing.


LEFT, TOP, PLOT, HEIGHT, RIGHT, BOTTOM = 70, 60, 720, 320, 30, 60
"""Margins, width and height of the plot, in pixels."""

NAMES, ROW, BAR = 320, 20, 12
"""Width of the names of bars, height of a row, height of its bar, in pixels."""

CLASSES = 40
"""Maximum number of classes of a histogram."""


def draw(rows: pl.DataFrame, chart: Chart, title: str) -> str:
    """Return a picture of rows as an SVG document; raises LocalError if no column has numbers."""
    complete = rows.drop_nulls()
    if not any(column.dtype.is_numeric() for column in rows):
        raise LocalError(f"nothing to draw: none of the columns {', '.join(rows.columns)} has numbers")
    if not len(complete):
        nothing = svg.text((LEFT, TOP), "no rows", font_size=svg.TEXT, fill=svg.PALE)
        return svg.document(title, svg.heading(title), nothing, width=LEFT + PLOT, height=TOP + BOTTOM)
    content, width, height = DRAWN[chart.kind](complete, chart)
    return svg.document(title, svg.heading(title), *content, width=width, height=height)


Drawn = tuple[list[str], int, int]
"""Elements, width and height of a picture."""


def chart_of(rows: pl.DataFrame) -> Chart:
    """Return a chart for the rows of any query: lines along a number in the first column, otherwise bars."""
    first = rows.columns[0]
    if len(rows.columns) == 1:
        return Chart(ChartKind.HISTOGRAM, first, "rows")
    kind = ChartKind.LINES if rows[first].dtype.is_numeric() else ChartKind.BARS
    return Chart(kind, first, ", ".join(rows.columns[1:]))


# Bars: one per row


def _bars(rows: pl.DataFrame, chart: Chart) -> Drawn:
    column = next(name for name in rows.columns[1:] or rows.columns if rows[name].dtype.is_numeric())
    names, values = rows[rows.columns[0]].cast(pl.String).to_list(), rows[column].cast(pl.Float64).to_list()
    bottom = TOP + ROW * len(values)
    scale = Axis(min(0.0, *values), max(0.0, *values) or 1.0, NAMES, NAMES + PLOT)
    content = list(_grid_down(scale, bottom, chart.up))
    for y, name, value in zip(range(TOP, bottom, ROW), names, values):
        low, high = sorted((scale.at(0), scale.at(value)))
        shown = f"{value:.6g}"
        bar = svg.group(
            svg.title(f"{name}: {shown}"),
            svg.text((NAMES - 10, y + BAR - 1), name, font_size=svg.TEXT, fill=svg.INK, text_anchor="end"),
            svg.rectangle(
                (low, y), max(high - low, 1.0), BAR, fill=svg.COLOURS[0]
            ),  # at least one pixel, so that a 0 is visible
            svg.text((high + 6, y + BAR - 1), shown, font_size=svg.TEXT, fill=svg.PALE),
        )
        content.append(bar)
    return content, NAMES + PLOT + RIGHT + 40, bottom + BOTTOM


def _grid_down(scale: Axis, bottom: float, label: str) -> Iterator[str]:
    yield from svg.axis_across(((scale.at(value), f"{value:g}") for value in scale.ticks()), TOP, bottom)
    middle = (scale.start + scale.end) / 2
    yield svg.text((middle, bottom + 42), label, font_size=svg.TEXT, fill=svg.INK, text_anchor="middle")


# Lines and histograms have two scales


def _axes(across: Axis, up: Axis, chart: Chart) -> Iterator[str]:
    yield from _grid_down(across, TOP + HEIGHT, chart.along)
    yield from svg.axis_up(up, LEFT, LEFT + PLOT)
    yield svg.text((LEFT, TOP - 12), chart.up, font_size=svg.TEXT, fill=svg.INK)


def _scales(across: Sequence[float], up: Sequence[float]) -> tuple[Axis, Axis]:
    low, high = min(across), max(across)
    most = max(0.0, *up) or 1.0
    # An axis has a length even if all values are equal.
    return Axis(low, high if high > low else low + 1, LEFT, LEFT + PLOT), Axis(min(0.0, *up), most, TOP + HEIGHT, TOP)


def _lines(rows: pl.DataFrame, chart: Chart) -> Drawn:
    first, *others = rows.columns
    series: Mapping[str, list[Any]] = {
        name: rows[name].cast(pl.Float64).to_list() for name in others if rows[name].dtype.is_numeric()
    }
    along = rows[first].cast(pl.Float64).to_list()
    across, up = _scales(along, [value for values in series.values() for value in values])
    content = list(_axes(across, up, chart))
    for number, (name, values) in enumerate(series.items()):
        colour = svg.COLOURS[number % len(svg.COLOURS)]
        places = zip(map(across.at, along), map(up.at, values))
        content.append(svg.polyline(places, fill="none", stroke=colour, stroke_width=1.5))
        content.append(svg.text((LEFT + PLOT - 150, TOP + 16 * number - 24), name, font_size=svg.TEXT, fill=colour))
    return content, LEFT + PLOT + RIGHT, TOP + HEIGHT + BOTTOM


def _histogram(rows: pl.DataFrame, chart: Chart) -> Drawn:
    values = rows[rows.columns[0]].cast(pl.Float64)
    low, high = float(values.min() or 0), float(values.max() or 0)  # type: ignore[arg-type]  # numbers
    # A round width, so that classes begin at round numbers.
    width = svg.round_step((high - low) / CLASSES) if high > low else 1.0
    classes = (values / width).floor().value_counts(name="count").sort("index" if not values.name else values.name)
    begins = [number * width for number in classes[:, 0].to_list()]
    counts = classes["count"].to_list()
    across, up = _scales([*begins, begins[-1] + width], counts)
    content = list(_axes(across, up, chart))
    for begin, count in zip(begins, counts):
        x, y = across.at(begin), up.at(count)
        bar = svg.rectangle((x, y), across.at(begin + width) - x - 1, up.start - y, fill=svg.COLOURS[0])
        content.append(svg.group(svg.title(f"{begin:g} to {begin + width:g}: {count}"), bar))
    return content, LEFT + PLOT + RIGHT, TOP + HEIGHT + BOTTOM


DRAWN: Mapping[ChartKind, Callable[[pl.DataFrame, Chart], Drawn]] = {
    ChartKind.BARS: _bars,
    ChartKind.LINES: _lines,
    ChartKind.HISTOGRAM: _histogram,
}


def tables(season: Season) -> pl.DataFrame:
    """Return the tables with their number of rows and their columns."""
    rows = []
    for name in [*season.files]:
        frames = season.frames(name)
        number = frames.select(pl.len()).collect().item()
        rows.append((name, number, ", ".join(frames.collect_schema().names())))
    return pl.DataFrame(rows, ["table", "rows", "columns"], orient="row")


def picture(ask: Callable[[str], pl.DataFrame], report: SeasonReport | None, rows: pl.DataFrame, title: str) -> str:
    """Return a picture of an answer as SVG, with the chart of its report, otherwise one that fits its columns."""
    if report is None:
        return draw(rows, chart_of(rows), title)
    return draw(ask(report.chart.sql) if report.chart.sql else rows, report.chart, report.title)


def as_json(rows: pl.DataFrame) -> str:
    """Return one JSON object per row."""
    return _plain(rows).write_ndjson()


def as_csv(rows: pl.DataFrame) -> str:
    """Return CSV; a list or record is JSON in its cell."""
    made = _plain(rows)
    for name, type_ in made.schema.items():
        if type_.is_nested():
            texts = [None if each is None else json.dumps(each, default=str) for each in made[name].to_list()]
            made = made.with_columns(pl.Series(name, texts, pl.String))
    written = [made[name] for name in made.columns if made[name].dtype == pl.String]
    escaped = [each.map_elements(cell, return_dtype=pl.String) for each in written]
    return made.with_columns(escaped).rename(cell).write_csv()


def as_table(rows: pl.DataFrame) -> str:
    """Return aligned lines, with numbers to the right."""
    made = _plain(rows)
    align = "".join("r" if type_.is_numeric() else "l" for type_ in made.dtypes)
    rows_shown = (
        [f"{each:.6f}".rstrip("0").rstrip(".") if isinstance(each, float) else each for each in row]
        for row in made.iter_rows()
    )
    shown = [["" if each is None else str(each) for each in row] for row in rows_shown]
    return "".join(f"{line}\n" for line in columns([made.columns, *shown], align))


def _plain(rows: pl.DataFrame) -> pl.DataFrame:
    """Return the rows with bytes as hexadecimal digits, as CSV and JSON have no bytes."""
    return rows.with_columns(cs.binary().bin.encode("hex").str.to_uppercase(), cs.categorical().cast(pl.String))
