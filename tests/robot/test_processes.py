"""The robot's nodes in processes of their own: its start, a match, and nodes that are killed or frozen."""

from __future__ import annotations

import re
import signal
import sys
import time
from pathlib import Path

import can
import pytest

from eurobot_od.bus.live import open_bus
from eurobot_od.robot.model.messages import CheckDriveRequest, GotoConfirm, GotoXY, StartConfigurationSet
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.protocol import EurobotProtocol
from tests.bus.live.loose import wait_for
from tests.processes import bus_server, free_port, node, process, shared

pytest.importorskip("can_remote")


pytestmark = pytest.mark.live

EUROBOT_OD = sys.executable, "-m", "eurobot_od"


@pytest.mark.long
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


MATCH = """
import asyncio

async def play(core):
    print("playing", flush=True)
    await asyncio.sleep(60)
"""


@pytest.mark.long
def test_a_match_that_a_core_leads_goes_on_when_the_bus_server_is_restarted(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    port = free_port()
    file.write_text(MATCH, encoding="utf-8")
    with bus_server(port) as first, process(*EUROBOT_OD, "world", "--listen", "127.0.0.1:0") as world:
        where = re.search(r"world on (\S+);", world.line("Ctrl-C ends it"))
        assert where is not None
        options = "--world", where[1], *shared(port)
        with node("drive", *options), node("navigation", *options):
            leading = "core", "--strategy", str(file), "--for", "5 s", *options
            with process(*EUROBOT_OD, "node", *leading) as core:
                core.line("playing")
                first.kill()
                core.line("it is opened again")
                with bus_server(port):
                    core.line("bus back")
                    assert core.wait() == 0, core.told()


PROTOCOL = EurobotProtocol.load()
EMCY_OF_DRIVE, HEARTBEAT_LOST = 0x082, b"\x30\x81"

STRATEGY = """
import sys
from contextlib import suppress
from eurobot_od import Robot
from eurobot_od.errors import EurobotError, StateError
from eurobot_od.robot.model.values import TeamColour

with Robot("remote", sys.argv[1]) as robot:
    robot.check_nodes()
    robot.configure_start(TeamColour.RED)
    while True:
        try:
            print("goto", flush=True)
            print(robot.goto(1500, 1000, 90, 10).outcome, flush=True)
        except StateError as error:  # the shutdown after some 2 s: on a busy machine a drive may take longer to start
            print(error, flush=True)
            with suppress(EurobotError):
                robot.recover()
        except EurobotError as error:
            print(error, flush=True)
"""


def strategy(port: int) -> tuple[str, ...]:
    """Return the command of a core that sends the drive to a place again and again."""
    return sys.executable, "-c", STRATEGY, f"ws://127.0.0.1:{port}/"


def joined(port: int) -> can.BusABC:
    return open_bus("remote", f"ws://127.0.0.1:{port}/")


def place(bus: can.BusABC) -> bytes:
    """Ask the drive where it is."""
    bus.send(can.Message(arbitration_id=0x0C0, is_extended_id=False))
    return wait_for(bus, 0x100)


@pytest.mark.long
def test_a_core_that_is_killed_is_noticed_in_its_heartbeat_time_and_the_drive_stopped() -> None:
    port = free_port()
    with bus_server(port), node("drive", *shared(port)), node("navigation", *shared(port)):
        watching = process(sys.executable, "-m", "eurobot_od", "monitor", "--plain", *shared(port))
        with watching as monitor:
            monitor.line("Heartbeat")  # from now on it sees everything
            with process(*strategy(port)) as core, joined(port) as bus:
                core.line("goto")
                wait_for(bus, PROTOCOL.cob_id(GotoConfirm))
                wait_for(bus, 0x701)  # a heartbeat: from now on the drive misses them
                core.signal(signal.SIGKILL)
                wait_for(bus, EMCY_OF_DRIVE, HEARTBEAT_LOST)
                assert "heartbeat lost" in monitor.line("0x8130")
                deadline = time.monotonic() + 30.0
                while place(bus) != place(bus):
                    assert time.monotonic() < deadline


@pytest.mark.long
def test_a_drive_that_is_killed_and_restarted_is_checked_configured_and_joins_by_itself() -> None:
    port = free_port()
    server = bus_server(port)
    navigation = node("navigation", *shared(port))
    drive = node("drive", *shared(port))
    with server, navigation, drive as killed, process(*strategy(port)) as core, joined(port) as bus:
        core.line("goto")
        wait_for(bus, PROTOCOL.cob_id(GotoConfirm))
        wait_for(bus, 0x702)
        killed.signal(signal.SIGKILL)
        core.line("LOST")
        with node("drive", *shared(port)):
            for message in (CheckDriveRequest, StartConfigurationSet, GotoXY, GotoConfirm):
                wait_for(bus, PROTOCOL.cob_id(message))


@pytest.mark.long
def test_a_drive_that_was_frozen_does_not_obey_an_old_goto() -> None:
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


@pytest.mark.socketcan
@pytest.mark.skipif(not Path("/sys/class/net/vcan0").exists(), reason="no vcan0 here (see CONTRIBUTING)")
def test_three_nodes_on_the_kernels_bus_start_up() -> None:
    bus = ("-i", "socketcan", "-c", "vcan0")
    with node("drive", *bus), node("navigation", *bus), node("core", "--team", "red", *bus) as core:
        core.line("start configuration confirmed after ")
