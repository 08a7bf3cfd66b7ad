"""CAN interfaces of Linux (SocketCAN): which ones there are, what state they are in, and the command that fixes one.

What `ip -details -json link` and `/sys/class/net` say is read by functions of a text and a folder; only `links` asks
the machine.
"""

from __future__ import annotations

import errno
import json
import socket
import subprocess
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

BITRATE = 500_000
"""Bit/s, where neither the caller nor python-can's configuration nor the interface gives another."""

NETWORK = Path("/sys/class/net")
"""Where the kernel shows its network interfaces; nothing is there on other systems."""

COMMAND = ("ip", "-details", "-json", "link")

ARPHRD_CAN = "280"
"""Type of a CAN interface in `/sys` (`linux/if_arp.h`)."""

IFF_UP = 1
"""Bit of an interface's flags in `/sys` (`linux/if.h`)."""

ONLY_LINUX = "SocketCAN is a part of Linux"
NO_SOCKETCAN = "this kernel has no SocketCAN; `sudo modprobe can_raw` loads it, if it is installed"
INSTEAD = (
    "instead: -i virtual (one program), -i remote (several programs, extra `remote`), "
    "or an adapter with its maker's driver"
)
"""What does without SocketCAN."""

BUS_OFF = "BUS-OFF"
"""State of a controller that has left the bus."""

ERRORS = ("ERROR-WARNING", "ERROR-PASSIVE")
"""States of a controller that has seen many errors and is still on the bus."""


class CanLink(NamedTuple):
    """An interface: `virtual` without a wire; `state` and `bit_rate` (bit/s) of the controller, as far as known.

    `restart` says whether the kernel restarts a controller that is bus-off, None if unknown.
    """

    name: str
    up: bool
    virtual: bool = False
    state: str = ""
    bit_rate: int | None = None
    restart: bool | None = None

    def __str__(self) -> str:
        rate = () if self.bit_rate is None else (f"{self.bit_rate} bit/s",)
        return ", ".join(["up" if self.up else "down", *rate, *filter(None, (self.state,))])


class Trouble(NamedTuple):
    """What is wrong with an interface, and the command that is the `fix`, or shows more."""

    what: str
    fix: str


# Their state


def without_socketcan() -> str:
    """Return why this machine has no SocketCAN, and what may bring it; empty if it has SocketCAN."""
    if not hasattr(socket, "AF_CAN"):
        return ONLY_LINUX
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
    except OSError as error:
        return NO_SOCKETCAN if error.errno == errno.EAFNOSUPPORT else ""
    return ""


def links() -> list[CanLink]:
    """Return the CAN interfaces of this machine, by `ip` if it is there, else by `/sys`; none on other systems."""
    if not NETWORK.is_dir():
        return []
    with suppress(OSError, ValueError, subprocess.SubprocessError):  # no `ip`, or one that has no -json
        return of_ip(subprocess.run(COMMAND, capture_output=True, text=True, check=True, timeout=5).stdout)
    return of_sys(NETWORK)


def of_ip(text: str) -> list[CanLink]:
    """Read the output of `ip -details -json link`; raises ValueError if it is not that."""
    found = []
    for said in (each for each in json.loads(text) if each.get("link_type") == "can"):
        info: dict[str, Any] = said.get("linkinfo", {})
        data = info.get("info_data", {})
        found.append(
            CanLink(
                said["ifname"],
                up="UP" in said.get("flags", ()),
                virtual=info.get("info_kind") in ("vcan", "vxcan"),
                state=data.get("state", ""),
                bit_rate=data.get("bittiming", {}).get("bitrate"),
                restart=data["restart_ms"] > 0 if "restart_ms" in data else None,
            )
        )
    return found


def of_sys(folder: Path) -> list[CanLink]:
    """Read a folder like `/sys/class/net`, which has neither bit rate nor state."""
    return [
        CanLink(each.name, up=bool(int(_said(each / "flags"), 16) & IFF_UP), virtual=not (each / "device").exists())
        for each in sorted(folder.iterdir())
        if _said(each / "type") == ARPHRD_CAN
    ]


def _said(file: Path) -> str:
    with suppress(OSError):
        return file.read_text(encoding="ascii").strip()
    return ""


# How to fix them


def troubles(link: CanLink) -> Iterator[Trouble]:
    """Yield what is wrong with an interface."""
    rate = link.bit_rate or BITRATE
    if not link.up:
        yield Trouble(f"{link.name} is down", set_up(link.name, rate, link.virtual))
    elif link.state == BUS_OFF:
        yield Trouble(
            f"{link.name} has left the bus after too many errors: look at bit rate, wires and the resistors of 120 ohm "
            "at both ends",
            f"sudo ip link set {link.name} down; {set_up(link.name, rate)} restart-ms 100",
        )
    elif link.state in ERRORS:
        yield Trouble(
            f"{link.name} sees errors: no node acknowledges its frames, or bit rate, wires or resistors are wrong",
            f"ip -details -statistics link show {link.name}",
        )


def set_up(name: str, bit_rate: int = BITRATE, virtual: bool = False) -> str:
    """Return the command that sets an interface up."""
    return f"sudo ip link set {name} up" + ("" if virtual else f" type can bitrate {bit_rate}")


def remedy(number: int | None, name: str) -> str:
    """Return what helps against an error of the operating system with a SocketCAN interface; empty if unknown."""
    virtual = "vcan" in name
    makes = f"`sudo ip link add dev {name} type vcan; {set_up(name, virtual=True)}` makes it"
    remedies = {
        errno.ENETDOWN: f"`{set_up(name, virtual=virtual)}` sets it up",
        errno.ENODEV: makes if virtual else "plug it in; `doctor` lists what is here",
        errno.EAFNOSUPPORT: f"{NO_SOCKETCAN}; {INSTEAD}",
        errno.ENOBUFS: "no node acknowledges its frames: is another node on the bus, at the same bit rate?",
    }
    return remedies.get(number or 0, "")
