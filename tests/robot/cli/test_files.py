"""The robot's EDS files are what its table says, and a log of it becomes poses."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.console import run


def test_a_log_becomes_mcap(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("mcap", reason="the extra `mcap` is not installed")
    log, file = tmp_path / "some.log", tmp_path / "some.mcap"
    log.write_text("(1.000000) can0 008#D27423592C01C3A5\n(1.250000) can0 7E6#\n")
    said = run(capsys, "export", "mcap", str(log), "-o", str(file))
    assert said == (0, f"{file}: 1 message, 1 pose, 1 defect\n", "")
    assert file.read_bytes().startswith(b"\x89MCAP")


# make-eds


ROOT = Path(__file__).resolve().parents[3]
EDS = ROOT / "eds"


def test_the_repositorys_files_are_what_its_table_says(capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "make-eds", str(EDS / "protocol.yaml"), "-o", str(EDS), "--check")
    assert said == (0, f"{EDS}: as the table says: 7 files\n", "")


def test_the_repositorys_tool_runs_the_command() -> None:
    command = [sys.executable, str(ROOT / "tools" / "make_eds.py"), "--check"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{EDS}: as the table says: 7 files\n", "")
