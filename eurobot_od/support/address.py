"""Where something listens: HOST:PORT."""

from __future__ import annotations

from typing import NamedTuple

from eurobot_od.errors import LocalError


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
