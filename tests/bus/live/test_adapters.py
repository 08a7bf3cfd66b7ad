"""Adapters on USB: known by vendor and product, with what drives each."""

from __future__ import annotations

from pathlib import Path

import pytest
from can.interfaces import BACKENDS

from eurobot_od.bus.live.adapters import ADAPTERS, plugged_in

PLUGGED_IN = [
    # (vendor, product, what it is, with SocketCAN, without)
    ("0c72", "000c", "PEAK PCAN-USB", "-i socketcan, by the kernel's peak_usb; ", "-i pcan, which needs PEAK's"),
    ("0bfd", "0120", "Kvaser", "-i socketcan, by the kernel's kvaser_usb; ", "-i kvaser, which needs Kvaser's"),
    ("1d50", "606f", "candleLight, CANable", "-i socketcan, by the kernel's gs_usb; ", "-i gs_usb, which needs `pip"),
    ("16d0", "117e", "CANable with slcan", "-i slcan, which needs `pip install", "-i slcan, which needs `pip install"),
]


def plug(folder: Path, port: str, vendor: str, product: str) -> None:
    (folder / port).mkdir()
    (folder / port / "idVendor").write_text(f"{vendor}\n")
    (folder / port / "idProduct").write_text(f"{product}\n")


@pytest.mark.parametrize(("vendor", "product", "name", "with_it", "without"), PLUGGED_IN)
def test_an_adapter_is_named_with_what_drives_it(
    vendor: str, product: str, name: str, with_it: str, without: str, tmp_path: Path
) -> None:
    plug(tmp_path, "1-2", vendor, product)
    plug(tmp_path, "1-3", "046d", "c31c")  # a keyboard
    (tmp_path / "1-2:1.0").mkdir()  # an interface of a device, without either number
    (adapter,) = plugged_in(tmp_path)
    assert adapter.name == name
    assert adapter.advice(with_socketcan=True).startswith(with_it)
    assert adapter.advice(with_socketcan=False).startswith(without)


def test_an_empty_usb_bus_has_no_adapters(tmp_path: Path) -> None:
    assert plugged_in(tmp_path) == []


def test_where_linux_shows_nothing_pyserial_is_asked(tmp_path: Path) -> None:
    assert set(plugged_in(tmp_path / "nowhere")) <= set(ADAPTERS.values())


def test_each_interface_is_one_of_python_can() -> None:
    assert {each.interface for each in ADAPTERS.values()} <= set(BACKENDS)
