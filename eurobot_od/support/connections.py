"""Network addresses, and the pause before the next attempt to connect."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from eurobot_od.errors import LocalError
from eurobot_od.support.texts import encodable


class Address(NamedTuple):
    """A host and a port."""

    host: str
    port: int

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


def parse(text: str) -> Address:
    """Read HOST:PORT, an IPv6 address in brackets; raises LocalError."""
    host, _, port = text.rpartition(":")  # the last colon: an IPv6 address has its own
    if not host or not port.isdecimal() or int(port) > 0xFFFF:
        raise LocalError(f"{text} is not HOST:PORT, such as 127.0.0.1:2014")
    return Address(host.strip("[]"), int(port))


def is_token(shown: str, token: str) -> bool:
    """Return whether a peer has shown the token; comparing takes the same time for every wrong one."""
    import hmac  # and with it OpenSSL, of which only a shared bus has a use

    return hmac.compare_digest(encodable(shown).encode(), token.encode())


FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0
"""First and longest pause before another attempt, in s; each pause is twice the one before."""

STEADY = 10.0
"""Time without a failure after which the pauses start from the shortest again, in s."""


class Backoff:
    """Growing pauses between attempts to connect, so that a dead peer costs little."""

    def __init__(self) -> None:
        self._pause = 0.0
        self._failed_at = -inf

    def pause(self, now: float) -> float:
        """Return the pause in s after a failure or a failed attempt at `now`."""
        # A loose plug fails again and again: a try that succeeds for a moment does not start from the beginning.
        self._pause = min(2 * self._pause, LONGEST_PAUSE) if now - self._failed_at < STEADY else FIRST_PAUSE
        self._failed_at = now
        return self._pause
