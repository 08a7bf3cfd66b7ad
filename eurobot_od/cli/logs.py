"""What the commands that read logs share: the options that name them, files, standard input."""

from __future__ import annotations

import argparse
import io
import os
import stat
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from eurobot_od.errors import LocalError

if TYPE_CHECKING:
    from eurobot_od.logs.entries import LogEntry
    from eurobot_od.sdo.client import Progress

STANDARD_INPUT = "-"
CHUNK = 1 << 16
"""Bytes read from a pipe at once."""


def add_log(parser: argparse.ArgumentParser) -> None:
    """Add the logs to read and how they are read."""
    parser.add_argument("logs", nargs="*", metavar="LOG", default=["-"], help="logs; left out or -: standard input")
    add_reading(parser)


def add_reading(parser: argparse.ArgumentParser) -> None:
    """Add the format of the logs, and the bound of what is read."""
    from eurobot_od.logs.entries import LARGEST
    from eurobot_od.logs.formats import FORMATS

    parser.add_argument(
        "--format",
        choices=FORMATS,
        help="format of the logs; left out: what a log begins with says it, or else its suffix",
    )
    parser.add_argument(
        "--largest",
        type=_bytes,
        default=LARGEST,
        metavar="BYTES",
        help="of a line or record of a log no more is read (default: %(default)s)",
    )


def _bytes(text: str) -> int:
    number = int(text) if text.isdecimal() and len(text) < 16 else 0
    if number < 1024:
        raise argparse.ArgumentTypeError(f"{text} is not a number of bytes from 1024 on")
    return number


def entries(
    logs: list[str], arguments: argparse.Namespace, is_watched: bool = True
) -> Generator[tuple[str, LogEntry], None, None]:
    """Give the entries of logs, one log after the other, with the log's name. Errors as `logs.formats.read`.

    A terminal sees how far a log is that takes its time, unless it is not to be watched.
    """
    from eurobot_od.logs import formats

    for log in logs:
        with opened(log, is_watched) as file:
            for entry in formats.read(file, arguments.format, arguments.largest):
                yield log, entry


@contextmanager
def opened(log: str, is_watched: bool = True) -> Iterator[io.BufferedReader]:
    """Open a log; a terminal sees how far it is read if it takes its time, unless it is not to be watched.

    What was decoded of lines from a pipe is shown before the next ones are waited for.
    """
    with ExitStack() as stack:
        if log == STANDARD_INPUT:
            if sys.stdin is None:
                raise LocalError("standard input is closed")
            file: BinaryIO = sys.stdin.buffer
        else:
            file = stack.enter_context(Path(log).open("rb", buffering=0))
        said = os.fstat(file.fileno())
        if not stat.S_ISREG(said.st_mode):
            yield io.BufferedReader(Source(file, lambda _: sys.stdout.flush()), CHUNK)
        elif is_watched and sys.stderr.isatty():
            draw = stack.enter_context(_bar(log))
            yield io.BufferedReader(Source(file, lambda done: draw(done, said.st_size)))
        else:
            yield io.BufferedReader(Source(file, lambda _: None))


def _bar(log: str) -> AbstractContextManager[Progress]:
    from eurobot_od.cli import progress  # where it is not needed, a command starts without

    return progress.bar(log, after=progress.SHORT)


class Source(io.RawIOBase):
    """What a file or a pipe gives; `told` hears before each read how many bytes have been read."""

    def __init__(self, file: BinaryIO, told: Callable[[int], object]) -> None:
        self.name, self._descriptor, self._told, self._read = file.name, file.fileno(), told, 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        self._told(self._read)
        data = os.read(self._descriptor, len(buffer))
        buffer[: len(data)] = data
        self._read += len(data)
        return len(data)
