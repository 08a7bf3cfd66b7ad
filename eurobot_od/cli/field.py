"""Draw the playing field to scale with what a log says of the match: path, gotos, stops, enemies, barriers."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od.cli import options
from eurobot_od.cli.decode import add_log, form_of, opened
from eurobot_od.errors import RemoteError

if TYPE_CHECKING:
    from eurobot_od.logs.meaning import Decoder
    from eurobot_od.logs.statistics import DamageCounts
    from eurobot_od.pdo.message import Message


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_log(parser)
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="picture: .svg, .html or .png")
    parser.add_argument("--title", help="heading of the picture; left out: the log's name")
    options.add_dialect(parser)


def run(arguments: argparse.Namespace) -> int:
    """Draw the match; say what was wrong in the log."""
    from eurobot_od.logs.statistics import DamageCounts
    from eurobot_od.robot.picture.files import form, save
    from eurobot_od.robot.picture.recording import record
    from eurobot_od.robot.protocol import decoder as robot_decoder

    form(arguments.output)
    decoder, damage = robot_decoder(arguments.dialect), DamageCounts()
    recording = record(
        event for log in arguments.logs for event in _messages(log, form_of(log, arguments.format), decoder, damage)
    )
    sys.stderr.writelines(f"{line}\n" for line in damage.report())
    if not recording.path and not recording.gotos:
        raise RemoteError(f"{', '.join(arguments.logs)}: neither a Kalman Position Response nor a Goto XY to draw")
    save(recording, arguments.output, arguments.title or Path(arguments.logs[0]).stem)
    return 0


def _messages(log: str, form: str | None, decoder: Decoder, damage: DamageCounts) -> Iterator[tuple[float, Message]]:
    from eurobot_od.logs import formats
    from eurobot_od.logs.entries import REMEMBERED

    decode = lru_cache(REMEMBERED)(decoder)
    with opened(log) as file:
        for line, time, _, raw in formats.read(file, form):
            meaning = decode(raw)
            damage.add(log, line, meaning.defects)
            if meaning.message is not None:
                yield time, meaning.message
