"""A CANopen master: SDO transfers, NMT, heartbeats, as procedures that await frames in `pump`.

No thread receives in here. Whoever waits for something takes frames from the bus meanwhile, and each frame goes to the
listener of its COB-ID; a frame that comes while nothing waits is read at the next wait. Masters that receive all the
time, in a thread or in an event loop, are in `masters`.

Theory of operation. A procedure is a coroutine that awaits only other procedures, down to `Master.pump`, where
frames are awaited. The pump of a blocking master waits inside itself: a procedure on it runs from beginning to end in
one step, which is what calling it does. The pump of an event loop's master suspends, and its procedures are awaited:

    configure(node, description, now)               # on a blocking master
    await configure.steps(node, description, now)   # in an event loop, and in other procedures

So each procedure is written only once, and there is no thread or loop that nobody has asked for.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Coroutine, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, AbstractContextManager, contextmanager, nullcontext
from datetime import datetime
from functools import partial, update_wrapper, wraps
from itertools import count
from numbers import Real
from threading import Lock
from typing import TYPE_CHECKING, Any, Concatenate, Generic, NamedTuple, ParamSpec, TypeAlias, TypeVar

from eurobot_od import errors
from eurobot_od.bus.live import Driver, Opener
from eurobot_od.bus.live.buses import Connection, failure
from eurobot_od.device.nmt import COMMAND_NAMES, STATE_NAMES, NmtCommand, NmtState
from eurobot_od.frame import Frame
from eurobot_od.od import values
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import absence
from eurobot_od.od.sdo_channels import SdoChannel
from eurobot_od.sdo import client as sdo
from eurobot_od.sdo.wire import LARGEST, REMEDIES, reason
from eurobot_od.support.progress import Progress, unwatched
from eurobot_od.support.texts import parameters

if TYPE_CHECKING:
    import can


SDO_LOG, NMT_LOG = logging.getLogger("eurobot_od.sdo"), logging.getLogger("eurobot_od.nmt")


# Procedures


P = ParamSpec("P")
Result = TypeVar("Result")
Owner = TypeVar("Owner")
Rest = ParamSpec("Rest")
Function = TypeVar("Function", bound=Callable[..., object])


class Procedure(Generic[P, Result]):
    """A coroutine function: calling it runs all of it at once, while its `steps` are awaited.

    It is a decorator for functions and methods. Called for the master of an event loop, it raises StateError.
    """

    def __init__(self, function: Callable[P, Coroutine[Any, Any, Result]]) -> None:
        self.steps = function
        if not isinstance(function, partial):
            update_wrapper(self, function)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> Result:
        """Run the procedure to its end, and return its result."""
        return finished(self.steps(*args, **kwargs))

    def __get__(
        self: Procedure[Concatenate[Owner, Rest], Result], instance: Owner, owner: type[Owner]
    ) -> Procedure[Rest, Result]:
        """Return the procedure bound to an object, like a method."""
        return Procedure(partial(self.steps, instance))


def finished(steps: Coroutine[Any, Any, Result]) -> Result:
    """Return the result of a coroutine that must not suspend; raises StateError if it does."""
    try:
        steps.send(None)
    except StopIteration as end:
        result: Result = end.value
        return result
    steps.close()
    raise errors.StateError("this network belongs to an event loop: await its calls")


def blocking(
    steps: Callable[Concatenate[Owner, Rest], Coroutine[Any, Any, Result]],
) -> Callable[Concatenate[Owner, Rest], Result]:
    """Return a blocking method made from an awaitable one."""

    @wraps(steps)
    def run(self: Owner, /, *arguments: Rest.args, **names: Rest.kwargs) -> Result:
        try:
            begun = steps(self, *arguments, **names)
        except TypeError as error:  # the arguments do not fit: none of the coroutine has run yet
            names_of = (each for each in dir(type(self)) if getattr(type(self), each, None) is run)
            name = next(names_of, steps.__name__)  # a method that hides it may call it
            what = str(error).partition("() ")[2]
            raise TypeError(f"{type(self).__name__}.{name}{parameters(steps, 1)}: {what}") from None
        return finished(begun)

    return run


# The master


ANSWER_WAIT = 0.5
"""Default timeout of an SDO request, in s."""

BLOCK_FROM = 128
"""Contents longer than this, in bytes, are written by block transfer; segments are as quick for shorter ones."""

STORE_WAIT = 5.0
"""Timeout for storing parameters, in s; a node may have to erase flash memory."""

BACKLOG = 1 << 16
"""Maximum number of waiting frames taken at once; no adapter buffers more."""

LONGEST_LOGGED = 32
"""Maximum number of bytes of a transfer in a log line."""

BOOT_WAIT = 5.0
"""Timeout from a reset to the boot-up message, in s."""


CLOSED = "the network is closed"


def seconds(time: float) -> float:
    """Return a time that a program gives; raises LocalError unless it is a number."""
    if not isinstance(time, Real):
        raise errors.LocalError(f"a time is a number of seconds, not {time!r}")
    return time


def function_of(function: Function) -> Function:
    """Return a function that a program gives; raises LocalError if it cannot be called."""
    if not callable(function):
        raise errors.LocalError(f"{function!r} is no function, and cannot be called")
    return function


Observer: TypeAlias = Callable[[int, bytes, float], object]
"""Function called with the COB-ID, data and time (in s) of a frame."""


class Master:
    """The master's end of a bus; a context manager that shuts the bus down at its end.

    `answer_wait` is how many seconds of `clock` a node has for an answer. `unannounced` is how many bytes are read of
    an object whose size the node does not give. `states` has the last NMT state heard of each node. `listeners` are
    called with the data of the frames of one COB-ID, `observers` with COB-ID, data and time of every frame; the time is
    the driver's, in seconds.
    """

    def __init__(
        self,
        bus: can.BusABC,
        answer_wait: float = ANSWER_WAIT,
        clock: Callable[[], float] = time.monotonic,
        unannounced: int = sdo.UNANNOUNCED,
    ) -> None:
        import can

        self.bus, self.answer_wait, self.clock, self.unannounced = bus, answer_wait, clock, unannounced
        self.states: dict[int, NmtState] = {}
        self.shared: dict[int, float] = {}
        """Time of the last skipped answer to another client, in s of `clock`, by the node-ID of the server."""
        self.controlwords: dict[tuple[int, int], int] = {}
        """Last controlword sent to an axis, by its node-ID and number."""
        self.booted: set[int] = set()
        """Nodes that have booted since the last command or wait."""
        self.listeners: dict[int, Callable[[bytes], None]] = {}
        self.observers: tuple[Observer, ...] = ()
        self.periodic: list[PeriodicTask] = []
        self.failure: errors.EurobotError | None = None
        """Why no frame comes: the error of the thread that reads the bus, or the network is closed; else None."""
        self._sdo_servers: dict[int, SdoChannel] = {}
        self.guard: AbstractContextManager[object] = nullcontext()
        """Lock held while frames are taken in, if another thread does that."""
        self._message = can.Message
        self._sending = Lock()

    def __enter__(self) -> Master:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Stop periodic frames, and shut the bus down."""
        self.stop_periodic()
        self.bus.shutdown()

    def stop_periodic(self) -> None:
        """Stop sending periodic frames."""
        for task in self.periodic:
            task.stop()

    def call(self, function: Callable[[], object]) -> None:
        """Call a user's function for a frame: here at once, on the thread that takes frames in.

        An exception it raises is logged, and the others are still called.
        """
        try:
            function()
        except Exception:
            logging.getLogger("eurobot_od").exception("a function that was to be called has failed")

    def node(self, node_id: int) -> RemoteNode:
        """Return a node by its node-ID; it need not be there."""
        return RemoteNode(self, node_id)

    def sdo_server(self, node_id: int) -> SdoChannel:
        """Return the COB-IDs of a node's SDO server: the default ones (CiA 301, 7.3.3) unless `follow` set others."""
        return self._sdo_servers.get(node_id, SdoChannel.default(node_id))

    def follow(self, device: Dictionary) -> None:
        """Use the SDO server that a device's file describes (0x1200; see `SdoChannel`)."""
        self._sdo_servers[device.node_id] = SdoChannel.of(device)

    def turn(self, node_id: int) -> AbstractAsyncContextManager[object]:
        """Return the lock held during a transfer, as an SDO server does one at a time (CiA 301, 7.2.4.1)."""
        return nullcontext()

    def send(self, cob_id: int, data: bytes) -> None:
        """Send a frame; raises BusError."""
        self._send(self._message(arbitration_id=cob_id, data=data, is_extended_id=False))

    def request(self, cob_id: int) -> None:
        """Send a remote frame, as node guarding does; raises BusError."""
        self._send(self._message(arbitration_id=cob_id, is_remote_frame=True, dlc=1, is_extended_id=False))

    def _send(self, message: can.Message) -> None:
        try:
            with self._sending:  # a heartbeat comes from a thread of its own
                self.bus.send(message)
        except Exception as error:  # drivers raise OSError, CanError, ValueError, or whatever else their makers chose
            raise failure(self.bus, error) from error

    def drain(self) -> None:
        """Take in the frames that are already waiting. Raises BusError."""
        # Bounded, as on a fully loaded bus a frame is always waiting.
        for _ in range(BACKLOG):
            if not self._receive(0):
                break

    @Procedure
    async def pump(self, wait: float, done: Callable[[], bool] = lambda: False) -> bool:
        """Take in frames for `wait` seconds or until `done`; return whether it is done. Raises BusError."""
        return await self.take_in(seconds(wait), done)

    async def take_in(self, wait: float, done: Callable[[], bool]) -> bool:
        """Implement `pump`; subclasses override it.

        Frames that are waiting at the end count as well: they have come in time, however late this process looks.
        """
        end = self.clock() + wait
        while not done() and (left := end - self.clock()) > 0:
            self._receive(left)
        if not done():
            self.drain()
        return done()

    def _receive(self, wait: float) -> bool:
        """Take in the next frame; return False if there was none within `wait` seconds."""
        try:
            message = self.bus.recv(wait)
        except Exception as error:  # as in `send`
            raise failure(self.bus, error) from error
        # CANopen has 11-bit data frames; remote frames are what a master itself sends to guard a node.
        if message is not None and not (message.is_extended_id or message.is_error_frame or message.is_remote_frame):
            self.receive(message.arbitration_id, bytes(message.data), message.timestamp)
        return message is not None

    @contextmanager
    def observed(self, observer: Observer) -> Iterator[None]:
        """Call an observer with every frame."""
        self.observers = (*self.observers, observer)  # replaced as a whole: a reader may be iterating over it
        try:
            yield
        finally:
            self.observers = tuple(each for each in self.observers if each is not observer)

    def receive(self, cob_id: int, data: bytes, now: float) -> None:
        """Process a classic data frame with an 11-bit identifier."""
        node_id = cob_id - values.ERROR_CONTROL_BASE
        if node_id in values.NODE_IDS and len(data) == 1 and data[0] in set(NmtState):
            # With bit 7 set, it is an answer to node guarding, which `NodeWatch` evaluates.
            state = NmtState(data[0])
            level = logging.DEBUG if state is self.states.get(node_id) else logging.INFO
            NMT_LOG.log(level, "node %d: %s", node_id, STATE_NAMES[state])
            self.states[node_id] = state
            if data[0] == NmtState.INITIALISING:
                self.booted.add(node_id)
        for observe in self.observers:
            observe(cob_id, data, now)
        if cob_id in self.listeners:
            self.listeners[cob_id](data)


class PeriodicTask:
    """Frames sent in turn, one every `period` seconds, by the driver or the kernel, until `stop`."""

    def __init__(self, master: Master, frames: Sequence[Frame], period: float, remote: bool = False) -> None:
        import can

        if not seconds(period) > 0:
            raise errors.LocalError(f"the period is a time longer than 0 s, not {period} s")
        kind: dict[str, Any] = {"is_extended_id": False, "is_remote_frame": remote, "dlc": 1 if remote else None}
        self._messages = [can.Message(arbitration_id=f.cob_id, data=f.data, **kind) for f in frames]
        self._master, self.period = master, period
        self._task: Any = None
        self._start()
        master.periodic.append(self)

    def is_sending(self, cob_id: int) -> bool:
        """Return whether it sends frames of an identifier, and is not stopped."""
        return self._task is not None and any(each.arbitration_id == cob_id for each in self._messages)

    def resume(self) -> None:
        """Start again on a reopened bus, unless it was stopped."""
        if self._task is not None:
            self.stop()
            self._start()

    def _start(self) -> None:
        try:
            self._task = self._master.bus.send_periodic(self._messages, self.period, store_task=False)
        except Exception as error:  # whatever a driver raises
            raise failure(self._master.bus, error) from error
        # A sending thread of python-can ends with the bus; the reader of the bus reports that once.
        if hasattr(self._task, "on_error"):
            self._task.on_error = lambda _: False

    def update(self, data: bytes) -> None:
        """Send other data from now on, as canopen calls it."""
        self.stop()
        for message in self._messages:
            message.data = bytearray(data)
        self._start()

    def stop(self) -> None:
        """Stop sending; does nothing if it has ended."""
        if self._task is not None:
            self._task.stop()
            self._task = None

    def __enter__(self) -> PeriodicTask:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


HINTS: Mapping[NmtState | None, str] = {
    None: "nothing was heard of it since the last command: is it there, at this node-ID and bit rate?",
    NmtState.STOPPED: "its last heartbeat said stopped: a stopped node answers no SDO",
    NmtState.INITIALISING: "it has booted, and sent no heartbeat since",
}
"""Possible causes of a node's silence, by the state in its last heartbeat."""

ALIVE = "its heartbeats come: is its SDO server at other COB-IDs?"
OTHERS = "another client is asking node {}: answers came, and none was to us"


class RemoteNode:
    """A node as the master sees it: its objects as bytes by address, and its NMT state."""

    def __init__(self, master: Master, node_id: int) -> None:
        self.master, self.node_id = master, node_id
        self.own_wait: float | None = None
        """Timeout of this node's answers in s; None: the master's."""

    @property
    def answer_wait(self) -> float:
        """Timeout of its answers, in s."""
        return self.master.answer_wait if self.own_wait is None else self.own_wait

    @Procedure
    async def upload(
        self,
        address: values.Address,
        name: str = "",
        progress: Progress = unwatched,
        most: int = LARGEST,
        unannounced: int = LARGEST,
    ) -> bytes:
        """Read an object of up to `most` bytes, or up to `unannounced` if the node does not announce the size.

        Raises NodeRefused, NoAnswer, RemoteError for an odd answer, BusError.
        """
        room = sdo.Room(most, min(most, unannounced, self.master.unannounced))
        begin = partial(sdo.upload, address, self.answer_wait, progress, room)
        first = begin()
        await self.run.steps(first)
        # A disturbed read is repeated: the server may have dropped our request for another client's.
        return await self._transfer("read", address, name, begin() if first.was_disturbed else first)

    @Procedure
    async def upload_block(self, address: values.Address, name: str = "", progress: Progress = unwatched) -> bytes:
        """Read a long object by block transfer, or by segments if the node has no block transfer."""
        room = sdo.Room(unannounced=self.master.unannounced)
        by_blocks = sdo.block_upload(address, self.answer_wait, progress=progress, room=room)
        try:
            return await self._transfer("read", address, name, by_blocks)
        except errors.RemoteError:
            return await self.upload.steps(address, name, progress)

    @Procedure
    async def download(
        self,
        address: values.Address,
        data: bytes,
        name: str = "",
        wait: float | None = None,
        progress: Progress = unwatched,
    ) -> None:
        """Write an object, waiting up to `wait` seconds for each answer. Raises as `upload` does.

        Long contents go by block transfer, or by segments if the node does not take the first block, however it says
        so.
        """
        if not isinstance(data, (bytes, bytearray)):
            raise errors.FieldError(values.label(address), name or "content", data, "bytes")
        answer_wait, taken = wait or self.answer_wait, [0]
        if len(data) > BLOCK_FROM:

            def noted(done: int, size: int | None) -> None:
                taken.append(done)
                progress(done, size)

            try:
                by_blocks = sdo.block_download(address, data, answer_wait, noted)
                await self._transfer("write", address, name, by_blocks, data)
                return
            except errors.RemoteError:
                # After a first block the node has block transfer, and segments would not help.
                if taken[-1]:
                    raise
        await self._transfer("write", address, name, sdo.download(address, data, answer_wait, progress), data)

    def command(self, command: NmtCommand) -> None:
        """Send an NMT command to this node; it is not confirmed, and invalidates earlier heartbeats."""
        # Waiting frames were sent before the command and do not show its effect.
        self.master.drain()
        self.master.states.pop(self.node_id, None)
        self.master.booted.discard(self.node_id)
        NMT_LOG.info("node %d: command %s", self.node_id, COMMAND_NAMES[command])
        self.master.send(values.NMT_COB_ID, bytes([command, self.node_id]))

    @Procedure
    async def state(self, wait: float) -> NmtState | None:
        """Wait for the next heartbeat and return its state, None without one."""
        # An earlier heartbeat does not count.
        self.master.states.pop(self.node_id, None)
        await self.master.pump.steps(wait, lambda: self.node_id in self.master.states)
        return self.last_state

    @Procedure
    async def wait_for(self, state: NmtState, wait: float) -> bool:
        """Wait for a heartbeat with a state (INITIALISING is the boot-up); return whether one came."""
        # All states are collected, as a heartbeat may follow the boot-up before the waiting thread wakes.
        heard: list[NmtState | None] = []

        def hear(cob_id: int, *_: object) -> None:
            if cob_id == values.ERROR_CONTROL_BASE + self.node_id:
                heard.append(self.last_state)

        with self.master.observed(hear):
            return await self.master.pump.steps(wait, lambda: state in (self.last_state, *heard))

    @Procedure
    async def wait_for_bootup(self, wait: float) -> bool:
        """Wait for a boot-up message, which may have come since the last command; return whether one came."""
        booted = self.master.booted
        is_there = await self.master.pump.steps(wait, lambda: self.node_id in booted)
        booted.discard(self.node_id)
        return is_there

    @property
    def last_state(self) -> NmtState | None:
        """State in the last heartbeat, None without one."""
        return self.master.states.get(self.node_id)

    @Procedure
    async def reset(self, command: NmtCommand = NmtCommand.RESET_NODE, booting_as: int | None = None) -> None:
        """Reset the node and wait for its boot-up message, under another node-ID if given. Raises NoAnswer."""
        booting = self if booting_as is None else self.master.node(booting_as)
        self.master.booted.discard(booting.node_id)
        self.command(command)
        if not await booting.wait_for_bootup.steps(BOOT_WAIT):
            awaited = f"boot-up of node {booting.node_id}"
            raise errors.NoAnswer(COMMAND_NAMES[command], awaited, 1, BOOT_WAIT, self.node_id)

    @property
    def _why_silent(self) -> str:
        others = absence([self.node_id], self.master.states) if self.last_state is None else ""
        return others or HINTS.get(self.last_state, ALIVE)

    async def _transfer(
        self, verb: str, address: values.Address, name: str, transfer: sdo.Transfer, sent: bytes = b""
    ) -> bytes:
        """Run a transfer unless it is done; its failure becomes an error that names the node and the object."""
        if not transfer.done:
            await self.run.steps(transfer)
        request = f"{verb} {values.label(address, name)}"
        try:
            data = transfer.result()
            SDO_LOG.debug("node %d: %s: %d bytes, %s", self.node_id, request, *logged(sent or data))
            return data
        except sdo.TransferError as error:
            SDO_LOG.info("node %d: %s: %s", self.node_id, request, error)
            where = errors.NamedObject(self.node_id, address, name)
            if isinstance(error, sdo.Aborted):
                refused = errors.NodeRefused(self.node_id, request, error.code, reason(error.code), where)
                if what_to_do := REMEDIES.get(error.code):
                    refused.add_note(what_to_do)
                raise refused from error
            if isinstance(error, sdo.Silence):
                answer = f"answer from node {self.node_id}"
                silent = errors.NoAnswer(request, answer, 1, transfer.wait, self.node_id, where)
                silent.add_note(OTHERS.format(self.node_id) if error.skipped else self._why_silent)
                raise silent from error
            raise errors.WrongAnswer(request, str(error), where) from error

    @Procedure
    async def run(self, transfer: sdo.Transfer) -> None:
        """Run a transfer to its end, whether it succeeds or not. Raises BusError."""
        master = self.master
        clock = self.master.clock
        requested_at, cob_id = master.sdo_server(self.node_id)

        def send(requests: list[bytes]) -> None:
            for request in requests:
                master.send(requested_at, request)

        async with master.turn(self.node_id):
            # Discards a late answer to the request before.
            master.drain()
            with master.guard:
                master.listeners[cob_id] = lambda data: send(transfer.receive(data, clock()))
                send(transfer.start(clock()))
            while not transfer.done:
                await master.pump.steps(transfer.deadline - clock(), lambda: transfer.done)
                with master.guard:
                    send(transfer.tick(clock()))
        if transfer.skipped:
            master.shared[self.node_id] = clock()


def logged(data: bytes) -> tuple[int, str]:
    """Return the number of bytes, and the first `LONGEST_LOGGED` of them in hexadecimal."""
    return len(data), data[:LONGEST_LOGGED].hex(" ") + (" ..." if len(data) > LONGEST_LOGGED else "")


# A bus that is lost and comes back


Guard: TypeAlias = Callable[[Callable[[], object]], None]
"""Runs one step; raises BusError if the bus has failed and will not be reopened."""


def unguarded(step: Callable[[], object]) -> None:
    """Run a step; BusError is not handled."""
    step()


class Reconnecting:
    """Guard that reopens a master's bus with `opener` when a step fails; that step is not repeated.

    A bus that has never worked is an error; only one that has worked is opened again. `tell` gets a line when the bus
    is lost and when it is back.
    """

    def __init__(self, master: Master, opener: Opener, tell: Callable[[str], object]) -> None:
        def lost(why: errors.BusError, _: bool) -> None:
            tell(f"{why}; it is opened again")

        def back(gap: float) -> None:
            tell(f"the bus is back after a gap of {gap:.1f} s")

        self._master = master
        self._has_worked = False
        self._connection = Connection(Driver(master.bus), opener, master.clock, lost, lambda: None, back)

    def __call__(self, step: Callable[[], object]) -> None:
        """Run a step."""
        try:
            step()
        except errors.BusError as error:
            if not self._has_worked:
                raise
            self._connection.fail(error)
            self._connection.reopen()
            self._master.bus = self._connection.driver.bus
        else:
            self._has_worked = True
            self._connection.works()


# SYNC, with or without a counter, and TIME (CiA 301, 7.2.5 and 7.2.6)


COUNTERS = range(2, 241)
"""Allowed overflow values of the synchronous counter (CiA 301, 7.5.2.22, object 0x1019)."""


def syncs(overflow: int | None = None, cob_id: int = values.SYNC_COB_ID) -> Iterator[Frame]:
    """Yield SYNC messages without end, counted from 1 to `overflow` if it is given; raises LocalError."""
    if overflow is None:
        return (Frame(cob_id) for _ in count())
    if overflow not in COUNTERS:
        raise errors.LocalError(f"a counter of SYNC ends at {COUNTERS[0]} to {COUNTERS[-1]}, not at {overflow}")
    return (Frame(cob_id, bytes([1 + number % overflow])) for number in count())


def times(now: Callable[[], datetime], cob_id: int = values.TIME_COB_ID) -> Iterator[Frame]:
    """Yield TIME messages without end, each with the current time."""
    return (Frame(cob_id, values.TimeOfDay.of(now()).data) for _ in count())


def produce(master: Master, frames: Iterable[Frame], period: float, guard: Guard = unguarded) -> None:
    """Send the first frame at once, then one every `period` seconds until there are no more. Raises BusError.

    Each is sent and waited for under the guard.
    """
    due = master.clock()
    for frame in frames:
        guard(partial(master.send, *frame))
        due += period * (1 + max(0, int((master.clock() - due) // period)))
        while (left := due - master.clock()) > 0:
            guard(partial(master.pump, left))


# Replay of a log


LATE = 0.001
"""Delay from which a frame counts as late, in s."""


class Replayed(NamedTuple):
    """Number of frames sent and of late ones, and the worst delay in seconds."""

    frames: int = 0
    late: int = 0
    worst: float = 0.0


def replay(master: Master, frames: Iterable[tuple[float, Frame]], speed: float) -> Replayed:
    """Send recorded frames at their times (in s), `speed` times as fast. Raises BusError."""
    sent = Replayed()
    begin = master.clock()
    first: float | None = None
    for at, frame in frames:
        first = at if first is None else first
        due = begin + (at - first) / speed
        master.pump(due - master.clock())
        lag = max(master.clock() - due, 0.0)
        master.send(*frame)
        sent = Replayed(sent.frames + 1, sent.late + (lag > LATE), max(sent.worst, lag))
    return sent
