"""Reading a bus in a thread: the loop that every received frame goes through."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING

from eurobot_od.errors import BusError
from eurobot_od.frame import Data, Frame
from eurobot_od.live.buses import failure

if TYPE_CHECKING:
    import can

POLL = 0.1
"""Longest time in seconds that a thread waits before it looks whether it is to end."""


class Reader:
    """Gives each classic data frame with an 11-bit identifier to `receive`, and any other frame to `foreign`.

    `receive` takes the COB-ID, the data in the driver's buffer, and when the frame was read, in seconds of `clock`;
    without one the driver's time stamps count, which start anywhere. `failed` gets the error that has ended the
    reading; not if `running` was set to False before.
    """

    def __init__(
        self,
        bus: can.BusABC,
        receive: Callable[[int, Data, float], object],
        clock: Callable[[], float] | None,
        foreign: Callable[[can.Message], object],
        failed: Callable[[BusError], object],
    ) -> None:
        self.running = True
        self._bus, self._receive, self._clock = bus, receive, clock
        self._foreign, self._failed = foreign, failed

    def read(self) -> None:
        """Read in this thread until `running` is False."""
        recv, receive, clock = self._bus.recv, self._receive, self._clock
        try:
            while self.running:
                message = recv(POLL)
                if message is None:
                    continue
                if message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd:
                    self._foreign(message)
                else:
                    receive(message.arbitration_id, message.data, clock() if clock else message.timestamp)
        except Exception as error:  # drivers raise OSError, CanError, ctypes' errors, ...
            if self.running:  # some raise when the bus is shut down meanwhile
                self._failed(failure(self._bus, error))


class Watch:
    """Calls `seen` with the time and every classic base data frame on a bus; a context manager.

    `clock`, `foreign` and `failed` are those of the Reader.
    """

    def __init__(
        self,
        bus: can.BusABC,
        seen: Callable[[float, Frame], object],
        clock: Callable[[], float] | None,
        failed: Callable[[BusError], object] = lambda _: None,
        foreign: Callable[[can.Message], object] = lambda _: None,
    ) -> None:
        def receive(cob_id: int, data: Data, now: float) -> None:
            seen(now, Frame(cob_id, bytes(data)))

        self._bus = bus
        self._reader = Reader(bus, receive, clock, foreign, failed)
        self._thread = threading.Thread(target=self._reader.read, name=f"{bus.channel_info} watch", daemon=True)

    def __enter__(self) -> Watch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._reader.running = False
        self._thread.join(10 * POLL)
        self._bus.shutdown()
