"""Draw the playing field to scale with what a log says about the match: path, gotos, stops, enemies, barriers."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from eurobot_od import plugin
from eurobot_od.cli import complain, options
from eurobot_od.cli.logs import ReadOptions, add_log, entries
from eurobot_od.errors import EurobotError, RemoteError

if TYPE_CHECKING:
    from eurobot_od.robot.scene.recording import Truth
    from eurobot_od.traffic.meaning import Meaning


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the command line."""
    add_log(parser)
    words = "picture: .svg or .png; .html: a page that plays the match"
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help=words)
    parser.add_argument("--title", help="heading of the picture; left out: the log's name")
    options.add_dialect(parser)


def run(arguments: argparse.Namespace) -> None:
    """Draw the match; say what was wrong in the log."""
    from eurobot_od.robot.model.options import MatchOptions
    from eurobot_od.robot.scene.files import SeenMatch, form, save
    from eurobot_od.traffic.entries import REMEMBERED
    from eurobot_od.traffic.meaning import DamageCounts

    form(arguments.output)  # complains of a suffix before the logs are read
    robot, damage = plugin.find(arguments.robot), DamageCounts()
    described = options.decoder_of(robot.dialects.load_all(arguments.dialect), robot)
    # Most frames of a match recur: a request without data, a position that has not changed.
    decode = lru_cache(REMEMBERED)(described)

    def meanings() -> Iterator[tuple[float, Meaning]]:
        for log, (line, time, _, raw) in entries(arguments.logs, ReadOptions.of(arguments)):
            meaning = decode(raw)
            damage.add(log, line, meaning.defects)
            yield time, meaning

    facts = MatchOptions(dialect=arguments.dialect, robot=arguments.robot).facts()
    seen = list(meanings())
    match = SeenMatch(seen, described, facts, _truth(arguments.logs, seen[0][0] if seen else 0.0))
    sys.stderr.writelines(f"{line}\n" for line in damage.report())
    recording = match.recording
    if not recording.path and not recording.gotos:
        raise RemoteError(f"{', '.join(arguments.logs)}: neither a Kalman Position Response nor a Goto XY to draw")
    save(match, arguments.output, arguments.title or Path(arguments.logs[0]).stem)


def _truth(logs: list[str], start: float) -> Truth:
    """Return what the world of a simulated match has left beside its log; of several logs nobody knows."""
    from eurobot_od.robot.scene.recording import NOTHING
    from eurobot_od.robot.scene.truth_file import read_truth

    try:
        return read_truth(Path(logs[0]), start) if len(logs) == 1 else NOTHING
    except EurobotError as error:
        complain(str(error))
        return NOTHING
