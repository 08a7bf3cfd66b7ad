"""Where the robots are: the last positions that came, and where another robot really is, judged by all of them.

Now and then the beacons see a robot somewhere else, take it for another one, or do not see it, and nothing filters what
they report about others. So a place that is further from the last one than a robot can have driven meanwhile is
believed only when the next one agrees with it, and an unknown place changes nothing.

Two drives on one bus both answer, and nobody can tell whose answer is whose: see `Twins`.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

from eurobot_od.robot.model import messages
from eurobot_od.robot.model.places import Point, is_near

TOP_SPEED = 800.0
"""No robot drives faster than this, mm/s."""

SPREAD = 50.0
"""Two right places of a standing robot are never further apart than this, mm."""


class Sighting(NamedTuple):
    """A received position, and when it came, in seconds of the node's time."""

    position: messages.PositionResponse
    time: float


class Seen(NamedTuple):
    """A place in mm where a robot was at a time in seconds."""

    point: Point
    time: float

    def agrees(self, earlier: Seen | None) -> bool:
        """Tell whether a robot that was seen earlier can be here by now."""
        if earlier is None:
            return False
        return math.dist(self.point, earlier.point) <= SPREAD + TOP_SPEED * (self.time - earlier.time)


class Track:
    """The track of a robot; `last` is where it was last seen, None before."""

    def __init__(self) -> None:
        self.last: Seen | None = None
        self._doubted: Seen | None = None

    def saw(self, sighting: Sighting) -> None:
        """Take in a position."""
        x, y, *_ = sighting.position
        if x is None or y is None:
            return
        seen = Seen(Point(x, y), sighting.time)
        if self.last is None or seen.agrees(self.last) or seen.agrees(self._doubted):
            self.last, self._doubted = seen, None
        else:
            self._doubted = seen


TOGETHER = 0.002
"""Answers to one question come within this time, s; what a drive reports hardly changes meanwhile."""

SURE = 3
"""How often in a row they have to differ: once may be a goto that begins just then, or a correction."""

SAME_TIME, SAME_DISTANCE, SAME_ANGLE = 100, 50.0, 10.0
"""Answers that are no further apart than this are the same, ms, mm and degrees."""

DriveAnswer: TypeAlias = messages.GotoStateResponse | messages.KalmanPositionResponse


class Twins:
    """Notices a second drive: each question gets two answers, one right after the other, and they differ."""

    def __init__(self) -> None:
        self._last: dict[type[DriveAnswer], tuple[DriveAnswer, float]] = {}
        self._times = 0

    def heard(self, answer: DriveAnswer, now: float) -> str:
        """Take in an answer; return two that differ once it is certain that there are two drives, otherwise ''."""
        before, then = self._last.get(type(answer), (answer, -math.inf))
        self._last[type(answer)] = answer, now
        # An answer to another question says nothing, and two drives are reported only once.
        if now - then >= TOGETHER or self._times == SURE:
            return ""
        self._times = self._times + 1 if _differ(before, answer) else 0
        return f"{before} and {answer}" if self._times == SURE else ""


def _differ(before: DriveAnswer, answer: DriveAnswer) -> bool:
    if isinstance(before, messages.KalmanPositionResponse) and isinstance(answer, messages.KalmanPositionResponse):
        return not is_near(before[:3], answer[:3], SAME_DISTANCE, SAME_ANGLE)
    times = before[0], answer[0]
    # One has a goto and the other has none: a few milliseconds do not explain that.
    return times.count(None) == 1 or abs((times[0] or 0) - (times[1] or 0)) > SAME_TIME
