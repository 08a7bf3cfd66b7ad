"""Finds out the bit rate of a bus by listening: no frame is sent, and none is acknowledged or destroyed."""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from eurobot_od.errors import BusError, LocalError

BIT_RATES = (500_000, 250_000, 1_000_000, 125_000, 800_000, 50_000, 20_000, 10_000)
"""The bit rates of CiA 301, in bit/s, the usual ones first."""

SILENTLY: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "slcan": {"listen_only": True},
        "kvaser": {"driver_mode": False},
        "pcan": {"state": "PASSIVE"},
        "seeedstudio": {"operation_mode": "silent"},
    }
)
"""What has the driver of an interface of python-can listen without acknowledging frames."""

WAIT = 0.7
"""Time in s to listen at one bit rate; most nodes send something twice a second."""


def check_silent(interface: str) -> None:
    """Raise LocalError for an interface whose driver cannot listen silently: at a wrong rate it would disturb a bus."""
    if interface == "socketcan":
        raise LocalError("the bit rate of a SocketCAN interface is the system's: `ip -details link` shows it")
    if interface not in SILENTLY:
        known = ", ".join(SILENTLY)
        raise LocalError(f"{interface} cannot listen silently, and a wrong bit rate disturbs a bus (can: {known})")


def frames_at(interface: str, channel: str, bit_rate: int, wait: float = WAIT) -> int:
    """Return how many frames are heard at a bit rate, 0 if anything is wrong with one. Raises LocalError, BusError."""
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
