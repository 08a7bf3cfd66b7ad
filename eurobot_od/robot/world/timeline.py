"""The timeline of a match: what happened when, in words and as data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum
from typing import Any


class EventKind(Enum):
    """The kind of an event; the value is the word that heads its line."""

    START = "start"
    CHECK = "check"
    CONFIGURE = "configure"
    POSITION = "position"
    MATCH = "match"
    GOTO = "goto"
    ARRIVED = "arrived"
    GIVEN_UP = "given up"
    TASK = "task"
    TOUCH = "touch"
    STOP = "stop"
    EMERGENCY = "emergency"
    WARNING = "warning"
    FAILED = "failed"
    END = "end"


@dataclass(frozen=True)
class MatchEvent:
    """One line of the timeline: `time` in seconds since power-on, in words (`text`) and as `data`."""

    time: float
    kind: EventKind
    text: str
    data: dict[str, Any] = field(default_factory=dict)

    def as_data(self) -> dict[str, Any]:
        """Return everything as plain data."""
        return {"time": round(self.time, 6), "kind": self.kind.value, "text": self.text} | self.data

    def __str__(self) -> str:
        return f"{self.time:9.3f} s  {self.kind.value:<10} {self.text}"


class Timeline:
    """Where events go; `show` is called with each as it comes. `clock` is the match's: seconds since power-on."""

    def __init__(self, clock: Callable[[], float], show: Callable[[MatchEvent], None]) -> None:
        self.clock, self._show = clock, show

    def tell(self, kind: EventKind, text: str, **data: Any) -> None:
        """Add an event that happens now."""
        self._show(MatchEvent(self.clock(), kind, text, data))
