"""A second bus on one adapter: for a master that asks nodes while somebody else reads every frame.

Rule of this file: one thread at a time sends, as few drivers allow two; what the master has no use for is not kept.
"""

from __future__ import annotations

from queue import Empty, SimpleQueue
from threading import Lock

import can

from eurobot_od.errors import BusError
from eurobot_od.frame import Frame
from eurobot_od.live import Driver
from eurobot_od.od.values import ERROR_CONTROL_BASE, NODE_IDS, SDO_RESPONSE_BASE

WANTED = {base + node for base in (SDO_RESPONSE_BASE, ERROR_CONTROL_BASE) for node in NODE_IDS}
"""COB-IDs that a master listens to: SDO answers and heartbeats."""

PATIENCE = 0.5
"""Seconds that the driver has to take a frame."""


class Tap(can.BusABC):
    """What a master may treat as a bus: it sends by the `driver` of another, and receives what it is given.

    Without a driver, as while the bus is down, sending raises BusError with `trouble`.
    """

    def __init__(self) -> None:
        super().__init__(channel="tap")
        self.channel_info = "bus"
        self.driver: Driver | None = None
        self.trouble = ""
        self._lock = Lock()
        self._came: SimpleQueue[can.Message] = SimpleQueue()
        self._sent: SimpleQueue[Frame] = SimpleQueue()

    def give(self, frame: Frame) -> None:
        """Let the master have a frame if it wants it."""
        if frame.cob_id in WANTED:
            self._came.put(can.Message(arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False))

    def send_frame(self, frame: Frame) -> None:
        """Send a frame; raises BusError if the driver does not take it."""
        with self._lock:
            if self.driver is None:
                raise BusError(self.trouble or "the bus is not open")
            if not self.driver.send(frame, PATIENCE):
                raise BusError("the bus did not take the frame: is anybody there to acknowledge it?")
        self._sent.put(frame)

    def sent(self) -> list[Frame]:
        """Return what was sent since the last call: a bus does not tell its own sender."""
        return [self._sent.get() for _ in range(self._sent.qsize())]

    # what python-can asks of a bus

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.send_frame(Frame(msg.arbitration_id, bytes(msg.data)))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        try:
            return self._came.get(timeout=timeout), False
        except Empty:
            return None, False
