"""`archive` makes a season, the Parquet files of many logs, and `query` asks it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from eurobot_od.cli import RobotName, complain
from eurobot_od.cli.decode import Format, Reading, decoder_for
from eurobot_od.cli.devices import Devices
from eurobot_od.cli.options import BIT_RATE, BitRate, FrameNames, Jobs, Json, Seconds, write
from eurobot_od.cli.signature import Option
from eurobot_od.errors import LocalError, look_up
from eurobot_od.season import campaign
from eurobot_od.season.reports import REPORTS, SeasonReport
from eurobot_od.support import extras, progress
from eurobot_od.support.progress import Progress, bar, counted, unwatched
from eurobot_od.support.texts import amount, columns, one_line

if TYPE_CHECKING:
    import polars as pl

    from eurobot_od.plugin import Plugins


def archive(
    logs: Annotated[Sequence[Path], Option(metavar="LOG")],
    *,
    output: Annotated[Path, Option("-o", metavar="SEASON")],
    format: Format | None = None,
    jobs: Jobs | None = None,
    devices: Devices,
    names: FrameNames,
) -> None:
    """Put logs into a season: Parquet files of all frames, the messages with their fields, and what is damaged.

    A log that was archived before is recognised by its content; an interrupted run goes on where it was.

    logs: logs in any format, packed with gzip or not
    output: folder of the season
    format: format of the logs (default: by suffix)
    jobs: logs at the same time (default: one per core)

    $ archive run.log -o season
    $ archive run.log -o season --eds 5=motor.eds
    """
    with extras.needed("season"):
        from eurobot_od.season.archive import DecodedNetwork, archive
    logs = list(dict.fromkeys(logs))  # two patterns may match the same log
    decoder = decoder_for(map(str, logs), Reading(format=format), devices, names)
    messages = {each.cob_id: each.name for each in decoder.protocol.bindings}
    promised = devices.promised(decoder).messages  # with a row for each sender of a message
    answering = (each for each in promised if each.answers and each.identifier in messages)
    answers = {messages[each.identifier]: each.answers for each in answering}
    sent = replace(devices)  # a copy without cached files, as it is pickled for other processes
    network = DecodedNetwork(
        decoder.dictionaries,
        decoder.protocol.catalogue,
        tuple(answers.items()),
        devices.error_words(names.emcy),
        tuple(devices.dbc_files(names)),
        sent.frames_of,
        sent.events_of,
    )
    drawn = bar(str(logs[0])) if len(logs) == 1 else nullcontext(unwatched)
    with campaign.workers(None, jobs, len(logs)) as workers, drawn as draw:
        done = archive(logs, output, network, format, workers, _adding(draw, logs[0]))
        archived = list(done) if len(logs) == 1 else counted(done, len(logs), "logs", workers.number)
        for each in archived:
            log = one_line(each.log)
            size = f"{amount(each.frames, 'frame')}, {each.damage} damaged"
            print(f"{log}: known, {each.run}" if each.known else f"{log}: {each.run}, {size}", flush=True)
            for note in each.notes:
                complain(f"{log}: {note}")


def _adding(draw: Progress, log: Path) -> Callable[[int], None]:
    """Return a function that adds up the sizes of parts and draws the progress of the log."""
    # The unpacked size of a compressed log is unknown.
    size = log.stat().st_size if log.suffix != ".gz" and log.is_file() else None
    read = 0

    def add(part: int) -> None:
        nonlocal read
        read += part
        draw(read, size)

    return add


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
    plot: Annotated[Path | None, Option(metavar="FILE")] = None,
    at_most: Seconds = inf,
    bitrate: BitRate = BIT_RATE,
    robot_name: RobotName = None,
) -> None:
    """Query a season: by SQL, with a view for each message, or by a ready report. Without a query: list its tables.

    DuckDB's SQL; tables are `runs`, `frames`, `damage`, `messages`, `fields`, services (`sdo`, `emcy`, `heartbeat`,
    `nmt`), and one for each message, such as `goto_xy`.

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
