"""Items that a node sends again and again, for a program: the last one, a callback, an iterator, the next one.

An iterator that is behind loses nothing, up to `BACKLOG` items; then it loses the oldest ones, and counts them.
"""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from functools import partial
from math import inf
from typing import Generic, NamedTuple, TypeVar
from weakref import WeakSet

from eurobot_od.client.master import Master, Procedure, RemoteNode, finished
from eurobot_od.device.broadcasts import REGISTER_BITS, error_words
from eurobot_od.errors import NoAnswer
from eurobot_od.od.standard import ERROR_FIELD, ERROR_REGISTER, ErrorCode

Item = TypeVar("Item")

BACKLOG = 10_000
"""Most items that an iterator keeps for a program that is behind: 10 s of a PDO every millisecond."""


class Stream(Generic[Item]):
    """Items that come again and again: the `last` one (None before the first), and the `count` of them."""

    def __init__(self, master: Master, name: str, node_id: int) -> None:
        self.last: Item | None = None
        self.count = 0
        self.name, self.node_id = name, node_id
        self._master = master
        self._functions: list[Callable[[Item], object]] = []
        self._readers: WeakSet[StreamReader[Item]] = WeakSet()

    def on(self, function: Callable[[Item], object]) -> Callable[[Item], object]:
        """Have a function called with each item, in the order in which they come; also a decorator.

        It runs on a thread of its own, or in the event loop. An exception it raises is logged, and the next item still
        comes.
        """
        self._functions.append(function)
        return function

    def off(self, function: Callable[[Item], object]) -> None:
        """Stop calling a function; raises ValueError if it was not called before."""
        self._functions.remove(function)

    def push(self, item: Item) -> None:
        """Take in an item."""
        self.last, self.count = item, self.count + 1
        for function in self._functions:
            self._master.call(partial(function, item))
        for reader in [*self._readers]:
            reader.put(item)

    def reader(self) -> StreamReader[Item]:
        """Return an iterator that keeps each item from now on."""
        made = StreamReader[Item](self._master)
        self._readers.add(made)
        return made

    async def _next(self, timeout: float) -> Item:
        number = self.count
        await self._master.pump.steps(timeout, lambda: self.count > number)
        if self.count == number or self.last is None:
            raise NoAnswer("the last one", f"{self.name} of node {self.node_id}", 1, timeout, self.node_id)
        return self.last


class StreamReader(Iterator[Item], AsyncIterator[Item]):
    """An endless iterator over a stream, for blocking programs and event loops; `lost` counts the items it dropped."""

    def __init__(self, master: Master) -> None:
        self._master, self._waiting, self.lost = master, deque[Item](), 0

    def put(self, item: Item) -> None:
        """Keep one more item."""
        if len(self._waiting) == BACKLOG:
            self._waiting.popleft()
            self.lost += 1
        self._waiting.append(item)

    def __iter__(self) -> StreamReader[Item]:
        return self

    def __next__(self) -> Item:
        return finished(self._next())

    def __aiter__(self) -> StreamReader[Item]:
        return self

    async def __anext__(self) -> Item:
        return await self._next()

    async def _next(self) -> Item:
        while not self._waiting:
            await self._master.pump.steps(inf, lambda: bool(self._waiting))
        return self._waiting.popleft()


class BlockingStream(Stream[Item]):
    """A stream of a `Network`: `for each in stream` never ends by itself."""

    def wait(self, timeout: float = 1.0) -> Item:
        """Wait for the next item and return it; raises NoAnswer after `timeout` seconds, BusError."""
        return finished(self._next(timeout))

    def __iter__(self) -> StreamReader[Item]:
        return self.reader()


class AsyncStream(Stream[Item]):
    """A stream of an `AsyncNetwork`: `async for each in stream` never ends by itself."""

    async def wait(self, timeout: float = 1.0) -> Item:
        """Wait for the next item and return it; raises NoAnswer after `timeout` seconds, BusError."""
        return await self._next(timeout)

    def __aiter__(self) -> StreamReader[Item]:
        return self.reader()


# The errors that a node remembers


class RememberedError(NamedTuple):
    """One remembered error: its emergency error `code` and the manufacturer's `info`, 16 bits each."""

    code: int
    info: int


class History(NamedTuple):
    """The error register, and the remembered errors, newest first."""

    register: int
    entries: list[RememberedError]

    @property
    def register_bits(self) -> list[str]:
        """Names of the bits that are set in the register."""
        return [name for bit, name in enumerate(REGISTER_BITS) if self.register >> bit & 1]


@Procedure
async def read_history(node: RemoteNode) -> History:
    """Read the errors of a node. Raises NodeRefused, NoAnswer, BusError."""
    register = (await node.upload.steps(ERROR_REGISTER, "Error register"))[0]
    count = (await node.upload.steps((ERROR_FIELD, 0), "Number of errors"))[0]
    fields = [await node.upload.steps((ERROR_FIELD, sub)) for sub in range(1, count + 1)]
    return History(register, [RememberedError(*struct.unpack_from("<HH", each)) for each in fields])


@Procedure
async def clear_history(node: RemoteNode) -> None:
    """Clear the history; raises as `read_history`."""
    await node.download.steps((ERROR_FIELD, 0), b"\0", "Number of errors")


# Emergency messages


EMCY_BYTES = 8


class Emergency(NamedTuple):
    """An emergency message: its time in seconds, the node, error code, error register and the maker's 5 bytes.

    Code 0 means that an error has gone.
    """

    time: float
    node_id: int
    code: int
    register: int
    data: bytes

    @property
    def text(self) -> str:
        """The words of the code's class in CiA 301."""
        return error_words(self.code, {})

    def __str__(self) -> str:
        data = self.data.hex(" ").upper()
        return f"node {self.node_id}: 0x{self.code:04X} {self.text} (error register 0x{self.register:02X}, data {data})"


class HeardEmergencies(Stream[Emergency]):
    """The common part of both kinds of emergency streams."""

    def __init__(self, node: RemoteNode) -> None:
        super().__init__(node.master, "emergency message", node.node_id)
        self._node = node
        self.active: dict[int, Emergency] = {}

    def push(self, item: Emergency) -> None:
        if item.code == ErrorCode.NO_ERROR:
            self.active.clear()
        else:
            self.active[item.code] = item
        super().push(item)

    def hear(self, data: bytes, now: float) -> None:
        """Take in a frame of the node's EMCY; one of another length is ignored."""
        if len(data) == EMCY_BYTES:
            self.push(Emergency(now, self.node_id, int.from_bytes(data[:2], "little"), data[2], data[3:]))


class EmergencyStream(HeardEmergencies, BlockingStream[Emergency]):
    """A node's emergency messages as they come; `active` has those since the last `no error`, by code."""

    def history(self) -> History:
        """Read the errors that the node remembers (0x1001, 0x1003); raises NodeRefused, NoAnswer, BusError."""
        return read_history(self._node)

    def clear(self) -> None:
        """Have the node forget its errors; raises as `history`."""
        clear_history(self._node)


class AsyncEmergencyStream(HeardEmergencies, AsyncStream[Emergency]):
    """A node's emergency messages as they come; `active` has those since the last `no error`, by code."""

    async def history(self) -> History:
        """Read the errors that the node remembers (0x1001, 0x1003); raises NodeRefused, NoAnswer, BusError."""
        return await read_history.steps(self._node)

    async def clear(self) -> None:
        """Have the node forget its errors; raises as `history`."""
        await clear_history.steps(self._node)
