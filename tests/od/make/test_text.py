"""The EDS files that a table makes go through other people's programs without a word."""

from __future__ import annotations

import logging
import subprocess
import sys
from pathlib import Path

import canopen
import pytest

from tests.kit import lift

every_file = pytest.mark.parametrize("name", [each for each in lift.texts() if each.endswith(".eds")])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return lift.write(tmp_path).parent


@every_file
def test_dcfchk_accepts(folder: Path, name: str) -> None:
    dcfchk = [sys.executable, "-W", "default", "-m", "dcf.cli", "--node_id", "2", str(folder / name)]
    done = subprocess.run(dcfchk, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@every_file
def test_canopen_reads_without_a_word(folder: Path, name: str, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG):
        canopen.import_od(str(folder / name), node_id=2)
    assert caplog.messages == []
