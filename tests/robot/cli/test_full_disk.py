"""The robot's commands write where nothing can be written: one line, status 3, and what was there is as it was."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.cli import test_full_disk as disk
from tests.cli.test_killed import check_killed

WRITING = ("field LOG -o FILE", "match --for 1 --log FILE", "check bytes --simulate --junit FILE")
LOG = "".join(f"({n}.5) can0 100#E8431F5A00\n" for n in range(100))
"""Kalman Position Response: the robot's way is drawn from it."""


@pytest.mark.long
@pytest.mark.parametrize("words", WRITING)
def test_a_full_disk_is_one_line_and_status_3(words: str, tmp_path: Path) -> None:
    disk.check_full_disk(words, tmp_path, LOG)


@pytest.mark.long
@disk.READ_ONLY
@pytest.mark.parametrize("words", WRITING)
def test_a_read_only_folder_is_one_line_and_status_3(words: str, tmp_path: Path) -> None:
    disk.check_read_only(words, tmp_path, LOG)


@pytest.mark.long
@pytest.mark.parametrize("words", ["new-robot mine", "match --for 1 --field out.svg"])
def test_a_kill_leaves_the_old_file_or_the_new_one(words: str, tmp_path: Path) -> None:
    check_killed(words, tmp_path)
