"""Records frames in a log file, in a format of python-can that the suffix selects.

Rule of this file: a second after a frame was written it is on the disk, whatever happens next; if not, that is reported
at once. Line formats go to the disk as they are. The others (BLF, SQLite, MF4) cannot be read before they are closed:
their frames go to a journal beside the log, `match.blf.log` in candump's format, from which the log is made at the end.
If that end does not come, or the disk has no room for both, the journal stays.

When a disk that was full has room again, the log goes on with a whole line, and how many frames are missing is told.
"""

from __future__ import annotations

import errno
import os
import threading
from _thread import interrupt_main
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from eurobot_od.errors import LocalError
from eurobot_od.support import extras
from eurobot_od.support.files import naming

if TYPE_CHECKING:
    from can.io.generic import MessageWriter

    from eurobot_od.frame import Frame

PERIOD = 0.5
"""Interval of syncs of the file to disk, in s."""

TABLE = ".db"
"""Suffix of an SQLite file; python-can's own writer loses the last frames and raises in a thread."""

FULL = (errno.ENOSPC, errno.EDQUOT)
"""Errors of a disk that may have room again."""

ROOM = 1 << 16
"""Bytes that must fit before a log goes on, so that it does not end and go on again each second."""

COMMENTS = {".asc": "// ", ".trc": ";   "}
"""Beginnings of a comment, by the suffixes of the line formats that have one."""

GO_ON, END = "go-on", "end"
"""Reactions to a log that can no longer be written: continue without it, or interrupt the program."""


@contextmanager
def recording(
    file: Path | None, on_failure: str = GO_ON, tell: Callable[[str], object] = print
) -> Iterator[Callable[[float, Frame], None]]:
    """Yield a function that writes a frame with its time in s to a new file, or nowhere if `file` is None.

    It may be called on any thread, and never fails: `tell` is called with what goes wrong at once. It is raised as
    OSError at the end of the block, unless an error ends it. With GO_ON a full disk ends a log only if it stays full.
    Raises LocalError for a format that python-can cannot write, OSError for a file that cannot be written.
    """
    if file is None:
        yield lambda _time, _frame: None
        return
    lines, finish = _opened(file, on_failure == END, tell)
    try:
        yield lines.write
    except KeyboardInterrupt:
        if lines.failure is None:  # otherwise `_try` has interrupted the program
            raise
    finally:
        lines.end(finish)
    if lines.failure is not None:
        raise OSError(f"{lines.trouble}: the log is not whole") from lines.failure
    if lines.missing:
        raise OSError(f"{file}: {lines.missing} frames are missing, as the disk was full: the log is not whole")


def _opened(file: Path, ends: bool, tell: Callable[[str], object]) -> tuple[Lines, Callable[[], object]]:
    """Return the lines to write to, and the function that makes the log of them at the end."""
    from can.io.generic import TextIOMessageWriter

    if file.suffix.lower() == TABLE:
        file.write_bytes(b"")  # fails at once if it cannot be written
    else:
        log = _writer(file)
        if isinstance(log, TextIOMessageWriter):
            return Lines(file, log, ends, tell), lambda: None
        with naming(file):
            log.stop()  # only checks that it can be written
    journal = file.with_name(f"{file.name}.log")
    return Lines(journal, _writer(journal), ends, tell), partial(_finish, file, journal)


def _writer(file: Path) -> MessageWriter:
    import can

    if file.suffix.lower() == ".mf4":
        extras.caught_up("asammdf", "can.io.mf4")
    try:
        with naming(file):
            return can.Logger(file)
    except (ValueError, NotImplementedError) as error:
        raise LocalError(f"{file}: {error}; name a file of a known format, such as match.log, .asc or .blf") from error


def _finish(file: Path, journal: Path) -> None:
    """Make the log from its journal, and remove the journal."""
    import can

    from eurobot_od.traffic.formats.python_can import write_table

    with can.LogReader(journal) as messages:
        if file.suffix.lower() == TABLE:
            write_table(file, messages)
        else:
            with naming(file), _writer(file) as log:
                for message in messages:
                    log(message)
    journal.unlink()  # last, once the log is complete


@dataclass
class Gap:
    """Frames that are missing: how many, and the times of the first and the last, in s."""

    frames: int = 0
    first: float = 0.0
    last: float = 0.0

    def add(self, time: float) -> None:
        """Count a frame."""
        self.first = self.first if self.frames else time
        self.frames, self.last = self.frames + 1, time

    def __str__(self) -> str:
        return f"{self.frames} frames within {self.last - self.first:.1f} s are missing"


class Disk:
    """The disk under a text file, of which a `size` in bytes is whole; what is written can go nowhere for a while."""

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._descriptor = os.dup(file.fileno())
        self.size = 0

    def flush(self) -> None:
        """Write what the file has in its buffers."""
        self._file.flush()
        self.size = os.fstat(self._descriptor).st_size

    def sync(self) -> None:
        """Bring the file to the disk."""
        os.fsync(self._descriptor)

    def leave(self) -> None:
        """Cut the file to what is whole, and lead all else nowhere."""
        self._cut()
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), self._file.fileno(), inheritable=False)
        self._file.flush()

    def come_back(self) -> bool:
        """Lead what is written to the file again, if there is room; return whether there is."""
        has_room = False
        with suppress(OSError):
            has_room = os.write(self._descriptor, bytes(ROOM)) == ROOM
        self._cut()
        if has_room:
            self._file.flush()
            os.dup2(self._descriptor, self._file.fileno(), inheritable=False)
        return has_room

    def close(self) -> None:
        """Close what this object has opened, but not the file."""
        os.close(self._descriptor)

    def _cut(self) -> None:
        os.ftruncate(self._descriptor, self.size)
        os.lseek(self._descriptor, self.size, os.SEEK_SET)


class Lines:
    """Writes frames to a `file` of lines and keeps it on disk; `failure` is the first error that ends it.

    `tell` is called with it; with `ends` the main thread is interrupted then. `missing` is the number of frames that
    came while the disk was full.
    """

    def __init__(self, file: Path, writer: Any, ends: bool, tell: Callable[[str], object]) -> None:
        self._file = file
        self._writer = writer
        self._ends = ends
        self._tell = tell
        self.failure: OSError | None = None
        self.missing = 0
        self._disk = Disk(writer.file)
        # A pipe has no room to wait for, and what is compressed cannot go on after a cut.
        self._waits = file.is_file() and file.suffix.lower() != ".gz" and not ends
        self._full: OSError | None = None
        self._unsure = Gap()  # of the frames since the last flush, missing if the next one fails
        self._lock, self._over = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._keep_on_disk, name="log", daemon=True)
        self._thread.start()

    @property
    def trouble(self) -> str:
        """First error and its file, as text."""
        return self._words_of(self.failure)

    def _words_of(self, error: OSError | None) -> str:
        return f"{(error and error.filename) or self._file}: {error and (error.strerror or error)}"

    def write(self, time: float, frame: Frame) -> None:
        """Write a frame, unless writing has failed."""
        from can import Message

        from eurobot_od.frame import EXTENDED, HIGHEST_EXTENDED

        identifier = frame.cob_id & HIGHEST_EXTENDED
        extended = frame.cob_id >= EXTENDED
        length = len(frame.data)
        data = None if frame.is_remote else frame.data
        message = Message(time, identifier, extended, frame.is_remote, dlc=length, data=data)
        with self._lock:
            if self.failure is None and not self._over.is_set():
                self._unsure.add(time)
                self._try(lambda: self._writer(message))

    def end(self, finish: Callable[[], object]) -> None:
        """Close the file, and call `finish` if nothing is missing but what came while the disk was full."""
        self._over.set()
        self._thread.join()
        self._flush()
        self._try(self._writer.stop)
        self._disk.close()
        if self.failure is None:
            self._try(finish)

    def _keep_on_disk(self) -> None:
        while self.failure is None and not self._over.wait(PERIOD):
            self._flush()
            if self.failure is self._full is None and self._file.is_file():  # a pipe has no disk
                # without the lock, as a slow disk must not block the bus
                self._try(self._disk.sync)

    def _flush(self) -> None:
        with self._lock:  # Python's text files are not safe for two threads at once
            if self._full is not None:
                self._go_on(self._full)
            elif self.failure is None:
                self._try(self._disk.flush)
                self._unsure = self._unsure if self._full else Gap()

    def _go_on(self, full: OSError) -> None:
        """Write to the file again if the disk has room; at the end it is the failure if not."""
        if not self._disk.come_back():
            self.failure = full if self._over.is_set() else None
            return
        if comment := COMMENTS.get(self._file.suffix.lower()):
            self._writer.file.write(f"{comment}{self._unsure} here: the disk was full\n")
        self._tell(f"{self._file}: there is room again; {self._unsure}")
        self.missing += self._unsure.frames
        self._full, self._unsure = None, Gap()

    def _try(self, step: Callable[[], object]) -> None:
        try:
            step()
        except OSError as error:
            if self.failure is not None:
                return
            if self._waits and error.errno in FULL and self._disk.size and not self._over.is_set():
                self._full = error
                self._disk.leave()
                self._tell(f"{self._words_of(error)}: nothing is logged until there is room")
                return
            self.failure = error
            self._tell(f"{self.trouble}: nothing more is logged")
            if self._ends and not self._over.is_set():
                interrupt_main()
