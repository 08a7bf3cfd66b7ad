"""Log files: every frame given is in the file, in every format, whatever ends the program; an old file is replaced."""

from __future__ import annotations

import errno
import gc
import itertools
import os
import queue
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path

import can
import pytest
from can.io.logger import MESSAGE_WRITERS

from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame
from eurobot_od.traffic import formats, recorder
from eurobot_od.traffic.recorder import END, GO_ON, recording

FORMATS = sorted(set(MESSAGE_WRITERS) - {".mf4"})  # .mf4 needs a package of its own
MANY = [(number / 100, Frame(number % 0x700, bytes([number % 256] * (number % 9)))) for number in range(3000)]
"""More frames than any writer keeps before it writes."""


def record(
    file: Path | None,
    frames: Iterable[tuple[float, Frame]],
    on_failure: str = GO_ON,
    tell: Callable[[str], object] = print,
) -> None:
    with recording(file, on_failure, tell) as write:
        for time, frame in frames:
            write(time, frame)


def given_up() -> Iterator[tuple[float, Frame]]:
    """Yield a frame, and then up."""
    yield MANY[1]
    raise LocalError("the match was given up")


def recorded(file: Path) -> list[Frame]:
    """Read a log with python-can, which reads all it writes but text."""
    with can.LogReader(file) as reader:
        return [Frame(message.arbitration_id, bytes(message.data)) for message in reader]


@pytest.mark.parametrize("suffix", FORMATS)
def test_every_frame_is_in_the_file(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"match{suffix}"
    record(file, MANY)
    if suffix == ".txt":
        assert len(file.read_text().splitlines()) == len(MANY)
    else:
        assert recorded(file) == [frame for _, frame in MANY]


@pytest.mark.parametrize("suffix", sorted(set(FORMATS) - {".txt"}))
def test_an_old_file_is_replaced(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"match{suffix}"
    for frames in (MANY[:20], MANY[5:8]):
        record(file, frames)
    assert recorded(file) == [frame for _, frame in MANY[5:8]]


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_missing_folder_is_an_error(tmp_path: Path, suffix: str) -> None:
    with pytest.raises(FileNotFoundError):
        record(tmp_path / "missing" / f"match{suffix}", [])


@pytest.mark.parametrize("name", ["match.md", "match", "match.mf4.md", "match.gz"])
def test_an_unknown_format_is_an_error_and_touches_nothing(tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    file.write_text("precious")
    with pytest.raises(LocalError, match=f"{name}: "):
        record(file, [])
    assert file.read_text() == "precious"


def test_times_are_those_given(tmp_path: Path) -> None:
    file = tmp_path / "match.log"
    record(file, [(0.000256, Frame(0x701, b"\0")), (93.25, Frame(0x004))])
    assert [line.split()[0] for line in file.read_text().splitlines()] == ["(0.000256)", "(93.250000)"]


def test_without_a_file_nothing_is_written() -> None:
    record(None, MANY[:1])


def test_an_error_while_recording_comes_out_and_the_file_is_closed(tmp_path: Path) -> None:
    file = tmp_path / "match.log"

    with pytest.raises(LocalError, match="given up"):
        record(file, given_up())
    assert recorded(file) == [MANY[1][1]]


# Programs that die


LINES = ("log", "asc", "csv", "trc", "log.gz")
JOURNALS = ("blf", "db")
"""Formats that are read as they are at any time, and those that have a journal until they are ended."""

RECORD = """
import itertools, sys, time
from contextlib import ExitStack
from pathlib import Path
from eurobot_od.traffic.recorder import recording
from eurobot_od.frame import Frame
with ExitStack() as stack:
    writers = [stack.enter_context(recording(Path(each))) for each in sys.argv[1:]]
    for number in itertools.count():
        for write in writers:
            write(number / 100, Frame(number % 0x700, bytes([number % 256])))
        time.sleep(0.01)
"""
"""A program that records for ever in each of the files it is given."""


def frames_on_disk(file: Path) -> list[Frame]:
    """Return the frames in a log that may have been cut off."""
    with file.open("rb") as opened:
        return [raw for *_, raw in formats.read(opened) if isinstance(raw, Frame)]


@pytest.mark.long
@pytest.mark.posix
@pytest.mark.parametrize("end", ["SIGKILL", "SIGTERM"])
def test_a_log_can_be_read_after_any_death(tmp_path: Path, end: str) -> None:
    logs = [tmp_path / f"match.{suffix}" for suffix in (*LINES, *JOURNALS)]
    readable = [*logs[: len(LINES)], *(each.with_name(f"{each.name}.log") for each in logs[len(LINES) :])]
    with subprocess.Popen([sys.executable, "-c", RECORD, *logs]) as running:
        while not all(each.exists() and frames_on_disk(each) for each in readable):
            assert running.poll() is None
        running.send_signal(signal.Signals[end])
    for each in readable:
        found = frames_on_disk(each)
        assert found == [Frame(n % 0x700, bytes([n % 256])) for n in range(len(found))], each


def test_a_log_is_brought_to_the_disk_while_it_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    on_disk, fsync = threading.Event(), os.fsync

    def synced(descriptor: int) -> None:
        fsync(descriptor)
        on_disk.set()

    monkeypatch.setattr(os, "fsync", synced)
    monkeypatch.setattr(recorder, "PERIOD", 0.001)
    with recording(tmp_path / "match.log") as write:
        write(*MANY[1])
        assert on_disk.wait(10)


@pytest.mark.parametrize("suffix", JOURNALS)
def test_a_journal_is_gone_when_its_log_is_made(tmp_path: Path, suffix: str) -> None:
    record(tmp_path / f"match.{suffix}", MANY[:5])
    assert [each.name for each in tmp_path.iterdir()] == [f"match.{suffix}"]


# Full disks

FULL = Path("/dev/full")
needs_full_disk = pytest.mark.skipif(not FULL.exists(), reason="a device that is always full, as Linux has one")


@needs_full_disk
@pytest.mark.parametrize(("name", "written"), [("match.log", "match.log"), ("match.blf", "match.blf.log")])
def test_a_full_disk_is_told_at_once_and_an_error_at_the_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str, written: str
) -> None:
    (tmp_path / written).symlink_to(FULL)
    with pytest.raises(OSError, match=f"{written}: No space left on device: the log is not whole"):
        record(tmp_path / name, MANY)
    told = f"{tmp_path / written}: No space left on device: nothing more is logged\n"
    assert capsys.readouterr() == (told, "")


@needs_full_disk
def test_a_full_disk_interrupts_what_is_recorded_if_that_was_asked_for(tmp_path: Path) -> None:
    (tmp_path / "match.log").symlink_to(FULL)
    for_ever = ((number, Frame(0x004)) for number in itertools.count())
    with pytest.raises(OSError, match="No space left on device"):
        record(tmp_path / "match.log", for_ever, END)


class Filling(recorder.Disk):
    """A disk that is full for a while; what is written then is there in part."""

    is_full = False
    written = threading.Event()

    def flush(self) -> None:
        self._file.flush()
        if self.is_full:
            raise OSError(errno.ENOSPC, "No space left on device")
        super().flush()
        self.written.set()

    def come_back(self) -> bool:
        return not self.is_full and super().come_back()


@pytest.mark.parametrize("suffix", ["log", "asc", "csv", "trc", "blf"])
def test_a_log_goes_on_when_its_disk_has_room_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    monkeypatch.setattr(recorder, "PERIOD", 0.001)
    monkeypatch.setattr(recorder, "Disk", Filling)
    file, told = tmp_path / f"match.{suffix}", queue.SimpleQueue[str]()

    def recorded_in_parts() -> Iterator[tuple[float, Frame]]:
        yield from MANY[:10]
        Filling.written.clear()
        assert Filling.written.wait(10)
        monkeypatch.setattr(Filling, "is_full", True)
        yield from MANY[10:15]
        assert told.get(timeout=10).endswith(": No space left on device: nothing is logged until there is room")
        yield from MANY[15:20]
        monkeypatch.setattr(Filling, "is_full", False)
        assert told.get(timeout=10).endswith(": there is room again; 10 frames within 0.1 s are missing")
        yield from MANY[20:23]

    with pytest.raises(OSError, match="10 frames are missing, as the disk was full: the log is not whole"):
        record(file, recorded_in_parts(), tell=told.put)
    assert frames_on_disk(file) == [frame for _, frame in (*MANY[:10], *MANY[20:23])]
    if suffix in ("asc", "trc"):
        assert "10 frames within 0.1 s are missing here: the disk was full\n" in file.read_text()


LEFT_OPEN = "ignore::pytest.PytestUnraisableExceptionWarning"
"""python-can's writer of BLF does not close a file that it could not end."""


@needs_full_disk
@pytest.mark.filterwarnings(LEFT_OPEN)
def test_a_log_that_cannot_be_begun_on_a_full_disk_is_named(tmp_path: Path) -> None:
    (tmp_path / "match.blf").symlink_to(FULL)
    with pytest.raises(OSError, match="No space left on device") as failed:
        record(tmp_path / "match.blf", MANY)
    assert failed.value.filename == str(tmp_path / "match.blf")
    del failed
    gc.collect()


@needs_full_disk
@pytest.mark.filterwarnings(LEFT_OPEN)
def test_a_log_that_cannot_be_ended_on_a_full_disk_is_named_and_its_journal_stays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "match.blf"

    def then_it_is_full() -> Iterator[tuple[float, Frame]]:
        yield 0.0, Frame(0x004)
        log.unlink()
        log.symlink_to(FULL)

    with pytest.raises(OSError, match=r"match\.blf: No space left on device: the log is not whole"):
        record(log, then_it_is_full())
    assert capsys.readouterr().out == f"{log}: No space left on device: nothing more is logged\n"
    assert len(frames_on_disk(tmp_path / "match.blf.log")) == 1
    gc.collect()


@needs_full_disk
def test_another_error_is_not_hidden_by_that_of_the_log(tmp_path: Path) -> None:
    (tmp_path / "match.log").symlink_to(FULL)
    with pytest.raises(LocalError, match="given up"):
        record(tmp_path / "match.log", given_up())


def test_a_full_disk_under_a_database_is_one_line_and_its_journal_stays(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    program = RECORD.replace("itertools.count()", "range(100)").replace("time.sleep(0.01)", "pass")
    little = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (6000, 6000))
    done = subprocess.run(
        [sys.executable, "-B", "-c", program, tmp_path / "match.db"], capture_output=True, text=True, preexec_fn=little
    )
    first, *_ = done.stdout.splitlines()
    *_, last = done.stderr.splitlines()
    assert first.startswith(f"{tmp_path / 'match.db'}: disk")
    assert last.endswith(": the log is not whole")
    assert len(frames_on_disk(tmp_path / "match.db.log")) == 100
