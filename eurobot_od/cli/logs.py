"""Logs that commands read: how they are named, files and standard input."""

from __future__ import annotations

import io
import os
import stat
import sys
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, BinaryIO, TypeAlias

from eurobot_od.cli.options import whole
from eurobot_od.cli.signature import Option
from eurobot_od.errors import LocalError
from eurobot_od.support import progress
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import LARGEST, LogEntry
from eurobot_od.traffic.formats import FORMATS

if TYPE_CHECKING:
    from eurobot_od.traffic.meaning import DamageCounts, Decoder, Meaning

STANDARD_INPUT = "-"
CHUNK = 1 << 16
"""Bytes read from a pipe at once."""

Log: TypeAlias = Annotated[str, Option(metavar="LOG", is_file=True)]
Logs: TypeAlias = Annotated[Sequence[Log], "logs; - for standard input, the default"]
Format: TypeAlias = Annotated[str, Option(choices=FORMATS.keys())]


@dataclass(frozen=True, kw_only=True)
class Reading:
    """How logs are read: their format, None to find out, and the most bytes of a line or record.

    format: format of the logs (default: by their first bytes, or else by suffix)
    largest: longest line or record of a log that is read (default: 1048576)
    """

    format: Format | None = None
    largest: Annotated[int, Option(metavar="BYTES", read=whole(1024, what="a number of bytes, 1024 or more"))] = LARGEST


def entries(
    logs: Iterable[str], reading: Reading, is_watched: bool = True
) -> Generator[tuple[str, LogEntry], None, None]:
    """Give the entries of logs, one log after the other, with the log's name. Errors as `formats.entries`.

    With `is_watched` a terminal shows how far a long log has been read.
    """
    for log in logs:
        with opened(log, is_watched) as file:
            for entry in formats.entries(file, reading.format, reading.largest):
                yield log, entry


def meanings(
    logs: Iterable[str], reading: Reading, decoder: Decoder, damage: DamageCounts, is_watched: bool = True
) -> Iterator[tuple[float, Meaning]]:
    """Give the times in s and meanings of the entries of logs; count in `damage` what is wrong. Errors as `entries`."""
    from eurobot_od.traffic.decoding import Following  # frames are sent and written without

    before, following = "", Following(decoder)
    for log, (line, time, channel, raw) in entries(logs, reading, is_watched):
        if log != before:  # a transfer ends with its log
            before, following = log, Following(decoder)
        meaning = following(time, channel, raw)
        damage.add(log, line, meaning.defects)
        yield time, meaning


@contextmanager
def opened(log: str, is_watched: bool = True) -> Iterator[io.BufferedReader]:
    """Open a log; with `is_watched` a terminal shows how far a long one has been read."""
    with ExitStack() as stack:
        if log == STANDARD_INPUT:
            if sys.stdin is None:
                raise LocalError("standard input is closed")
            file: BinaryIO = sys.stdin.buffer
        else:
            file = stack.enter_context(Path(log).open("rb", buffering=0))  # `Watched` is buffered below
        status = os.fstat(file.fileno())
        if not stat.S_ISREG(status.st_mode):
            # A pipe may be a live bus: what has been decoded is shown before the next lines are waited for.
            yield io.BufferedReader(Watched(file, lambda _: sys.stdout.flush()), CHUNK)
        elif is_watched and sys.stderr.isatty():
            draw = stack.enter_context(progress.bar(log, after=progress.SHORT))
            yield io.BufferedReader(Watched(file, lambda done: draw(done, status.st_size)))
        else:
            yield io.BufferedReader(Watched(file, lambda _: None))  # the same class, so that no format has a second way


class Watched(io.RawIOBase):
    """A file or a pipe that calls `on_read` before each read with the bytes read so far."""

    def __init__(self, file: BinaryIO, on_read: Callable[[int], object]) -> None:
        self.name, self._descriptor, self._on_read, self._read = file.name, file.fileno(), on_read, 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        self._on_read(self._read)
        # Gives what a pipe has now; a buffered file would wait until the whole buffer is full.
        data = os.read(self._descriptor, len(buffer))
        buffer[: len(data)] = data
        self._read += len(data)
        return len(data)
