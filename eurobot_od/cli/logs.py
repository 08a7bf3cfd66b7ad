"""What the commands that read logs share: the options that name them, files, standard input."""

from __future__ import annotations

import argparse
import io
import os
import stat
import sys
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, NamedTuple

from eurobot_od.cli import options
from eurobot_od.cli.table import Parameter
from eurobot_od.errors import LocalError

if TYPE_CHECKING:
    from eurobot_od.traffic.entries import LogEntry
    from eurobot_od.traffic.meaning import DamageCounts, Decoder, Meaning

STANDARD_INPUT = "-"
CHUNK = 1 << 16
"""Bytes read from a pipe at once."""


def add_log(parser: argparse.ArgumentParser) -> None:
    """Add the logs to read and how they are read."""
    parser.add_argument("logs", nargs="*", metavar="LOG", default=["-"], help="logs; - for standard input, the default")
    add_reading(parser)


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add the format of the logs, and the bound of what is read."""
    from eurobot_od.traffic.entries import LARGEST
    from eurobot_od.traffic.formats import FORMATS

    parser.add_argument(
        "--format",
        choices=FORMATS,
        help="format of the logs (default: by their first bytes, or else by suffix)",
    )
    parser.add_argument(
        "--largest",
        type=options.whole(1024, what="a number of bytes, 1024 or more"),
        default=LARGEST,
        metavar="BYTES",
        help="longest line or record of a log that is read (default: %(default)s)",
    )


class ReadOptions(NamedTuple):
    """How logs are read: their format, None to find out, and the most bytes of a line or record."""

    form: str | None
    largest: int

    @classmethod
    def of(cls, arguments: argparse.Namespace) -> ReadOptions:
        """Take it from a command line."""
        return cls(arguments.format, arguments.largest)


READING = Parameter("reading", add_reading, ReadOptions.of)


def entries(
    logs: Iterable[str], reading: ReadOptions, is_watched: bool = True
) -> Generator[tuple[str, LogEntry], None, None]:
    """Give the entries of logs, one log after the other, with the log's name. Errors as `formats.entries`.

    With `is_watched` a terminal shows how far a long log has been read.
    """
    from eurobot_od.traffic import formats

    for log in logs:
        with opened(log, is_watched) as file:
            for entry in formats.entries(file, reading.form, reading.largest):
                yield log, entry


def meanings(
    logs: Iterable[str], reading: ReadOptions, decoder: Decoder, damage: DamageCounts, is_watched: bool = True
) -> Iterator[tuple[float, Meaning]]:
    """Give the times in s and meanings of the entries of logs; count in `damage` what is wrong. Errors as `entries`."""
    from eurobot_od.traffic.decoding import Following

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
            from eurobot_od.support import progress  # a command that needs no bar starts faster without

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
