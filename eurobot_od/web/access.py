"""Decides who may see the page, by the headers of a request, before anything else is read; and limits connections.

This module has no socket. Any other web page that is open in the same browser can send requests to this server, even
under a host name of its own that resolves to this machine (DNS rebinding). So the Host header must be an address or the
configured name, and the Origin, which a page cannot forge, must be this page.

Any machine on the network can open connections and send nothing, or one byte at a time. A connection is `known` once a
request on it was let in by the access rules. Unknown ones get few places, and the oldest makes room for the newest, so
that a browser with the token always gets in.
"""

from __future__ import annotations

import re
import secrets
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from http import HTTPStatus
from ipaddress import ip_address
from typing import Any, NamedTuple, Protocol, Self
from urllib.parse import urlsplit

from eurobot_od.support.connections import is_token

TOKEN = "token"
"""Name of the token in the first address; the name of its cookie ends with the port."""

LOCAL_NAME = "localhost"

HOST = re.compile(r"(?P<name>[A-Za-z0-9._-]+|\[[0-9A-Fa-f:.]+\])(?::[0-9]{1,5})?")
"""A Host header: a name or an address, in brackets if it is one of IPv6 and without a zone, and a port (RFC 3986)."""

EVERYWHERE = {"0.0.0.0": "127.0.0.1", "::": "::1"}
"""The name to print for a server that listens at all addresses."""


class Denial(NamedTuple):
    """Why a request is refused: the status, and one line."""

    status: HTTPStatus
    why: str


class AccessRules(NamedTuple):
    """The conditions for a request: the `host` at which the server listens, and its `token`, if it has one.

    `origin` is the address for browsers behind a proxy, such as `https://bench.example`.
    """

    host: str = "127.0.0.1"
    token: str = ""
    origin: str = ""

    @classmethod
    def at(cls, host: str, origin: str = "", token: str = "") -> Self:
        """Return the rules of a server at a host; without a `token` one is made where other machines can reach it.

        A program that can reach the loopback address could run the command as well, unless a proxy lets others in.
        """
        is_open = origin or not is_local(host)
        return cls(host, token or (secrets.token_urlsafe(24) if is_open else ""), origin)

    def address(self, listening: Sequence[Any]) -> str:
        """Return the address to type into a browser for a server at a socket's address."""
        asked = f"?{TOKEN}={self.token}" if self.token else ""
        if self.origin:
            return f"{self.origin}/{asked}"
        host, port, *_ = listening  # IPv6 has two more numbers
        host = EVERYWHERE.get(host, host)
        named = f"[{host}]" if ":" in host else host
        return f"http://{named}:{port}/{asked}"

    def refusal(self, headers: Mapping[str, str], shown: str, acts: bool = False) -> Denial | None:
        """Return why a request is refused, None if it is not; `shown` is the token that came with it.

        A request that `acts`, a websocket or a POST, needs an Origin: browsers always send it with them.
        """
        host, origin = headers.get("Host", ""), headers.get("Origin")
        named = HOST.fullmatch(host)
        name = named["name"].lower() if named else ""
        # Any address is accepted: another page's host name can be made to resolve to this machine, an address cannot.
        ours = (LOCAL_NAME, self.host.lower(), *([urlsplit(self.origin).hostname] if self.origin else []))
        if not name or (name not in ours and not _is_address(name.strip("[]"))):
            return Denial(HTTPStatus.FORBIDDEN, f"Host {host[:60]!r} is not this server: use the printed address")
        if origin not in (f"http://{host}", self.origin or "-") and (acts or origin is not None):
            return Denial(HTTPStatus.FORBIDDEN, f"Origin {(origin or '')[:60]!r} is another page, not http://{host}")
        if self.token and not is_token(shown, self.token):
            return Denial(HTTPStatus.UNAUTHORIZED, "the token is missing or wrong: use the address that was printed")
        return None


def _is_address(text: str) -> bool:
    try:
        ip_address(text)
    except ValueError:
        return False
    return True


def is_local(host: str) -> bool:
    """Return whether only this machine can reach a server that listens at a host."""
    return host == LOCAL_NAME or (_is_address(host) and ip_address(host).is_loopback)


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
