"""Draw the playing field to scale with what a log says of the match: path, gotos, stops, enemies, barriers."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import options
from eurobot_od.cli.logs import add_log, entries
from eurobot_od.errors import RemoteError

if TYPE_CHECKING:
    from eurobot_od.pdo.message import Message


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_log(parser)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="picture: .svg, .html or .png")
    parser.add_argument("--title", help="heading of the picture; left out: the log's name")
    options.add_dialect(parser)


def run(arguments: argparse.Namespace) -> None:
    """Draw the match; say what was wrong in the log."""
    from eurobot_od.logs.entries import REMEMBERED
    from eurobot_od.logs.statistics import DamageCounts
    from eurobot_od.robot.picture.files import form, save
    from eurobot_od.robot.picture.recording import record
    from eurobot_od.robot.protocol import decoder

    form(arguments.output)  # complains of a suffix before the logs are read
    decode, damage = lru_cache(REMEMBERED)(decoder(arguments.dialect)), DamageCounts()

    def messages() -> Iterator[tuple[float, Message]]:
        for log, (line, time, _, raw) in entries(arguments.logs, arguments):
            meaning = decode(raw)
            damage.add(log, line, meaning.defects)
            if meaning.message is not None:
                yield time, meaning.message

    recording = record(messages())
    sys.stderr.writelines(f"{line}\n" for line in damage.report())
    if not recording.path and not recording.gotos:
        raise RemoteError(f"{', '.join(arguments.logs)}: neither a Kalman Position Response nor a Goto XY to draw")
    save(recording, arguments.output, arguments.title or Path(arguments.logs[0]).stem)
