"""`archive` makes a season, the Parquet files of many logs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from eurobot_od.cli import complain
from eurobot_od.cli.decode import Format, Reading, decoder_for
from eurobot_od.cli.devices import Devices
from eurobot_od.cli.options import FrameNames, Jobs
from eurobot_od.cli.signature import Option
from eurobot_od.season import campaign
from eurobot_od.support import extras
from eurobot_od.support.progress import Progress, bar, counted, unwatched
from eurobot_od.support.texts import amount, one_line

if TYPE_CHECKING:
    pass


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
            size = f"{amount(each.frames, 'frame')}, {amount(each.damage, 'defect')}"
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
