"""A bus in this process in real time that can do what a simulated network can: freeze a node, and switch the bus off.

A node is frozen while another thread holds its guard: it neither receives, ticks nor sends, and frames that come
meanwhile wait in its driver, as for a stopped process. A bus that is off takes no frame, like one on which no node
acknowledges.
"""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Coroutine
from contextlib import suppress
from functools import partial
from math import inf
from typing import Any

import can
from can.interfaces.virtual import VirtualBus

from eurobot_od.bus.live import Live
from eurobot_od.device.node import Node
from eurobot_od.device.station import Station
from eurobot_od.device.timers import Result
from eurobot_od.errors import EurobotError


class CutBus(VirtualBus):
    """A node's access to the bus of a network."""

    def __init__(self, network: LiveNetwork) -> None:
        super().__init__(channel=f"network {id(network)}")
        self._network = network

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; raises CanOperationError while the bus is off."""
        if self._network.now < self._network.off_until:
            raise can.CanOperationError("nobody acknowledges")
        super().send(msg, timeout)


class LiveNetwork:
    """Stations on a bus in real time; `now` is the time in s since it was made. It is used for one `run`."""

    def __init__(self) -> None:
        self._begin = time.monotonic()
        self._over = threading.Event()
        self._lives: list[Live] = []
        self.off_until = 0.0

    @property
    def now(self) -> float:
        """The time in s."""
        return time.monotonic() - self._begin

    def attach(self, node: Node, start: float = 0.0, _: float = 0.0) -> Station:
        """Connect a node; it boots at once, or later at `start`, in s."""
        time.sleep(max(start - self.now, 0.0))
        open_bus = partial(CutBus, self)
        live = Live.node(open_bus(), node, lambda: self.now, open_bus)
        assert live.station is not None
        self._lives.append(live.start())
        return live.station

    def freeze(self, station: Station, until: float) -> None:
        """Freeze a station until a time in s."""
        threading.Thread(target=self._hold, args=(station, until), daemon=True).start()

    def _hold(self, station: Station, until: float) -> None:
        with station.node.guard:
            self._over.wait(None if until == inf else until - self.now)

    def detach(self, station: Station) -> None:
        """Freeze a station for ever, which is the same to the others as its end."""
        self.freeze(station, inf)

    def cut(self, until: float) -> None:
        """Switch the bus off until a time in s."""
        self.off_until = until

    def run(self, program: Coroutine[Any, Any, Result]) -> Result:
        """Run a program to its end; then stop the nodes, the first one first."""
        try:
            return asyncio.run(program)  # without a watchdog: whoever calls a core that hangs, hangs with it
        finally:
            self._over.set()
            for live in self._lives:
                with suppress(EurobotError):  # whether the robot stands is seen by its wheels
                    live.stop()
