"""A bus that is lost and comes back: when it was lost, when it is opened again, and how long it was away.

Theory of operation. Whoever uses the bus calls `fail` when its driver has failed: the reader, a sender, the keeper. The
first of them is heard; the others see only what follows from it. From then on the connection is not `up`, which ends
the reader's loop. The reader, who has nothing else to do now, calls `reopen`, which shuts the bus down and opens it
anew after pauses that grow. That a bus can be opened does not mean that it works: SocketCAN opens an interface that is
down, and reports that only on reading. So the gap ends with `works`, which the reader calls when it has read without an
error.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

from eurobot_od.bus.live.buses import Driver
from eurobot_od.errors import BusError
from eurobot_od.support.connections import Backoff

if TYPE_CHECKING:
    import can

Opener: TypeAlias = "Callable[[], can.BusABC]"
"""Opens a bus as it was opened before; raises BusError."""


class Gaps(NamedTuple):
    """How often a bus was lost and came back, and for how many seconds in all."""

    number: int = 0
    seconds: float = 0.0


class Connection:
    """The bus of a `driver`, opened again by `opener` when it fails; without one, reading ends with its failure.

    `lost` is called with the error when the bus fails, and whether it will be opened again, in the thread that noticed.
    The reader calls `opened` when it is open again, which may raise BusError like opening it, and `back` when it works,
    with the length of the gap in seconds of `clock`. `failure` is why it is lost, None while all is well. The reader
    reads while it is `up`. `overflow` counts frames that have found no room in the driver's receive queue.
    """

    def __init__(
        self,
        driver: Driver,
        opener: Opener | None,
        clock: Callable[[], float],
        lost: Callable[[BusError, bool], object],
        opened: Callable[[], object],
        back: Callable[[float], object],
    ) -> None:
        self.driver = driver
        self.up = True
        self.failure: BusError | None = None
        self.gaps = Gaps()
        self.overflow = self._of_this_bus = 0
        self._opener, self._clock = opener, clock
        self._lost, self._opened, self._back = lost, opened, back
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._since = clock()
        self._backoff = Backoff()

    def fail(self, why: BusError) -> None:
        """Note that the bus has failed; from any thread."""
        if self._closing.is_set():
            return  # it is being shut down
        with self._lock:
            first = self.failure is None
            self.failure = self.failure or why
            self.up = self._opener is None  # nobody opens it again: reading goes on until it fails itself
            if first:
                self._since = self._clock()
        if first:  # without the lock: it takes the `Live`'s, whose owner may just be in here with a failed filter
            self._lost(why, self._opener is not None)

    def reopen(self) -> bool:
        """Open the bus again, and wait until that succeeds; False if the connection is to end instead."""
        if self._opener is None:
            return False
        while not self._closing.wait(self._backoff.pause(self._clock())):
            try:
                self.count_overflow()  # the last chance: the count goes with the socket
                self.driver.replace(self._opener)
                self._of_this_bus = 0  # a new socket counts from 0
                self._opened()
            except BusError:
                continue
            self.up = not self._closing.is_set()
            return self.up
        return False

    def works(self) -> None:
        """Note that the bus was read without an error: if it was lost, it is back."""
        if self.failure is None:
            return
        with self._lock:
            if not self.up or self._opener is None:  # a sender has seen the next failure meanwhile
                return
            now = self._clock()
            gap, self._since, self.failure = now - self._since, now, None
            self.gaps = Gaps(self.gaps.number + 1, self.gaps.seconds + gap)
        self._back(gap)

    def count_overflow(self) -> bool:
        """Ask the driver how many frames it has lost; return whether the number has doubled since the last report."""
        now, before = self.driver.overflow, self.overflow
        self.overflow += max(now - self._of_this_bus, 0)
        self._of_this_bus = now
        return self.overflow.bit_length() > before.bit_length()  # at 1, 2, 4, ...: many lost frames, few reports

    def close(self) -> None:
        """End reading, and any attempt to open the bus again."""
        self._closing.set()
        self.up = False
