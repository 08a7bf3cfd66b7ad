"""`query` asks a season."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from eurobot_od.cli import RobotName, complain
from eurobot_od.cli.options import BIT_RATE, BitRate, Json, Seconds, write
from eurobot_od.cli.signature import Option
from eurobot_od.errors import LocalError, look_up
from eurobot_od.season.reports import REPORTS, SeasonReport
from eurobot_od.support import extras, progress
from eurobot_od.support.progress import bar
from eurobot_od.support.texts import columns

if TYPE_CHECKING:
    import polars as pl

    from eurobot_od.plugin import Plugins


def reports(plugins: Plugins) -> Mapping[str, SeasonReport]:
    """Return all reports by name: the robot's, and those for any devices."""
    return {**plugins.robot.reports(), **REPORTS}


def _known(robot_name: str | None) -> Mapping[str, SeasonReport]:
    from eurobot_od.cli.devices import Devices  # here, as importing it takes as long as a query

    return reports(Devices(robot_name=robot_name).plugins)


def query(
    season: Annotated[Path, Option(metavar="SEASON")],
    sql: Annotated[str | None, Option(metavar="SQL")] = None,
    *,
    report: Annotated[str | None, Option(metavar="NAME", suggest=reports)] = None,
    as_json: Annotated[Json, Option(either="form")] = False,
    as_csv: Annotated[bool, Option("--csv", either="form")] = False,
    plot: Annotated[Path | None, Option(metavar="FILE", is_output=True)] = None,
    at_most: Seconds = inf,
    bitrate: BitRate = BIT_RATE,
    robot_name: RobotName = None,
) -> None:
    """Query a season: by SQL, with a view for each message, or by a ready report. Without a query: list its tables.

    DuckDB's SQL; tables are `runs`, `frames`, `damage`, `messages`, `fields`, services (`sdo`, `emcy`, `heartbeat`,
    `nmt`), `events` of simulated matches, and one for each message, such as `goto_xy`.

    season: folder made by `archive`
    sql: a query (default: list the tables)
    report: a ready query; `--report list` lists them
    as_json: one JSON object per row
    as_csv: comma-separated values
    plot: also draw the answer as SVG
    at_most: end a query that takes longer, such as 60s (default: no limit)
    bitrate: bit/s for the load (default: 500000)

    $ query season
    $ query season "SELECT cob_id, count(*) FROM frames GROUP BY cob_id"
    """
    if sql is None and " " in str(season) and not season.exists():
        raise LocalError(f"which season? Write query SEASON '{season}'")
    if sql and report:
        raise LocalError("a query is SQL or --report, not both")
    with extras.needed("season"):
        from eurobot_od.season import answers
        from eurobot_od.season.season import Season
    known = {} if report is None else _known(robot_name)
    if report == "list":
        print(*columns((name, each.title) for name, each in known.items()), sep="\n")
        return
    ready = None if report is None else look_up("report", report, known)
    opened = Season.open(season)
    question = ready.sql if ready else sql
    try:
        with bar(str(season), unit=progress.PERCENT, late=True) as draw:

            def ask(sql: str) -> pl.DataFrame:
                return opened.sql(sql, {"bitrate": bitrate}, lambda done: draw(done, 100), at_most)

            rows = ask(question) if question else answers.tables(opened)
            if plot is not None:
                write(plot, answers.picture(ask, ready, rows, sql or "tables"))
    finally:
        for file in opened.damaged:
            complain(f"left out: {file} is damaged; archive its log again")
    # Last, when the bar has been erased, as both may be on one terminal.
    written = answers.as_csv if as_csv else answers.as_table
    sys.stdout.write(answers.as_json(rows) if as_json else written(rows))
