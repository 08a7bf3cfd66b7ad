"""Ask a season: by SQL, one view for each message, or by a ready report. Without a question: what there is.

DuckDB's SQL; tables are `runs`, `frames`, `damage`, `messages`, and one for each message, such as `goto_xy`.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import options, output, progress
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.plugin import Plugin
from eurobot_od.support import extras
from eurobot_od.support.escaping import cell, one_line

if TYPE_CHECKING:
    import polars as pl

    from eurobot_od.season.reports import SeasonReport
    from eurobot_od.season.season import Season

BIT_RATE = 500_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("season", type=Path, metavar="SEASON", help="folder that `archive` has made")
    parser.add_argument("sql", nargs="?", metavar="SQL", help="a query; left out: the tables")
    parser.add_argument("--report", metavar="NAME", help="a ready question; `--report list` lists them")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="one JSON object a row")
    form.add_argument("--csv", action="store_true", help="comma-separated values")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="also draw the answer as SVG")
    parser.add_argument(
        "-b", "--bitrate", type=options.bit_rate, default=BIT_RATE, help="bit/s for the load; left out: %(default)s"
    )


def run(arguments: argparse.Namespace) -> None:
    """Ask, print, draw."""
    if arguments.sql and arguments.report:
        raise LocalError("a question is SQL or --report, not both")
    with extras.needed("season"):
        from eurobot_od.season.season import Season
    known = reports(options.robot(arguments))
    if arguments.report == "list":
        width = max(map(len, known))
        print("\n".join(f"{name:{width}}  {report.title}" for name, report in known.items()))
        return
    if arguments.report is not None and arguments.report not in known:
        raise UnknownName("report", arguments.report, known)
    season, report = Season.open(arguments.season), known.get(arguments.report)
    question = report.sql if report else arguments.sql
    with progress.bar(str(arguments.season), unit=progress.PERCENT, after=progress.SHORT) as draw:

        def ask(sql: str) -> pl.DataFrame:
            return season.sql(sql, {"bitrate": arguments.bitrate}, lambda done: draw(done, 100))

        rows = ask(question) if question else _tables(season)
        if arguments.plot is not None:
            output.write(arguments.plot, _picture(ask, report, rows, arguments.sql))
    for file in season.damaged:
        print(f"eurobot-od: left out: {one_line(str(file))} is damaged; archive its log again", file=sys.stderr)
    written = _json if arguments.json else _csv if arguments.csv else _table
    sys.stdout.write(written(rows))


def reports(robot: Plugin) -> Mapping[str, SeasonReport]:
    """Return all reports by name, a robot's and those for any devices."""
    from eurobot_od.season.reports import REPORTS

    return {**robot.reports(), **REPORTS}


def _tables(season: Season) -> pl.DataFrame:
    """Return the tables, how many rows each has, and its columns."""
    import polars as pl

    rows = []
    for name in season.files:
        frames = season.frames(name)
        number = frames.select(pl.len()).collect().item()
        rows.append((name, number, ", ".join(frames.collect_schema().names())))
    return pl.DataFrame(rows, ["table", "rows", "columns"], orient="row")


def _picture(ask: Callable[[str], pl.DataFrame], report: SeasonReport | None, rows: pl.DataFrame, sql: str) -> str:
    from eurobot_od.season.chart import chart_of, draw

    if report is None:
        return draw(rows, chart_of(rows), sql or "tables")
    shown = ask(report.chart.sql) if report.chart.sql else rows
    return draw(shown, report.chart, report.title)


# Forms


def _json(rows: pl.DataFrame) -> str:
    return _plain(rows).write_ndjson()


def _csv(rows: pl.DataFrame) -> str:
    """Write CSV; a list or a record is text there, as JSON."""
    import polars as pl

    made = _plain(rows)
    for name, type_ in made.schema.items():
        if type_.is_nested():
            texts = [None if each is None else json.dumps(each, default=str) for each in made[name].to_list()]
            made = made.with_columns(pl.Series(name, texts, pl.String))
    escaped = [
        made[name].map_elements(cell, return_dtype=pl.String) for name in made.columns if made[name].dtype == pl.String
    ]
    return made.with_columns(escaped).rename(cell).write_csv()


def _plain(rows: pl.DataFrame) -> pl.DataFrame:
    """Return rows with bytes as hexadecimal digits, which CSV and JSON have no form for."""
    import polars as pl
    import polars.selectors as cs

    return rows.with_columns(cs.binary().bin.encode("hex").str.to_uppercase(), cs.categorical().cast(pl.String))


def _table(rows: pl.DataFrame) -> str:
    return "".join(f"{line}\n" for line in _lines(_plain(rows)))


def _lines(rows: pl.DataFrame) -> Iterator[str]:
    """Yield aligned lines: numbers to the right, all else to the left."""
    columns = [[one_line(name), *map(_shown, rows[name].to_list())] for name in rows.columns]
    widths = [max(map(len, column)) for column in columns]
    aligned: list[Callable[[str, int], str]] = [
        str.rjust if rows[name].dtype.is_numeric() else str.ljust for name in rows.columns
    ]
    for cells in zip(*columns):
        yield "  ".join(align(cell, width) for cell, width, align in zip(cells, widths, aligned)).rstrip()


def _shown(value: object) -> str:
    return (
        ""
        if value is None
        else f"{value:.6f}".rstrip("0").rstrip(".")
        if isinstance(value, float)
        else one_line(str(value))
    )
