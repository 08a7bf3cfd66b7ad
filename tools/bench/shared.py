"""What several rows use: the default dialect's protocol, and in-process buses of their own."""

from __future__ import annotations

from functools import cache
from itertools import count
from typing import Any

import can

from eurobot_od.pdo.protocol import Protocol
from eurobot_od.robot.protocol import EurobotProtocol

_numbers = count()


@cache
def protocol() -> Protocol:
    """Return the protocol of the default dialect."""
    return EurobotProtocol.load()


def new_channel() -> str:
    """Return the name of a new in-process bus."""
    return f"bench {next(_numbers)}"


def new_bus(channel: str) -> Any:
    """Open an end of an in-process bus."""
    return can.Bus(interface="virtual", channel=channel)
