"""`node` with the robot's nodes: a core that starts up and drives, and leaves a robot that stands."""

from __future__ import annotations

import io
import json
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.bus.live import Live, open_bus
from eurobot_od.plugin import Plugins
from eurobot_od.robot import dialects
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.messages import StopDrive
from eurobot_od.robot.model.values import TeamColour
from eurobot_od.robot.nodes import Drive, Navigation
from eurobot_od.robot.plugin import ROBOT
from tests.cli.console import run
from tests.cli.processes import PATIENCE, killed_if_it_hangs, line, node, serve_bus
from tests.client.peers import new_channel
from tests.device import io_module

FACTS = robot_file.read()


@pytest.fixture
def shared_bus() -> Iterator[str]:
    with serve_bus("test-node") as channel:
        yield channel


@pytest.mark.long
def test_a_core_starts_up_with_the_others_and_ends_in_time(shared_bus: str) -> None:
    bus = ["-i", "remote", "-c", shared_bus]
    with node("drive", *bus) as drive, node("navigation", *bus) as navigation:
        line(drive, "drive (node-ID 2) on ")
        line(navigation, "navigation (node-ID 3) on ")
        with node("core", "--team", "yellow", "--for", "100 ms", *bus) as core:
            for what in ("core (node-ID 1) on ", "drive answered after ", "navigation answered after "):
                line(core, what)
            line(core, "start configuration confirmed after ")
            assert core.wait(PATIENCE) == 0


class Pipe(io.StringIO):
    """A pipe to another program, which gets what was flushed."""

    flushed = 0

    def flush(self) -> None:
        self.flushed += 1


def test_each_line_is_there_for_another_program_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe = Pipe()
    channel = new_channel()
    monkeypatch.setattr(sys, "stdout", pipe)
    others = Drive(dialects.load("drive")), Navigation(dialects.load("navigation"))
    with ExitStack() as stack:
        for each in others:
            stack.enter_context(Live.node(open_bus("virtual", channel), each))
        words = ["node", "core", "--team", "red", "--verbose", "--for", "1 ms", "-i", "virtual", "-c", channel]
        assert cli.main(words) == 0
    assert "start configuration confirmed after " in pipe.getvalue()
    assert "  Check Drive Response\n" in pipe.getvalue()
    assert pipe.flushed == pipe.getvalue().count("\n") + 1, "and at the end"


# A core that is told to end while its goto is under way

SCRIPT = """
import sys
from eurobot_od import Robot
from eurobot_od.robot.model.values import TeamColour

with Robot("remote", sys.argv[1]) as robot:
    robot.check_nodes()
    robot.configure_start(TeamColour.RED)
    print(robot.goto(2700, 1700, 0, speed=30))
"""


@contextmanager
def partners(channel: str) -> Iterator[Drive]:
    """Run a drive and a navigation in this process; gives the drive."""
    drive = Drive(dialects.load("drive"))
    with ExitStack() as stack:
        for node in (drive, Navigation(dialects.load("navigation"))):
            stack.enter_context(Live.node(open_bus("remote", channel), node))
        yield drive


def wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def is_on_its_way(drive: Drive) -> bool:
    """Return whether the drive has left its start place; it takes some 100 ms for that."""
    pose = drive.estimate.pose
    return drive.goto is not None and pose is not None and pose.distance(FACTS.start(TeamColour.RED).point) > 10


@pytest.mark.long
@pytest.mark.posix
@pytest.mark.parametrize(("told", "status"), [(signal.SIGTERM, 128 + signal.SIGTERM), (signal.SIGINT, -signal.SIGINT)])
def test_the_robot_stands_after_its_script_is_terminated(shared_bus: str, told: signal.Signals, status: int) -> None:
    with partners(shared_bus) as drive, killed_if_it_hangs([sys.executable, "-c", SCRIPT, shared_bus]) as script:
        wait_for(lambda: is_on_its_way(drive))
        script.send_signal(told)
        assert script.wait(PATIENCE) == status
        assert not drive.moving
        assert drive.stopped_by == StopDrive()  # said, and not only missed later


@pytest.mark.long
def test_the_robot_stands_soon_after_its_script_is_killed(shared_bus: str) -> None:
    with partners(shared_bus) as drive, killed_if_it_hangs([sys.executable, "-c", SCRIPT, shared_bus]) as script:
        wait_for(lambda: is_on_its_way(drive))
        script.kill()
        wait_for(lambda: not drive.moving)
        assert 0x8130 in drive.device.emergencies.errors.values()


@pytest.mark.long
@pytest.mark.posix
def test_the_robot_stands_after_its_drill_is_terminated(shared_bus: str) -> None:
    with partners(shared_bus) as drive, node("core", "--drill", "-i", "remote", "-c", shared_bus) as core:
        wait_for(lambda: is_on_its_way(drive))
        core.send_signal(signal.SIGTERM)
        assert core.wait(PATIENCE) == 130
        assert not drive.moving
        assert drive.stopped_by == StopDrive()


def test_a_drill_ends_with_the_duration(shared_bus: str) -> None:
    bus = ("-i", "remote", "-c", shared_bus)
    with partners(shared_bus) as drive, node("core", "--drill", "--for", "1 s", *bus) as core:
        assert core.wait(PATIENCE) == 0
        assert drive.stopped_by is None  # its first goto would have come after 10 s


@pytest.mark.parametrize(
    ("words", "status", "complaint"), [(["drive", "--team", "red"], 2, "--team is for the core, not for the drive")]
)
def test_a_node_that_cannot_run_is_one_line(
    capsys: pytest.CaptureFixture[str], words: list[str], status: int, complaint: str
) -> None:
    said = run(capsys, "node", *words)
    assert (said.status, said.out) == (status, "")
    assert said.err.startswith(f"eurobot-od: {complaint}")
    assert said.err.count("\n") == 1


# Anybody's device


@pytest.fixture
def eds(tmp_path: Path) -> str:
    file = tmp_path / "module.eds"
    file.write_text(f"[FileInfo]\nFileName=module.eds\n{io_module.TEXT}", encoding="ascii")
    return str(file)


def test_a_node_of_the_named_robot_runs_from_a_file_in_any_folder(capsys: pytest.CaptureFixture[str]) -> None:
    files = "--network", str(dialects.folder("canopen")), "--robot", "eurobot2014"
    said = run(capsys, "node", "drive", *files, "--for", "1 ms", "-i", "virtual")
    assert said.out.startswith("drive (node-ID 2)")
    said = run(capsys, "node", "drive", *files, "--set", "0x1017=5")
    assert said.complaint == "eurobot-od: unknown fact '0x1017'; known: body, match, field, barriers, tasks, robots"


OURS = ("--robot", "eurobot2014")
WRONG_DEVICES = [
    (["--team", "red", *OURS], "--team is for the core, not for devices that do not belong to the robot"),
    (
        ["--fault", "goto-not-confirmed", *OURS],
        "the fault goto-not-confirmed is one of the drive, not of other devices",
    ),
]


@pytest.mark.parametrize(("words", "complaint"), WRONG_DEVICES)
def test_a_device_that_cannot_run_is_one_line(
    capsys: pytest.CaptureFixture[str], eds: str, words: list[str], complaint: str
) -> None:
    said = run(capsys, "node", "--eds", f"5={eds}", *words)
    assert (said.status, said.complaint.partition(complaint)[:2]) == (2, ("eurobot-od: ", complaint))


# pdo


# faults


def test_faults_as_json_name_the_step_that_finds_them(capsys: pytest.CaptureFixture[str]) -> None:
    rows = json.loads(run(capsys, "faults", "--json").out)
    assert {
        "name": "goto-not-confirmed",
        "node": "drive",
        "text": "sends no Goto Confirm",
        "suite": "drive",
        "step": "2.1 Goto ACK: a goto is confirmed",
    } in rows
    assert len(rows) == len(Plugins(ROBOT).fault_names())
