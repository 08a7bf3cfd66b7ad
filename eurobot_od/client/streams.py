"""What a node sends again and again, as a program takes it: the last one, a callback, an iterator, the next one.

Rule of this file: nothing that came is lost to an iterator that is behind, up to `BACKLOG`; then the oldest are, and it
counts them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import AsyncIterator, Callable, Iterator
from functools import partial
from math import inf
from typing import Generic, TypeVar
from weakref import WeakSet

from eurobot_od.client.master import Master
from eurobot_od.client.procedure import finished
from eurobot_od.errors import NoAnswer

Item = TypeVar("Item")

BACKLOG = 10_000
"""What an iterator keeps for a program that is behind: 10 s of a PDO every millisecond."""


class Stream(Generic[Item]):
    """What comes again and again: the `last` of it (None before the first), and `count`, how many came."""

    def __init__(self, master: Master, name: str, node_id: int) -> None:
        self.last: Item | None = None
        self.count = 0
        self.name, self.node_id = name, node_id
        self._master = master
        self._functions: list[Callable[[Item], object]] = []
        self._readers: WeakSet[StreamReader[Item]] = WeakSet()

    def on(self, function: Callable[[Item], object]) -> Callable[[Item], object]:
        """Have a function called with each one, in the order in which they come; a decorator, too.

        It runs in a thread of its own, or in the event loop. What it raises is logged, and the next one still comes.
        """
        self._functions.append(function)
        return function

    def off(self, function: Callable[[Item], object]) -> None:
        """Have a function called no more; raises ValueError if it is not."""
        self._functions.remove(function)

    def push(self, item: Item) -> None:
        """Take in one that has come."""
        self.last, self.count = item, self.count + 1
        for function in self._functions:
            self._master.call(partial(function, item))
        for reader in [*self._readers]:
            reader.put(item)

    def reader(self) -> StreamReader[Item]:
        """Return what keeps each one from now on."""
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
    """An endless iterator over a stream, for programs that block and for event loops; `lost` counts what it dropped."""

    def __init__(self, master: Master) -> None:
        self._master, self._waiting, self.lost = master, deque[Item](), 0

    def put(self, item: Item) -> None:
        """Keep one more."""
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
        """Wait for the next one and return it; raises NoAnswer after `timeout` seconds, BusError."""
        return finished(self._next(timeout))

    def __iter__(self) -> StreamReader[Item]:
        return self.reader()


class AsyncStream(Stream[Item]):
    """A stream of an `AsyncNetwork`: `async for each in stream` never ends by itself."""

    async def wait(self, timeout: float = 1.0) -> Item:
        """Wait for the next one and return it; raises NoAnswer after `timeout` seconds, BusError."""
        return await self._next(timeout)

    def __aiter__(self) -> StreamReader[Item]:
        return self.reader()
