"""A second bus on one adapter, for a master that asks nodes while another reader takes every frame.

Only one thread at a time sends, as few drivers allow two. The frames that wait for the master are bounded: it takes
frames only while it asks for something, and other masters may be on the bus all day.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from queue import Empty, Full, Queue, SimpleQueue
from threading import Lock

import can

from eurobot_od.errors import BusError
from eurobot_od.frame import Frame
from eurobot_od.od.values import NODE_IDS, SDO_RESPONSE_BASE

DEFAULT_ANSWERS = frozenset(SDO_RESPONSE_BASE + node for node in NODE_IDS)
"""COB-IDs of SDO answers where no file gives others."""

MOST_WAITING = 1000
"""Most frames that wait for the master; the oldest make room."""

PATIENCE = 0.5
"""Seconds that the driver has to accept a frame."""


class Tap(can.BusABC):
    """A bus for a master: it sends by another's `send`, and receives what it is given.

    It is given the SDO answers; `moved` are the COB-IDs of those that a file has moved. While there is `trouble` with
    the bus, sending raises it as a BusError.
    """

    def __init__(self, send: Callable[[Frame, float], bool], moved: Iterable[int] = ()) -> None:
        super().__init__(channel="tap")
        self.channel_info = "bus"
        self._send_by, self._wanted = send, DEFAULT_ANSWERS.union(moved)
        self.trouble = ""
        self._lock = Lock()
        self._came: Queue[can.Message] = Queue(MOST_WAITING)
        self._sent: SimpleQueue[Frame] = SimpleQueue()

    def give(self, frame: Frame) -> None:
        """Pass a frame to the master if it listens to it."""
        if frame.cob_id not in self._wanted or frame.is_remote:
            return
        message = can.Message(arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False)
        with suppress(Full):  # only this thread puts anything in
            if self._came.full():
                with suppress(Empty):  # the master was quicker
                    self._came.get_nowait()
            self._came.put_nowait(message)

    def send_frame(self, frame: Frame) -> None:
        """Send a frame; raises BusError if the driver does not take it."""
        with self._lock:
            if self.trouble:
                raise BusError(self.trouble)
            if not self._send_by(frame, PATIENCE):
                raise BusError("the bus did not take the frame: is another node there to acknowledge it?")
        self._sent.put(frame)

    def sent(self) -> list[Frame]:
        """Return what was sent since the last call: a bus does not return a frame to its sender."""
        return [self._sent.get() for _ in range(self._sent.qsize())]

    # what python-can asks of a bus

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.send_frame(Frame(msg.arbitration_id, bytes(msg.data)))

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        try:
            return self._came.get(timeout=timeout), False
        except Empty:
            return None, False
