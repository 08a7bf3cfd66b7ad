"""What the gatekeeper and the live bus report: harm done to a listener, a frame or the bus.

Nothing is lost silently. A momentary fault (a failure, a refused or dropped frame) is reported each time. A lasting
condition (a full queue, a slow listener) is reported when it begins and whenever its count has doubled: reports must
not cost more than the condition itself.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

from eurobot_od.support.texts import one_line


class Event(Enum):
    """What happened."""

    LISTENER_FAILED = "listener failed"
    LISTENER_SLOW = "listener slow"
    LISTENER_STUCK = "listener stuck"
    QUEUE_OVERFLOW = "queue overflow"
    FRAME_REFUSED = "frame refused"
    FRAME_DROPPED = "frame dropped"
    BUS_FAILED = "bus failed"
    BUS_OFF = "bus off"
    BUS_BACK = "bus back"
    FRAMES_LOST = "frames lost"
    END_FAILED = "end failed"
    NODE_ALARM = "node alarm"
    NODE_FAILED = "node failed"


@dataclass(frozen=True)
class Report:
    """One event: the `name` of a listener, message, identifier or bus, what happened to it, and when in seconds.

    `timestamp` is that of the frame concerned; `error` is the exception, for a caller that wants its traceback. `str()`
    is one line for a person.
    """

    event: Event
    name: str
    text: str
    timestamp: float
    error: BaseException | None = None

    def __str__(self) -> str:
        return one_line(f"{self.event.value}: {self.name}: {' '.join(self.text.split())}")


Reporter: TypeAlias = Callable[[Report], object]
"""Takes a report, on the thread where it happened; it must neither raise nor wait."""


def has_doubled(count: int) -> bool:
    """Tell whether the count of a lasting condition has to be reported: at 1, 2, 4, 8, ..."""
    # A power of two has one bit set: a million losses make twenty reports.
    return count.bit_count() == 1
