"""Put logs into a season: Parquet files of all frames, the messages with their fields, and what is damaged.

A log that was archived before is recognised by its content; an interrupted run goes on where it was.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import options
from eurobot_od.support import extras
from eurobot_od.support.texts import amount, one_line

if TYPE_CHECKING:
    from eurobot_od.support.progress import Progress


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    from eurobot_od.traffic.formats import FORMATS

    parser.add_argument("logs", nargs="+", type=Path, metavar="LOG", help="logs in any format, packed with gzip or not")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="SEASON", help="folder of the season")
    parser.add_argument("--format", choices=FORMATS, help="format of the logs (default: by suffix)")
    parser.add_argument("--jobs", type=options.jobs, metavar="N", help="logs at the same time (default: one per core)")
    options.add_network(parser)


def run(arguments: argparse.Namespace) -> None:
    """Archive all logs; print a line for each."""
    from eurobot_od.season import campaign
    from eurobot_od.support.progress import bar, counted, unwatched

    with extras.needed("season"):
        from eurobot_od.season.archive import archive
        from eurobot_od.season.writing import DecodedNetwork
    logs = list(dict.fromkeys(arguments.logs))  # one that two patterns of a shell name is archived once
    devices = options.Devices.of(arguments)
    decoder = devices.decoder()
    names = {each.cob_id: each.name for each in decoder.protocol.bindings}
    promised = devices.promised(decoder).messages  # one that several nodes send is there for each of them
    answers = {names[each.identifier]: each.answers for each in promised if each.answers and each.identifier in names}
    network = DecodedNetwork(decoder.dictionaries, decoder.protocol.catalogue, tuple(answers.items()))
    drawn = bar(str(logs[0])) if len(logs) == 1 else nullcontext(unwatched)
    with campaign.workers(None, arguments.jobs, len(logs)) as workers, drawn as draw:
        done = archive(logs, arguments.output, network, arguments.format, workers, _adding(draw, logs[0]))
        for each in list(done) if len(logs) == 1 else counted(done, len(logs), "logs", workers.number):
            log, size = one_line(each.log), f"{amount(each.frames, 'frame')}, {each.damage} damaged"
            print(f"{log}: known, {each.run}" if each.known else f"{log}: {each.run}, {size}", flush=True)


def _adding(draw: Progress, log: Path) -> Callable[[int], None]:
    """Return a function that takes the sizes of the parts as they are read, and draws how much of the log that is."""
    # The unpacked size of a packed log is not known before its end.
    size = log.stat().st_size if log.suffix != ".gz" and log.is_file() else None
    read = 0

    def add(part: int) -> None:
        nonlocal read
        read += part
        draw(read, size)

    return add
