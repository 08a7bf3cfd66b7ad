"""The command `make-eds`: the repository's own files, a team's table, and what cannot be read or written."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.console import run
from tests.od.make.tables import TABLE

ROOT = Path(__file__).resolve().parents[2]
EDS = ROOT / "eds"


@pytest.fixture
def table(tmp_path: Path) -> Path:
    file = tmp_path / "table.yaml"
    file.write_text(TABLE)
    return file


def test_the_repositorys_files_are_what_its_table_says(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "make-eds", str(EDS / "protocol.yaml"), "-o", str(EDS), "--check")
    assert said == (0, f"{EDS}: as the table says: 7 files\n", "")


def test_the_repositorys_tool_runs_the_command() -> None:
    command = [sys.executable, str(ROOT / "tools" / "make_eds.py"), "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{EDS}: as the table says: 7 files\n", "")


def test_makes_the_files_of_a_teams_own_table(table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("make-eds", str(table), "-o", str(tmp_path / "new" / "eds"))
    assert run(capsys, *words) == (0, "", "")
    assert run(capsys, *words, "--check").status == 0
    files = [str(each) for each in (tmp_path / "new" / "eds" / "plain").iterdir()]
    assert run(capsys, "lint", "--strict", *files).status == 0
    assert run(capsys, "lint", "--network", str(tmp_path / "new" / "eds" / "network.yaml")).status == 0


def test_check_tells_what_differs_and_writes_nothing(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "make-eds", str(table), "-o", str(tmp_path / "eds"), "--check")
    assert (said.status, said.err) == (1, "")
    assert said.out.splitlines()[0] == f"{tmp_path / 'eds' / 'network.yaml'}: is missing"
    assert not (tmp_path / "eds").exists()


def test_every_problem_of_a_table_is_a_line_and_nothing_is_written(
    table: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table.write_text(
        TABLE.replace("object: Target", "object: Goal").replace("receivers: [drive]", "receivers: [wheel]")
    )
    said = run(capsys, "make-eds", str(table), "-o", str(tmp_path / "eds"))
    assert (said.status, said.out) == (2, "")
    assert [line.partition(": ")[2] for line in said.err.splitlines()] == [
        "unknown node 'wheel'",
        "unknown object 'Goal'",
    ]
    lines = [n for n, line in enumerate(table.read_text().split("\n"), start=1) if "wheel" in line or "Goal" in line]
    assert [int(line.split(":")[1]) for line in said.err.splitlines()] == 2 * lines
    assert not (tmp_path / "eds").exists()


def test_a_table_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "make-eds", str(tmp_path / "none.yaml"), "-o", str(tmp_path))
    assert said == (2, "", f"eurobot-od: {tmp_path / 'none.yaml'}: No such file or directory\n")


def test_a_folder_that_cannot_be_written(table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "make-eds", str(table), "-o", str(table / "eds"))
    assert said == (3, "", f"eurobot-od: {table / 'eds'}: Not a directory\n")


def test_a_command_without_folder_is_wrong_usage(table: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "make-eds", str(table)).status == 2
