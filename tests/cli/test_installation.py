"""The command `doctor`: what it says of packages, extras and ports, whatever this machine has."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterable
from importlib.metadata import version
from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.cli import installation
from eurobot_od.loading import ROBOTS
from eurobot_od.support import extras
from eurobot_od.support.extras import Package
from tests.cli.console import run
from tests.kit import plant


def test_info_lists_what_is_installed_and_its_faults(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "doctor")
    lines = said.out.splitlines()
    assert lines[0].startswith("eurobot-od ")
    assert f"package    python-can {version('python-can')}" in lines
    assert any(line.startswith("drivers    ") and "virtual" in line for line in lines)
    assert {line.split()[0] for line in lines if line} <= {
        *(
            "eurobot-od",
            "package",
            "extra",
            "robot",
            "interface",
            "drivers",
            "no",
            "socketcan",
            "adapter",
            "wrong",
            "nothing",
        ),
    }
    fine = lines[-1].startswith("nothing is wrong") or lines[-2].startswith("nothing is wrong")
    assert fine is not any(line.startswith("wrong") for line in lines)
    assert (said.status, said.err) == (0 if fine else 1, "")


def test_packages_are_lines() -> None:
    assert list(installation.packages([Package("canopen", "2.4.1"), Package("wings", "")])) == [
        "package    canopen 2.4.1",
        "package    wings is not installed",
    ]


def test_an_extra_has_its_versions_or_its_install_command() -> None:
    brought = {"monitor": ["python-can>=4"], "flight": ["no-such-wings>=2", "python-can>=4"]}
    assert list(installation.extra_lines(brought)) == [
        f"extra      monitor  python-can {version('python-can')}",
        f"extra      flight   not installed: {sys.executable} -m pip install 'no-such-wings>=2' 'python-can>=4'",
    ]


def test_extras_of_other_packages_are_checked_too() -> None:
    names = [each.name for each in extras.installed("python-can[mf4]>=4.4")]
    assert names[:2] == ["python-can", "asammdf"]


def test_a_port_without_permission_names_the_remedy() -> None:
    assert list(installation.denied(["/dev/ttyUSB0"])) == [
        ("/dev/ttyUSB0 cannot be opened by this user", "sudo usermod -aG dialout $USER, and log in again")
    ]


SHELLS = ("bash", "zsh", "fish", "tcsh")
COMMANDS = [*cli.COMMANDS]
LONG = re.compile(r"^ +(?:-\w(?: \S+)?, )?(--[a-z-]+)", re.MULTILINE)


@pytest.fixture(scope="module")
def scripts() -> dict[str, str]:
    """The script of each shell, as a process of its own prints it."""
    words = ["-m", "eurobot_od", "completion"]
    line = os.environ | {ROBOTS.variable: str(plant.HERE)}
    return {shell: subprocess.check_output([sys.executable, *words, shell], text=True, env=line) for shell in SHELLS}


def test_each_shell_has_a_script_with_every_command(scripts: dict[str, str]) -> None:
    missing = {shell: [each for each in COMMANDS if each not in text] for shell, text in scripts.items()}
    assert not any(missing.values()), missing


def test_the_script_has_the_options_of_every_command(
    scripts: dict[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    for command in COMMANDS:
        name = f"_shtab_eurobot_od_{command.replace('-', '_')}_option_strings"
        (options,) = re.findall(rf"^{name}=\((.*)\)", scripts["bash"], re.MULTILINE)
        assert set(re.findall(r"--[a-z-]+", options)) == set(LONG.findall(run(capsys, command, "--help").out)), command


def test_the_workbench_completes_itself_and_knows_no_robot() -> None:
    code = "import sys; from eurobot_od.__main__ import workbench; sys.exit(workbench())"
    script = subprocess.check_output([sys.executable, "-c", code, "completion", "bash"], text=True)
    assert script.endswith(" _shtab_canopen_workbench canopen-workbench\n")
    assert "_shtab_canopen_workbench_decode_option_strings" in script
    assert not re.search("eurobot|packaging", script)


COMPLETED = [
    (["ma"], ["make-eds"]),
    (["lint", "--str"], ["--strict"]),
    (["nmt", "2", "pre"], ["pre-operational"]),
    (["completion", "f"], ["fish"]),
    (["export", "wi"], ["wireshark"]),
    (["check", "--fault", "move-to-not-s"], ["move-to-not-sent"]),
    (["node", "sca"], ["scale"]),
    (["read", "li"], ["lift"]),
    (["read", "lift", "0x101"], ["0x1010", "0x1011", "0x1014", "0x1015", "0x1016", "0x1017", "0x1018"]),
    (["write", "lift", "Motion.Acc"], ["Motion.Acceleration"]),
    (["show", "--dialect", "pac"], ["packed"]),
    (["scan", "-i", "socketcan"], ["socketcan", "socketcand"]),
    (["query", "season", "--report", "ans"], ["answers"]),
    (["lint", "--explain", "W44"], ["W440", "W442", "W443", "W446", "W447", "W448"]),
    (["check", "sdo-"], ["sdo-mine.yaml"]),
    (["decode", "sdo-m"], ["sdo-mine.yaml"]),
    (["diff", "sdo-mine.yaml", "sdo-m"], ["sdo-mine.yaml"]),
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


def test_doctor_names_a_device_package_of_the_environment_that_is_not_there(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("EUROBOT_OD_PACKAGES", "nowhere/x")
    told = run(capsys, "doctor")
    assert told.status == 1
    assert "EUROBOT_OD_PACKAGES names nowhere/x: " in told.out
