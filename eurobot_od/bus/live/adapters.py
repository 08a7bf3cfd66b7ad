"""CAN hardware of this machine: the interfaces of Linux (SocketCAN), and USB adapters.

For an interface: its state, and the command that repairs it. The output of `ip -details -json link` and the folder
`/sys/class/net` are parsed by separate functions; only `links` reads them from the machine.

For an adapter: its driver, and what has to be installed. Adapters are recognised by USB vendor and product; others are
not listed. Linux shows USB devices as files. On other systems, pyserial finds adapters that are serial ports, if it is
installed.

The bit rate of a bus is detected by listening: no frame is sent, acknowledged or destroyed.
"""

from __future__ import annotations

import errno
import json
import logging
import os
import re
import socket
import subprocess
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

from eurobot_od.errors import BusError, LocalError

SOCKETCAN = "socketcan"
"""python-can's name of Linux's own CAN interfaces."""

BITRATE = 500_000
"""Default bit rate in bit/s, if neither caller, python-can's configuration nor interface has one."""

NETWORK = Path("/sys/class/net")
"""The kernel's folder of network interfaces; missing on other systems."""

COMMAND = ("ip", "-details", "-json", "link")

ARPHRD_CAN = "280"
"""Type of a CAN interface in `/sys` (`linux/if_arp.h`)."""

IFF_UP = 1
"""Bit of an interface's flags in `/sys` (`linux/if.h`)."""

ONLY_LINUX = "SocketCAN is a part of Linux"
NO_SOCKETCAN = "this kernel has no SocketCAN; `sudo modprobe can_raw` loads it, if it is installed"
INSTEAD = (
    "instead: -i virtual (one program), -i remote (several programs, extra `remote`), "
    "-i udp_multicast -c 239.74.163.2 (several programs), or an adapter with its maker's driver"
)
"""Alternatives to SocketCAN."""

BUS_OFF = "BUS-OFF"
"""State of a controller that has left the bus."""

ERRORS = ("ERROR-WARNING", "ERROR-PASSIVE")
"""States of a controller that has seen many errors and is still on the bus."""


class CanLink(NamedTuple):
    """A CAN interface; `virtual` without a wire, `state` and `bit_rate` (bit/s) of the controller if known.

    `restart` is whether the kernel restarts a controller that is bus-off, None if unknown.
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
    """A problem of an interface, and the command that fixes it or shows more."""

    what: str
    fix: str


# State of interfaces


def without_socketcan() -> str:
    """Return why this machine has no SocketCAN, and how to get it; empty if it has SocketCAN."""
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
    """Parse the output of `ip -details -json link`; raises ValueError for another text."""
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


# Remedies


def troubles(link: CanLink) -> Iterator[Trouble]:
    """Yield the problems of an interface."""
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
    """Return the remedy for an operating system error with a SocketCAN interface; empty if unknown."""
    virtual = "vcan" in name
    makes = f"`sudo ip link add dev {name} type vcan; {set_up(name, virtual=True)}` makes it"
    remedies = {
        errno.ENETDOWN: f"`{set_up(name, virtual=virtual)}` sets it up",
        errno.ENODEV: makes if virtual else "plug it in; `doctor` lists what is here",
        errno.EAFNOSUPPORT: f"{NO_SOCKETCAN}; {INSTEAD}",
        errno.ENOBUFS: "no node acknowledges its frames: is another node on the bus, at the same bit rate?",
    }
    return remedies.get(number or 0, "")


# Adapters on USB


USB = Path("/sys/bus/usb/devices")
"""Linux's folder of USB devices; missing on other systems."""


class Adapter(NamedTuple):
    """A kind of adapter: `kernel` module on Linux, empty without one, python-can's `interface`, and its driver."""

    name: str
    kernel: str
    interface: str
    needs: str

    def advice(self, with_socketcan: bool) -> str:
        """Return how to use it, with or without SocketCAN."""
        if with_socketcan and self.kernel:
            return f"-i socketcan, by the kernel's {self.kernel}; no can0? `sudo modprobe {self.kernel}`"
        return f"-i {self.interface}, which needs {self.needs}"


def _pip(extra: str) -> str:
    return f'`pip install "python-can[{extra}]"`'


PEAK = "PEAK's driver with PCAN-Basic"
KVASER = "Kvaser's driver with CANlib"

ANY = ""
"""Matches all products of a vendor."""

ADAPTERS = {
    # (vendor, product), as in the kernel's drivers/net/can/usb and the makers' pages
    ("0c72", ANY): Adapter("PEAK PCAN-USB", "peak_usb", "pcan", PEAK),
    ("0bfd", ANY): Adapter("Kvaser", "kvaser_usb", "kvaser", KVASER),
    ("1d50", "606f"): Adapter("candleLight, CANable", "gs_usb", "gs_usb", _pip("gs-usb")),
    ("1209", "2323"): Adapter("candleLight", "gs_usb", "gs_usb", _pip("gs-usb")),
    ("16d0", "10b8"): Adapter("ABE CANdebugger FD", "gs_usb", "gs_usb", _pip("gs-usb")),
    ("0483", "1234"): Adapter("8devices USB2CAN", "usb_8dev", "usb2can", "the maker's CANAL library"),
    ("04d8", "0053"): Adapter("CANalyst-II", "", "canalystii", _pip("canalystii")),
    ("16d0", "117e"): Adapter("CANable with slcan", "", "slcan", _pip("serial")),
    ("ad50", "60c4"): Adapter("CANable with slcan", "", "slcan", _pip("serial")),
    ("0403", "ffa8"): Adapter("Lawicel CANUSB", "", "slcan", _pip("serial")),
}


DRIVERS = {each.interface: each.needs for each in ADAPTERS.values()} | {
    "ixxat": "HMS' VCI driver, on Windows; on Linux -i socketcan",
    "vector": "Vector's XL Driver Library, on Windows",
    "nican": "NI-CAN, on Windows",
    "nixnet": "NI-XNET",
    "systec": "SYS TEC's driver, on Windows",
    "serial": _pip("serial"),
    "seeedstudio": _pip("serial"),
    "robotell": _pip("serial"),
    "neovi": _pip("neovi"),
    "udp_multicast": _pip("multicast"),
}
"""Software to install for each interface of python-can."""


NO_CHANNEL = re.compile(r"argument: 'channel'|specify a serial port", re.IGNORECASE)
"""Pattern of errors of python-can's drivers about a missing channel."""


def driver_remedy(interface: str | None, error: BaseException) -> str:
    """Return the remedy for a missing channel or driver of a python-can interface; empty for other errors."""
    from can import CanInterfaceNotImplementedError

    if NO_CHANNEL.search(str(error)):
        return "name its channel: -c; `doctor` lists what is here"
    # Without its library, Kvaser's driver raises NameError, PEAK's an OSError without a number.
    absent = isinstance(error, (ImportError, NameError, CanInterfaceNotImplementedError))
    if interface in DRIVERS and (absent or (isinstance(error, OSError) and error.errno is None)):
        return f"it needs {DRIVERS[interface]}"
    return ""


def plugged_in(folder: Path = USB) -> list[Adapter]:
    """Return the adapters of this machine, in the order of the table."""
    if folder.is_dir():  # hubs' ports have neither file
        seen = {(_said(device / "idVendor"), _said(device / "idProduct")) for device in folder.iterdir()}
    else:
        seen = set(_of_pyserial())
    seen |= {(vendor, ANY) for vendor, _ in seen}
    return [each for key, each in ADAPTERS.items() if key in seen]


def _of_pyserial() -> Iterator[tuple[str, str]]:
    with suppress(ImportError):
        from serial.tools.list_ports import comports

        yield from ((f"{port.vid:04x}", f"{port.pid:04x}") for port in comports() if port.vid is not None)


# CAN interfaces: those of SocketCAN, and what the drivers of python-can find


NOT_ASKED = ("virtual", "udp_multicast", "socketcand", SOCKETCAN)
"""Interfaces that always exist, take seconds to search, or are better described by `links`."""


class Attached(NamedTuple):
    """An interface of python-can, its channel, and its state (`is_`) if known."""

    interface: str
    channel: str
    is_: str = ""

    def __str__(self) -> str:
        how = f" ({self.is_})" if self.is_ else ""
        return f"-i {self.interface} -c {self.channel}{how}"


PORTS = ("ttyUSB*", "ttyACM*")
"""Names of serial ports of slcan adapters."""


def refused(folder: Path = Path("/dev")) -> list[str]:
    """Return the serial ports that this user may not open."""
    ports = sorted(port for pattern in PORTS for port in folder.glob(pattern))
    return [str(port) for port in ports if not os.access(port, os.R_OK | os.W_OK)]


def silence_logs() -> None:
    """Suppress drivers' log lines unless the program has set up logging; errors are still raised."""
    for name in ("can", "can_remote", "seeedbus"):
        if not logging.getLogger(name).handlers:
            logging.getLogger(name).addHandler(logging.NullHandler())


def drivers() -> dict[str, bool]:
    """Return whether python-can's driver for each interface can be loaded; its library may still be missing."""
    from can.interfaces import BACKENDS

    silence_logs()
    loaded = dict.fromkeys(sorted(BACKENDS), False)
    for interface in loaded:
        with suppress(Exception):  # drivers raise anything while they look for their library
            import_module(BACKENDS[interface][0])
            loaded[interface] = True
    return loaded


def here() -> list[Attached]:
    """Return the interfaces of this machine, as far as their drivers are installed."""
    import can
    from can.interfaces import BACKENDS

    silence_logs()
    ours = [Attached(SOCKETCAN, link.name, str(link)) for link in links()]
    found = can.detect_available_configs([each for each in BACKENDS if each not in NOT_ASKED])
    return ours + [Attached(str(each["interface"]), str(each["channel"])) for each in found]


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
