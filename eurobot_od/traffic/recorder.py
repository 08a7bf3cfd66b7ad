"""Records frames in a log file, in a format of python-can that the suffix selects.

Rule of this file: a second after a frame was written it is on the disk, whatever happens next; if not, that is reported
at once. Line formats go to the disk as they are. The others (BLF, SQLite, MF4) cannot be read before they are closed:
their frames go to a journal beside the log, `match.blf.log` in candump's format, from which the log is made at the end.
If that end does not come, or the disk has no room for both, the journal stays.
"""

from __future__ import annotations

import os
import threading
from _thread import interrupt_main
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

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

GO_ON, END = "go-on", "end"
"""Reactions to a log that can no longer be written: continue without it, or interrupt the program."""


@contextmanager
def recording(
    file: Path | None, on_failure: str = GO_ON, tell: Callable[[str], object] = print
) -> Iterator[Callable[[float, Frame], None]]:
    """Yield a function that writes a frame with its time in s to a new file, or nowhere if `file` is None.

    It may be called on any thread, and never fails: `tell` is called with what goes wrong at once. It is raised as
    OSError at the end of the block, unless an error ends it. Raises LocalError for a format that python-can cannot
    write, OSError for a file that cannot be written.
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


class Lines:
    """Writes frames to a `file` of lines and keeps it on disk; `failure` is the first error.

    `tell` is called with it; with `ends` the main thread is interrupted then.
    """

    def __init__(self, file: Path, writer: Any, ends: bool, tell: Callable[[str], object]) -> None:
        self._file = file
        self._writer = writer
        self._ends = ends
        self._tell = tell
        self.failure: OSError | None = None
        self._lock, self._over = threading.Lock(), threading.Event()
        self._thread = threading.Thread(target=self._keep_on_disk, name="log", daemon=True)
        self._thread.start()

    @property
    def trouble(self) -> str:
        """First error and its file, as text."""
        file = (self.failure and self.failure.filename) or self._file
        return f"{file}: {self.failure and (self.failure.strerror or self.failure)}"

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
                self._try(lambda: self._writer(message))

    def end(self, finish: Callable[[], object]) -> None:
        """Close the file, and call `finish` if everything was written."""
        self._over.set()
        self._thread.join()
        self._try(self._writer.stop)
        if self.failure is None:
            self._try(finish)

    def _keep_on_disk(self) -> None:
        while self.failure is None and not self._over.wait(PERIOD):
            with self._lock:  # Python's text files are not safe for two threads at once
                self._try(self._writer.file.flush)
            if self.failure is None and self._file.is_file():  # a pipe has no disk
                # without the lock, as a slow disk must not block the bus
                self._try(lambda: os.fsync(self._writer.file.fileno()))

    def _try(self, step: Callable[[], object]) -> None:
        try:
            step()
        except OSError as error:
            if self.failure is not None:
                return
            self.failure = error
            self._tell(f"{self.trouble}: nothing more is logged")
            if self._ends and not self._over.is_set():
                interrupt_main()
