"""Objects that are read by SDO again and again, for plots.

A few objects a few times a second; SDO requests of a page must not load the bus.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable


PERIOD = 0.25
"""Seconds from one reading of all polled objects to the next."""

MOST = 16
"""Objects polled at once, for all browsers together."""


WANTED = 15.0
"""Seconds for which an object is read after a request; a page that still plots it asks again before that."""


@dataclass
class PolledObject:
    """An object of a node, its last value and when that was read, and until when.

    `turn` is the session's, for what has changed.
    """

    node_id: int
    thing: ODVariable
    time: float = 0.0
    value: Any = None
    trouble: str = ""
    turn: int = -1
    wanted_until: float = 0.0

    def shown(self) -> dict[str, Any]:
        """Return it as data."""
        return {"time": round(self.time, 4), "value": self.value, "trouble": self.trouble}
