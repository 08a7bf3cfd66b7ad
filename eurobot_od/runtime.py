"""Live operation: a gatekeeper and its node on a python-can bus, with real time and real threads.

Rule of this file: the only place with threads and the real clock. The reader takes frames from the bus and delivers
them; the keeper does what is due at a time, retries what the driver could not take, and watches over listeners that
do not return. Whoever submits a frame never waits for the bus.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from eurobot_od.device.emergency import ErrorCode
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame
from eurobot_od.gatekeeper import Gatekeeper, Running
from eurobot_od.messages import Message

if TYPE_CHECKING:
    import can

    from eurobot_od.nodes.node import Node
    from eurobot_od.station import Station

BITRATE = 500_000
"""Bit/s of the robot's bus, where neither caller nor python-can's configuration says another."""

DEFAULT_BUS = {"interface": "virtual", "channel": "eurobot"}
"""The in-process bus, where neither caller nor python-can's configuration names one."""

POLL = 0.1
"""Longest time in seconds that a thread waits before it looks whether it is to end."""

RETRY = 0.001
"""Seconds until a frame that the driver did not take is tried again."""

PROMPT = ("can.interfaces.virtual", "can.interfaces.socketcan.socketcan")
"""Drivers whose `send` does not wait when told so; python-can leaves that to each driver, and few keep to it."""

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


def open_bus(interface: str | None = None, channel: str | None = None, bitrate: int | None = None) -> can.BusABC:
    """Open a python-can bus; what is not given comes from python-can's own configuration files and variables.

    Raises BusError in one line, whatever the driver had to say.
    """
    import can

    given = {"interface": interface, "channel": channel, "bitrate": bitrate}
    try:
        config = _configured({key: value for key, value in given.items() if value is not None})
        return can.Bus(ignore_config=True, **config)
    except Exception as error:  # drivers raise what comes to hand: OSError, ImportError, ValueError, CanError, ...
        name = f"{interface or 'configured'} bus {channel or ''}".strip()
        raise BusError(f"cannot open the {name}: {_one_line(error)}") from error


def _configured(given: dict[str, Any]) -> dict[str, Any]:
    """Complete what is given by python-can's configuration, and that by our defaults."""
    from can import rc, util

    sources = (given, rc, util.load_environment_config(), util.load_file_config())
    said = {key for source in sources for key, value in source.items() if value}
    named = said & {"interface", "bustype"}
    defaults = {} if named else {key: value for key, value in DEFAULT_BUS.items() if key not in said}
    config = dict(util.load_config(config=defaults | given))
    return {"bitrate": BITRATE} | config


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


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
        self._running = False
        self._pumping = False
        self._blocked = False
        self._prompt = _sends_promptly(bus)
        self._looks_at = 0.0
        self._threads: list[threading.Thread] = []
        if station is not None:
            station.node.guard = self._lock
            station.node.wake = self._wake_for_node

    @classmethod
    def node(cls, bus: can.BusABC, node: Node, clock: Callable[[], float] = time.perf_counter, **options: Any) -> Live:
        """Return a node ready to run on a bus; `options` are those of Station."""
        from eurobot_od.station import Station  # a gatekeeper alone needs no nodes

        station = Station(node, aside=_in_thread, **options)
        return cls(bus, station.gatekeeper, station, clock)

    # Life

    def start(self) -> Live:
        """Hand the receive filters to the bus, switch the node on, start reading."""
        self.gatekeeper.start()
        self._filter()
        self._running = True
        if self.station is not None:
            self.station.start(self.clock())
        self._spawn(self._read)
        self._spawn(self._keep)
        return self

    def _filter(self) -> None:
        """Hand the receive filters to the bus if its hardware or kernel filters.

        python-can itself would look at one filter after the other, in our thread, for what the gatekeeper finds by one
        look into a dictionary: there, filters cost the more the more of them there are, and save nothing.
        """
        self._generation = self.gatekeeper.generation
        self.bus.set_filters(self.gatekeeper.filters() if _filters_itself(self.bus) else None)

    def stop(self) -> None:
        """End the threads and shut the bus down; frames still waiting are sent first if the bus takes them."""
        self._pump()
        with self._changed:
            self._running = False
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

    def _wake_for_node(self) -> None:
        """Wake the keeper unless this thread serves the node: it sees itself to what the node wants."""
        with self._lock:
            if self.station is not None and not self.station.serving:
                self._wake()

    # Sending

    def send(self, message: Message) -> None:
        """Encode a message and leave it to the mailboxes; never waits. Raises FieldError for a value out of range."""
        with self._lock:
            self.gatekeeper.send(message, self.clock())
        if self._prompt:
            self._pump(timeout=0)  # here and now: waking the keeper first would take as long as the frame on the bus
        if self._blocked or not self._prompt:
            self._wake()

    def _pump(self, timeout: float = RETRY) -> None:
        """Hand loaded frames to the driver, most urgent first, until none is left or it takes no more in `timeout`."""
        frame = self._first_frame()
        while frame is not None:
            frame = self._next_frame(frame, self._sent(frame, timeout))

    def _first_frame(self) -> Frame | None:
        """Return the frame to send first; None, too, if another thread is at it, which sends the others as well."""
        with self._lock:
            self._blocked = self._blocked and self._pumping
            return None if self._pumping else self._urgent_frame()

    def _next_frame(self, frame: Frame, sent: bool) -> Frame | None:
        """Return the frame to send behind another, None if the driver has not taken that."""
        with self._lock:
            self._blocked, self._pumping = not sent, sent
            if not sent:
                return None
            self.gatekeeper.mailboxes.complete(frame)
            return self._urgent_frame()

    def _urgent_frame(self) -> Frame | None:
        """Return the most urgent frame; without one, pumping has ended before anyone can submit another."""
        mailboxes = self.gatekeeper.mailboxes
        mailboxes.load(self.clock())
        frame = mailboxes.urgent()
        self._pumping = frame is not None
        return frame

    def _sent(self, frame: Frame, timeout: float) -> bool:
        try:
            return transmit(self.bus, frame, timeout)
        except BusError as failure:
            self._fail(failure)
            return False

    # Threads

    def _fail(self, failure: BusError) -> None:
        """Note that the adapter was pulled out, the server went away, the driver failed."""
        if self._running:
            self.failure = failure

    def _read(self) -> None:
        gatekeeper, clock, recv = self.gatekeeper, self.clock, self.bus.recv
        receive, since = gatekeeper.receive_data, None if clock is gatekeeper.clock else gatekeeper.clock
        try:
            while self._running:
                message = recv(POLL)
                if message is None:
                    continue
                if not _is_ours(message):
                    self._note_foreign(message)
                    continue
                now = clock()
                if not receive(message.arbitration_id, bytes(message.data), now, since() if since else now):
                    return
                if self.station is not None or gatekeeper.generation != self._generation:
                    self._follow_up()
        except Exception as error:  # drivers raise what comes to hand
            self._fail(_failure(self.bus, error))

    def _follow_up(self) -> None:
        """Do what a frame has made necessary: filters that a master has changed, answers, another time to wake up."""
        if self.gatekeeper.generation != self._generation:
            self._filter()
        self._pump()
        self._hurry()

    def _hurry(self) -> None:
        """Wake the keeper if the node wants to be called before the keeper would look again."""
        wakeup = self.station.next_wakeup if self.station is not None else None
        if wakeup is not None and wakeup < self._looks_at:
            self._wake()

    def _note_foreign(self, message: can.Message) -> None:
        """Count what is no classic base data frame, and tell the node what the controller reports."""
        self.foreign += 1
        for error in ERROR_FRAMES:
            if self.station is not None and message.is_error_frame and error.in_frame(message):
                self.station.bus_error(error.code, self.clock())

    def _keep(self) -> None:
        while self._running:
            self._tick()
            self._pump()
            self._watch()
            with self._changed:
                if self._running and (pause := self._pause()) > 0:
                    self._looks_at = self.clock() + pause
                    self._changed.wait(pause)

    def _tick(self) -> None:
        if self.station is not None:
            wakeup = self.station.next_wakeup
            if wakeup is not None and wakeup <= self.clock():
                self.station.tick(self.clock())

    def _pause(self) -> float:
        if self._blocked:
            return RETRY
        wakeup = self.station.next_wakeup if self.station is not None else None
        if self.gatekeeper.mailboxes.next_expiry is not None and not self._pumping:
            return 0.0
        return POLL if wakeup is None else min(wakeup - self.clock(), POLL)

    def _watch(self) -> None:
        """Give a new reader to the bus if a listener does not return."""
        running = self.gatekeeper.running()
        if running is not None and time.perf_counter() - running.since > STUCK_AFTER:
            self._spawn(lambda: self._succeed(running))

    def _succeed(self, running: Running) -> None:
        if self.gatekeeper.take_over(running):
            self._read()


class Watch:
    """Calls `seen` with the time and every classic base data frame on a bus; a context manager.

    `failed` is called, once, with the error that ended the reading.
    """

    def __init__(
        self,
        bus: can.BusABC,
        seen: Callable[[float, Frame], None],
        clock: Callable[[], float],
        failed: Callable[[BusError], None] = lambda _: None,
    ) -> None:
        self._bus, self._seen, self._clock, self._failed = bus, seen, clock, failed
        self._running = True
        self._thread = threading.Thread(target=self._read, name=f"{bus.channel_info} watch", daemon=True)

    def __enter__(self) -> Watch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._running = False
        self._thread.join(10 * POLL)
        self._bus.shutdown()

    def _read(self) -> None:
        try:
            while self._running:
                message = self._bus.recv(POLL)
                if message is not None and _is_ours(message):
                    self._seen(self._clock(), Frame(message.arbitration_id, bytes(message.data)))
        except Exception as error:  # drivers raise what comes to hand
            if self._running:
                self._failed(_failure(self._bus, error))


def transmit(bus: can.BusABC, frame: Frame, timeout: float = RETRY) -> bool:
    """Hand a frame to the driver; False if it does not take it in `timeout` seconds. Raises BusError if it failed."""
    import can

    message = can.Message(arbitration_id=frame.cob_id, data=frame.data, is_extended_id=False)
    try:
        bus.send(message, timeout=timeout)
    except can.CanError:
        return False
    except Exception as error:  # drivers raise what comes to hand; this one does not say "try again"
        raise _failure(bus, error) from error
    return True


def _failure(bus: can.BusABC, error: Exception) -> BusError:
    return BusError(f"the bus {bus.channel_info} failed: {_one_line(error)}")


def _in_thread(work: Callable[[], None]) -> None:
    """Run the work of a listener that was set aside; a thread that never ends does not keep the process."""
    threading.Thread(target=work, name="aside", daemon=True).start()


def _filters_itself(bus: can.BusABC) -> bool:
    """Tell whether a driver has filters: it overrides the hook that python-can documents for them."""
    import can

    return bus.__class__._apply_filters is not can.BusABC._apply_filters


def _sends_promptly(bus: can.BusABC) -> bool:
    return bus.__class__.send.__module__ in PROMPT


def _is_ours(message: can.Message) -> bool:
    """Tell whether a message is a classic data frame with an 11-bit identifier."""
    return not (message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd)
