"""What completes the command line in shells is made of the parsers when it is asked for."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.robot.plugin import ROBOT
from tests.cli.console import run

SHELLS = ("bash", "zsh", "fish", "tcsh")
COMMANDS = [*cli.COMMANDS, *ROBOT.commands]
LONG = re.compile(r"^ +(?:-\w(?: \S+)?, )?(--[a-z-]+)", re.MULTILINE)


@pytest.fixture(scope="module")
def scripts() -> dict[str, str]:
    """The script of each shell, as a process of its own prints it."""
    words = ["-m", "eurobot_od", "completion"]
    return {shell: subprocess.check_output([sys.executable, *words, shell], text=True) for shell in SHELLS}


def test_each_shell_has_a_script_with_every_command(scripts: dict[str, str]) -> None:
    missing = {shell: [each for each in COMMANDS if each not in text] for shell, text in scripts.items()}
    assert not any(missing.values()), missing


def test_it_has_the_options_of_every_command(scripts: dict[str, str], capsys: pytest.CaptureFixture[str]) -> None:
    for command in COMMANDS:
        name = f"_shtab_eurobot_od_{command.replace('-', '_')}_option_strings"
        (options,) = re.findall(rf"^{name}=\((.*)\)", scripts["bash"], re.MULTILINE)
        assert set(re.findall(r"--[a-z-]+", options)) == set(LONG.findall(run(capsys, command, "--help").out)), command


def test_the_workbench_completes_itself_and_knows_no_robot() -> None:
    code = "import sys; from eurobot_od.__main__ import workbench; sys.exit(workbench())"
    script = subprocess.check_output([sys.executable, "-c", code, "completion", "bash"], text=True)
    assert script.endswith(" _shtab_canopen_workbench canopen-workbench\n")
    assert "_shtab_canopen_workbench_decode_option_strings" in script
    assert not re.search("eurobot|navigation|_match_", script)


COMPLETED = [
    (["ma"], ["make-eds", "match"]),
    (["lint", "--str"], ["--strict"]),
    (["nmt", "2", "pre"], ["pre-operational"]),
    (["completion", "f"], ["fish"]),
    (["export", "wi"], ["wireshark"]),
    (["match", "--fault", "mushroom-l"], ["mushroom-late"]),
    (["check", "--fault", "angle-36"], ["angle-360-taken"]),
    (["node", "nav"], ["navigation"]),
    (["read", "dri"], ["drive"]),
    (["read", "drive", "0x101"], ["0x1010", "0x1011", "0x1014", "0x1015", "0x1016", "0x1017", "0x1018"]),
    (["write", "drive", "Motion.Bra"], ["Motion.Braking"]),
    (["match", "--dialect", "firm"], ["firmware2014"]),
    (["scan", "-i", "socketcan"], ["socketcan", "socketcand"]),
    (["query", "season", "--report", "lat"], ["latency"]),
    (["lint", "--explain", "W44"], ["W440", "W442", "W443", "W446", "W447", "W448"]),
    (["check", "sdo-"], ["sdo-commands", "sdo-mine.yaml"]),
    (["decode", "sdo-m"], ["sdo-mine.yaml"]),
]


def test_bash_completes(tmp_path: Path, scripts: dict[str, str]) -> None:
    lines = (
        f"COMP_WORDS=(eurobot-od {' '.join(words)}); COMP_CWORD={len(words)}; _shtab_eurobot_od; echo ${{COMPREPLY[@]}}"
        for words, _ in COMPLETED
    )
    said = printed(tmp_path, "bash", scripts["bash"], lines)
    assert [(words, sorted(line.split())) for (words, _), line in zip(COMPLETED, said)] == COMPLETED


def test_fish_completes(tmp_path: Path, scripts: dict[str, str]) -> None:
    lines = (f"echo (complete -C 'eurobot-od {' '.join(words)}' | string join '|')" for words, _ in COMPLETED)
    said = printed(tmp_path, "fish", scripts["fish"], lines)
    found = [sorted(each.split("\t")[0] for each in line.split("|") if each) for line in said]
    assert [(words, each) for (words, _), each in zip(COMPLETED, found)] == COMPLETED


def printed(folder: Path, shell: str, script: str, lines: Iterable[str]) -> list[str]:
    """The lines that a shell prints in a folder with one file, after it has read the script."""
    if shutil.which(shell) is None:
        pytest.skip(f"there is no {shell} here")
    (folder / "sdo-mine.yaml").touch()
    (folder / "all.sh").write_text("\n".join([script, *lines]))
    done = subprocess.run([shell, "all.sh"], cwd=folder, capture_output=True, text=True, check=True, timeout=60)
    return done.stdout.splitlines()
