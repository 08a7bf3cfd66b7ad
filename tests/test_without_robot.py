"""The workbench never enters the robot when it is given its devices, under either name; and data runs no code.

Every command runs where the robot's modules cannot be imported, for each way of giving devices; and once more in a
folder that came from somebody, whose network file names a robot beside it.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from itertools import product
from pathlib import Path
from typing import NamedTuple

import pytest

from eurobot_od import cli

pytestmark = pytest.mark.posix

ROOT = Path(__file__).parents[1]
ENVIRONMENT = {name: value for name, value in os.environ.items() if not name.startswith("EUROBOT_OD_")}
NETWORK = "nodes: {motor: {file: motor.eds, node_id: 5}}\n"
FILES = {
    "motor.log": "(0.000000) can0 605#4000100000000000\n(0.000400) can0 585#4300100092010200\n",
    "motor.check.yaml": "spec: 1\nname: motor\nnode: motor\nsteps:\n  - name: type\n    sdo: {read: 0x1000}\n",
    "net.yaml": NETWORK,
    "somebodys/robot.py": "from pathlib import Path\nPath('it ran').touch()\n",
}

WAYS = {
    # how the devices are given: what is typed, and what the folder's own network file says
    "eds": (["--eds", "5=motor.eds"], ""),
    "network": (["--network", "net.yaml"], ""),
    "folder": ([], NETWORK),
    "somebody's folder": ([], f"{NETWORK}robot: ./somebodys\n"),
}
NEEDS_A_FILE = {"show", "check", "node", "dump", "configure", "export"}
"""What asks for a device's file where there is none; all else works by number."""

FOUND = {
    # what ends with status 1, as the motor has no such thing or the robot does not load, and what is said
    "store": "cannot store parameters: it has no 0x1010",
    "restore": "refused to write 0x1011:1",
    "program": "has no 0x1F50:1 Program data",
    "drive": "is no drive of CiA 402: read 0x6041:0 is refused",
    "lss": "no device without a node-ID answers",
    "doctor": "robot eurobot2014: ",
}
SILENT = ("configure", "make-eds", "diff", "sync", "time")
"""What prints nothing when all is well."""

ABOUT_ROBOTS = {("doctor",), ("--help",), ("node", "--help"), ("faults",), ("query", "season"), ("completion", "bash")}
"""What is about the robot itself: which are there, its commands, options and words, its faults and reports."""


class Done(NamedTuple):
    """How a command ended, what it printed, and the robot's modules that it has looked for."""

    words: list[str]
    status: int
    out: str
    err: str
    entered: list[str]


def ran(folder: Path, program: str, devices: list[str], network: str) -> list[Done]:
    """Run all commands of a program in a folder with this network file, each that takes devices with these."""
    (folder / "somebodys").mkdir()
    for name, text in FILES.items():
        (folder / name).write_text(text)
    for file in ("docs/motor.eds", "eds/protocol.yaml"):
        shutil.copy(ROOT / file, folder)
    if network:
        (folder / "eurobot-od.yaml").write_text(network)
    line = [sys.executable, str(ROOT / "tests" / "without_robot.py"), program, *devices]
    done = subprocess.run(line, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    return [Done(*each) for each in json.loads(done.stdout)]


# A way for each program in every suite, all ways at night.
SOON = {(cli.PROGRAM, "somebody's folder"), (cli.WORKBENCH, "network")}
TOGETHER = [
    pytest.param(*each, marks=[] if each in SOON else [pytest.mark.long])
    for each in product((cli.PROGRAM, cli.WORKBENCH), WAYS)
]


@pytest.mark.parametrize(("program", "way"), TOGETHER)
def test_every_command_works_and_none_enters_a_robot(program: str, way: str, tmp_path: Path) -> None:
    done = ran(tmp_path, program, *WAYS[way])
    called = [each for each in done if each.words[-1] != "--help"]
    helped = [each for each in done if each.words[-1] == "--help"]
    assert {each.words[0] for each in called} == {each.words[0] for each in helped[1:]} == cli.COMMANDS.keys()

    entered = {tuple(each.words[:2]) for each in done if each.entered}
    assert entered <= (ABOUT_ROBOTS if program == cli.PROGRAM else {("doctor",)})
    assert not (tmp_path / "it ran").exists()

    for words, status, out, err, _ in called:
        found = FOUND.get(words[0], "")
        assert (status, found in out + err) == (bool(found), True), (words, out, err)
        assert out + err or words[0] in SILENT, words
        assert {line.partition(": ")[0] for line in err.splitlines() if not line.startswith(" ")} <= {program}, words
    for each in helped:
        assert (each.status, each.out.startswith(f"usage: {program}")) == (0, True), each
        assert not {"goto xy", "match", "navigation", "core,"} & set(each.out.lower().split()), each.words
    if WAYS[way][0]:
        taking = {each.words[0] for each in helped if "--eds" in each.out}
        assert taking <= {each.words[0] for each in called if {"--eds", "net.yaml"} & set(each.words)}


def test_only_commands_about_files_need_a_file(tmp_path: Path) -> None:
    for words, status, out, err, _ in ran(tmp_path, cli.WORKBENCH, [], ""):
        refused = words[0] in NEEDS_A_FILE and not {"--help", "xdd", "mcap"} & set(words)
        assert (status == 2) is refused, (words, out, err)
        assert err.count("\n") == 1 or not refused, words
