"""Nodes in processes of their own on a bus of python-can-remote: what is noticed, and what comes back by itself."""

from __future__ import annotations

import signal
import sys
import time

import can
import pytest

from eurobot_od.robot.model.messages import CheckDriveRequest, GotoConfirm, GotoXY, StartConfigurationSet
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.protocol import EurobotProtocol
from tests.live.loose import wait_for
from tests.processes import bus_server, free_port, node, process, shared

pytest.importorskip("can_remote")
pytestmark = pytest.mark.live


def test_a_bus_server_that_is_restarted_is_found_again() -> None:
    port = free_port()
    with bus_server(port) as first, node("drive", *shared(port)) as drive, node("core", *shared(port)) as core:
        first.kill()
        for each in (drive, core):
            assert each.line("bus failed").endswith("; it is opened again")
        with bus_server(port):
            for each in (drive, core):
                assert "after a gap of " in each.line("bus back")
            with node("navigation", *shared(port)), node("core", "--team", "red", *shared(port)) as another:
                another.line("start configuration confirmed after ")


def test_without_reconnection_a_lost_bus_ends_a_node_with_status_3() -> None:
    port = free_port()
    with bus_server(port) as server, node("drive", "--no-reconnect", *shared(port)) as drive:
        server.kill()
        assert drive.wait() == 3
        [line] = [line for line in drive.told() if line.startswith("eurobot-od: ")]
        assert line.startswith("eurobot-od: the bus Virtual bus channel shared on ws://127.0.0.1:")


PROTOCOL = EurobotProtocol.load()
EMCY_OF_DRIVE, HEARTBEAT_LOST = 0x082, b"\x30\x81"

STRATEGY = """
import sys
from eurobot_od import Robot
from eurobot_od.errors import EurobotError
from eurobot_od.robot.model.values import TeamColour

with Robot("remote", sys.argv[1]) as robot:
    robot.check_nodes()
    robot.configure_start(TeamColour.RED)
    while True:
        try:
            print("goto", flush=True)
            print(robot.goto(1500, 1000, 90, 10).outcome, flush=True)
        except EurobotError as error:
            print(error, flush=True)
"""


def strategy(port: int) -> tuple[str, ...]:
    """Return the command of a core that sends the drive to a place again and again."""
    return sys.executable, "-c", STRATEGY, f"ws://127.0.0.1:{port}/"


def joined(port: int) -> can.BusABC:
    return can.Bus(f"ws://127.0.0.1:{port}/", interface="remote")


def place(bus: can.BusABC) -> bytes:
    """Ask the drive where it is."""
    bus.send(can.Message(arbitration_id=0x0C0, is_extended_id=False))
    return wait_for(bus, 0x100)


def test_a_core_that_is_killed_is_noticed_in_its_heartbeat_time_and_the_drive_stopped() -> None:
    port = free_port()
    with bus_server(port), node("drive", *shared(port)), node("navigation", *shared(port)):
        watching = process(sys.executable, "-m", "eurobot_od", "monitor", "--plain", *shared(port))
        with watching as monitor, process(*strategy(port)) as core, joined(port) as bus:
            core.line("goto")
            wait_for(bus, PROTOCOL.cob_id(GotoConfirm))
            wait_for(bus, 0x701)  # a heartbeat: from now on the drive misses them
            core.signal(signal.SIGKILL)
            wait_for(bus, EMCY_OF_DRIVE, HEARTBEAT_LOST)
            assert "heartbeat lost" in monitor.line("0x8130")
            deadline = time.monotonic() + 30.0
            while place(bus) != place(bus):
                assert time.monotonic() < deadline


def test_a_drive_that_is_killed_and_restarted_is_checked_configured_and_joins_by_itself() -> None:
    port = free_port()
    server, navigation, drive = bus_server(port), node("navigation", *shared(port)), node("drive", *shared(port))
    with server, navigation, drive as killed, process(*strategy(port)) as core, joined(port) as bus:
        core.line("goto")
        wait_for(bus, PROTOCOL.cob_id(GotoConfirm))
        wait_for(bus, 0x702)
        killed.signal(signal.SIGKILL)
        core.line("LOST")
        with node("drive", *shared(port)):
            for message in (CheckDriveRequest, StartConfigurationSet, GotoXY, GotoConfirm):
                wait_for(bus, PROTOCOL.cob_id(message))


def test_a_drive_that_was_frozen_carries_out_no_stale_goto() -> None:
    port = free_port()
    with bus_server(port), node("drive", *shared(port)) as drive, joined(port) as bus:
        bus.send(frame(StartConfigurationSet(TeamColour.RED, 0, 0, 0, 0)))
        wait_for(bus, 0x300)
        before = place(bus)
        drive.signal(signal.SIGSTOP)
        bus.send(frame(GotoXY(1500, 1000, 0, 100)))
        time.sleep(2.5)  # what is tested is that time passes
        drive.signal(signal.SIGCONT)
        said = [drive.line("stood still") for _ in range(2)]
        assert sorted(line.partition(":")[0] for line in said) == ["frames lost", "node alarm"]
        assert place(bus) == before
        bus.send(frame(GotoXY(1500, 1000, 0, 100)))  # a fresh one is
        wait_for(bus, PROTOCOL.cob_id(GotoConfirm))


def frame(message: GotoXY | StartConfigurationSet) -> can.Message:
    cob_id, data = PROTOCOL.encode(message)
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)
