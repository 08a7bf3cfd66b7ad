"""What only the world of a simulated match knows, kept in a file beside the match's log: path, touches, points.

Rule of this file: a log is worth more than what lies beside it. A file that is damaged, or is another log's, is an
error in one line, for a caller to say and to go on without.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from eurobot_od.errors import FileError, LocalError
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.scene.recording import NOTHING, PathPoint, ScoredTask, TouchMark, Truth
from eurobot_od.support.files import read_whole, write_whole

BEGINNING = 1 << 16
"""Bytes of a log that tell it from another one."""


def truth_file(log: Path) -> Path:
    """Return where a log's truth lies."""
    return log.with_name(f"{log.name}.truth.json")


def _digest(log: Path) -> str:
    with log.open("rb") as file:
        return hashlib.sha256(file.read(BEGINNING)).hexdigest()


def write_truth(log: Path, truth: Truth, start: float) -> None:
    """Write what is true of a match beside its log, whose first frame came at `start`; raises OSError.

    Of a log that is a pipe or a device nothing is kept.
    """
    if not log.is_file():
        return
    known = truth.later(-start)
    rounded = [[round(each, 3) for each in place if each is not None] for place in known.path]
    data = {"log": _digest(log), **known._asdict(), "path": rounded}
    write_whole(truth_file(log), json.dumps(data).encode())


def read_truth(log: Path, start: float = 0.0) -> Truth:
    """Return what is known of a log whose first frame came at `start`, NOTHING if nothing lies beside it.

    Raises LocalError for a file that is not one, or that is another log's.
    """
    file = truth_file(log)
    if not file.is_file():
        return NOTHING
    try:
        data = json.loads(read_whole(file))
        if data["log"] == _digest(log):
            return _truth(data).later(start)
    except (FileError, ValueError, KeyError, TypeError) as error:
        raise LocalError(f"{file}: not what `match --log` writes: {error}") from error
    raise LocalError(f"{file}: of another log than {log.name}; its points are left out")


def _truth(data: Any) -> Truth:
    return Truth(
        [PathPoint(*map(float, place)) for place in data["path"]],
        [TouchMark(float(time), Point(*place), str(words), bool(ours)) for time, place, words, ours in data["touches"]],
        [ScoredTask(float(time), str(robot), str(task), int(points)) for time, robot, task, points in data["scores"]],
    )
