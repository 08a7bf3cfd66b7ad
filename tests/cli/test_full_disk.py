"""Commands that write where nothing can be written: one line, status 3, and what was there before is as it was."""

from __future__ import annotations

import re
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from tests.kit import plant
from tests.kit.plant import messages as m

resource = pytest.importorskip("resource", reason="limits of a process are POSIX's")

PLACE = m.PlaceResponse(1000, 500, 90, m.Source.ENCODER)
ROOT = Path(__file__).parents[2]
EDS = plant.FILES.folder() / "panel.eds"
FRAME = plant.protocol().encode(PLACE)
LOG = "".join(f"({n}.5) can0 {FRAME}\n" for n in range(100))

WRITING = (
    f"lint --fix {EDS} -o FILE",
    "check --conformance --eds EDS -o FILE",
    "export mcap LOG -o FILE",
    "export c -o FILE",
    "export dbc -o FILE",
    "export wireshark -o FILE",
    "export xdd EDS -o FILE",
)
FORMER = "; what was there\n"


def run(words: str, file: Path, folder: Path, bytes_left: int, content: str) -> subprocess.CompletedProcess[str]:
    """Run a command that writes a file, in a process that may write so many bytes to each file."""
    log = folder / "in.log"
    log.write_text(content)
    (folder / "bad.eds").write_text(EDS.read_text().replace("ObjectType=0x7", "ObjectType=", 1))
    named = words.replace(str(EDS), str(folder / "bad.eds")).replace("EDS", str(EDS))
    command = named.replace("LOG", str(log)).replace("FILE", str(file)).split()
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


READ_ONLY = pytest.mark.skipif(not Path("/proc/self").exists(), reason="a folder in which not even root can write")


def name_of(words: str) -> str:
    """Return the name of the file that a command writes."""
    if "field" in words:
        return "out.svg"
    return "out.log" if "--log" in words else "out"


def check_full_disk(words: str, folder: Path, content: str = LOG) -> None:
    """Check that a command which cannot write all of its file leaves the former one."""
    file = folder / name_of(words)
    file.write_text(FORMER)
    assert f"{file}: File too large" in complaint(run(words, file, folder, 100, content))
    if "--log" not in words:  # a log is written as it comes
        assert file.read_text() == FORMER
    assert not list(folder.glob("*.new"))


def check_read_only(words: str, folder: Path, content: str = LOG) -> None:
    """Check that a command which cannot make its file names it."""
    file = Path("/proc/self") / name_of(words)
    assert str(file) in complaint(run(words, file, folder, 1 << 30, content))


@pytest.mark.long
@pytest.mark.parametrize("words", WRITING)
def test_a_full_disk_is_one_line_and_status_3(words: str, tmp_path: Path) -> None:
    check_full_disk(words, tmp_path)


@pytest.mark.long
@READ_ONLY
@pytest.mark.parametrize("words", WRITING)
def test_a_read_only_folder_is_one_line_and_status_3(words: str, tmp_path: Path) -> None:
    check_read_only(words, tmp_path)


OPENS_TO_WRITE = re.compile(
    r"""\.open\(["'][wxa]|(?<!output)(?<!files)\.write_(text|bytes)\(|\bopen\([^)]*, ["'][wxa]"""
)


@pytest.mark.parametrize("folder", ["cli", "export", "web"])
def test_each_command_writes_whole_files_or_none(folder: str) -> None:
    files = (ROOT / "eurobot_od" / folder).rglob("*.py")
    lines = [f"{file.name}: {line}" for file in files for line in file.read_text().splitlines()]
    assert [line for line in lines if OPENS_TO_WRITE.search(line) and "os.devnull" not in line] == []
