"""`field` draws the playing field to scale with a match from a log: path, gotos, stops, enemies, barriers."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Annotated

from eurobot_od import loading
from eurobot_od.cli import RobotName, complain
from eurobot_od.cli.decode import STANDARD_INPUT, Logs, Reading, entries
from eurobot_od.cli.devices import Dialect, left_out
from eurobot_od.cli.signature import Option
from eurobot_od.errors import EurobotError, RemoteError
from eurobot_od.robot.model.options import MatchOptions
from eurobot_od.robot.scene.files import SeenMatch, form, save
from eurobot_od.robot.scene.recording import NOTHING, Truth, read_truth
from eurobot_od.traffic.entries import REMEMBERED
from eurobot_od.traffic.meaning import DamageCounts, Decoder, Meaning


def field(
    logs: Logs = (STANDARD_INPUT,),
    *,
    reading: Reading,
    output: Annotated[Path, Option("-o", metavar="FILE", is_output=True)],
    title: str | None = None,
    dialect: Dialect = None,
    robot_name: RobotName = None,
) -> None:
    """Draw the playing field to scale with what a log says about the match: path, gotos, stops, enemies, barriers.

    output: picture: .svg or .png; .html: a page that plays the match
    title: heading of the picture; left out: the log's name

    $ field run.log -o field.svg
    $ field run.log -o field.html
    """
    form(output)  # raises for an unknown suffix before the logs are read
    robot = loading.find(robot_name)
    damage = DamageCounts()
    with left_out() as refused:
        described = Decoder(robot.dialects.load_all(dialect), robot.catalogue(), refused)
    # Most frames of a match recur: requests without data, unchanged positions.
    decode = lru_cache(REMEMBERED)(described)

    def meanings() -> Iterator[tuple[float, Meaning]]:
        for log, (line, time, _, raw) in entries(logs, reading):
            meaning = decode(raw)
            damage.add(log, line, meaning.defects)
            yield time, meaning

    facts = MatchOptions(dialect=dialect, robot=robot_name).facts()
    seen = list(meanings())
    match = SeenMatch(seen, described, facts, _truth(logs, seen[0][0] if seen else 0.0))
    sys.stderr.writelines(f"{line}\n" for line in damage.report())
    recording = match.recording
    if not recording.path and not recording.gotos:
        named = ", ".join("standard input" if each == STANDARD_INPUT else each for each in logs)
        raise RemoteError(f"{named}: neither a Kalman Position Response nor a Goto XY to draw")
    save(match, output, title or Path(logs[0]).stem)


def _truth(logs: Sequence[str], start: float) -> Truth:
    """Return what the world of a simulated match has written beside its log; nothing for several logs."""
    try:
        return read_truth(Path(logs[0]), start) if len(logs) == 1 else NOTHING
    except EurobotError as error:
        complain(str(error))
        return NOTHING
