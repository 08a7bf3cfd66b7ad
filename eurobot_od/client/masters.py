"""Masters that receive all the time: in a thread of their own, or in an event loop.

Theory of operation. Both have one thread for each bus, whatever the number of nodes: the reader, which waits for
frames. In a blocking program (`ThreadedMaster`) the reader also takes them in: it continues transfers, so that no other
thread has to be woken for each segment, and wakes those who wait in `pump` once what they wait for may be there. Users'
functions run in one more thread, in the order of their calls: they may talk to nodes themselves, for which the reader
must be free. In an event loop (`LoopMaster`) the reader hands frames over to the loop, and everything else happens
there.

Locks. `guard` protects what `receive` changes; nobody holds it while waiting for frames. A node's `turn` is held for a
whole transfer, so that two threads or tasks can talk to one node. It is taken before the guard, never after it.
"""

from __future__ import annotations

import asyncio
import threading
from collections import defaultdict, deque
from collections.abc import Callable, Mapping
from contextlib import AbstractAsyncContextManager
from math import inf
from queue import SimpleQueue
from typing import Any, TypeAlias

import can

from eurobot_od.bus.live.buses import Driver, Opener
from eurobot_od.bus.live.reader import FrameReader
from eurobot_od.client.master import ANSWER_WAIT, CLOSED, Master
from eurobot_od.errors import BusError, LocalError, StateError
from eurobot_od.frame import HIGHEST_IDENTIFIER, Frame

SEND_WAIT = 0.5
"""Timeout for a driver to accept a frame, in s."""

PATIENCE = 1.0
"""Time that `close` waits for users' functions, in s."""

Seen = Callable[[float, Frame], object]
Failed = Callable[[BusError], object]


class OwnFeed:
    """A bus that `opener` opens, and opens again when it is lost; it is shut down at the end.

    A feed gives each classic data frame to `seen`, on any thread, between `start` and `stop`. `failed` is called with
    the error when the bus is lost, `back` when it is there again. `send` raises BusError.
    """

    def __init__(self, opener: Opener) -> None:
        self._opener = opener
        self._first = opener()
        self._reader: FrameReader | None = None

    @property
    def bus(self) -> can.BusABC:
        return self._first if self._reader is None else self._reader.bus

    def start(self, seen: Seen, failed: Failed, back: Callable[[], object]) -> None:
        self._reader = FrameReader(self._first, seen, None, failed, opener=self._opener, back=lambda _: back())
        self._reader.__enter__()

    def send(self, frame: Frame) -> None:
        assert self._reader is not None
        if not self._reader.send(frame, SEND_WAIT):
            raise Driver(self.bus).stuck(SEND_WAIT)

    def stop(self) -> None:
        if self._reader is not None:
            self._reader.__exit__()


class SharedFeed:
    """Another owner's bus and python-can notifier, left open at the end; without a notifier we make one."""

    def __init__(self, bus: can.BusABC, notifier: can.Notifier | None = None) -> None:
        self.bus = bus
        self._driver = Driver(bus)
        found = getattr(can.Notifier, "find_instances", lambda _: ())(bus)  # since python-can 4.5
        self._notifier = notifier or next(iter(found), None)
        self._own = False
        self._hear: Any = None

    def start(self, seen: Seen, failed: Failed, back: Callable[[], object]) -> None:
        def hear(message: can.Message) -> None:
            odd = message.is_extended_id or message.is_remote_frame or message.is_error_frame or message.is_fd
            if not odd and message.arbitration_id <= HIGHEST_IDENTIFIER:
                seen(message.timestamp, Frame(message.arbitration_id, bytes(message.data)))

        self._hear = hear
        if self._notifier is None:
            self._notifier = can.Notifier(self.bus, [], timeout=0.1)
            self._own = True
        self._notifier.add_listener(hear)

    def send(self, frame: Frame) -> None:
        if not self._driver.send(frame, SEND_WAIT):
            raise self._driver.stuck(SEND_WAIT)

    def stop(self) -> None:
        if self._notifier is None:
            return
        self._notifier.remove_listener(self._hear)
        if self._own:
            self._notifier.stop()


Feed: TypeAlias = OwnFeed | SharedFeed
"""A bus that is read all the time: our own, or a shared one."""


def feed_of(network: Any) -> SharedFeed:
    """Return the feed of an open python-can bus, or of a connected `canopen.Network`; raises LocalError."""
    if isinstance(network, can.BusABC):
        return SharedFeed(network)
    bus = getattr(network, "bus", None)
    if not isinstance(bus, can.BusABC):
        raise LocalError(f"{network!r} is neither an interface's name nor an open bus nor a connected canopen.Network")
    return SharedFeed(bus, getattr(network, "notifier", None))


class FedMaster(Master):
    """Base class of both masters: a feed, and periodic frames."""

    def __init__(self, feed: Feed, answer_wait: float = ANSWER_WAIT, **options: Any) -> None:
        super().__init__(feed.bus, answer_wait, **options)
        self._feed = feed
        self._turns: Mapping[int, AbstractAsyncContextManager[object]] = {}

    def turn(self, node_id: int) -> AbstractAsyncContextManager[object]:
        """Return the lock held during a transfer."""
        return self._turns[node_id]

    def send(self, cob_id: int, data: bytes) -> None:
        """Send a frame; raises BusError."""
        self._feed.send(Frame(cob_id, data))

    def drain(self) -> None:
        """Do nothing: frames are taken in as they come."""

    def close(self) -> None:
        """Stop periodic frames and the reading; a call that waits for frames raises StateError."""
        self.stop_periodic()
        self._feed.stop()
        self.failure = StateError(CLOSED)

    def _back(self) -> None:
        self.failure = None
        self.bus = self._feed.bus
        for task in self.periodic:
            task.resume()


class ThreadedMaster(FedMaster):
    """Master for blocking programs; its reader takes frames in (see the module's docstring)."""

    def __init__(self, feed: Feed, answer_wait: float = ANSWER_WAIT) -> None:
        super().__init__(feed, answer_wait)
        self._changed = threading.Condition(threading.RLock())
        self.guard = self._changed
        self._turns = defaultdict(_BlockingTurn)
        self._calls: SimpleQueue[Callable[[], object] | None] = SimpleQueue()
        self._caller = threading.Thread(target=self._call, name=f"{feed.bus.channel_info} functions", daemon=True)
        self._caller.start()
        feed.start(self._seen, self._failed, self._back)

    def call(self, function: Callable[[], object]) -> None:
        """Queue a user's function for the thread that runs them."""
        self._calls.put(function)

    def _call(self) -> None:
        while (function := self._calls.get()) is not None:
            super().call(function)

    def _seen(self, now: float, frame: Frame) -> None:
        with self._changed:
            self.receive(frame.cob_id, frame.data, now)
            self._changed.notify_all()

    def _failed(self, why: BusError) -> None:
        with self._changed:
            self.failure = why
            self._changed.notify_all()

    async def take_in(self, wait: float, done: Callable[[], bool]) -> bool:
        with self._changed:
            self._changed.wait_for(lambda: done() or self.failure is not None, None if wait == inf else max(wait, 0))
            if self.failure is not None and not done():
                raise self.failure
            return done()

    def close(self) -> None:
        """Stop periodic frames, the reading and the users' functions; a call that waits raises StateError."""
        super().close()
        with self._changed:
            self._changed.notify_all()
        self._calls.put(None)
        if self._caller is not threading.current_thread():
            self._caller.join(PATIENCE)


class _BlockingTurn:
    """A thread lock in the form that procedures use."""

    def __init__(self) -> None:
        self._lock = threading.Lock()

    async def __aenter__(self) -> None:
        self._lock.acquire()

    async def __aexit__(self, *_: object) -> None:
        self._lock.release()


class LoopMaster(FedMaster):
    """Master in the running event loop; its reader passes frames to the loop."""

    def __init__(self, feed: Feed, answer_wait: float = ANSWER_WAIT) -> None:
        self._loop = asyncio.get_running_loop()
        super().__init__(feed, answer_wait, clock=self._loop.time)
        self._turns = defaultdict(asyncio.Lock)
        self._waiting: dict[asyncio.Future[bool], Callable[[], bool]] = {}
        self._arrived: deque[tuple[float, Frame]] = deque()
        self._is_called = False
        feed.start(self._seen, self._failed, lambda: self._loop.call_soon_threadsafe(self._back))

    def _seen(self, now: float, frame: Frame) -> None:
        """Pass a frame to the loop, on the reader's thread, and wake the loop unless it is already called."""
        self._arrived.append((now, frame))
        if not self._is_called and not self._loop.is_closed():
            self._is_called = True
            self._loop.call_soon_threadsafe(self._look)

    def _look(self) -> None:
        self._is_called = False  # before the loop, so that later frames are seen now or call again
        while self._arrived:
            now, frame = self._arrived.popleft()
            try:
                self.receive(frame.cob_id, frame.data, now)
            except BusError as error:  # from what a transfer sends next
                self.failure = error
            self._wake()  # after each frame, as the next one may undo the awaited condition

    def close(self) -> None:
        """Stop periodic frames and the reading; a call that waits for frames raises StateError."""
        super().close()
        self._wake()

    def _failed(self, why: BusError) -> None:
        def fail() -> None:
            self.failure = why
            self._wake()

        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(fail)

    def _wake(self) -> None:
        for future, done in [*self._waiting.items()]:
            if not future.done() and ((is_done := done()) or self.failure is not None):
                future.set_result(is_done)

    async def take_in(self, wait: float, done: Callable[[], bool]) -> bool:
        if not done():
            future: asyncio.Future[bool] = self._loop.create_future()
            self._waiting[future] = done
            try:
                await asyncio.wait([future], timeout=None if wait == inf else max(wait, 0))
            finally:
                del self._waiting[future]
            if future.done() and future.result():  # it was done, even if a later frame has undone it
                return True
        if self.failure is not None and not done():
            raise self.failure
        return done()
