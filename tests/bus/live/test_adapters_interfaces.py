"""Which interfaces a machine has, and which ports this user may not open."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from can.interfaces import BACKENDS

from eurobot_od.bus.live.adapters import Attached, drivers, here, refused


def test_an_interface_is_written_as_the_command_line_takes_it() -> None:
    assert str(Attached("pcan", "PCAN_USBBUS1")) == "-i pcan -c PCAN_USBBUS1"
    assert str(Attached("socketcan", "can0", "down")) == "-i socketcan -c can0 (down)"


def test_drivers_that_load() -> None:
    assert drivers()["virtual"]


class Bench:
    """A driver that finds what is attached to it."""

    @staticmethod
    def _detect_available_configs() -> list[dict[str, str]]:
        return [{"interface": "bench", "channel": "left"}]


def test_each_channel_that_a_driver_detects_is_an_interface(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(BACKENDS, "bench", (__name__, Bench.__name__))
    assert Attached("bench", "left") in here()


@pytest.mark.skipif(os.name == "nt" or os.geteuid() == 0, reason="root may open everything")
def test_ports_that_may_not_be_opened(tmp_path: Path) -> None:
    for name, mode in (("ttyUSB0", 0o600), ("ttyACM1", 0o000), ("tty9", 0o000)):
        (tmp_path / name).touch(mode)
    assert refused(tmp_path) == [str(tmp_path / "ttyACM1")]
