"""CAN adapters on USB: which ones are plugged in, what drives each, and what is still to be installed.

An adapter is known by its vendor and product on USB; one that is not in the table is not mentioned. Linux shows them as
files. Elsewhere pyserial finds those that are serial ports, if it is installed.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

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
