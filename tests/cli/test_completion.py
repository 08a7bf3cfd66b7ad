"""What completes the command line in shells is there, and is what the commands take now."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from eurobot_od import cli
from eurobot_od.cli.completion import SHELLS
from eurobot_od.robot.plugin import ROBOT
from tests.cli.console import run

COMMANDS = [*cli.COMMANDS, *ROBOT.commands]
MADE_ANEW = "python3 tools/make_completion.py makes it anew"
LONG = re.compile(r"^ +(?:-\w(?: \S+)?, )?(--[a-z-]+)", re.MULTILINE)


@pytest.mark.parametrize("shell", SHELLS)
def test_each_shell_has_its_text(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "completion", shell)
    assert (said.status, said.err) == (0, "")
    assert all(command in said.out for command in COMMANDS), MADE_ANEW


def test_another_shell_is_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "completion", "cmd")
    assert (said.status, said.out) == (2, "")


@pytest.mark.parametrize("command", COMMANDS)
def test_it_is_what_the_command_takes_now(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    parser = cli.Parser(command)
    cli.find(command).add_arguments(parser)
    cli.add_robot(parser)
    text = run(capsys, "completion", "bash").out
    name = f"_shtab_eurobot_od_{command.replace('-', '_')}_option_strings"
    (options,) = re.findall(rf"^{name}=\((.*)\)", text, re.MULTILINE)
    assert set(re.findall(r"--[a-z-]+", options)) == set(LONG.findall(parser.format_help())), MADE_ANEW


COMPLETED = [
    (["ma"], ["make-eds", "match"]),
    (["lint", "--str"], ["--strict"]),
    (["nmt", "2", "pre"], ["pre-operational"]),
    (["completion", "f"], ["fish"]),
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
]


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash here")
@pytest.mark.parametrize(("words", "completions"), COMPLETED)
def test_bash_completes(words: list[str], completions: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    text = run(capsys, "completion", "bash").out
    line = f"COMP_WORDS=(eurobot-od {' '.join(words)}); COMP_CWORD={len(words)}; _shtab_eurobot_od"
    script = f"{text}\n{line}; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True, timeout=60)
    assert sorted(done.stdout.split()) == completions


@pytest.mark.skipif(shutil.which("bash") is None, reason="there is no bash here")
def test_bash_completes_suites_and_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("sdo-mine.yaml").touch()
    test_bash_completes(["check", "sdo-"], ["sdo-commands", "sdo-mine.yaml"], capsys)


@pytest.mark.skipif(shutil.which("fish") is None, reason="there is no fish here")
@pytest.mark.parametrize(("words", "completions"), COMPLETED)
def test_fish_completes(words: list[str], completions: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    script = f"{run(capsys, 'completion', 'fish').out}\ncomplete -C 'eurobot-od {' '.join(words)}'"
    done = subprocess.run(["fish", "--no-config", "-c", script], capture_output=True, text=True, check=True, timeout=60)
    assert sorted(line.split("\t")[0] for line in done.stdout.splitlines()) == completions
