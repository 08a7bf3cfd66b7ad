"""Runs a group of nodes on one bus, in one thread and in real time: a whole network of simulated devices.

A bus that fails is opened again, if there is what opens it, and then the nodes go on, as a single one does (`Live`).
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from eurobot_od.bus.live.buses import Driver, Opener, failure, shut_down
from eurobot_od.device.station import NodeGroup
from eurobot_od.errors import BusError
from eurobot_od.frame import HIGHEST_IDENTIFIER, MOST_BYTES, Frame, RemoteFrame
from eurobot_od.gatekeeper import Event, Report
from eurobot_od.support.connections import Backoff

if TYPE_CHECKING:
    import can

POLL = 0.1
"""Seconds after which the loop looks at the time when nothing comes and nothing is due."""

TAKEN_WITHIN = 1.0
"""Seconds in which a driver has to take a frame."""


class LiveGroup:
    """A group of nodes on a bus; `sent` and `received` count frames. A context manager, which shuts the bus down.

    A bus that fails is opened again by `opener`, if there is one; `report` is told.
    """

    def __init__(
        self,
        bus: can.BusABC,
        group: NodeGroup,
        clock: Callable[[], float] = time.perf_counter,
        opener: Opener | None = None,
        report: Callable[[Report], object] = lambda _: None,
    ) -> None:
        self.group, self.clock, self.name = group, clock, str(bus.channel_info)
        self._opener, self._report, self._backoff = opener, report, Backoff()
        self.sent = self.received = 0
        self._driver = Driver(bus)

    def run(self, end: float) -> None:
        """Switch the nodes on, and run them until a time of the clock. Raises BusError."""
        first: Callable[[float], list[Frame]] = self.group.start
        while self.clock() < end:
            try:
                self._send(first(self.clock()))
                self._exchange(end)
            except BusError as why:
                if self._opener is None:
                    raise
                self._reopen(why, self._opener, end)
                first = self.group.bus_back

    def _exchange(self, end: float) -> None:
        """Run the nodes until the end or the bus's failure, which raises BusError."""
        while (now := self.clock()) < end:
            if self.group.next_wakeup <= now:
                self._send(self.group.tick(now))
            frame = self._received(min(self.group.next_wakeup, end, now + POLL) - self.clock())
            if frame is not None:
                self.received += 1
                self._send(self.group.receive(frame, self.clock()))

    def _reopen(self, why: BusError, opener: Opener, end: float) -> None:
        """Open the bus again, trying until the end."""
        lost_at = self.clock()
        self._report(Report(Event.BUS_FAILED, self.name, f"{why}; it is opened again", lost_at))
        self.group.bus_lost(lost_at)
        while (now := self.clock()) < end:
            time.sleep(min(self._backoff.pause(now), end - now))
            try:
                self._driver.replace(opener)
            except BusError:
                continue
            gap = self.clock() - lost_at
            self._report(Report(Event.BUS_BACK, self.name, f"after a gap of {gap:.1f} s", self.clock()))
            return

    def _received(self, wait: float) -> Frame | None:
        """Wait for a frame up to some seconds; None for none, and for one that is not classic CAN with 11 bits."""
        bus = self._driver.bus
        try:
            message = bus.recv(max(wait, 0.0))
        except Exception as error:  # drivers raise OSError, CanError, ctypes' errors, ...
            raise failure(bus, error) from error
        if message is None or message.is_extended_id or message.is_error_frame or message.is_fd:
            return None
        if len(message.data) > MOST_BYTES or not 0 <= message.arbitration_id <= HIGHEST_IDENTIFIER:
            return None
        if message.is_remote_frame:
            return RemoteFrame(message.arbitration_id, bytes(message.dlc))
        return Frame(message.arbitration_id, bytes(message.data))

    def _send(self, frames: list[Frame]) -> None:
        for frame in frames:
            tried = self.clock()
            while not self._driver.send(frame):  # its queue is full until the bus has taken a frame
                if self.clock() - tried > TAKEN_WITHIN:
                    raise self._driver.stuck(TAKEN_WITHIN)
            self.sent += 1

    def __enter__(self) -> LiveGroup:
        return self

    def __exit__(self, *_: object) -> None:
        try:
            shut_down(self._driver.bus)
        except Exception as error:
            raise BusError(f"the bus {self.name} cannot be shut down: {error}") from error
