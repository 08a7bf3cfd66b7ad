"""Files are read up to a bound, and written whole: by several programs at once, over links, nothing left behind."""

from __future__ import annotations

import errno
import os
import re
import stat
import subprocess
import sys
import tracemalloc
from pathlib import Path
from types import FrameType

import pytest

from eurobot_od.errors import FileError
from eurobot_od.support import files
from eurobot_od.support.files import MOST, check_writable, read_whole, write_whole
from tests.cli.console import run

SIZE = 20_000
WRITE = f"""
import sys
import tracemalloc
from pathlib import Path
from eurobot_od.support.files import write_whole
for _ in range(60):
    write_whole(Path(sys.argv[1]), sys.argv[2].encode() * {SIZE})
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    file = tmp_path / "settings [1].dcf"
    file.write_bytes(b"old")
    return file


def test_concurrent_writers_succeed_and_readers_see_whole_files(file: Path) -> None:
    write_whole(file, b"0" * SIZE)
    programs = [subprocess.Popen([sys.executable, "-c", WRITE, file, name]) for name in "12"]
    seen = set()
    while any(each.poll() is None for each in programs):
        seen.add(file.read_bytes())
    assert [each.returncode for each in programs] == [0, 0]
    assert seen <= {name * SIZE for name in (b"0", b"1", b"2")}
    assert list(file.parent.iterdir()) == [file]


@pytest.mark.posix
def test_a_symbolic_link_is_kept(file: Path) -> None:
    link = file.with_name("link.dcf")
    link.symlink_to(file.name)
    write_whole(link, b"new")
    assert link.is_symlink()
    assert file.read_bytes() == b"new"


@pytest.mark.posix
@pytest.mark.parametrize("mode", [0o600, 0o664, 0o444])
def test_the_file_mode_is_kept(file: Path, mode: int) -> None:
    file.chmod(mode)
    write_whole(file, b"new")
    assert (stat.S_IMODE(file.stat().st_mode), file.read_bytes()) == (mode, b"new")


@pytest.mark.posix
def test_a_new_file_has_the_mode_of_the_umask(tmp_path: Path) -> None:
    before = os.umask(0o027)
    try:
        write_whole(tmp_path / "new", b"")
    finally:
        os.umask(before)
    assert stat.S_IMODE((tmp_path / "new").stat().st_mode) == 0o640


def test_old_temporary_files_are_deleted_and_other_files_kept(file: Path) -> None:
    for name in ("settings [1].dcf.0123abcd.new", "settings [1].dcf.mine.new", "other.dcf.0123abcd.new"):
        file.with_name(name).write_bytes(b"half")
        os.utime(file.with_name(name), (1.0, 1.0))
    write_whole(file, b"new")
    left = sorted(each.name for each in file.parent.iterdir())
    assert left == ["other.dcf.0123abcd.new", "settings [1].dcf", "settings [1].dcf.mine.new"]


def test_a_young_temporary_file_is_kept(file: Path) -> None:
    beside = file.with_name("settings [1].dcf.0123abcd.new")
    beside.write_bytes(b"half")
    write_whole(file, b"new")
    assert beside.exists()


def test_a_failed_write_keeps_the_old_file_and_leaves_no_temporary_file(file: Path) -> None:
    with pytest.raises(TypeError):
        write_whole(file, "no bytes")  # type: ignore[arg-type]
    assert file.read_bytes() == b"old"
    assert list(file.parent.iterdir()) == [file]


class Interrupt:
    """Raises KeyboardInterrupt at one step of a module, as Python may between any two; `hit` tells that it has."""

    def __init__(self, step: int) -> None:
        self._left, self.hit = step, False

    def __call__(self, frame: FrameType, event: str, _: object) -> Interrupt | None:
        if frame.f_code.co_filename != files.__file__:
            return None
        frame.f_trace_opcodes = True
        self._left -= event == "opcode"
        if self._left == 0 and not self.hit:
            self.hit = True
            raise KeyboardInterrupt
        return self


# An interrupt between `open` and `with` leaves the open file to the collector, which says so.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_ctrl_c_at_any_line_leaves_one_complete_file(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "fsync", lambda _: None)  # hundreds of them take a disk's time
    before, step = sys.gettrace(), 0
    sys._getframe().f_trace_opcodes = True  # Python 3.12 traces opcodes only if a frame wanted that before `settrace`
    interrupt = Interrupt(0)
    while not step or interrupt.hit:
        interrupt, step = Interrupt(step + 1), step + 1
        file.write_bytes(b"old")
        sys.settrace(interrupt)
        try:
            write_whole(file, b"new")
        except KeyboardInterrupt:
            pass
        finally:
            sys.settrace(before)
        assert file.read_bytes() in (b"old", b"new")
        assert list(file.parent.iterdir()) == [file], step
    assert step > 100


def test_a_missing_folder_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        write_whole(tmp_path / "nowhere" / "drive.dcf", b"")


def test_an_unwritable_file_is_detected_before_writing(tmp_path: Path) -> None:
    check_writable(tmp_path / "new")
    check_writable(Path(os.devnull))
    for path, number in {tmp_path / "nowhere" / "new": errno.ENOENT, tmp_path: errno.EISDIR}.items():
        with pytest.raises(OSError, match=re.escape(str(path))) as raised:
            check_writable(path)
        assert raised.value.errno == number


def test_a_file_is_synced_before_it_replaces_the_old_one(file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    steps: list[str] = []
    fsync, replace = os.fsync, Path.replace

    def synced(descriptor: int) -> None:
        steps.append("folder" if stat.S_ISDIR(os.fstat(descriptor).st_mode) else "file")
        fsync(descriptor)

    def replaced(beside: Path, target: Path) -> Path:
        steps.append("replace")
        return replace(beside, target)

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(Path, "replace", replaced)
    write_whole(file, b"new")
    assert steps == ["file", "replace", "folder"]


# Reading

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


@pytest.mark.parametrize("command", COMMANDS)
def test_a_file_above_the_limit_is_refused_in_one_line(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for suffix in ("eds", "yaml"):
        with (tmp_path / f"large.{suffix}").open("wb") as file:
            file.truncate(MOST + 1)
    monkeypatch.chdir(tmp_path)
    said = run(capsys, *command.replace("{}", "large").split())
    assert (said.status, said.out) == (2, "")
    assert said.err.count("\n") == 1
    assert "larger than 16 MB, which is the most that is read" in said.err


def test_a_file_at_the_limit_is_read(tmp_path: Path) -> None:
    file = tmp_path / "fits.eds"
    with file.open("wb") as stream:
        stream.truncate(MOST)
    assert len(read_whole(file)) == MOST


def test_reading_stops_after_the_limit(tmp_path: Path) -> None:
    file = tmp_path / "endless.eds"
    with file.open("wb") as stream:
        stream.truncate(8 * MOST)
    tracemalloc.start()
    with pytest.raises(FileError, match="larger than 16 MB"):
        read_whole(file)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 3 * MOST
