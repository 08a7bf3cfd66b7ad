"""The EDS files of the repository go through other people's programs without a word."""

from __future__ import annotations

import logging
import subprocess
import sys
from pathlib import Path

import canopen
import pytest

FILES = sorted((Path(__file__).resolve().parents[3] / "eds").glob("*/*.eds"))


@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}/{file.stem}")
def test_dcfchk_accepts(file: Path) -> None:
    dcfchk = [sys.executable, "-W", "default", "-m", "dcf.cli", "--node_id", "2", str(file)]
    done = subprocess.run(dcfchk, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}/{file.stem}")
def test_canopen_reads_without_a_word(file: Path, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG):
        canopen.import_od(str(file), node_id=2)
    assert caplog.messages == []
