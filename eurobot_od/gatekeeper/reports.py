"""What the gatekeeper says when a listener or a frame comes to harm.

Rule of this file: nothing is lost without a word. A fault of one moment (a failure, a refused or dropped frame) is
reported each time; a condition that lasts (a full queue, a slow listener) when it begins and whenever its count has
doubled, so that a report never costs more than what it reports.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias


class Event(Enum):
    """What happened."""

    LISTENER_FAILED = "listener failed"
    LISTENER_SLOW = "listener slow"
    LISTENER_STUCK = "listener stuck"
    QUEUE_OVERFLOW = "queue overflow"
    FRAME_REFUSED = "frame refused"
    FRAME_DROPPED = "frame dropped"


@dataclass(frozen=True)
class Report:
    """One event: whose (`name` of a listener, a message or an identifier), what, and when in seconds.

    `timestamp` is that of the frame concerned; `error` is the exception a listener raised, for whoever wants its
    traceback. `str()` is one line for a person.
    """

    event: Event
    name: str
    text: str
    timestamp: float
    error: Exception | None = None

    def __str__(self) -> str:
        return f"{self.event.value}: {self.name}: {' '.join(self.text.split())}"


Reporter: TypeAlias = Callable[[Report], object]
"""Takes a report, on the thread where it happened; it must neither raise nor wait."""


def has_doubled(count: int) -> bool:
    """Tell whether the count of a lasting condition is to be reported: at 1, 2, 4, 8, ..."""
    return count.bit_count() == 1
