"""What a master sends again and again: SYNC, with or without a counter, and TIME (CiA 301, 7.2.5 and 7.2.6).

A frame that is late is sent late, and the next one at its own time; missed frames are not sent later.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from datetime import datetime
from functools import partial
from itertools import count

from eurobot_od.client.master import Master
from eurobot_od.client.reconnecting import Guard, unguarded
from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame
from eurobot_od.od.time_of_day import TimeOfDay
from eurobot_od.od.values import SYNC_COB_ID, TIME_COB_ID

COUNTERS = range(2, 241)
"""Values that the synchronous counter may overflow at (CiA 301, 7.5.2.22, object 0x1019)."""


def syncs(overflow: int | None = None, cob_id: int = SYNC_COB_ID) -> Iterator[Frame]:
    """Yield endless SYNC messages, counted from 1 to `overflow` and again if there is one; raises LocalError."""
    if overflow is None:
        return (Frame(cob_id) for _ in count())
    if overflow not in COUNTERS:
        raise LocalError(f"a counter of SYNC ends at {COUNTERS[0]} to {COUNTERS[-1]}, not at {overflow}")
    return (Frame(cob_id, bytes([1 + number % overflow])) for number in count())


def times(now: Callable[[], datetime], cob_id: int = TIME_COB_ID) -> Iterator[Frame]:
    """Yield endless TIME messages, each with the time at which it is taken."""
    return (Frame(cob_id, TimeOfDay.of(now()).data) for _ in count())


def produce(master: Master, frames: Iterable[Frame], period: float, guard: Guard = unguarded) -> None:
    """Send the first frame at once and then one every `period` seconds until there are no more, with the guard held.

    Raises BusError.
    """
    due = master.clock()
    for frame in frames:
        guard(partial(master.send, *frame))
        due += period * (1 + max(0, int((master.clock() - due) // period)))
        while (left := due - master.clock()) > 0:
            guard(partial(master.pump, left))
