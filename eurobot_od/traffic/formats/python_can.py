"""Logs by way of python-can: SQLite tables, MF4, and messages of a bus.

Where a file cannot be read any further, the last entry says so.
"""

from __future__ import annotations

import errno
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from eurobot_od.errors import LocalError
from eurobot_od.support import extras
from eurobot_od.traffic.entries import Damage, Entries, Foreign, Raw, read_each, recorded, seconds, shortened

if TYPE_CHECKING:
    import can

CREATE = """CREATE TABLE messages
(ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER, error INTEGER, dlc INTEGER, data BLOB)"""
"""The table of python-can's SqliteWriter."""


def of_message(message: can.Message) -> Raw:
    """Return an entry for a message of python-can; raises ValueError for what no bus can carry."""
    flags = message.is_extended_id, message.is_remote_frame, message.is_error_frame, message.is_fd
    return recorded(message.arbitration_id, bytes(message.data), message.dlc, *flags)


ROWS = "SELECT ts, arbitration_id, extended, remote, error, dlc, data FROM messages"

TYPES: Mapping[str, Any] = {"ts": float | int, "arbitration_id": int, "dlc": int, "data": bytes | None}
"""Types of the columns, which SQLite itself does not enforce."""

IS_TABLE = "SELECT count(*) FROM sqlite_schema WHERE name = 'messages' AND sql LIKE 'CREATE TABLE%'"
"""Whether `messages` is a table; rows of a view or virtual table are computed and may not end."""


def read_table(file: BinaryIO, largest: int) -> Entries:
    """Read the table `messages` of an SQLite file, as written by python-can's SqliteWriter."""
    return read_each(_rows(file, largest), _row, _reason_of_sqlite)


def _rows(file: BinaryIO, largest: int) -> Iterator[Sequence[Any]]:
    with closing(sqlite3.connect(file.name)) as connection:
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, largest)  # also of what a generated column computes
        connection.text_factory = partial(str, encoding="utf-8", errors="replace")
        if not connection.execute(IS_TABLE).fetchone()[0]:
            raise sqlite3.DatabaseError("no table messages")
        yield from connection.execute(ROWS)


def _reason_of_sqlite(error: Exception) -> Foreign | None:
    # SQLite's message quotes the file, which may not be UTF-8.
    words = error.object.decode(errors="replace") if isinstance(error, UnicodeDecodeError) else error
    is_known = isinstance(error, (sqlite3.Error, UnicodeDecodeError))
    return Foreign(Damage.CUT_OFF, shortened(f"SQLite reads no further: {words}")) if is_known else None


def _row(row: Sequence[Any]) -> tuple[float, str, Raw]:
    time, identifier, extended, remote, error, length, data = row
    for name, value in {"ts": time, "arbitration_id": identifier, "dlc": length, "data": data}.items():
        if not isinstance(value, TYPES[name]):
            raise ValueError(f"{name} is {value!r}")
    return seconds(time), "", recorded(identifier, data or b"", length, extended, remote, error)


def read_mf4(file: BinaryIO, _largest: int) -> Entries:
    """Read an MF4 file; raises LocalError without the extra, and ends where python-can fails.

    One without frames has an entry that says so.
    """
    return read_each(_messages(file), _entry, _reason_of_python_can)


def _messages(file: BinaryIO) -> Iterator[can.Message]:
    import can

    extras.caught_up("asammdf", "can.io.mf4")
    message = None
    try:
        with can.MF4Reader(file.name) as messages:
            for message in messages:
                yield message
    except NotImplementedError:
        raise LocalError(f"{file.name}: {extras.missing('asammdf', 'mf4')}") from None
    if message is None:  # most MF4 files hold measured values
        raise EOFError("no frame of a bus is recorded here")


def _reason_of_python_can(error: Exception) -> Foreign | None:
    if isinstance(error, LocalError):
        return None
    # What a reader raises for a damaged file is not documented: struct.error, KeyError.
    words = error if isinstance(error, EOFError) else f"python-can reads no further: {error}"
    return Foreign(Damage.CUT_OFF, shortened(str(words)))


def _entry(message: can.Message) -> tuple[float, str, Raw]:
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
        raise OSError(errno.EIO, str(error), str(file)) from error
