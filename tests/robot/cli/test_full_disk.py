"""The robot's commands write where nothing can be written: one line, status 3, and what was there is as it was."""

from __future__ import annotations

import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from eurobot_od.robot.model.messages import KalmanPositionResponse
from eurobot_od.robot.model.values import Source
from eurobot_od.robot.protocol import EurobotProtocol
from tests.rows import rows

resource = pytest.importorskip("resource", reason="limits of a process are POSIX's")

PLACE = KalmanPositionResponse(1000, 500, 90, Source.INTERNAL)
FRAME = EurobotProtocol.load().encode(PLACE)
LOG = "".join(f"({n}.5) can0 {FRAME}\n" for n in range(100))

WRITING = ("field LOG -o FILE", "match --duration 1 --log FILE", "check bytes --simulate --junit FILE")
FORMER = "; what was there\n"


def run(words: str, file: Path, folder: Path, bytes_left: int) -> subprocess.CompletedProcess[str]:
    """Run a command that writes a file, in a process that may write so many bytes to each file."""
    log = folder / "in.log"
    log.write_text(LOG)
    command = words.replace("LOG", str(log)).replace("FILE", str(file)).split()
    return subprocess.run(
        [sys.executable, "-B", "-m", "eurobot_od", *command],  # Python would leave half a compiled file, too
        capture_output=True,
        text=True,
        timeout=120,
        preexec_fn=partial(resource.setrlimit, resource.RLIMIT_FSIZE, (bytes_left, bytes_left)),
    )


def complaint(done: subprocess.CompletedProcess[str]) -> str:
    """Return the last line on standard error of a command that has failed because of the file system."""
    assert done.returncode == 3, (done.stdout, done.stderr)
    assert "Traceback" not in done.stderr
    return done.stderr.splitlines()[-1]


@pytest.mark.long
@rows("words", WRITING)
def test_a_full_disk_is_one_line_and_status_3(words: str, tmp_path: Path) -> None:
    file = tmp_path / ("out.svg" if "field" in words else "out.log" if "--log" in words else "out")
    file.write_text(FORMER)
    assert f"{file}: File too large" in complaint(run(words, file, tmp_path, 100))
    if "--log" not in words:  # a log is written as it comes
        assert file.read_text() == FORMER
    assert not list(tmp_path.glob("*.new"))


@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self").exists(), reason="a folder in which not even root can write")
@rows("words", WRITING)
def test_a_read_only_folder_is_one_line_and_status_3(words: str, tmp_path: Path) -> None:
    file = Path("/proc/self") / ("out.svg" if "field" in words else "out.log" if "--log" in words else "out")
    assert str(file) in complaint(run(words, file, tmp_path, 1 << 30))
