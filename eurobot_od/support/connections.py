"""Connections: where something listens, and how long to wait before the next try to reach it."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

from eurobot_od.errors import LocalError
from eurobot_od.support.texts import encodable


class Address(NamedTuple):
    """A host, and a port on it."""

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
    """Return whether a peer has shown the token; the time it takes does not depend on how much of it is right."""
    import hmac  # and with it OpenSSL, of which only a shared bus has a use

    return hmac.compare_digest(encodable(shown).encode(), token.encode())


FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0
"""Seconds until the next try, doubled each time."""

STEADY = 10.0
"""Seconds without a failure after which the pauses start from the shortest again."""


class Backoff:
    """Growing pauses between attempts: the first come at once, and what stays dead costs little."""

    def __init__(self) -> None:
        self._pause, self._failed_at = 0.0, -inf

    def pause(self, now: float) -> float:
        """Return how many seconds to wait after a failure or a failed try at `now`."""
        # A loose plug fails again and again: a try that succeeds for a moment does not start from the beginning.
        self._pause = min(2 * self._pause, LONGEST_PAUSE) if now - self._failed_at < STEADY else FIRST_PAUSE
        self._failed_at = now
        return self._pause
