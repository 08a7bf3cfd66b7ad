"""A bus whose cable can be pulled out and put in again, and reports that a test can wait for."""

from __future__ import annotations

import time
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any

import can
from can.interfaces.virtual import VirtualBus

from eurobot_od.controller import Event, Report
from eurobot_od.errors import BusError

LONG = 60.0
"""Timeout of a test, in s; what it waits for comes at once."""


def until(done: Callable[[], object]) -> None:
    """Wait for what another thread does."""
    end = time.monotonic() + LONG
    while not done():
        assert time.monotonic() < end, "never"
        time.sleep(0.005)


class Cable:
    """A cable to a virtual bus: while `error` is set, whoever reads or sends gets it.

    `opens` tells whether a bus can be opened meanwhile, as a SocketCAN interface that is down can. `buses` are all that
    were opened.
    """

    def __init__(self, channel: str, opens: bool = False) -> None:
        self.channel, self.opens = channel, opens
        self.error: Exception | None = None
        self.buses: list[LooseBus] = []

    def open(self) -> can.BusABC:
        if self.error is not None and not self.opens:
            raise BusError(f"cannot open it: {self.error}")
        self.buses.append(LooseBus(self))
        return self.buses[-1]


class LooseBus(VirtualBus):
    """A bus at the end of a cable; `closed` tells that it was shut down."""

    def __init__(self, cable: Cable) -> None:
        self.closed = False
        self._cable = cable
        super().__init__(cable.channel)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self._cable.error is not None:
            raise self._cable.error
        super().send(msg, timeout)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if self._cable.error is not None:
            raise self._cable.error
        return super()._recv_internal(timeout and min(timeout, 0.01))

    def _apply_filters(self, filters: Any) -> None:
        self.applied = filters

    def shutdown(self) -> None:
        self.closed = True
        super().shutdown()


class Reports:
    """Reports as they come; on a slow machine there may be others of slow listeners."""

    def __init__(self) -> None:
        self._reports: SimpleQueue[Report] = SimpleQueue()

    def __call__(self, report: Report) -> None:
        self._reports.put(report)

    def wait_for(self, event: Event) -> Report:
        """Return the next report of an event."""
        while (report := self._reports.get(timeout=LONG)).event is not event:
            pass
        return report

    def rest(self) -> list[Report]:
        """Return the reports that have arrived."""
        return [self._reports.get() for _ in range(self._reports.qsize())]

    def empty(self) -> bool:
        return self._reports.empty()


def wait_for(bus: can.BusABC, cob_id: int, beginning: bytes = b"") -> bytes:
    """Return the next report of an event."""
    end = time.monotonic() + LONG
    while (message := bus.recv(max(end - time.monotonic(), 0))) is not None:
        if message.arbitration_id == cob_id and message.data.startswith(beginning):
            return bytes(message.data)
    raise AssertionError(f"nothing came with {cob_id:03X}")
