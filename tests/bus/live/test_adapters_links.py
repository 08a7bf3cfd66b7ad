"""SocketCAN interfaces, by what `ip` and the kernel have said of them, and the command that mends each."""

from __future__ import annotations

import errno
import json
import socket
from pathlib import Path
from typing import Any

import pytest

from eurobot_od.bus.live.adapters import (
    INSTEAD,
    NO_SOCKETCAN,
    ONLY_LINUX,
    CanLink,
    Trouble,
    of_ip,
    of_sys,
    remedy,
    troubles,
    without_socketcan,
)


def said(name: str, flags: list[str], **linkinfo: Any) -> dict[str, Any]:
    """What `ip -details -json link` of iproute2 6.1 says about an interface, as far as it matters."""
    return {"ifname": name, "flags": flags, "mtu": 16, "operstate": "UP", "link_type": "can", "linkinfo": linkinfo}


def can(name: str, flags: list[str], state: str, restart_ms: int = 0) -> dict[str, Any]:
    data = {
        "state": state,
        "berr_counter": {"tx": 0, "rx": 0},
        "restart_ms": restart_ms,
        "bittiming": {"bitrate": 250000, "sample_point": "0.875", "tq": 250},
        "clock": 8000000,
    }
    return said(name, flags, info_kind="can", info_data=data)


UP = ["NOARP", "UP", "LOWER_UP", "ECHO"]
LINKS: list[tuple[dict[str, Any], CanLink, str]] = [
    (said("vcan0", ["NOARP", "UP", "LOWER_UP"], info_kind="vcan"), CanLink("vcan0", True, True), "up"),
    (said("vcan1", ["NOARP"], info_kind="vcan"), CanLink("vcan1", False, True), "down"),
    (
        can("can0", UP, "ERROR-ACTIVE"),
        CanLink("can0", True, False, "ERROR-ACTIVE", 250000, False),
        "up, 250000 bit/s, ERROR-ACTIVE",
    ),
    (
        can("can1", UP, "BUS-OFF", 100),
        CanLink("can1", True, False, "BUS-OFF", 250000, True),
        "up, 250000 bit/s, BUS-OFF",
    ),
    # an interface that was never set up has no bit rate; slcan tells neither rate nor state
    (
        said("can2", ["NOARP", "ECHO"], info_kind="can", info_data={"state": "STOPPED", "restart_ms": 0}),
        CanLink("can2", False, False, "STOPPED", None, False),
        "down, STOPPED",
    ),
    (said("slcan0", UP, info_kind="slcan"), CanLink("slcan0", True), "up"),
]


@pytest.mark.parametrize(("told", "link", "text"), LINKS, ids=[link.name for _, link, _ in LINKS])
def test_ip_output_is_parsed(told: dict[str, Any], link: CanLink, text: str) -> None:
    others = [{"ifname": "lo", "flags": ["UP"], "link_type": "loopback"}]
    assert of_ip(json.dumps([*others, told])) == [link]
    assert str(link) == text


@pytest.mark.parametrize("text", ["", 'Option "-json" is unknown', "[{"])
def test_other_output_than_that_of_ip_is_an_error(text: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        of_ip(text)


def test_without_ip_the_kernel_tells_which_there_are_and_which_are_up(tmp_path: Path) -> None:
    for name, kind, flags, wired in (
        ("can0", "280", "0x40080", True),
        ("eth0", "1", "0x1003", True),
        ("vcan0", "280", "0xc1", False),
    ):
        (tmp_path / name).mkdir()
        (tmp_path / name / "type").write_text(f"{kind}\n")
        (tmp_path / name / "flags").write_text(f"{flags}\n")
        if wired:
            (tmp_path / name / "device").mkdir()
    (tmp_path / "bonding_masters").write_text("\n")
    assert of_sys(tmp_path) == [CanLink("can0", False), CanLink("vcan0", True, True)]


TROUBLES = [
    (CanLink("can0", True, False, "ERROR-ACTIVE", 500000), []),
    (CanLink("vcan0", True, True), []),
    (CanLink("can0", False), [Trouble("can0 is down", "sudo ip link set can0 up type can bitrate 500000")]),
    (
        CanLink("can0", False, False, "STOPPED", 250000),
        [Trouble("can0 is down", "sudo ip link set can0 up type can bitrate 250000")],
    ),
    (CanLink("vcan0", False, True), [Trouble("vcan0 is down", "sudo ip link set vcan0 up")]),
    (
        CanLink("can0", True, False, "BUS-OFF", 500000),
        [
            Trouble(
                "can0 has left the bus after too many errors: look at bit rate, wires and the resistors of 120 ohm "
                "at both ends",
                "sudo ip link set can0 down; sudo ip link set can0 up type can bitrate 500000 restart-ms 100",
            )
        ],
    ),
    (
        CanLink("can0", True, False, "ERROR-PASSIVE", 500000),
        [
            Trouble(
                "can0 sees errors: no node acknowledges its frames, or bit rate, wires or resistors are wrong",
                "ip -details -statistics link show can0",
            )
        ],
    ),
]


@pytest.mark.parametrize(("link", "found"), TROUBLES, ids=[f"{link.name} {link}" for link, _ in TROUBLES])
def test_problems_of_an_interface_have_a_remedy(link: CanLink, found: list[Trouble]) -> None:
    assert list(troubles(link)) == found


REMEDIES = [
    (errno.ENETDOWN, "can0", "`sudo ip link set can0 up type can bitrate 500000` sets it up"),
    (errno.ENETDOWN, "vcan0", "`sudo ip link set vcan0 up` sets it up"),
    (errno.ENODEV, "can0", "plug it in; `doctor` lists what is here"),
    (
        errno.ENODEV,
        "vcan0",
        "`sudo ip link add dev vcan0 type vcan; sudo ip link set vcan0 up` makes it",
    ),
    (errno.EAFNOSUPPORT, "can0", f"{NO_SOCKETCAN}; {INSTEAD}"),
    (errno.ENOBUFS, "can0", "no node acknowledges its frames: is another node on the bus, at the same bit rate?"),
    (errno.EINVAL, "can0", ""),
    (None, "can0", ""),
]


@pytest.mark.parametrize(("number", "name", "text"), REMEDIES)
def test_errors_of_adapters_have_a_remedy(number: int | None, name: str, text: str) -> None:
    assert remedy(number, name) == text


def test_a_machine_without_socketcan_says_why() -> None:
    reasons = {
        errno.EAFNOSUPPORT: NO_SOCKETCAN,  # a kernel without it
        0: "" if hasattr(socket, "AF_CAN") else ONLY_LINUX,
    }
    try:
        socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW).close()
        number = 0
    except AttributeError:
        number = 0
    except OSError as error:
        number = error.errno or 0
    assert without_socketcan() == reasons[number]
