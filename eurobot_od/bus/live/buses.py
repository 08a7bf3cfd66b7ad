"""python-can's buses: opening one, what its driver can do, the connection to it, and sending to it.

Rules of this file: whatever a driver raises becomes a BusError of one line. A sender sends in whatever thread has
something to send, from the queue to the driver, most urgent first: one thread at a time has the turn and sends what
others submit meanwhile; no lock is held while the driver has a frame; and the turn is given back however its owner
leaves.
"""

from __future__ import annotations

import errno
import logging
import socket
import sys
import threading
from collections.abc import Callable
from contextlib import suppress
from threading import RLock
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from eurobot_od.bus.live.adapters import BITRATE, INSTEAD, ONLY_LINUX, SOCKETCAN, driver_remedy, remedy, silence_logs
from eurobot_od.errors import BusError, UnknownName
from eurobot_od.frame import EXTENDED, HIGHEST_EXTENDED, Frame
from eurobot_od.support import extras
from eurobot_od.support.connections import Backoff

if TYPE_CHECKING:
    import can

    from eurobot_od.controller import TransmitQueue


LIVE_LOG = logging.getLogger("eurobot_od.live")

INTERFACE_KEYS = {"interface", "bustype"}
"""What python-can's configuration calls the interface."""

DEFAULT_BUS = {"interface": "virtual", "channel": "eurobot"}
"""The in-process bus, where neither caller nor python-can's configuration names one."""

ONLY_HERE = "127.0.0.1"
"""Where a shared bus is to be had: it has neither passwords nor encryption."""

RETRY = 0.001
"""Seconds that a driver may take to accept a frame; one that does not is given the frame again later."""

FILTERING = (SOCKETCAN, "etas")
"""Interfaces with a driver that takes as many receive filters as there are identifiers."""

PROMPT = (SOCKETCAN, "virtual")
"""Interfaces whose `send` really does not wait when its timeout is 0."""

SERIAL = ("slcan",)
"""Interfaces that write to a serial port: it has room for hundreds of frames, but a write that took longer than it may
counts as failed even when all is written."""

SERIAL_WAIT = 0.2
"""Seconds that a write to a serial port may take: on a busy machine a thread may have to wait for its turn."""

FULL = (errno.ENOBUFS, errno.EAGAIN, errno.EWOULDBLOCK, errno.ETIMEDOUT)
"""What an operating system says when there is no room for a frame; any other error of it means that the bus is lost."""

SO_MEMINFO, DROPS = 55, slice(32, 36)
"""A socket's counters (Linux 4.12), and where among them is how many frames have found no room in its receive queue.

SO_RXQ_OVFL gives the same count with each frame, which python-can neither reads nor copes with.
"""

FIRST_PAUSE, LONGEST_PAUSE = 0.001, 0.1
"""Seconds until a frame that the driver has not taken is tried again; doubled each time, as a full buffer empties
within a frame or two, but a dead adapter stays dead. The longest is what a stop waits at most when the driver is back.
"""

STUCK_AFTER = 1.0
"""Seconds without a frame that is taken, after which the driver has failed: a full buffer empties in milliseconds."""

# python-can has no way to ask a bus for either. So its documentation and its code (4.6) were asked once, and
# these are the answers; an interface that is not listed still works. Kvaser, Vector and Systec filter in the driver as
# long as there is one filter; with more of them python-can compares each frame with each filter, in our thread, for
# what the controller finds by one look into a dictionary. `send(timeout=0)` is left to each driver, and few keep to it.


def open_bus(interface: str | None = None, channel: str | int | None = None, bitrate: int | None = None) -> can.BusABC:
    """Open a python-can bus; what is not given comes from python-can's own configuration files and variables.

    Raises BusError in one line, whatever the driver had to say.
    """
    import can
    from can import util
    from can.interfaces import BACKENDS

    silence_logs()
    if interface == SOCKETCAN and not hasattr(socket, "AF_CAN"):
        raise BusError(f"cannot open the {interface} bus {channel or ''}: {ONLY_LINUX}; {INSTEAD}")
    asked = {"interface": interface, "channel": channel, "bitrate": bitrate}
    given = {key: value for key, value in asked.items() if value is not None}
    try:
        said = _named(given)
        # Our bus by default goes with our channel: neither completes an interface that somebody else has named.
        defaults = {key: value for key, value in DEFAULT_BUS.items() if key not in said}
        config = util.load_config(config=({} if said & INTERFACE_KEYS else defaults) | given)
        bus = can.Bus(ignore_config=True, **({"bitrate": BITRATE} | dict(config)))  # it has been read just now
        if bus.channel_info == can.BusABC.channel_info:  # "unknown": slcan's, for one, does not say where it is
            bus.channel_info = f"{config.get('interface')} {config.get('channel')}"
        LIVE_LOG.info("%s is open", bus.channel_info)
        return bus
    except Exception as error:  # drivers raise OSError, ImportError, ValueError, CanError, ...
        name = f"{interface or 'configured'} bus {channel or ''}".strip()
        is_linux = interface == SOCKETCAN
        helps = remedy(_number(error), str(channel)) if is_linux else driver_remedy(interface, error)
        why = _with_remedy(error, helps)
        if interface == "remote" and _number(error) == errno.ECONNREFUSED:
            why += "; nobody shares a bus there: `node --share PORT` does, in another terminal"
        if interface is not None and interface not in BACKENDS:
            unknown = str(UnknownName("interface", interface, sorted(BACKENDS)))
            why = extras.missing(f"interface {interface}", interface) if interface in extras.brought() else unknown
        raise BusError(f"cannot open the {name}: {why}") from error


def share(port: int) -> str:
    """Let other programs of this machine join an in-process bus by python-can-remote, until this process ends.

    Returns the channel: for `virtual` in here, and for `remote` everywhere else. Raises LocalError without the extra
    `remote`, BusError for a port that cannot be had.
    """
    with extras.needed("remote"):
        from can_remote.server import RemoteServer
    silence_logs()
    channel = f"ws://{ONLY_HERE}:{port}/"
    try:
        server = RemoteServer(ONLY_HERE, port, interface="virtual", channel=channel)
    except OSError as error:
        raise BusError(f"cannot share a bus at port {port} of this machine: {_one_line(error)}") from error
    threading.Thread(target=server.serve_forever, name=channel, daemon=True).start()
    return channel


def _with_remedy(error: BaseException, helps: str) -> str:
    """Return an error in one line, with what helps, if that is known."""
    return f"{_one_line(error)}; {helps}" if helps else _one_line(error)


def _number(error: BaseException) -> int | None:
    """Return the operating system's number of an error, its own, python-can's or its cause's."""
    known: int | None = getattr(error, "error_code", None) or getattr(error, "errno", None)
    return known if known or error.__cause__ is None else _number(error.__cause__)


def is_named(interface: str | None) -> bool:
    """Return whether a caller or python-can's configuration names an interface, so that it is not our default."""
    return bool(_named({"interface": interface} if interface else {}) & INTERFACE_KEYS)


def _named(given: dict[str, Any]) -> set[str]:
    """Return the keys that have a value from the caller, python-can's variables or its files."""
    from can import rc, util

    sources = (given, rc, util.load_environment_config(), util.load_file_config())
    return {key for source in sources for key, value in source.items() if value}


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


CLOSED = (errno.EBADF, errno.ENOTCONN, errno.ECONNRESET, errno.EPIPE)
"""What the system says of a connection that the other end has closed already."""


def shut_down(bus: can.BusABC) -> None:
    """Shut a bus down; raises whatever its driver raises, and python-can does not try again when the bus is deleted.

    A bus server that has gone first, such as by the same Ctrl-C, is nothing to complain of.
    """
    import can

    try:
        bus.shutdown()
    except BaseException as error:
        can.BusABC.shutdown(bus)
        if not (isinstance(error, OSError) and error.errno in CLOSED):
            raise


class Driver:
    """A bus, and what its driver can do: whether it `filters`, and whether its `send` returns `prompt`ly.

    `refusal` is what the driver said when it did not take a frame. `bus` changes when a lost one is opened again.
    """

    def __init__(self, bus: can.BusABC) -> None:
        import can

        self._message, self._refused = can.Message, can.CanError
        self.refusal = ""
        self._adopt(bus)

    def _adopt(self, bus: can.BusABC) -> None:
        self.bus = bus
        self.filters = any(_is_of(bus, interface) for interface in FILTERING)
        self.prompt = any(_is_of(bus, interface) for interface in PROMPT)
        serial = any(_is_of(bus, interface) for interface in SERIAL)
        self._wait = 0.0 if self.prompt else SERIAL_WAIT if serial else RETRY
        self._socket = getattr(bus, "socket", None) if _is_of(bus, SOCKETCAN) else None

    def replace(self, opener: Callable[[], can.BusABC]) -> None:
        """Shut the bus down, which has failed, and open it again; raises BusError."""
        with suppress(Exception):  # of a bus that has failed, what its end has to say is only a consequence
            shut_down(self.bus)
        self._adopt(opener())

    def send(self, frame: Frame, timeout: float | None = None) -> bool:
        """Hand over a frame; False if the driver does not take it in `timeout` seconds. Raises BusError if it failed.

        Without a timeout it is as short as the driver allows. A driver that is not `prompt` may wait longer.
        """
        # by their places: by their names the arguments take half as long again
        identifier, extended = frame.cob_id & HIGHEST_EXTENDED, frame.cob_id >= EXTENDED
        message = self._message(0.0, identifier, extended, frame.is_remote, False, None, len(frame.data), frame.data)
        bus = self.bus
        try:
            bus.send(message, timeout=self._wait if timeout is None else timeout)
        except self._refused as error:
            if isinstance(error.__cause__, OSError) and error.__cause__.errno not in FULL:
                raise failure(bus, error) from error
            self.refusal = _one_line(error)
            return False
        except Exception as error:  # OSError, ctypes' errors, ...: unlike CanError, they do not mean "try again"
            if bus is not self.bus:  # it was opened again meanwhile: that the old one failed is known
                return False
            raise failure(bus, error) from error
        return True

    @property
    def overflow(self) -> int:
        """How many received frames have found no room since the bus was opened; only SocketCAN tells."""
        if not isinstance(self._socket, socket.socket):
            return 0
        try:
            counters = self._socket.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, DROPS.stop)
        except OSError:  # an older kernel; or the bus is being shut down
            return 0
        return int.from_bytes(counters[DROPS], sys.byteorder)

    def stuck(self, seconds: float) -> BusError:
        """Return the error for a driver that has taken no frame for some seconds."""
        return BusError(f"the bus {self.bus.channel_info} has taken no frame for {seconds:.1f} s: {self.refusal}")


def _is_of(bus: can.BusABC, interface: str) -> bool:
    """Return whether a bus is of an interface of python-can, without importing the drivers of the others."""
    from can.interfaces import BACKENDS

    module, name = BACKENDS[interface]
    return module in sys.modules and isinstance(bus, getattr(sys.modules[module], name))


def failure(bus: can.BusABC, error: BaseException) -> BusError:
    """Return an error of a driver in one line."""
    helps = remedy(_number(error), str(getattr(bus, "channel", ""))) if _is_of(bus, SOCKETCAN) else ""
    return BusError(f"the bus {bus.channel_info} failed: {_with_remedy(error, helps)}")


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
        self._since = 0.0
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
                LIVE_LOG.info("%s is lost: %s", self.driver.bus.channel_info, why)
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
            gap, self.failure = self._clock() - self._since, None
            self.gaps = Gaps(self.gaps.number + 1, self.gaps.seconds + gap)
        LIVE_LOG.info("%s is back after %.1f s", self.driver.bus.channel_info, gap)
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


class Sender:
    """Hands waiting frames to a driver. `lock` guards the `queue`; `failed` is called when that fails or is stuck.

    `blocked` says that the driver has not taken the last frame. `wake` is called then: the thread that keeps the time
    has to call `retry` after `pause` seconds, and until then no other tries.
    """

    def __init__(
        self,
        driver: Driver,
        queue: TransmitQueue,
        lock: RLock,
        clock: Callable[[], float],
        failed: Callable[[BusError], object],
        wake: Callable[[], object],
    ) -> None:
        self.blocked = False
        self.pause = 0.0
        self._driver, self._queue, self._lock = driver, queue, lock
        self._clock, self._failed, self._wake = clock, failed, wake
        self._turn: object | None = None
        self._refused_since: float | None = None

    @property
    def busy(self) -> bool:
        """Whether a thread has the turn."""
        return self._turn is not None

    def retry(self) -> None:
        """Send although the driver has not taken the last frame."""
        self.blocked = False
        self.pump()

    def pump(self) -> None:
        """Send until no frame is left or the driver takes no more.

        Does nothing if another thread has the turn, which sends what is here as well.
        """
        # Ctrl-C may raise between any two lines. A token tells the owner by one assignment, within the `try`: there is
        # no moment in which the turn is taken and would never be given back.
        token = object()
        try:
            frame = self._begin(token)
            while frame is not None:
                frame = self._after(frame, self._hand_over(frame))
        finally:
            if self._turn is token:
                self._turn = None

    def _begin(self, token: object) -> Frame | None:
        with self._lock:
            if self._turn is not None or self.blocked:
                return None
            self._turn = token
            return self._next()

    def _hand_over(self, frame: Frame) -> bool:
        """Hand a frame to the driver; False if that has not taken it."""
        # Not written out in `pump`: CPython 3.11 does not guard the line of an inner `try` by the outer one.
        try:
            return self._driver.send(frame)
        except BusError as failure:
            self._failed(failure)
            return False

    def _after(self, frame: Frame, taken: bool) -> Frame | None:
        """Return the frame after one that the driver has `taken`; otherwise give up, and wait longer each time."""
        with self._lock:
            if taken:
                self._queue.complete(frame)
                self.pause, self._refused_since = 0.0, None
                return self._next()
            self._turn, self.blocked = None, True  # the frame still waits
            self.pause = min(max(2 * self.pause, FIRST_PAUSE), LONGEST_PAUSE)
            now = self._clock()
            since = self._refused_since = now if self._refused_since is None else self._refused_since
        if now - since >= STUCK_AFTER:
            self._refused_since = None
            self._failed(self._driver.stuck(now - since))
        self._wake()
        return None

    def _next(self) -> Frame | None:
        """Return the most urgent frame; without one, give the turn back before anyone can submit another."""
        frame = self._queue.next(self._clock())
        if frame is None:
            self._turn = None
        return frame
