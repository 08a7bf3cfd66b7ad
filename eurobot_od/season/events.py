"""Events of a log that its frames do not show, such as the points of a match; for the table `events` of a season."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple, TypeAlias


class LogEvent(NamedTuple):
    """An event of a log: time in s from the log's first frame, kind, robot, text, and points if it is about points."""

    t: float
    kind: str
    robot: str
    text: str
    points: int | None = None


EventsOfLog: TypeAlias = Callable[[Path], Sequence[LogEvent]]
"""Returns the events of a log; raises LocalError for a damaged file of events."""


def no_events(_: Path) -> Sequence[LogEvent]:
    """Return no events, for a log of which nothing but its frames is known."""
    return ()
