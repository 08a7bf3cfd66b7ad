"""The scripts of the shells with the robot's commands, nodes, faults and dialects."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.robot.plugin import ROBOT

SHELLS = ("bash", "zsh", "fish", "tcsh")
COMMANDS = [*cli.COMMANDS, *ROBOT.commands]


@pytest.fixture(scope="module")
def scripts() -> dict[str, str]:
    """The script of each shell, as a process of its own prints it."""
    words = ["-m", "eurobot_od", "completion"]
    return {shell: subprocess.check_output([sys.executable, *words, shell], text=True) for shell in SHELLS}


def test_each_shell_has_a_script_with_every_command(scripts: dict[str, str]) -> None:
    missing = {shell: [each for each in COMMANDS if each not in text] for shell, text in scripts.items()}
    assert not any(missing.values()), missing


COMPLETED = [
    (["ma"], ["make-eds", "match"]),
    (["match", "--fault", "mushroom-l"], ["mushroom-late"]),
    (["check", "--fault", "time-b"], ["time-byte-order"]),
    (["node", "nav"], ["navigation"]),
    (["read", "dri"], ["drive"]),
    (["write", "drive", "Motion.Bra"], ["Motion.Braking"]),
    (["match", "--dialect", "firm"], ["firmware2014"]),
    (["query", "season", "--report", "lat"], ["latency"]),
]


def test_bash_completes(tmp_path: Path, scripts: dict[str, str]) -> None:
    lines = (
        f"COMP_WORDS=(eurobot-od {' '.join(words)}); COMP_CWORD={len(words)}; _shtab_eurobot_od; echo ${{COMPREPLY[@]}}"
        for words, _ in COMPLETED
    )
    said = printed(tmp_path, "bash", scripts["bash"], lines)
    assert [(words, sorted(line.split())) for (words, _), line in zip(COMPLETED, said)] == COMPLETED


def printed(folder: Path, shell: str, script: str, lines: Iterable[str]) -> list[str]:
    """The lines that a shell prints in a folder with one file, after it has read the script."""
    if shutil.which(shell) is None:
        pytest.skip(f"there is no {shell} here")
    (folder / "sdo-mine.yaml").touch()
    (folder / "all.sh").write_text("\n".join([script, *lines]))
    done = subprocess.run([shell, "all.sh"], cwd=folder, capture_output=True, text=True, check=True, timeout=60)
    return done.stdout.splitlines()
