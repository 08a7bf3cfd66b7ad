"""Query a season: by SQL, with a view for each message, or by a ready report. Without a query: list its tables.

DuckDB's SQL; tables are `runs`, `frames`, `damage`, `messages`, and one for each message, such as `goto_xy`.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import complain, options, output
from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.plugin import Plugin
from eurobot_od.support import extras, progress
from eurobot_od.support.texts import columns

if TYPE_CHECKING:
    import polars as pl

    from eurobot_od.season.reports import SeasonReport

BIT_RATE = 500_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    parser.add_argument("season", type=Path, metavar="SEASON", help="folder made by `archive`")
    parser.add_argument("sql", nargs="?", metavar="SQL", help="a query (default: list the tables)")
    parser.add_argument("--report", metavar="NAME", help="a ready query; `--report list` lists them")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="one JSON object per row")
    form.add_argument("--csv", action="store_true", help="comma-separated values")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="also draw the answer as SVG")
    parser.add_argument(
        "-b", "--bitrate", type=options.bit_rate, default=BIT_RATE, help="bit/s for the load (default: %(default)s)"
    )


def run(arguments: argparse.Namespace) -> None:
    """Ask, print, draw."""
    if arguments.sql and arguments.report:
        raise LocalError("a query is SQL or --report, not both")
    with extras.needed("season"):
        from eurobot_od.season import answers
        from eurobot_od.season.season import Season
    known = reports(options.robot(arguments))
    if arguments.report == "list":
        print(*columns((name, report.title) for name, report in known.items()), sep="\n")
        return
    if arguments.report is not None and arguments.report not in known:
        raise UnknownName("report", arguments.report, known)
    season, report = Season.open(arguments.season), known.get(arguments.report)
    question = report.sql if report else arguments.sql
    with progress.bar(str(arguments.season), unit=progress.PERCENT, after=progress.SHORT) as draw:

        def ask(sql: str) -> pl.DataFrame:
            return season.sql(sql, {"bitrate": arguments.bitrate}, lambda done: draw(done, 100))

        rows = ask(question) if question else answers.tables(season)
        if arguments.plot is not None:
            output.write(arguments.plot, answers.picture(ask, report, rows, arguments.sql or "tables"))
    for file in season.damaged:
        complain(f"left out: {file} is damaged; archive its log again")
    # Last, when the bar is wiped out: both may be on one terminal.
    write = answers.as_json if arguments.json else answers.as_csv if arguments.csv else answers.as_table
    sys.stdout.write(write(rows))


def reports(robot: Plugin) -> Mapping[str, SeasonReport]:
    """Return all reports by name, a robot's and those for any devices."""
    from eurobot_od.season.reports import REPORTS

    return {**robot.reports(), **REPORTS}
