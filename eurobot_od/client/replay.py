"""Sends a log's frames to a bus at their recorded times, so that a real node meets yesterday's other nodes.

Frames keep their order and their distance from the first one; a frame that is late is sent at once,
and the next one at its own time.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from eurobot_od.client.master import Master
from eurobot_od.frame import Frame

LATE = 0.001
"""Seconds after its time from which a frame counts as late."""


class Replayed(NamedTuple):
    """How many frames were sent, how many of them late, and by how many seconds the worst."""

    frames: int = 0
    late: int = 0
    worst: float = 0.0


def replay(master: Master, frames: Iterable[tuple[float, Frame]], speed: float) -> Replayed:
    """Send frames with their times in s, `speed` times as fast as they came. Raises BusError."""
    sent, begin = Replayed(), master.clock()
    first: float | None = None
    for time, frame in frames:
        first = time if first is None else first
        due = begin + (time - first) / speed
        master.pump(due - master.clock())
        lag = max(master.clock() - due, 0.0)
        master.send(*frame)
        sent = Replayed(sent.frames + 1, sent.late + (lag > LATE), max(sent.worst, lag))
    return sent
