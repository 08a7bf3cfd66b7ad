"""A sender with its queue and a wire, and an interrupt at any of their lines."""

from __future__ import annotations

import inspect
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

import can

from eurobot_od.bus.live import Driver
from eurobot_od.bus.live import buses as buses_module
from eurobot_od.bus.live.buses import Sender
from eurobot_od.controller import Stay, TransmitQueue
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame

FRAMES = [Frame(cob_id) for cob_id in (0x008, 0x004, 0x3C0, 0x002, 0x010)]
"""More than a controller has mailboxes."""


class Wire(can.BusABC):
    """A bus that keeps what it is given, as long as it has no `error`."""

    def __init__(self) -> None:
        super().__init__(channel="wire")
        self.channel_info = "wire"
        self.error: Exception | None = None
        self.sent: list[Frame] = []

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.error is not None:
            raise self.error
        self.sent.append(Frame(msg.arbitration_id, bytes(msg.data)))


class Scene:
    """A sender with a queue and its wire."""

    def __init__(self, queue: TransmitQueue) -> None:
        self.wire = Wire()
        self.failures: list[BusError] = []
        self.woken = 0
        self.now = 0.0
        self.queue, lock = queue, threading.RLock()
        self.sender = Sender(Driver(self.wire), queue, lock, lambda: self.now, self.failures.append, self.wake)

    def wake(self) -> None:
        self.woken += 1

    def submit(self, *frames: Frame) -> None:
        for frame in frames:
            self.queue.submit(frame, 0.0, Stay.LASTING)


class Interrupt:
    """Raises KeyboardInterrupt at a line of the sender or a queue, counted from the first one that is run."""

    def __init__(self, line: int, queue: TransmitQueue) -> None:
        self.left = line
        self._files = {buses_module.__file__, *map(inspect.getfile, type(queue).__mro__[:-1])}

    def __call__(self, frame: FrameType, event: str, _: Any) -> Interrupt | None:
        if frame.f_code.co_filename not in self._files:
            return None
        if event == "line":
            self.left -= 1
            if self.left == 0:
                raise KeyboardInterrupt
        return self


def interrupted(scene: Scene, line: int) -> bool:
    """Pump, interrupted at a line; False if there are not that many."""
    before = sys.gettrace()
    sys.settrace(Interrupt(line, scene.queue))
    try:
        scene.sender.pump()
    except KeyboardInterrupt:
        return True
    finally:
        sys.settrace(before)
    return False


def interrupt_at_any_line(queue: Callable[[], TransmitQueue]) -> int:
    """Interrupt a sender at each of its lines and its queue's, and return their number; no frame may be lost."""
    line = 0
    hit = True
    while hit:
        line += 1
        scene = Scene(queue())
        scene.submit(*FRAMES)
        with scene.wire:
            hit = interrupted(scene, line)
            scene.submit(Frame(0x001))
            scene.sender.pump()
        assert set(scene.wire.sent) == {*FRAMES, Frame(0x001)}, line
        assert not scene.sender.busy, line
    return line
