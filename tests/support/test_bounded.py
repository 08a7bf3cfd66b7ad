"""What is read whole has a bound, in every command that reads such a file: one line says so."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import pytest

from eurobot_od.errors import DictionaryError
from eurobot_od.support import bounded
from tests.cli.console import run
from tests.rows import rows

COMMANDS = [
    "lint {}.eds",
    "show --eds 5={}.eds",
    "diff {}.eds {}.eds",
    "lint --network {}.yaml",
    "show --network {}.yaml",
    "check {}.yaml --simulate",
    "make-eds {}.yaml -o out",
    "load {}.yaml",
    "node --eds {}.eds --values {}.yaml -i virtual",
]


@rows("command", COMMANDS)
def test_a_file_that_is_too_large_is_one_line(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for suffix in ("eds", "yaml"):
        with (tmp_path / f"large.{suffix}").open("wb") as file:
            file.truncate(bounded.MOST + 1)
    monkeypatch.chdir(tmp_path)
    said = run(capsys, *command.replace("{}", "large").split())
    assert (said.status, said.out) == (2, "")
    assert said.err.count("\n") == 1
    assert "larger than 16 MB, which is the most that is read" in said.err


def test_a_file_that_just_fits_is_read(tmp_path: Path) -> None:
    file = tmp_path / "fits.eds"
    with file.open("wb") as stream:
        stream.truncate(bounded.MOST)
    assert len(bounded.read(file)) == bounded.MOST


def test_no_more_is_read_than_fits(tmp_path: Path) -> None:
    file = tmp_path / "endless.eds"
    with file.open("wb") as stream:
        stream.truncate(8 * bounded.MOST)
    tracemalloc.start()
    with pytest.raises(DictionaryError, match="larger than 16 MB"):
        bounded.read(file)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 3 * bounded.MOST
