"""A python-can bus in simulated time, which advances while a program waits for a frame.

There are neither threads nor a real clock. Time advances only in `recv`; `simulation.now` is the time in s.
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
    """A participant of a simulated bus; its frames take part in the arbitration."""

    def __init__(self, simulation: Simulation) -> None:
        self.simulation = simulation
        self.channel_info = "simulated bus"
        self.channel = "simulated"
        self._waiting: deque[Frame] = deque()
        self._heard: deque[can.Message] = deque()
        self._is_own = False
        self._has_new = simulation.join(self)
        simulation.observers.append(self._observed)
        super().__init__(self.channel)

    # Sending

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Queue a frame; remote frames are dropped, because no simulated device answers them."""
        if not msg.is_remote_frame:
            self._waiting.append(Frame(msg.arbitration_id, bytes(msg.data)))
            self._has_new()

    def urgent(self) -> Frame | None:
        """Return the first queued frame, or None."""
        return self._waiting[0] if self._waiting else None

    def complete(self, frame: Frame) -> None:
        """Note that a frame was sent; it is observed next, like every frame."""
        self._waiting.popleft()
        self._is_own = True

    def _send_periodic_internal(
        self, msgs: Sequence[can.Message] | can.Message, period: float, *_: Any, **__: Any
    ) -> SimulatedTask:
        messages = [msgs] if isinstance(msgs, can.Message) else msgs
        return SimulatedTask(self, messages, period)

    # Receiving

    def _observed(self, now: float, frame: Frame) -> None:
        if self._is_own:
            self._is_own = False
            return
        cob_id, data = frame
        self._heard.append(can.Message(timestamp=now, arbitration_id=cob_id, data=data, is_extended_id=False))

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Advance simulated time until a frame comes, for at most `timeout` s.

        Raises LocalError if no frame would ever come. Unlike python-can's own `recv`, it takes no real time.
        """
        end = inf if timeout is None else self.simulation.now + timeout
        while not self._heard:
            if end == inf == self.simulation.next_event:
                raise LocalError("no device has anything to do: waiting without an end would last for ever")
            if not self.simulation.advance(end):
                return None
        return self._heard.popleft()

    def shutdown(self) -> None:
        """Leave the bus."""
        if not self._is_shutdown:
            self.simulation.observers.remove(self._observed)
        super().shutdown()


class SimulatedTask(can.broadcastmanager.CyclicSendTaskABC):
    """Messages that are sent in turn with a fixed period in s of simulated time."""

    def __init__(self, bus: SimulatedBus, messages: Sequence[can.Message], period: float) -> None:
        super().__init__(messages, period)
        self._bus = bus
        self._next = cycle(self.messages)
        self._runs = True
        self._due = bus.simulation.now
        self._send()

    def _send(self) -> None:
        if self._runs:
            self._bus.send(next(self._next))
            self._due += self.period
            self._bus.simulation.plan(self._due, self._send)

    def stop(self) -> None:
        """Stop sending."""
        self._runs = False
