"""`node`: one node in a process of its own, which `send` meets on a bus that processes share."""

from __future__ import annotations

import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from can_remote.server import RemoteServer

from tests.cli.console import run

PATIENCE = 60.0
"""Seconds after which a process that hangs is killed."""


@pytest.fixture
def shared_bus() -> Iterator[str]:
    """Serve a bus to other processes, on this machine only and on a free port; gives its channel."""
    server = RemoteServer("127.0.0.1", 0, interface="virtual", channel="test-node")
    thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    thread.start()
    yield f"ws://127.0.0.1:{server.server_port}/"
    server.shutdown()
    server.server_close()
    thread.join(PATIENCE)


@contextmanager
def node(*words: str) -> Iterator[subprocess.Popen[str]]:
    """Run a node in a process of its own, and kill it if it hangs."""
    command = [sys.executable, "-m", "eurobot_od", "node", *words]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        watchdog = threading.Timer(PATIENCE, process.kill)
        watchdog.start()
        try:
            yield process
        finally:
            watchdog.cancel()
            process.kill()


def line(process: subprocess.Popen[str], what: str) -> str:
    """Wait for the line that says `what`, whatever is reported before it; a process that ends first fails the test."""
    assert process.stdout is not None
    for text in process.stdout:
        if what in text:
            return text.rstrip()
    pytest.fail(f"{process.args!r} ended and did not say {what!r}")


def test_a_drive_and_send_meet_on_a_shared_bus(capsys: pytest.CaptureFixture[str], shared_bus: str) -> None:
    bus = ["-i", "remote", "-c", shared_bus]
    with node("drive", *bus, "--verbose") as drive:
        line(drive, "drive (node-ID 2) on ")
        expect = ["--expect", "Goto Confirm", "--within", "30 s"]
        goto = run(capsys, "send", "Goto XY", "x=1500", "y=1000", "angle=90", "speed=50", *expect, *bus)
        assert (goto.status, goto.err) == (0, "")
        assert goto.out.splitlines()[1].startswith("received  00C#  Goto Confirm  after ")
        line(drive, "  008#DC853E5AC8000000  Goto XY  x=1500 mm, y=1000 mm, angle=90 deg, speed=50 %")
        drive.send_signal(signal.SIGINT)
        assert drive.wait(PATIENCE) == 130


def test_a_core_starts_up_with_the_others_and_ends_in_time(shared_bus: str) -> None:
    bus = ["-i", "remote", "-c", shared_bus]
    with node("drive", *bus) as drive, node("navigation", *bus) as navigation:
        line(drive, "drive (node-ID 2) on ")
        line(navigation, "navigation (node-ID 3) on ")
        with node("core", "--team", "yellow", "--duration", "100 ms", *bus) as core:
            for what in ("core (node-ID 1) on ", "drive answered after ", "navigation answered after "):
                line(core, what)
            line(core, "start configuration confirmed after ")
            assert core.wait(PATIENCE) == 0


def test_a_terminated_node_ends_as_an_interrupted_one(shared_bus: str) -> None:
    with node("navigation", "-i", "remote", "-c", shared_bus) as navigation:
        line(navigation, "Ctrl-C ends it")
        navigation.send_signal(signal.SIGTERM)
        assert navigation.wait(PATIENCE) == 130
        assert navigation.stderr is not None
        assert navigation.stderr.read() == ""


@pytest.mark.parametrize(
    ("words", "status", "complaint"),
    [
        (["drive", "--duration", "5"], 2, "'5' is not a duration; write a number and one of us, ms, s, min, such as"),
        (["drive", "--dialect", "nonsense"], 2, "unknown dialect 'nonsense'; known: canopen, firmware2014"),
        (["drive", "--team", "red"], 2, "--team is for the core, not for the drive"),
        (["core", "--beacons"], 2, "--beacons is for the navigation, not for the core"),
        (["drive", "--store", "README.md"], 2, "README.md: "),
        (["drive", "-i", "nosuch"], 3, 'cannot open the nosuch bus: Unknown interface type "nosuch"'),
        (["drive", "-i", "socketcan", "-c", "nosuch0"], 3, "cannot open the socketcan bus nosuch0: "),
    ],
)
def test_a_node_that_cannot_run_says_why_in_one_line(
    capsys: pytest.CaptureFixture[str], words: list[str], status: int, complaint: str
) -> None:
    said = run(capsys, "node", *words)
    assert (said.status, said.out) == (status, "")
    assert said.err.startswith(f"eurobot-od: {complaint}")
    assert said.err.count("\n") == 1


def test_what_a_master_has_stored_survives_a_restart(
    capsys: pytest.CaptureFixture[str], shared_bus: str, tmp_path: Path
) -> None:
    bus, store = ("-i", "remote", "-c", shared_bus), ("--store", str(tmp_path / "drive.dcf"))
    with node("drive", *store, *bus) as first:
        line(first, "Ctrl-C ends it")
        assert run(capsys, "write", "2", "Motion.Maximum speed", "650", *bus).status == 0
        assert run(capsys, "store", "2", *bus).status == 0
        first.send_signal(signal.SIGTERM)
    with node("drive", *store, *bus) as second:
        line(second, "Ctrl-C ends it")
        assert "650" in run(capsys, "read", "2", "Motion.Maximum speed", *bus).out
        second.send_signal(signal.SIGTERM)


@pytest.mark.parametrize("node_id", ["0", "128", "-1"])
def test_a_node_id_out_of_range_is_refused(capsys: pytest.CaptureFixture[str], node_id: str) -> None:
    said = run(capsys, "node", "drive", "--node-id", node_id)
    assert (said.status, said.out) == (2, "")
    assert said.err.endswith(f"drive.eds: node-ID {node_id} is not in 1..127\n")


WRONG_USAGE = [
    ([], "eurobot-od: which node? Name one of the robot's, or give a device's file with --eds"),
    (["engine"], "eurobot-od: unknown node 'engine'; known: core, drive, navigation"),
    (["drive", "--team", "blue"], "eurobot-od node: error: "),
]


@pytest.mark.parametrize(("words", "complaint"), WRONG_USAGE)
def test_wrong_usage(capsys: pytest.CaptureFixture[str], words: list[str], complaint: str) -> None:
    said = run(capsys, "node", *words)
    assert said.status == 2
    assert said.complaint.startswith(complaint)
