"""A sound device of which one frame is lost, comes late, or comes twice on its way to the tester."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from math import inf

from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.frame import Frame


class Mishap(Enum):
    """What happens to a frame."""

    LOST = "lost"
    LATE = "late"
    TWICE = "twice"


@dataclass
class Disturbance:
    """What happens to the frame of this `number`, counted over all suites from 0; a late one is late by `delay` s."""

    number: int
    mishap: Mishap
    delay: float = 0.0
    seen: int = 0


def disturbed(disturbance: Disturbance) -> type[SimulatedDevice]:
    """Return a device that is its file, and of whose frames one is disturbed."""

    class Disturbed(SimulatedDevice):
        _late: tuple[float, Frame] | None = None

        @property
        def next_wakeup(self) -> float:
            return min(super().next_wakeup, inf if self._late is None else self._late[0])

        def start(self, now: float) -> list[Frame]:
            return self._disturbed(super().start(now), now)

        def receive(self, frame: Frame, now: float) -> list[Frame]:
            return self._disturbed(super().receive(frame, now), now)

        def requested(self, cob_id: int, now: float) -> list[Frame]:
            return self._disturbed(super().requested(cob_id, now), now)

        def tick(self, now: float) -> list[Frame]:
            frames = self._disturbed(super().tick(now) if super().next_wakeup <= now else [], now)
            if self._late is not None and self._late[0] <= now:
                frames.append(self._late[1])
                self._late = None
            return frames

        def _disturbed(self, frames: list[Frame], now: float) -> list[Frame]:
            first, disturbance.seen = disturbance.seen, disturbance.seen + len(frames)
            place = disturbance.number - first
            if not 0 <= place < len(frames):
                return frames
            if disturbance.mishap is Mishap.LATE:
                self._late = now + disturbance.delay, frames[place]
            copies = 2 if disturbance.mishap is Mishap.TWICE else 0
            return [*frames[:place], *[frames[place]] * copies, *frames[place + 1 :]]

    return Disturbed
