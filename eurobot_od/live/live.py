"""A gatekeeper and its node on a python-can bus, with real time and real threads.

Rule of this file: the reader's thread delivers what comes and sends the answers; the keeper's does what is due at a
time, retries what the driver could not take, and watches over listeners that do not return. Whoever submits a frame
never waits for the bus.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from eurobot_od.device.emergency import ErrorCode
from eurobot_od.errors import BusError
from eurobot_od.frame import Data
from eurobot_od.gatekeeper import Gatekeeper, Running
from eurobot_od.live.buses import RETRY, Driver, failure
from eurobot_od.live.reader import POLL, Reader, Receive
from eurobot_od.live.sender import Sender
from eurobot_od.pdo.message import Message

if TYPE_CHECKING:
    import can

    from eurobot_od.device.node import Node
    from eurobot_od.device.station import Station

STUCK_AFTER = 0.25
"""Seconds after which a listener that does not return loses its thread."""


class ErrorFrame(NamedTuple):
    """What an error frame says: a class bit in its identifier, bits of one data byte (0: any), and our error code."""

    class_bit: int
    byte: int
    bits: int
    code: ErrorCode

    def in_frame(self, message: can.Message) -> bool:
        """Tell whether an error frame says this."""
        details = int.from_bytes(message.data[self.byte : self.byte + 1], "little")
        return bool(message.arbitration_id & self.class_bit and (details & self.bits or not self.bits))


ERROR_FRAMES = (
    ErrorFrame(0x004, 1, 0x03, ErrorCode.OVERRUN),
    ErrorFrame(0x004, 1, 0x30, ErrorCode.ERROR_PASSIVE),
    ErrorFrame(0x100, 0, 0x00, ErrorCode.RECOVERED_FROM_BUS_OFF),
)
"""Error frames that become an EMCY, in the form of Linux's `can/error.h`, which python-can's drivers pass on."""


class Live:
    """A gatekeeper, and the node of a station if there is one, running on a bus.

    `clock` gives the time in seconds that nodes and listeners see. `foreign` counts what the bus brought that is no
    classic base data frame. `failure` is the error that ended reading or sending, None while all is well.
    Use it as a context manager; it shuts the bus down at its end.
    """

    def __init__(
        self,
        bus: can.BusABC,
        gatekeeper: Gatekeeper,
        station: Station | None = None,
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.bus, self.gatekeeper, self.station, self.clock = bus, gatekeeper, station, clock
        self.foreign = 0
        self.failure: BusError | None = None
        self._lock = threading.RLock()
        self._changed = threading.Condition(self._lock)
        self._since = None if clock is gatekeeper.clock else gatekeeper.clock
        self._driver = Driver(bus)
        self._sender = Sender(self._driver, gatekeeper.mailboxes, self._lock, clock, self._fail)
        self._reader = Reader(bus, self._receiver(), clock, self._note_foreign, self._fail)
        self._running = False
        self._looks_at = 0.0
        self._threads: list[threading.Thread] = []
        if station is not None:
            station.node.guard = self._lock
            station.node.wake = self._wake

    @classmethod
    def node(cls, bus: can.BusABC, node: Node, clock: Callable[[], float] = time.perf_counter, **options: Any) -> Live:
        """Return a node ready to run on a bus; `options` are those of Station."""
        from eurobot_od.device.station import Station  # a gatekeeper alone needs no nodes

        station = Station(node, aside=_in_thread, **options)
        return cls(bus, station.gatekeeper, station, clock)

    # Life

    def start(self) -> Live:
        """Hand the receive filters to the bus, switch the node on, start reading."""
        self.gatekeeper.start()
        self._filter()
        self.gatekeeper.rerouted = self._refilter
        self._running = True
        if self.station is not None:
            self.station.start(self.clock())
        self._spawn(self._reader.read)
        self._spawn(self._keep)
        return self

    def _filter(self) -> None:
        """Hand the receive filters to the bus if its hardware or kernel filters.

        python-can itself would look at one filter after the other, in our thread, for what the gatekeeper finds by one
        look into a list: there, filters cost the more the more of them there are, and save nothing.
        """
        self.bus.set_filters(self.gatekeeper.filters() if self._driver.filters else None)

    def _refilter(self) -> None:
        """Follow a master who has changed what a node listens to."""
        try:
            self._filter()
        except Exception as error:  # drivers raise what comes to hand
            self._fail(failure(self.bus, error))

    def stop(self) -> None:
        """End the threads and shut the bus down; frames still waiting are sent first if the bus takes them."""
        self._sender.pump()
        with self._changed:
            self._running = self._reader.running = False
            self._changed.notify_all()
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join(10 * POLL)
        self.bus.shutdown()

    def __enter__(self) -> Live:
        return self.start()

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _spawn(self, target: Callable[[], None]) -> None:
        thread = threading.Thread(target=target, name=f"{self.bus.channel_info} {target.__name__}", daemon=True)
        self._threads.append(thread)
        thread.start()

    def _wake(self) -> None:
        with self._changed:
            self._changed.notify_all()

    # Sending

    def send(self, message: Message) -> None:
        """Encode a message and leave it to the mailboxes; never waits. Raises FieldError for a value out of range."""
        with self._lock:
            self.gatekeeper.send(message, self.clock())
            frame = self._sender.begin() if self._driver.prompt else None
        self._sender.go_on(frame, timeout=0)  # here and now: to wake the keeper takes as long as the frame on the bus
        if self._sender.blocked or not self._driver.prompt:
            self._wake()

    # Threads

    def _fail(self, why: BusError) -> None:
        """Note that the adapter was pulled out, the server went away, the driver failed."""
        if self._running:
            self.failure = why

    def _receiver(self) -> Receive:
        """Return what every frame goes to: the gatekeeper itself, if nothing else is to be done."""
        simple = self.station is None and self._since is None
        return self.gatekeeper.receive_data if simple else self._receive

    def _receive(self, cob_id: int, data: Data, now: float) -> bool:
        """Deliver a frame, let the keeper know when to look again, and send the answers.

        In this order: whoever has got the answer waits for the interpreter until this thread is done.
        """
        if not self.gatekeeper.receive_data(cob_id, data, now, self._since and self._since()):
            return False
        if self.station is not None and self.station.plan.soonest < self._looks_at:
            self._wake()
        self._sender.pump()
        return True

    def _note_foreign(self, message: can.Message) -> None:
        """Count what is no classic base data frame, and tell the node what the controller reports."""
        self.foreign += 1
        for error in ERROR_FRAMES:
            if self.station is not None and message.is_error_frame and error.in_frame(message):
                self.station.bus_error(error.code, self.clock())

    def _keep(self) -> None:
        while self._running:
            self._tick()
            self._sender.pump()
            self._watch()
            with self._changed:
                self._looks_at = self._next_look()
                pause = self._looks_at - self.clock()
                if self._running and pause > 0:
                    self._changed.wait(pause)

    def _tick(self) -> None:
        if self.station is not None and self.station.next_wakeup <= self.clock():
            self.station.tick(self.clock())

    def _next_look(self) -> float:
        """Return when there is something to do again: at once, if frames wait that no thread is at."""
        now = self.clock()
        if self._sender.blocked:
            return now + RETRY
        if self.gatekeeper.mailboxes.next_expiry is not None and not self._sender.busy:
            return now
        return now + POLL if self.station is None else min(self.station.next_wakeup, now + POLL)

    def _watch(self) -> None:
        """Give a new reader to the bus if a listener does not return."""
        running = self.gatekeeper.running()
        if running is not None and time.perf_counter() - running.since > STUCK_AFTER:
            self._spawn(lambda: self._succeed(running))

    def _succeed(self, running: Running) -> None:
        if self.gatekeeper.take_over(running):
            self._reader.read()


def _in_thread(work: Callable[[], None]) -> None:
    """Run the work of a listener that was set aside; a thread that never ends does not keep the process."""
    threading.Thread(target=work, name="aside", daemon=True).start()
