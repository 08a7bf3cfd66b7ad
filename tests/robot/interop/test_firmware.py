"""The firmware of docs/firmware.md: compiled, checked over slcan on a pseudo-terminal, red where the page says so."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

PAGE = (Path(__file__).parents[3] / "docs" / "firmware.md").read_text(encoding="utf-8")
FILES = dict(re.findall(r'^```\w+ title="(.*?)"\n(.*?)^```$', PAGE, re.DOTALL | re.MULTILINE))
NEEDED = ("cc", "patch", "nm")

pytestmark = [
    pytest.mark.skipif(any(shutil.which(each) is None for each in NEEDED), reason="there is no C compiler here"),
    pytest.mark.skipif(sys.platform == "win32", reason="there are no pseudo-terminals"),
    pytest.mark.live,
]


def eurobot_od(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "eurobot_od", *words], cwd=folder, capture_output=True, text=True, timeout=120
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    assert eurobot_od(tmp_path, "export", "c", "--name", "robot", "-o", "robot.h").returncode == 0
    return tmp_path


@contextmanager
def running(folder: Path) -> Iterator[str]:
    """Compile the firmware and run it; yields its terminal."""
    words = ["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-Os", "drive.c", "board.c", "-o", "firmware"]
    subprocess.run(words, cwd=folder, check=True)
    with subprocess.Popen([folder / "firmware"], stdout=subprocess.PIPE, text=True) as firmware:
        assert firmware.stdout is not None
        try:
            yield firmware.stdout.readline().strip()
        finally:
            firmware.kill()


def red(folder: Path) -> tuple[list[str], str]:
    """Check the firmware; return the failed steps with their lines, and the end of the last line before the times."""
    with running(folder) as terminal:
        said = eurobot_od(folder, "check", "drive", "-i", "slcan", "-c", terminal, "--keep-going", "--level", "2014")
    return failed(said.stdout), said.stdout.splitlines()[-2].partition(" in ")[0]


def failed(text: str) -> list[str]:
    return re.findall(r"^  FAILED +[0-9.]+ s +[0-9.]+ ms +(.*)$", text, re.MULTILINE)


@pytest.mark.long
def test_the_firmware_fails_as_the_page_says_and_passes_when_mended(folder: Path) -> None:
    assert red(folder) == (failed(PAGE), "1 suite: 116 ok, 6 FAILED, 5 skipped")
    assert len(failed(PAGE)) == 6
    subprocess.run(["patch", "-i", "mended.patch", "drive.c"], cwd=folder, check=True)
    assert red(folder) == ([], "1 suite: 122 ok, 5 skipped")


@pytest.mark.long
def test_the_firmware_plays_with_core_and_navigation(folder: Path) -> None:
    subprocess.run(["patch", "-i", "mended.patch", "drive.c"], cwd=folder, check=True)
    shown = PAGE.partition("$ python play.py /dev/pts/3\n")[2].partition("```")[0]
    with running(folder) as terminal:
        words = [sys.executable, "play.py", terminal]
        said = subprocess.run(words, cwd=folder, capture_output=True, text=True, timeout=60)
    assert (said.stdout, said.returncode) == (shown, 0), said.stderr


@pytest.mark.long
def test_the_firmware_allocates_nothing_and_uses_no_floats(folder: Path) -> None:
    subprocess.run(["cc", "-std=c99", "-Os", "-c", "drive.c"], cwd=folder, check=True)
    undefined = subprocess.run(["nm", "-u", "drive.o"], cwd=folder, capture_output=True, text=True, check=True).stdout
    assert set(undefined.split()) - {"U"} <= {"can_send", "memset", "memcpy", "__stack_chk_fail"}
    assert not re.search(r"\b(float|double)\b", FILES["drive.c"] + (folder / "robot.h").read_text())
