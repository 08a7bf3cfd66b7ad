"""What the commands that read logs share: the options that name them, files, standard input."""

from __future__ import annotations

import argparse
import io
import os
import stat
import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from eurobot_od.errors import LocalError

if TYPE_CHECKING:
    from eurobot_od.logs.entries import LogEntry

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


def entries(logs: list[str], arguments: argparse.Namespace) -> Generator[tuple[str, LogEntry], None, None]:
    """Give the entries of logs, one log after the other, with the log's name. Errors as `logs.formats.read`."""
    from eurobot_od.logs import formats

    for log in logs:
        with opened(log) as file:
            for entry in formats.read(file, arguments.format, arguments.largest):
                yield log, entry


@contextmanager
def opened(log: str) -> Iterator[io.BufferedReader]:
    """Open a log. What was decoded of lines from a pipe is shown before the next ones are waited for."""
    if log != STANDARD_INPUT:
        with Path(log).open("rb") as file:
            yield file
        return
    if sys.stdin is None:
        raise LocalError("standard input is closed")
    standard: io.BufferedReader = sys.stdin.buffer  # type: ignore[assignment]  # as it is, unless a program replaces it
    is_file = stat.S_ISREG(os.fstat(standard.fileno()).st_mode)
    yield standard if is_file else io.BufferedReader(Pipe(standard.fileno(), sys.stdout.flush), CHUNK)


class Pipe(io.RawIOBase):
    """The reading end of a pipe or a terminal; `before_waiting` is called before each read."""

    def __init__(self, descriptor: int, before_waiting: Callable[[], object]) -> None:
        self._descriptor, self._before_waiting = descriptor, before_waiting

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        self._before_waiting()
        data = os.read(self._descriptor, len(buffer))
        buffer[: len(data)] = data
        return len(data)
