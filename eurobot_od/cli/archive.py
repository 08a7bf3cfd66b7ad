"""Put logs into a season: Parquet files with all frames, the messages with their fields, and what is damaged.

A log that is there already is known by its content; a run that was broken off goes on where it was.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import ExitStatus, options
from eurobot_od.support import extras
from eurobot_od.support.amounts import amount
from eurobot_od.support.escaping import one_line

if TYPE_CHECKING:
    from eurobot_od.sdo.client import Progress
    from eurobot_od.season.archive import Archived
    from eurobot_od.season.writing import DecodedNetwork


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    from eurobot_od.logs.formats import FORMATS

    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="logs in any format, packed with gzip or not")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="SEASON", help="folder of the season")
    parser.add_argument("--format", choices=FORMATS, help="format of the logs; left out: by suffix")
    parser.add_argument("--jobs", type=options.jobs, metavar="N", help="logs at once (default: one a core)")
    options.add_network(parser)


def run(arguments: argparse.Namespace) -> ExitStatus:
    """Archive all logs; print a line for each."""
    from eurobot_od.campaign import executors
    from eurobot_od.cli.progress import bar, counted
    from eurobot_od.sdo.client import unwatched

    with extras.needed("season"):
        from eurobot_od.season.archive import archive
    logs = list(dict.fromkeys(arguments.logs))
    drawn = bar(str(logs[0])) if len(logs) == 1 else nullcontext(unwatched)
    with executors.workers(None, arguments.jobs, len(logs)) as workers, drawn as draw:
        told = _adding(draw, logs[0])
        done = archive(logs, arguments.output, _network(arguments), arguments.format, workers, told)
        for each in list(done) if len(logs) == 1 else counted(done, len(logs), "logs", workers.number):
            print(_line(each), flush=True)
    return ExitStatus.FINE


def _adding(draw: Progress, log: Path) -> Callable[[int], None]:
    """Return what draws how much of a log is read from the parts that are; one that is packed has no known size."""
    size = log.stat().st_size if log.suffix != ".gz" and log.is_file() else None
    read = 0

    def told(part: int) -> None:
        nonlocal read
        read += part
        draw(read, size)

    return told


def _network(arguments: argparse.Namespace) -> DecodedNetwork:
    from eurobot_od.season.writing import DecodedNetwork

    decoder = options.decoder(arguments)
    names = {each.cob_id: each.name for each in decoder.protocol.bindings}
    promised = options.promised(arguments, decoder).messages  # one that several nodes send is there for each of them
    answers = {names[each.identifier]: each.answers for each in promised if each.answers and each.identifier in names}
    return DecodedNetwork(decoder.outlines, decoder.protocol.catalogue, tuple(answers.items()))


def _line(archived: Archived) -> str:
    log = one_line(archived.log)
    if archived.known:
        return f"{log}: known, {archived.run}"
    return f"{log}: {archived.run}, {amount(archived.frames, 'frame')}, {archived.damage} damaged"
