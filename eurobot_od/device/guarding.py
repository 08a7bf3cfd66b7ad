"""Node guarding: a master asks by remote frames whether the device is there (CiA 301, 7.2.8.2.2.1, 7.5.2.11, 7.5.2.12).

Rule of this file: the device misses its master from the first question on, never before; times are in seconds.
"""

from __future__ import annotations

from math import inf

from eurobot_od.device.nmt import NmtState
from eurobot_od.frame import Frame
from eurobot_od.od.values import ERROR_CONTROL_BASE

TOGGLE = 1 << 7
"""Bit of an answer that changes each time, from 0 on: two answers in a row are told apart from one repeated."""


class NodeGuarding:
    """The guarded side; `next` is when the master will have been silent too long, infinite if it is not missed."""

    def __init__(self) -> None:
        self.next = inf
        self.lost = False
        self._toggle = 0
        self._life_time = 0.0

    def configure(self, life_time: float) -> None:
        """Take over how long the master may be silent, 0.0 for ever; a changed time holds from the next question on."""
        if life_time != self._life_time:
            self._life_time, self.next, self.lost = life_time, inf, False

    def answer(self, node_id: int, state: NmtState, now: float) -> Frame:
        """Return the answer to a question."""
        data = bytes([self._toggle | state])
        # Only a reset, which makes this object anew, begins with 0 again; a master that was silent does not.
        self._toggle ^= TOGGLE
        self.next = now + self._life_time if self._life_time else inf
        self.lost = False
        return Frame(ERROR_CONTROL_BASE + node_id, data)

    def overdue(self, now: float) -> bool:
        """Whether the master has fallen silent by now; told once."""
        if now < self.next:
            return False
        self.next, self.lost = inf, True
        return True
