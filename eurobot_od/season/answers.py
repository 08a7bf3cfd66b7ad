"""Answers of a season as text: aligned lines, CSV, JSON lines, pictures; and the answer to no query, its tables."""

from __future__ import annotations

import json
from collections.abc import Callable

import polars as pl
import polars.selectors as cs

from eurobot_od.season.chart import chart_of, draw
from eurobot_od.season.reports import SeasonReport
from eurobot_od.season.season import Season
from eurobot_od.support.texts import cell, columns


def tables(season: Season) -> pl.DataFrame:
    """Return the tables, how many rows each has, and its columns."""
    rows = []
    for name in season.files:
        frames = season.frames(name)
        number = frames.select(pl.len()).collect().item()
        rows.append((name, number, ", ".join(frames.collect_schema().names())))
    return pl.DataFrame(rows, ["table", "rows", "columns"], orient="row")


def picture(ask: Callable[[str], pl.DataFrame], report: SeasonReport | None, rows: pl.DataFrame, title: str) -> str:
    """Draw an answer as SVG, as its report says, or else as its columns suggest and with a title."""
    if report is None:
        return draw(rows, chart_of(rows), title)
    return draw(ask(report.chart.sql) if report.chart.sql else rows, report.chart, report.title)


def as_json(rows: pl.DataFrame) -> str:
    """Write one JSON object a row."""
    return _plain(rows).write_ndjson()


def as_csv(rows: pl.DataFrame) -> str:
    """Write CSV; a list or a record is JSON in its cell."""
    made = _plain(rows)
    for name, type_ in made.schema.items():
        if type_.is_nested():
            texts = [None if each is None else json.dumps(each, default=str) for each in made[name].to_list()]
            made = made.with_columns(pl.Series(name, texts, pl.String))
    written = [made[name] for name in made.columns if made[name].dtype == pl.String]
    escaped = [each.map_elements(cell, return_dtype=pl.String) for each in written]
    return made.with_columns(escaped).rename(cell).write_csv()


def as_table(rows: pl.DataFrame) -> str:
    """Write aligned lines: numbers to the right, all else to the left."""
    made = _plain(rows)
    align = "".join("r" if type_.is_numeric() else "l" for type_ in made.dtypes)
    rows_shown = (
        [f"{each:.6f}".rstrip("0").rstrip(".") if isinstance(each, float) else each for each in row]
        for row in made.iter_rows()
    )
    shown = [["" if each is None else str(each) for each in row] for row in rows_shown]
    return "".join(f"{line}\n" for line in columns([made.columns, *shown], align))


def _plain(rows: pl.DataFrame) -> pl.DataFrame:
    """Return rows with bytes as hexadecimal digits, which CSV and JSON have no form for."""
    return rows.with_columns(cs.binary().bin.encode("hex").str.to_uppercase(), cs.categorical().cast(pl.String))
