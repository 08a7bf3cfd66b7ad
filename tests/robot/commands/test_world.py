"""`world`, and the nodes in it: four processes, one truth."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

import pytest

from eurobot_od.robot import dialects
from eurobot_od.robot.commands.node import enter
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.options import WorldAddress
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import Source, TeamColour
from eurobot_od.robot.nodes import Navigation
from eurobot_od.robot.world.server import RemoteVehicle
from eurobot_od.robot.world.world import SimulatedBeacons
from eurobot_od.support.connections import Address
from tests.cli.console import run
from tests.cli.processes import PATIENCE, command, killed_if_it_hangs, line, node, serve_bus

FACTS = robot_file.read()

START = FACTS.start(TeamColour.RED)
PLACE = Point(350, 1800)

SHORT_WAY = f"""
async def play(core):
    await core.goto({PLACE.x}, {PLACE.y}, 0, speed=20)
"""

RAISES = """
async def play(core):
    raise ValueError(f"{core.time_left > 0}")
"""


class Scene(NamedTuple):
    """A world, and a drive and a navigation in it, in processes of their own; and the options of a third node."""

    world: subprocess.Popen[str]
    address: WorldAddress
    options: list[str]


@pytest.fixture(scope="module")
def served() -> Iterator[Scene]:
    with ExitStack() as stack:
        bus = stack.enter_context(serve_bus("test-world"))
        errors = ["--world", "sensor_false=0", "--world", "beacon_outliers=0", "--world", "beacon_swaps=0"]
        alone = ["--listen", "127.0.0.1:0", "--enemies", "0", "--confederates", "0", *errors]
        world = stack.enter_context(command("world", *alone))
        where = re.search("world on (.+):([0-9]+);", line(world, "Ctrl-C ends it"))
        assert where is not None
        options = ["--world", f"{where[1]}:{where[2]}", "-i", "remote", "-c", bus]
        for name in ("drive", "navigation"):
            line(stack.enter_context(node(name, *options)), "Ctrl-C ends it")
        yield Scene(world, WorldAddress(Address(where[1], int(where[2]))), options)


def lead(served: Scene, folder: Path, strategy: str, duration: str) -> subprocess.CompletedProcess[str]:
    """Play a match by a strategy with a core, to its end."""
    file = folder / "mine.py"
    file.write_text(strategy, encoding="utf-8")
    with node("core", "--strategy", str(file), "--for", duration, *served.options) as core:
        out, err = core.communicate(timeout=PATIENCE)
        return subprocess.CompletedProcess(core.args, core.returncode, out, err)


@pytest.mark.long
def test_four_processes_play_a_match_to_its_end(served: Scene, tmp_path: Path) -> None:
    robot = RemoteVehicle(served.address, pytest.fail)
    before = robot.truth().pose
    assert before.distance(START.point) < 15
    core = lead(served, tmp_path, SHORT_WAY, "4 s")
    assert (core.returncode, core.stderr) == (0, "")
    arrival = re.search(r"arrived    after .* position error ([0-9]+) mm", core.stdout)
    assert arrival is not None, core.stdout
    assert int(arrival[1]) < 30
    truth = robot.truth().pose
    assert truth.distance(PLACE) < 30
    assert f"the robot stands at ({truth.x:.0f}, {truth.y:.0f}); since it stopped it moved 0 mm" in core.stdout
    assert re.search(r"1 place reached, position error [0-9.]+ mm on average", core.stdout)
    assert "\npoints: ours 0\n" in core.stdout
    robot.close()


def test_the_instruments_of_a_node_err_by_the_seed_of_the_world(served: Scene) -> None:
    node = Navigation(dialects.load("navigation"))
    vehicle, options = enter(node, served.address, 1.0)
    same = SimulatedBeacons(vehicle, FACTS.field, options.errors, node.deviations, str(options.seed))
    assert node.beacons is not None
    assert [node.beacons.locate(Source.INTERNAL, now) for now in (1.0, 2.0)] == [
        same.locate(Source.INTERNAL, now) for now in (1.0, 2.0)
    ]
    vehicle.close()


@pytest.mark.long
def test_a_strategy_that_raises_ends_the_match_with_its_last_lines(served: Scene, tmp_path: Path) -> None:
    core = lead(served, tmp_path, RAISES, "1 s")
    assert core.returncode == 1
    assert "failed     the strategy raised ValueError: True" in core.stdout
    assert core.stderr.endswith("\nValueError: True\n")


BUS = """
from can_remote.server import RemoteServer
server = RemoteServer("127.0.0.1", 0, interface="virtual", channel="test-failing")
print(server.server_port, flush=True)
server.serve_forever(0.05)
"""

WAITS = """
import asyncio

async def play(core):
    print("waits", flush=True)
    await asyncio.sleep(60)
"""


@pytest.mark.long
def test_a_lost_bus_in_a_match_is_reported(served: Scene, tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(WAITS, encoding="utf-8")
    world = served.options[:2]
    with ExitStack() as stack:
        server = stack.enter_context(killed_if_it_hangs([sys.executable, "-c", BUS]))
        assert server.stdout is not None
        bus = ["-i", "remote", "-c", f"ws://127.0.0.1:{int(server.stdout.readline())}/"]
        for name in ("drive", "navigation"):
            line(stack.enter_context(node(name, *bus)), "Ctrl-C ends it")
        core = stack.enter_context(node("core", "--strategy", str(file), "--no-reconnect", *world, *bus))
        line(core, "waits")
        server.kill()
        _, err = core.communicate(timeout=PATIENCE)
        assert core.returncode == 3
        assert re.fullmatch("eurobot-od: the bus .* failed: .*", err.splitlines()[0])


# The world alone


@pytest.mark.posix
@pytest.mark.parametrize("told", [signal.SIGINT, signal.SIGTERM])
def test_a_terminated_world_prints_its_result(told: signal.Signals) -> None:
    with command("world", "--listen", "127.0.0.1:0") as world:
        line(world, "Ctrl-C ends it")
        world.send_signal(told)
        out, err = world.communicate(timeout=PATIENCE)
        assert (world.returncode, err) == (0, "")
        assert out.endswith(" 0 requests, 0 of them refused\n")


def test_as_json_it_is_a_line_for_each_event_and_the_summary(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "world", "--listen", "127.0.0.1:0", "--json", "--for", "1 ms")
    assert (said.status, said.err) == (0, "")
    first, last = map(json.loads, said.out.splitlines())
    assert (first["kind"], first["host"]) == ("start", "127.0.0.1")
    nothing = dict.fromkeys(("points", "touches", "at_fault", "requests", "refused"), 0)
    assert last["summary"] | {"seconds": 0} == {"seconds": 0, **nothing}


@pytest.mark.parametrize(
    ("listen", "printed"),
    [
        ("0.0.0.0:0", r"world on [0-9a-f]{24}@0\.0\.0\.0:[0-9]+;"),
        ("ours@0.0.0.0:0", r"world on ours@0\.0\.0\.0:[0-9]+;"),
        ("ours@127.0.0.1:0", r"world on ours@127\.0\.0\.1:[0-9]+;"),
        ("127.0.0.1:0", r"world on 127\.0\.0\.1:[0-9]+;"),
    ],
)
def test_beyond_this_machine_its_address_has_a_token(
    capsys: pytest.CaptureFixture[str], listen: str, printed: str
) -> None:
    said = run(capsys, "world", "--listen", listen, "--for", "1 ms")
    assert (said.status, said.err) == (0, "")
    assert re.search(printed, said.out)


WORLD = ["--world", "127.0.0.1:9"]


@pytest.mark.parametrize(
    ("words", "status", "complaint"),
    [
        (["world", "--listen", "2014"], 2, "2014 is not HOST:PORT, such as 127.0.0.1:2014"),
        (["world", "--listen", "127.0.0.1:65536"], 2, "127.0.0.1:65536 is not HOST:PORT"),
        (["world", "--listen", "192.0.2.1:0"], 3, "eurobot-od: cannot listen on 192.0.2.1:0: "),
        (["world", "--world", "wheel_noise"], 2, "argument --world: wheel_noise: write NAME=VALUE"),
        (["world", "--world", "wheel_noize=1"], 2, "did you mean wheel_noise?"),
        (
            ["world", "--world", "wheel_noise=-1"],
            2,
            "allowed: a number from 0 on, in mm over 1 m",
        ),
        (["node", "drive", *WORLD], 3, "eurobot-od: the world at 127.0.0.1:9 does not answer: "),
        (
            ["node", "core", "--strategy", "shipped"],
            2,
            "--strategy goes with --world only; with a real drive and navigation a program plays it: "
            "docs/real-robot.md",
        ),
        (["node", "drive", "--strategy", "shipped", *WORLD], 2, "--strategy is for the core, not for the drive"),
        (
            ["node", "core", "--strategy", "a.py", "--team", "red", *WORLD],
            2,
            "--strategy and --team do not go together",
        ),
        (["node", "core", "--strategy", "a.py", "--drill", *WORLD], 2, "--strategy and --drill do not go together"),
        (["node", "core", "--strategy", "nosuch.py", *WORLD], 2, "nosuch.py: No such file or directory"),
        (["node", "core", "--strategy", "README.md", *WORLD], 2, "README.md: a strategy is a Python file"),
    ],
)
def test_an_error_is_one_line(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    status: int,
    complaint: str,
) -> None:
    monkeypatch.setattr("eurobot_od.robot.commands.node.PATIENCE", 0.0)
    said = run(capsys, *words)
    assert said.status == status
    assert complaint in said.err
    assert said.err.count("\n") == 1
