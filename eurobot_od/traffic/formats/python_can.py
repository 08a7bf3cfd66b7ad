"""Logs that python-can's own readers read: its CSV, its SQLite tables, and MF4.

Where such a reader gives up, the last entry says so.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterable
from contextlib import closing
from functools import partial
from io import TextIOBase
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from eurobot_od.errors import LocalError
from eurobot_od.frame import MOST_BYTES
from eurobot_od.support import extras
from eurobot_od.traffic.entries import (
    LARGEST,
    Damage,
    Entries,
    Foreign,
    Raw,
    foreign,
    frame,
    read_each,
    seconds,
    shortened,
)

if TYPE_CHECKING:
    import can

CREATE = """CREATE TABLE messages
(ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER, error INTEGER, dlc INTEGER, data BLOB)"""
"""The table of python-can's SqliteWriter."""


def of_message(message: can.Message) -> Raw:
    """Return what python-can read, from a log or from a bus; raises ValueError for what no bus can carry."""
    # CSV and SQLite do not say that a frame is one of CAN FD; its length does.
    flags = {Damage.ERROR_FRAME: message.is_error_frame, Damage.FD: message.is_fd or len(message.data) > MOST_BYTES}
    damage = next((each for each, is_set in flags.items() if is_set), None)
    if damage is not None:
        return foreign(damage, message.arbitration_id, bytes(message.data))
    remote = message.dlc if message.is_remote_frame else None
    return frame(message.arbitration_id, bytes(message.data), message.is_extended_id, remote)


class _Lines(TextIOBase):
    """The lines of a log as a text file; what is longer than `largest` bytes is more than one line."""

    def __init__(self, file: BinaryIO, largest: int) -> None:
        self._read = partial(file.readline, largest)

    def __next__(self) -> str:  # type: ignore[override]  # as typeshed has it, no text file has lines of text
        if line := self._read():
            return line.decode("latin-1")
        raise StopIteration


def read_csv(file: BinaryIO, largest: int = LARGEST) -> Entries:
    """Read python-can's CSV."""
    import can

    return _read(lambda: can.CSVReader(_Lines(file, largest)))  # type: ignore[arg-type]  # it asks for no more


def read_table(file: BinaryIO, _: int = LARGEST) -> Entries:
    """Read the table `messages` of an SQLite file."""
    import can

    return _read(lambda: can.SqliteReader(file.name))


def read_mf4(file: BinaryIO, _: int = LARGEST) -> Entries:
    """Read an MF4 file; raises LocalError if that needs an extra."""
    import can

    def reader() -> can.MF4Reader:
        try:
            return can.MF4Reader(file.name)
        except NotImplementedError:
            raise LocalError(f"{file.name}: {extras.missing('asammdf', 'mf4')}") from None

    return _read(reader)


def _read(open_: Callable[[], can.io.generic.MessageReader]) -> Entries:
    number, time = 0, 0.0
    try:
        with open_() as messages:
            for number, time, channel, raw in read_each(messages, _entry):
                yield number, time, channel, raw
    except LocalError:
        raise
    except Exception as error:  # what a reader raises for a damaged file is not documented: struct.error, KeyError
        yield number + 1, time, "", Foreign(Damage.CUT_OFF, shortened(f"python-can reads no further: {error}"))


def _entry(message: can.Message) -> tuple[float, str, Raw]:
    if message.dlc != len(message.data) and not (message.is_remote_frame or message.is_error_frame):
        raise ValueError(f"{message.arbitration_id:03X}#{message.data.hex().upper()} with length {message.dlc}")
    return seconds(message.timestamp), "" if message.channel is None else str(message.channel), of_message(message)


def write_table(file: Path, messages: Iterable[can.Message]) -> None:
    """Write an SQLite file with a table `messages`; raises OSError.

    Python-can's own SqliteWriter drops its last messages when it is stopped.
    """
    flags = ("is_extended_id", "is_remote_frame", "is_error_frame")
    rows = ((m.timestamp, m.arbitration_id, *(getattr(m, each) for each in flags), m.dlc, m.data) for m in messages)
    try:
        with closing(sqlite3.connect(file)) as connection, connection:  # by itself it commits, but does not close
            connection.execute(CREATE)
            connection.executemany("INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
    except sqlite3.Error as error:
        raise OSError(f"{file}: {error}") from error
