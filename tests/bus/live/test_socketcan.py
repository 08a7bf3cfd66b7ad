"""The kernel's bus: devices in processes of their own, the interface that bounces, the flood, error frames, no room.

They run wherever there is a `vcan0` that may be changed. On one slow CPU, too: nothing here waits less than 100 ms.
"""

from __future__ import annotations

import shutil
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

from eurobot_od.bus.live import Live, open_bus
from eurobot_od.controller import Controller, Event
from eurobot_od.device.simulated import SimulatedDevice
from eurobot_od.od.standard import ErrorCode
from eurobot_od.od.values import SYNC_COB_ID
from tests.bus.live.loose import LONG, Reports, wait_for
from tests.cli.console import run
from tests.kit import lift
from tests.kit.devices import MOTOR
from tests.kit.lift import Halt
from tests.processes import PATIENCE, motor, node, process

INTERFACE = "vcan0"
PROTOCOL = lift.protocol()
BUS = ("-i", "socketcan", "-c", INTERFACE)
SETS_UP = f"`sudo ip link set {INTERFACE} up` sets it up"
CAN_FRAME = struct.Struct("=IB3x8s")
ERROR_FLAG = 0x20000000

pytestmark = [
    pytest.mark.socketcan,
    pytest.mark.skipif(
        not Path("/sys/class/net", INTERFACE).exists(), reason=f"no {INTERFACE} here (see CONTRIBUTING)"
    ),
]


def ip(*words: str) -> None:
    program = shutil.which("ip")
    command = [program] if program else ["busybox", "ip"]
    subprocess.run([*command, "link", "set", INTERFACE, *words], check=True, timeout=PATIENCE)


@pytest.fixture(autouse=True)
def _up() -> Iterator[None]:
    yield
    ip("up")


@pytest.fixture
def bus() -> Iterator[can.BusABC]:
    with open_bus("socketcan", INTERFACE) as bus:
        yield bus


def live_motor(reports: Reports) -> Live:
    def opener() -> can.BusABC:
        return open_bus("socketcan", INTERFACE)

    return Live.node(opener(), SimulatedDevice.load(MOTOR, 5), opener=opener, report=reports)


def ask_motor(bus: can.BusABC) -> None:
    """Ask for the device type until it answers: what is sent while it opens its bus is lost."""
    for _ in range(100):
        bus.send(can.Message(arbitration_id=0x605, data=b"\x40\0\x10\0\0\0\0\0", is_extended_id=False))
        while (message := bus.recv(0.2)) is not None:
            if message.arbitration_id == 0x585:
                return
    pytest.fail("the motor does not answer")


def test_three_devices_in_three_processes_are_found(capsys: pytest.CaptureFixture[str]) -> None:
    with node(*motor(5), *BUS), node(*motor(6), *BUS), node(*motor(7), *BUS):
        found = run(capsys, "scan", *BUS)
    assert [line.split()[0] for line in found.out.splitlines() if "Motor controller" in line] == ["5", "6", "7"]


def test_can_utils_see_what_is_sent(bus: can.BusABC) -> None:
    if shutil.which("candump") is None:
        pytest.skip("no candump here")
    with process("candump", "-L", INTERFACE) as candump, node(*motor(), *BUS):
        assert candump.line("705#").endswith("705#00")
        ask_motor(bus)
        candump.line("585#")


def test_an_interface_that_bounces_leaves_no_deaf_process() -> None:
    with node(*motor(5), *BUS) as first, node(*motor(6), *BUS) as second:
        for _ in range(2):
            ip("down")
            for each in (first, second):
                assert each.line("bus failed").endswith(
                    f"Network is down [Error Code 100]; {SETS_UP}; it is opened again"
                )
            ip("up")
            for each in (first, second):
                assert "after a gap of " in each.line("bus back")
        with open_bus("socketcan", INTERFACE) as fresh:
            ask_motor(fresh)


@pytest.mark.parametrize(
    "words", [["send", "Motor.RPDO1", "--eds", f"5={MOTOR}", "target_speed=1"], ["scan"], ["time"]]
)
def test_a_network_that_is_down_is_answered_with_what_sets_it_up(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    ip("down")
    said = run(capsys, *words, *BUS)
    assert said.status == 3
    assert SETS_UP in said.out + said.err
    assert "sent " not in said.out


def test_the_doctor_sees_an_interface_and_what_mends_it(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "doctor")
    assert f"interface  -i socketcan -c {INTERFACE} (up)" in said.out.splitlines()
    ip("down")
    said = run(capsys, "doctor")
    assert said.status == 1
    assert said.out.splitlines()[-1] == f"wrong      {INTERFACE} is down: sudo ip link set {INTERFACE} up"


def test_a_command_without_a_bus_lists_what_is_here(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "scan")
    assert said.status == 2
    assert f"here: -i socketcan -c {INTERFACE} (up)" in said.err


def test_sync_goes_on_behind_an_interface_that_bounces(bus: can.BusABC) -> None:
    with process(sys.executable, "-m", "eurobot_od", "sync", "--period", "100 ms", *BUS):
        wait_for(bus, SYNC_COB_ID)
        ip("down")
        with pytest.raises(can.CanOperationError, match="Network is down"):
            wait_for(bus, -1)
        ip("up")
        wait_for(bus, SYNC_COB_ID)


def test_without_reconnection_a_bounce_ends_a_node_with_status_3() -> None:
    with node(*motor(), "--no-reconnect", *BUS) as running:
        ip("down")
        assert running.wait() == 3


def test_a_stop_that_is_sent_while_the_interface_is_down_leaves_when_it_is_up(bus: can.BusABC) -> None:
    reports = Reports()
    live = Live(
        open_bus("socketcan", INTERFACE),
        Controller(PROTOCOL, report=reports),
        opener=lambda: open_bus("socketcan", INTERFACE),
    )
    with live:
        ip("down")
        reports.wait_for(Event.BUS_FAILED)
        live.send(Halt())
        ip("up")
        with pytest.raises(can.CanOperationError, match="Network is down"):
            bus.recv(LONG)  # once; then the witness hears again
        wait_for(bus, PROTOCOL.cob_id(Halt))
        reports.wait_for(Event.BUS_BACK)


def test_a_flood_that_overflows_the_queue_is_counted_and_told(bus: can.BusABC) -> None:
    """It used to be silent: 51 555 frames on the bus, 4312 in summary and log."""
    reports = Reports()
    with live_motor(reports) as live:
        live.bus.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)  # type: ignore[attr-defined]
        flood = can.Message(arbitration_id=0x205, data=bytes(2), is_extended_id=False)
        for _ in range(500):
            bus.send(flood, timeout=1.0)
        assert "found no room" in reports.wait_for(Event.FRAMES_LOST).text
        data = wait_for(bus, 0x085, ErrorCode.OVERRUN.to_bytes(2, "little"))
        assert len(data) == 8
        assert live.overflow > 0


def test_the_monitor_writes_a_comment_for_what_is_missing() -> None:
    flood = f"import can\nbus = can.Bus('{INTERFACE}', interface='socketcan')\n" + (
        "m = can.Message(arbitration_id=0x123, data=bytes(8), is_extended_id=False)\n"
        "for _ in range(20000): bus.send(m, timeout=1.0)\n"
    )
    command = (sys.executable, "-m", "eurobot_od", "monitor", "--plain", *BUS)
    with node(*motor(), *BUS), process(*command) as monitor:
        monitor.line("Heartbeat")
        with process(sys.executable, "-c", flood) as flooding:
            assert flooding.wait() == 0
        assert monitor.line("because the driver's queue was full").startswith("# ")


# Class bit of the identifier, data byte 1, and what the node tells by EMCY (Linux's can/error.h).
ERROR_FRAMES = {
    "overrun": (0x004, 0x01, ErrorCode.OVERRUN),
    "error passive": (0x004, 0x10, ErrorCode.ERROR_PASSIVE),
    "restarted after bus-off": (0x100, 0x00, ErrorCode.RECOVERED_FROM_BUS_OFF),
}


@pytest.mark.parametrize(("error", "detail", "code"), ERROR_FRAMES.values(), ids=ERROR_FRAMES)
def test_error_frames_become_emcy(bus: can.BusABC, error: int, detail: int, code: ErrorCode) -> None:
    with live_motor(Reports()), socket.socket(socket.PF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as raw:
        raw.bind((INTERFACE,))
        raw.send(CAN_FRAME.pack(ERROR_FLAG | error, 8, bytes([0, detail])))
        wait_for(bus, 0x085, code.to_bytes(2, "little"))


def test_a_send_buffer_without_room_is_no_lost_bus_and_loses_no_stop(bus: can.BusABC) -> None:
    reports = Reports()
    with Live(open_bus("socketcan", INTERFACE), Controller(PROTOCOL, report=reports)) as live:
        live.bus.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1)  # type: ignore[attr-defined]
        for _ in range(100):
            live.send(Halt())
        for _ in range(100):
            wait_for(bus, PROTOCOL.cob_id(Halt))
        assert live.failure is None
    assert all(report.event is not Event.BUS_FAILED for report in reports.rest())
