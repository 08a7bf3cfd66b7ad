"""python-can's buses: opening, capabilities of drivers, connection, and sending.

Any exception of a driver becomes a BusError of one line. A sender passes frames from the queue to the driver, by
priority, in the thread that has submitted one: one thread at a time has the turn, and also sends the frames of others;
no lock is held during the driver's `send`; and the turn is always returned.
"""

from __future__ import annotations

import errno
import logging
import re
import socket
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from threading import RLock
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from eurobot_od.bus.live.adapters import (
    BITRATE,
    DRIVERS,
    INSTEAD,
    ONLY_LINUX,
    SOCKETCAN,
    driver_remedy,
    remedy,
    silence_logs,
)
from eurobot_od.errors import BusError, LocalError, UnknownName
from eurobot_od.frame import EXTENDED, HIGHEST_EXTENDED, Frame
from eurobot_od.support import extras
from eurobot_od.support.connections import Backoff

if TYPE_CHECKING:
    import can

    from eurobot_od.controller import TransmitQueue


LIVE_LOG = logging.getLogger("eurobot_od.live")

INTERFACE_KEYS = {"interface", "bustype"}
"""Keys of the interface in python-can's configuration."""

DEFAULT_BUS = {"interface": "virtual", "channel": "eurobot"}
"""The in-process bus, used if neither caller nor python-can's configuration names one."""

ONLY_HERE = "127.0.0.1"
"""Address of a shared bus: only this machine, because it has neither passwords nor encryption."""

WITHOUT_REMOTE = (
    "without it: -i udp_multicast -c 239.74.163.2 for each program, instead of --share; "
    f"it needs {DRIVERS['udp_multicast']}"
)
"""The way to share a bus without python-can-remote."""

RETRY = 0.001
"""Time for a driver to accept a frame, in s, before the frame is retried later."""

FILTERING = (SOCKETCAN, "etas")
"""Interfaces whose driver accepts any number of receive filters."""

PROMPT = (SOCKETCAN, "virtual")
"""Interfaces whose `send` does not block with timeout 0."""

SERIAL = ("slcan",)
"""Interfaces that write to a serial port, where a write that exceeds its timeout fails even if it was complete."""

SERIAL_WAIT = 0.2
"""Timeout of a write to a serial port, in s; long enough for a busy machine."""

FULL = (errno.ENOBUFS, errno.EAGAIN, errno.EWOULDBLOCK, errno.ETIMEDOUT)
"""Errors of an operating system for a full buffer; any other error means that the bus is lost."""

SO_MEMINFO = 55
DROPS = slice(32, 36)
"""Socket option with a socket's counters (Linux 4.12), and the bytes with the number of dropped received frames.

SO_RXQ_OVFL adds the number to each frame, which python-can does not support.
"""

FIRST_PAUSE, LONGEST_PAUSE = 0.001, 0.1
"""First and longest pause before a refused frame is retried, in s; doubled each time.

A full buffer is free again within a frame or two. The longest pause is also the delay of a stop message once the
driver works again.
"""

STUCK_AFTER = 1.0
"""Time without an accepted frame after which the driver has failed, in s."""

# python-can cannot report these capabilities; they were taken from its documentation and code (4.6). An interface that
# is not listed still works. Kvaser, Vector and Systec filter in the driver only with a single filter; with more,
# python-can compares each frame with each filter in our thread, which is slower than the controller's look-up. Few
# drivers respect `send(timeout=0)`.


def open_bus(
    interface: str | None = None, channel: str | int | None = None, bitrate: int | None = None, **options: Any
) -> can.BusABC:
    """Open a python-can bus; omitted parameters come from python-can's configuration files and variables.

    Args:
        interface: name of python-can's interface, such as `socketcan`
        channel: the adapter or bus, such as `can0`
        bitrate: in bit/s; SocketCAN has that of the interface
        options: options of the interface, such as `fd`

    Raises:
        BusError: the bus cannot be opened; the reason is one line
    """
    import can
    from can import util
    from can.interfaces import BACKENDS

    silence_logs()
    if interface == SOCKETCAN and not hasattr(socket, "AF_CAN"):
        raise BusError(f"cannot open the {interface} bus {channel or ''}: {ONLY_LINUX}; {INSTEAD}")
    asked = {"interface": interface, "channel": channel, "bitrate": bitrate}
    given = {key: value for key, value in asked.items() if value is not None} | options
    config: Mapping[str, Any] = given
    try:
        said = named(given).keys()
        # Our default channel is only for our default interface.
        defaults = {key: value for key, value in DEFAULT_BUS.items() if key not in said}
        config = util.load_config(config=({} if said & INTERFACE_KEYS else defaults) | given)
        bus = can.Bus(ignore_config=True, **({"bitrate": BITRATE} | dict(config)))
        kind, at = (str(config.get(key) or "") for key in ("interface", "channel"))
        is_twice = kind == "remote" and str(bus.channel_info).count(at.rstrip("/")) > 1  # the server's name has it, too
        if is_twice or bus.channel_info == can.BusABC.channel_info:  # "unknown", for example for slcan
            bus.channel_info = f"{config.get('interface')} {config.get('channel')}"
        LIVE_LOG.info("%s is open", bus.channel_info)
        return bus
    except Exception as error:  # drivers raise OSError, ImportError, ValueError, CanError, ...
        kind, at = (str(config.get(key) or "") for key in ("interface", "channel"))
        name = " ".join(filter(None, ("" if interface else "configured", kind, "bus", at)))
        is_linux = interface == SOCKETCAN
        helps = remedy(_number(error), str(channel)) if is_linux else driver_remedy(interface, error)
        if not helps and _number(error) == errno.ENOENT:  # no such serial port
            helps = "`doctor` lists what is here"
        why = _with_remedy(error, helps)
        if config.get("interface") == "remote" and _number(error) == errno.ECONNREFUSED:
            why += "; nobody shares a bus there: `node NODE --share PORT` does, in another terminal"
        if interface is not None and interface not in BACKENDS:
            unknown = str(UnknownName("interface", interface, sorted(BACKENDS)))
            if re.fullmatch(r"v?x?can\d*", interface):  # the kernel's names of its interfaces
                unknown = f"unknown interface {interface!r}; {at or interface} is a channel of socketcan: -i socketcan"
            why = extras.missing(f"interface {interface}", interface) if interface in extras.brought() else unknown
        raise BusError(f"cannot open the {name}: {why}") from error


def share(port: int) -> str:
    """Share an in-process bus with other programs of this machine by python-can-remote, until this process ends.

    Returns the channel: of `virtual` in this process, of `remote` in others. Raises LocalError without the extra
    `remote`, BusError for an unavailable port.
    """
    try:
        from can_remote.server import RemoteServer
    except ModuleNotFoundError:
        raise LocalError(f"{extras.missing('python-can-remote', 'remote')}; {WITHOUT_REMOTE}") from None
    silence_logs()
    channel = f"ws://{ONLY_HERE}:{port}/"
    try:
        server = RemoteServer(ONLY_HERE, port, interface="virtual", channel=channel)
    except OSError as error:
        other = f"; share at another port, or join the bus there by -i remote -c {channel}"
        taken = other if error.errno == errno.EADDRINUSE else ""
        raise BusError(f"cannot share a bus at port {port} of this machine: {_one_line(error)}{taken}") from error
    accept = server.get_request

    def accept_departing() -> tuple[DepartingClient, object]:
        client, address = accept()
        return DepartingClient(client), address

    server.get_request = accept_departing
    threading.Thread(target=server.serve_forever, name=channel, daemon=True).start()
    return channel


class DepartingClient:
    """The socket of a client that may have gone: what is sent to it then is lost without an error.

    The server notices at its next reading. An error while it sends would be a traceback, and leave the client's bus
    open.
    """

    def __init__(self, client: socket.socket) -> None:
        self._client = client

    def sendall(self, data: bytes) -> None:
        """Send all bytes."""
        with suppress(OSError):
            self._client.sendall(data)

    def shutdown(self, how: int) -> None:
        """End the connection."""
        with suppress(OSError):
            self._client.shutdown(how)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._client, name)


def _with_remedy(error: BaseException, helps: str) -> str:
    """Return an error in one line, with its remedy if known."""
    return f"{_one_line(error)}; {helps}" if helps else _one_line(error)


def _number(error: BaseException) -> int | None:
    """Return the operating system's number of an error, from itself or its cause."""
    known: int | None = getattr(error, "error_code", None) or getattr(error, "errno", None)
    return known if known or error.__cause__ is None else _number(error.__cause__)


def is_named(interface: str | None) -> bool:
    """Return whether the caller or python-can's configuration names an interface."""
    return bool(named({"interface": interface}).keys() & INTERFACE_KEYS)


def named(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what has a value from the caller, python-can's variables or its files, by python-can's keys."""
    from can import rc, util

    sources = (util.load_file_config(), util.load_environment_config(), rc, given)
    return {key: value for source in sources for key, value in source.items() if value}


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


CLOSED = (errno.EBADF, errno.ENOTCONN, errno.ECONNRESET, errno.EPIPE)
"""Errors of a connection that the other end has closed."""


def shut_down(bus: can.BusABC) -> None:
    """Shut a bus down once, also if its driver raises, so that python-can does not retry when the bus is deleted.

    A bus server that exits first (same Ctrl-C) is not an error.
    """
    import can

    try:
        bus.shutdown()
    except BaseException as error:
        can.BusABC.shutdown(bus)
        if not (isinstance(error, OSError) and error.errno in CLOSED):
            raise


class Driver:
    """A bus and its driver's capabilities: whether it `filters`, and whether its `send` is `prompt`.

    `refusal` is the driver's last reason for not accepting a frame. `bus` changes when it is reopened.
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
        self._wait = RETRY
        if self.prompt:
            self._wait = 0.0
        elif any(_is_of(bus, interface) for interface in SERIAL):
            self._wait = SERIAL_WAIT
        self._socket = getattr(bus, "socket", None) if _is_of(bus, SOCKETCAN) else None

    def replace(self, opener: Callable[[], can.BusABC]) -> None:
        """Shut the failed bus down, and open it again; raises BusError."""
        with suppress(Exception):  # only a consequence of the failure
            shut_down(self.bus)
        self._adopt(opener())

    def send(self, frame: Frame, timeout: float | None = None) -> bool:
        """Send a frame; return whether the driver has accepted it in `timeout` s. Raises BusError if it has failed.

        The default timeout is as short as the driver allows. A driver that is not `prompt` may block longer.
        """
        # Positional arguments are faster than keywords.
        identifier = frame.cob_id & HIGHEST_EXTENDED
        extended = frame.cob_id >= EXTENDED
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
            if bus is not self.bus:  # it was reopened meanwhile
                return False
            raise failure(bus, error) from error
        return True

    @property
    def overflow(self) -> int:
        """Number of received frames that the driver has dropped since the bus was opened; only for SocketCAN."""
        if not isinstance(self._socket, socket.socket):
            return 0
        try:
            counters = self._socket.getsockopt(socket.SOL_SOCKET, SO_MEMINFO, DROPS.stop)
        except OSError:  # an older kernel; or the bus is being shut down
            return 0
        return int.from_bytes(counters[DROPS], sys.byteorder)

    def stuck(self, seconds: float) -> BusError:
        """Return the error about a driver that has accepted no frame for some seconds."""
        why = f": {self.refusal}" if self.refusal else ""
        return BusError(f"the bus {self.bus.channel_info} has taken no frame for {seconds:.1f} s{why}")


PATIENCE = 1.0
"""Maximum time for a driver to accept a frame of `transmit`, in s."""


def transmit(bus: can.BusABC, frame: Frame) -> None:
    """Send a frame; raises BusError if the driver does not accept it in time."""
    if not Driver(bus).send(frame, PATIENCE):
        raise BusError("the bus did not take the frame")


def _is_of(bus: can.BusABC, interface: str) -> bool:
    """Return whether a bus belongs to an interface of python-can, without importing other drivers."""
    from can.interfaces import BACKENDS

    module, name = BACKENDS[interface]
    return module in sys.modules and isinstance(bus, getattr(sys.modules[module], name))


def failure(bus: can.BusABC, error: BaseException) -> BusError:
    """Return a driver's error in one line."""
    helps = remedy(_number(error), str(getattr(bus, "channel", ""))) if _is_of(bus, SOCKETCAN) else ""
    return BusError(f"the bus {bus.channel_info} failed: {_with_remedy(error, helps)}")


Opener: TypeAlias = "Callable[[], can.BusABC]"
"""Function that reopens a bus; raises BusError."""


class Gaps(NamedTuple):
    """Number of times that a bus was lost and came back, and the total time in s."""

    number: int = 0
    seconds: float = 0.0


class Connection:
    """The bus of a `driver`, reopened by `opener` when it fails; without one, reading ends with the failure.

    When the bus fails, `lost` is called with the error and whether it will be reopened, in the thread that noticed it.
    The reader calls `opened` after reopening, which may raise BusError, and `back` with the length of the gap in s once
    the bus works. `failure` is the reason why it is lost, or None. The reader reads while it is `up`. `overflow` is the
    number of received frames that the driver has dropped.
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
        """Note that the bus has failed; may be called from any thread."""
        if self._closing.is_set():
            return  # it is being shut down
        with self._lock:
            first = self.failure is None
            self.failure = self.failure or why
            self.up = self._opener is None  # without an opener, reading continues until it fails itself
            if first:
                self._since = self._clock()
                LIVE_LOG.info("%s is lost: %s", self.driver.bus.channel_info, why)
        if first:  # without the lock, because `lost` takes the lock of the `Live`, whose owner may be waiting here
            self._lost(why, self._opener is not None)

    def reopen(self) -> bool:
        """Reopen the bus, retrying until it succeeds; return False if the connection has to end."""
        if self._opener is None:
            return False
        while not self._closing.wait(self._backoff.pause(self._clock())):
            try:
                self.count_overflow()  # before the socket with the count is closed
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
            if not self.up or self._opener is None:  # a sender has noted another failure meanwhile
                return
            gap = self._clock() - self._since
            self.failure = None
            self.gaps = Gaps(self.gaps.number + 1, self.gaps.seconds + gap)
        LIVE_LOG.info("%s is back after %.1f s", self.driver.bus.channel_info, gap)
        self._back(gap)

    def count_overflow(self) -> bool:
        """Update `overflow`; return whether it has doubled since the last report."""
        now = self.driver.overflow
        before = self.overflow
        self.overflow += max(now - self._of_this_bus, 0)
        self._of_this_bus = now
        return self.overflow.bit_length() > before.bit_length()  # reported at 1, 2, 4, ...

    def close(self) -> None:
        """End reading and reopening."""
        self._closing.set()
        self.up = False


class Sender:
    """Passes queued frames to a driver. `lock` guards the `queue`; `failed` is called if the driver fails or is stuck.

    `blocked` is set if the driver has not accepted the last frame. `wake` is called then: the keeper has to call
    `retry` after `pause` s, and no other thread tries before.
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
        """Send again after the driver has refused a frame."""
        self.blocked = False
        self.pump()

    def pump(self) -> None:
        """Send until no frame is left or the driver accepts no more; does nothing if another thread has the turn."""
        # Ctrl-C may raise between any two lines. The owner's token is set by one assignment within the `try`, so that
        # the turn is always returned.
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
        """Pass a frame to the driver; return whether it has accepted it."""
        # Separate from `pump`, because CPython 3.11 does not guard the line of an inner `try` by the outer one.
        try:
            return self._driver.send(frame)
        except BusError as failure:
            self._failed(failure)
            return False

    def _after(self, frame: Frame, taken: bool) -> Frame | None:
        """Return the next frame if this one was `taken`; else return the turn, and lengthen the pause."""
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
        """Return the frame with the highest priority; without one, return the turn in the same step."""
        frame = self._queue.next(self._clock())
        if frame is None:
            self._turn = None
        return frame
