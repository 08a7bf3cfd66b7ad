"""Detects the bit rate of a bus by listening; no frame is sent, acknowledged or destroyed."""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from eurobot_od.errors import BusError, LocalError

BIT_RATES = (500_000, 250_000, 1_000_000, 125_000, 800_000, 50_000, 20_000, 10_000)
"""Bit rates of CiA 301 in bit/s, the most common ones first."""

SILENTLY: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "slcan": {"listen_only": True},
        "kvaser": {"driver_mode": False},
        "pcan": {"state": "PASSIVE"},
        "seeedstudio": {"operation_mode": "silent"},
    }
)
"""Options of python-can's interfaces for listening without acknowledging frames."""

WAIT = 0.7
"""Time to listen at one bit rate, in s; most nodes send twice a second."""


def check_silent(interface: str) -> None:
    """Check that an interface can listen silently; a wrong bit rate would disturb the bus. Raises LocalError."""
    if interface == "socketcan":
        raise LocalError("the bit rate of a SocketCAN interface is the system's: `ip -details link` shows it")
    if interface not in SILENTLY:
        known = ", ".join(SILENTLY)
        raise LocalError(f"{interface} cannot listen silently, and a wrong bit rate disturbs a bus (can: {known})")


def frames_at(interface: str, channel: str, bit_rate: int, wait: float = WAIT) -> int:
    """Return the number of frames heard at a bit rate, 0 after an error frame; raises LocalError, BusError."""
    import can

    check_silent(interface)
    options = dict(SILENTLY[interface])
    if "state" in options:
        options["state"] = can.BusState[options["state"]]
    try:
        with can.Bus(ignore_config=True, interface=interface, channel=channel, bitrate=bit_rate, **options) as bus:
            return _heard(bus, time.monotonic() + wait)
    except Exception as error:  # whatever a driver raises
        raise BusError(f"{interface} {channel}: {' '.join(str(error).split()) or type(error).__name__}") from error


def _heard(bus: Any, end: float) -> int:
    count = 0
    while (left := end - time.monotonic()) > 0:
        message = bus.recv(left)
        if message is not None and message.is_error_frame:
            return 0
        count += message is not None
    return count
