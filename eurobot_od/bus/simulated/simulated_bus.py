"""A python-can bus in simulated time: whoever waits for a frame lets the devices live until it comes.

This bus has neither threads nor a real clock. Time passes only in `recv`; `simulation.now` is the time in seconds.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from itertools import cycle
from math import inf
from typing import Any

import can

from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame


class SimulatedBus(can.BusABC):
    """A participant of a simulated bus; its frames have to win the arbitration as all others."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation, self.channel_info, self.channel = simulation, "simulated bus", "simulated"
        self._waiting: deque[Frame] = deque()
        self._heard: deque[can.Message] = deque()
        self._is_own = False
        self._has_new = simulation.join(self)
        simulation.observers.append(self._observed)
        super().__init__(self.channel)

    # What it sends

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Leave a frame to the controller; remote frames, which nothing simulated answers, are not sent."""
        if not msg.is_remote_frame:
            self._waiting.append(Frame(msg.arbitration_id, bytes(msg.data)))
            self._has_new()

    def urgent(self) -> Frame | None:
        """Return the frame to be sent first."""
        return self._waiting[0] if self._waiting else None

    def complete(self, frame: Frame) -> None:
        """Take note that a frame is through; it is observed next, as every frame is."""
        self._waiting.popleft()
        self._is_own = True

    def _send_periodic_internal(
        self, msgs: Sequence[can.Message] | can.Message, period: float, *_: Any, **__: Any
    ) -> SimulatedTask:
        messages = [msgs] if isinstance(msgs, can.Message) else msgs
        return SimulatedTask(self, messages, period)

    # What it hears

    def _observed(self, now: float, frame: Frame) -> None:
        if self._is_own:
            self._is_own = False
            return
        cob_id, data = frame
        self._heard.append(can.Message(timestamp=now, arbitration_id=cob_id, data=data, is_extended_id=False))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Let simulated time pass until a frame comes, for at most `timeout` seconds.

        Raises LocalError if without an end none ever would. Python-can's own `recv` would wait in real time as well.
        """
        end = inf if timeout is None else self.simulation.now + timeout
        while not self._heard:
            if end == inf == self.simulation.next_event:
                raise LocalError("no device has anything to do: waiting without an end would last for ever")
            if not self.simulation.advance(end):
                return None
        return self._heard.popleft()

    def shutdown(self) -> None:
        """Let go of the bus."""
        if not self._is_shutdown:
            self.simulation.observers.remove(self._observed)
        super().shutdown()


class SimulatedTask(can.broadcastmanager.CyclicSendTaskABC):
    """Messages in simulated time, one after the other, at a fixed period in seconds."""

    def __init__(self, bus: SimulatedBus, messages: Sequence[can.Message], period: float) -> None:
        super().__init__(messages, period)
        self._bus, self._next, self._runs = bus, cycle(self.messages), True
        self._due = bus.simulation.now
        self._send()

    def _send(self) -> None:
        if self._runs:
            self._bus.send(next(self._next))
            self._due += self.period
            self._bus.simulation.plan(self._due, self._send)

    def stop(self) -> None:
        """End it."""
        self._runs = False
