"""Other Pythons: which one is found, and what is said about one that is not here."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
import pythons

HERE = ".".join(map(str, sys.version_info[:2]))


def program(folder: Path, name: str, text: str) -> None:
    (folder / name).write_text(f"#!/bin/sh\n{text}\n")
    (folder / name).chmod(0o755)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The only folder with programs, but for those of the system's shell."""
    monkeypatch.setenv("PATH", os.pathsep.join((str(tmp_path), os.defpath)))
    return tmp_path


def test_a_python_is_found_by_its_name(folder: Path) -> None:
    program(folder, f"python{HERE}", f'exec "{sys.executable}" "$@"')
    assert pythons.find(HERE) == str(folder / f"python{HERE}")


def test_a_python_is_found_among_those_of_pyenv_if_its_program_does_not_run(folder: Path) -> None:
    program(folder, "python9.8", "echo pyenv: python9.8: command not found >&2; exit 127")
    program(folder, "pyenv", f'[ "$1" = versions ] && echo 9.7.1 && echo 9.8.3 || echo {folder}/"$2"')
    (folder / "9.8.3" / "bin").mkdir(parents=True)
    program(folder / "9.8.3" / "bin", "python", "echo 9.8")
    assert pythons.find("9.8") == str(folder / "9.8.3" / "bin" / "python")


def test_a_python_of_another_version_is_not_taken(folder: Path) -> None:
    program(folder, "python9.8", f'exec "{sys.executable}" "$@"')
    assert pythons.find("9.8") is None


def test_a_missing_python_is_skipped_with_a_message(capsys: pytest.CaptureFixture[str]) -> None:
    assert pythons.is_fine(pythons.Row("9.8", "highest"))
    assert capsys.readouterr().out == "Python 9.8: skipped: not on this machine\n"


def test_an_unknown_row_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert pythons.main(["2.7"]) == pythons.WRONG_USAGE
    assert capsys.readouterr().err == "unknown: 2.7; known: lowest, 3.11, 3.12, 3.13, 3.14\n"
