"""Limits the connections of browsers: their number, and how long one may stay without a complete request.

Any machine on the network can open connections and send nothing, or one byte at a time. A connection is `known` once a
request on it was let in by the access rules. Unknown ones get few places, and the oldest makes room for the newest, so
that a browser with the token always gets in.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol

MOST_CONNECTIONS = 256
MOST_UNKNOWN = 32

LONGEST_SILENCE = 10.0
"""Time within which a connection must send the complete head of its next request, in s."""


class Transport(Protocol):
    """The methods used of an asyncio transport."""

    def abort(self) -> None:
        """Close the connection at once."""

    def is_closing(self) -> bool:
        """Return whether the connection is closed, or about to be."""


@dataclass
class ClientConnection:
    """One connection: `since` when it owes a request (time in s), whether one is being answered, and if it is known."""

    transport: Transport
    since: float
    is_busy: bool = False
    is_known: bool = False


class Connections:
    """All open connections of a server, by their handlers; the caller passes the time, in s.

    `refused` counts those that had to make room, found none, or were silent for too long.
    """

    def __init__(self) -> None:
        self._open: dict[object, ClientConnection] = {}
        self.refused = 0

    def add(self, handler: object, transport: Transport, now: float) -> None:
        """Add a new connection; the oldest unknown one makes room for it, and without one it is closed itself."""
        self._open = {key: each for key, each in self._open.items() if not each.transport.is_closing()}
        added = ClientConnection(transport, now)
        unknown = [each for each in self._open.values() if not each.is_known]
        if len(unknown) >= MOST_UNKNOWN or len(self._open) >= MOST_CONNECTIONS:
            self._close([*unknown, added][0])
        self._open[handler] = added

    @contextmanager
    def answering(self, handler: object, clock: Callable[[], float], *, is_known: bool) -> Iterator[None]:
        """Keep a connection open while a request on it is answered; from then on it owes the next one."""
        each = self._open.get(handler)
        if each is None:  # closed, while its request was waiting
            yield
            return
        each.is_busy = True
        each.is_known = each.is_known or is_known
        try:
            yield
        finally:
            each.is_busy = False
            each.since = clock()

    def close_silent(self, now: float) -> None:
        """Close the connections that have owed a request for too long."""
        for each in self._open.values():
            if not each.is_busy and now - each.since > LONGEST_SILENCE and not each.transport.is_closing():
                self._close(each)

    def _close(self, each: ClientConnection) -> None:
        self.refused += 1
        each.transport.abort()
