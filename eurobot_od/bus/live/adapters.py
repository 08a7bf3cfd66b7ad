"""CAN adapters on USB: which ones are plugged in, what drives each, and what is still to be installed.

An adapter is known by its vendor and product on USB; one that is not in the table is not mentioned. Linux shows them as
files. Elsewhere pyserial finds those that are serial ports, if it is installed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import NamedTuple

from eurobot_od.bus.live.buses import SOCKETCAN, silence_logs
from eurobot_od.bus.live.links import links

USB = Path("/sys/bus/usb/devices")
"""Where Linux shows what is plugged in; nothing is there on other systems."""


class Adapter(NamedTuple):
    """A make: its `kernel` module on Linux, empty without one, python-can's `interface`, and what that needs."""

    name: str
    kernel: str
    interface: str
    needs: str

    def advice(self, with_socketcan: bool) -> str:
        """Say how to use it, on a machine with or without SocketCAN."""
        if with_socketcan and self.kernel:
            return f"-i socketcan, by the kernel's {self.kernel}; no can0? `sudo modprobe {self.kernel}`"
        return f"-i {self.interface}, which needs {self.needs}"


def _pip(extra: str) -> str:
    return f'`pip install "python-can[{extra}]"`'


PEAK = "PEAK's driver with PCAN-Basic"
KVASER = "Kvaser's driver with CANlib"

ANY = ""
"""In place of a product: all of a vendor's."""

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


def plugged_in(folder: Path = USB) -> list[Adapter]:
    """Return the adapters of this machine, in the order of the table."""
    seen = set(_of_sys(folder) if folder.is_dir() else _of_pyserial())
    seen |= {(vendor, ANY) for vendor, _ in seen}
    return [each for key, each in ADAPTERS.items() if key in seen]


def _of_sys(folder: Path) -> Iterator[tuple[str, str]]:
    for device in folder.iterdir():
        with suppress(OSError):  # a hub's ports, which have neither; or it was unplugged just now
            vendor, product = ((device / name).read_text("ascii").strip() for name in ("idVendor", "idProduct"))
            yield vendor, product


def _of_pyserial() -> Iterator[tuple[str, str]]:
    with suppress(ImportError):
        from serial.tools.list_ports import comports

        yield from ((f"{port.vid:04x}", f"{port.pid:04x}") for port in comports() if port.vid is not None)


# CAN interfaces: those of SocketCAN, and what the drivers of python-can find


NOT_ASKED = ("virtual", "udp_multicast", "socketcand", SOCKETCAN)
"""What python-can finds anywhere, what it listens for in the network for seconds, and what `links` describes better."""


class Attached(NamedTuple):
    """An interface of python-can, its channel, and how it `is`, as far as that is known."""

    interface: str
    channel: str
    is_: str = ""

    def __str__(self) -> str:
        how = f" ({self.is_})" if self.is_ else ""
        return f"-i {self.interface} -c {self.channel}{how}"


PORTS = ("ttyUSB*", "ttyACM*")
"""Serial ports, as slcan adapters have."""


def refused(folder: Path = Path("/dev")) -> list[str]:
    """Return the serial ports that this user may not open."""
    ports = sorted(port for pattern in PORTS for port in folder.glob(pattern))
    return [str(port) for port in ports if not os.access(port, os.R_OK | os.W_OK)]


def drivers() -> dict[str, bool]:
    """Return whether the driver of each interface of python-can can be loaded; what it drives may still be missing."""
    from can.interfaces import BACKENDS

    silence_logs()
    loaded = {}
    for interface, (module, _) in sorted(BACKENDS.items()):
        try:
            import_module(module)
            loaded[interface] = True
        except Exception:  # whatever a driver raises while it looks for its library
            loaded[interface] = False
    return loaded


def here() -> list[Attached]:
    """Return the interfaces of this machine; what a driver that is not installed would find is not among them."""
    import can
    from can.interfaces import BACKENDS

    silence_logs()
    ours = [Attached(SOCKETCAN, link.name, str(link)) for link in links()]
    found = can.detect_available_configs([each for each in BACKENDS if each not in NOT_ASKED])
    return ours + [Attached(str(each["interface"]), str(each["channel"])) for each in found]
