"""What a master sends by the clock: SYNC and TIME, and the frames of a log at their recorded times.

A late frame is sent at once, and the next one at its own time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from datetime import datetime
from functools import partial
from itertools import count
from typing import NamedTuple

from eurobot_od.client.master import Guard, Master, unguarded
from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame
from eurobot_od.od.time_of_day import TimeOfDay
from eurobot_od.od.values import SYNC_COB_ID, TIME_COB_ID

# SYNC, with or without a counter, and TIME (CiA 301, 7.2.5 and 7.2.6)


COUNTERS = range(2, 241)
"""Values at which the synchronous counter may overflow (CiA 301, 7.5.2.22, object 0x1019)."""


def syncs(overflow: int | None = None, cob_id: int = SYNC_COB_ID) -> Iterator[Frame]:
    """Yield SYNC messages without end, counted from 1 to `overflow` if there is one; raises LocalError."""
    if overflow is None:
        return (Frame(cob_id) for _ in count())
    if overflow not in COUNTERS:
        raise LocalError(f"a counter of SYNC ends at {COUNTERS[0]} to {COUNTERS[-1]}, not at {overflow}")
    return (Frame(cob_id, bytes([1 + number % overflow])) for number in count())


def times(now: Callable[[], datetime], cob_id: int = TIME_COB_ID) -> Iterator[Frame]:
    """Yield TIME messages without end, each with the time at which it is taken."""
    return (Frame(cob_id, TimeOfDay.of(now()).data) for _ in count())


def produce(master: Master, frames: Iterable[Frame], period: float, guard: Guard = unguarded) -> None:
    """Send the first frame at once, then one every `period` seconds until there are no more. Raises BusError.

    Each is sent and waited for under the guard.
    """
    due = master.clock()
    for frame in frames:
        guard(partial(master.send, *frame))
        due += period * (1 + max(0, int((master.clock() - due) // period)))
        while (left := due - master.clock()) > 0:
            guard(partial(master.pump, left))


# A log, so that a real node meets yesterday's other nodes


LATE = 0.001
"""Seconds after its time from which a frame counts as late."""


class Replayed(NamedTuple):
    """The number of frames that were sent and of those that were late, and the worst delay in seconds."""

    frames: int = 0
    late: int = 0
    worst: float = 0.0


def replay(master: Master, frames: Iterable[tuple[float, Frame]], speed: float) -> Replayed:
    """Send frames with their times in seconds, `speed` times as fast as they came. Raises BusError."""
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
