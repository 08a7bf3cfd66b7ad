"""The workbench without a robot: a copy of the package from which `robot/` was removed, and all commands of its own."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from eurobot_od import cli
from tests.without_robot import COMMANDS

pytestmark = pytest.mark.posix

ROOT = Path(__file__).parents[1]
LOG = "(0.000000) can0 605#4000100000000000\n(0.000400) can0 585#4300100092010200\n"
SUITE = "spec: 1\nname: motor\nnode: motor\nsteps:\n  - name: type\n    sdo: {read: 0x1000}\n"

FOUND = {
    # what ends with status 1, as the motor has no such thing, and what is said
    "store": "refused to write 0x1010:1",
    "restore": "refused to write 0x1011:1",
    "program": "has no 0x1F50:1 Program data",
    "drive": "refused to read 0x6041:0",
    "lss": "no device without a node-ID answers",
}
SILENT = ("configure", "make-eds", "diff", "export-dcf", "sync", "time")
"""What prints nothing when all is well."""


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, ...], tuple[int, str, str]]:
    folder = tmp_path_factory.mktemp("without_robot")
    shutil.copytree(ROOT / "eurobot_od", folder / "eurobot_od", ignore=shutil.ignore_patterns("robot", "__pycache__"))
    for file in ("docs/motor.eds", "eds/protocol.yaml", "tests/without_robot.py"):
        shutil.copy(ROOT / file, folder)
    (folder / "net.yaml").write_text("nodes: {motor: {file: motor.eds, node_id: 5}}")
    (folder / "motor.log").write_text(LOG)
    (folder / "motor.check.yaml").write_text(SUITE)
    done = subprocess.run(
        [sys.executable, "without_robot.py"],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return {tuple(words): (status, out, err) for words, status, out, err in json.loads(done.stdout)}


def test_every_command_is_tried() -> None:
    assert {words[0] for words in COMMANDS if words[-1] != "--help"} == cli.COMMANDS.keys()


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_a_command_works(words: tuple[str, ...], results: dict[tuple[str, ...], tuple[int, str, str]]) -> None:
    status, out, err = results[words]
    found = "" if words[-1] == "--help" else FOUND.get(words[0], "")
    assert status == bool(found), (out, err)
    assert found in out + err
    assert out + err or words[0] in SILENT


def test_the_help_knows_no_robot(results: dict[tuple[str, ...], tuple[int, str, str]]) -> None:
    for words, (_, out, _) in results.items():
        if words[-1] == "--help":
            assert not {"goto xy", "match", "navigation", "core,"} & set(out.lower().split()), words
