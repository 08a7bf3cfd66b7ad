"""The time of the match: the core ends it, and the drive keeps it for a core that begins again."""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from eurobot_od.device.timers import START, Script, Timer
from eurobot_od.errors import StateError
from eurobot_od.robot.nodes.core import flows
from eurobot_od.robot.nodes.core.settings import CoreSettings, SingleFlow
from eurobot_od.robot.nodes.node import TIME_LEFT, milliseconds_until

MATCH_OVER = "the match is over"


class MatchClock:
    """Calls `ended` at the `end` of a match, which is None before the first; `is_over` from then on."""

    def __init__(self, core: CoreSettings, ended: Callable[[], object]) -> None:
        self._core = core
        self._ended = ended
        self.is_over = False
        self.end: float | None = None
        self._timer: Timer | None = None
        self._telling: SingleFlow[bool] = SingleFlow(core, is_called=False)

    @property
    def time_left(self) -> float:
        """The time in s until the core ends the match, infinite if there is none."""
        return inf if self.end is None else max(self.end - self._core.now, 0.0)

    @property
    def is_running(self) -> bool:
        """Whether a match was started and has not ended."""
        return self.end is not None and not self.is_over

    def start(self, seconds: float) -> None:
        """Start a match of so many seconds, from the next `tick` on."""
        self.is_over = False
        self._core.soon(lambda now: self._end_at(now + seconds))
        self.tell_drive()

    def recall(self, time_left: float) -> None:
        """Continue a match with so many seconds left; with none it is over."""
        self.is_over = time_left == 0
        self._end_at(self._core.now + time_left)

    def _end_at(self, end: float) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._core.at(end, self._end)
        self.end = end

    def _end(self, _: float) -> None:
        self.is_over = True
        self._ended()

    def tell_drive(self) -> None:
        """Send the drive the time of the match, which it keeps for a core that begins again."""
        self._telling.end(StateError("replaced by a newer clock"))
        self._telling.begin(self._tell_time_left())

    def _tell_time_left(self) -> Script[bool]:
        yield START
        left = milliseconds_until(self.end, self._core.now)
        return (yield from flows.tell_drive(self._core, TIME_LEFT, left, self._core.transmissions))
