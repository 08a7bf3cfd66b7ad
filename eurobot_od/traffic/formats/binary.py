"""Logs that do not consist of lines: python-can's SQLite tables, and MF4, which only python-can knows.

A log that is cut off, or that its reader gives up on, ends with an entry that says so.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterable
from contextlib import closing
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

# Of a blob one byte more than any frame has, to see that it is too long: damage may make it as long as the file.
QUERY = """SELECT ts, arbitration_id, extended, remote, error, dlc,
CASE typeof(data) WHEN 'blob' THEN substr(data, 1, 65) END FROM messages"""
CREATE = """CREATE TABLE messages
(ts REAL, arbitration_id INTEGER, extended INTEGER, remote INTEGER, error INTEGER, dlc INTEGER, data BLOB)"""
"""The table of python-can's SqliteWriter."""


def of_message(message: can.Message) -> Raw:
    """Return what python-can read, from a log or from a bus; raises ValueError for what no bus can carry."""
    flags = {Damage.ERROR_FRAME: message.is_error_frame, Damage.FD: message.is_fd}
    damage = next((each for each, is_set in flags.items() if is_set), None)
    if damage is not None:
        return foreign(damage, message.arbitration_id, bytes(message.data))
    remote = message.dlc if message.is_remote_frame else None
    return frame(message.arbitration_id, bytes(message.data), message.is_extended_id, remote)


# SQLite


def read_table(file: BinaryIO, _: int = LARGEST) -> Entries:
    """Read the table `messages` of an SQLite file."""
    number = 0
    # Read only: sqlite3 would otherwise make an empty file where there is none.
    with closing(sqlite3.connect(f"{Path(file.name).absolute().as_uri()}?mode=ro", uri=True)) as connection:
        connection.text_factory = bytes  # a text that is not UTF-8 must not end the reading
        try:
            for number, time, channel, raw in read_each(connection.execute(QUERY), _of_row):
                yield number, time, channel, raw
        except sqlite3.DatabaseError as error:
            yield number + 1, 0.0, "", Foreign(Damage.CUT_OFF, shortened(str(error)))


def write_table(file: Path, messages: Iterable[can.Message]) -> None:
    """Write an SQLite file with a table `messages`, as python-can's SqliteWriter does; raises OSError."""
    flags = ("is_extended_id", "is_remote_frame", "is_error_frame")
    rows = ((m.timestamp, m.arbitration_id, *(getattr(m, each) for each in flags), m.dlc, m.data) for m in messages)
    try:
        with closing(sqlite3.connect(file)) as connection, connection:  # by itself it commits, but does not close
            connection.execute(CREATE)
            connection.executemany("INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
    except sqlite3.Error as error:
        raise OSError(f"{file}: {error}") from error


def _of_row(row: tuple[float, int, int, int, int, int, bytes | None]) -> tuple[float, str, Raw]:
    time, cob_id, extended, remote, error, length, data = row
    octets = data or b""
    if error:
        return seconds(time), "", foreign(Damage.ERROR_FRAME, cob_id, octets)
    if remote:
        return seconds(time), "", frame(cob_id, b"", extended, length)
    if len(octets) != length:
        raise ValueError(f"{cob_id:03X}#{octets.hex()} with length {length}")
    if length > MOST_BYTES:  # no column says so
        return seconds(time), "", foreign(Damage.FD, cob_id, octets)
    return seconds(time), "", frame(cob_id, octets, extended)


# Whatever else python-can knows


def read_messages(file: BinaryIO, _: int = LARGEST) -> Entries:
    """Read a log by python-can's reader for the file's suffix; raises LocalError if that needs an extra."""
    import can

    number = 0
    try:
        with can.LogReader(file.name) as messages:
            for number, time, channel, raw in read_each(
                messages, lambda m: (seconds(m.timestamp), "" if m.channel is None else str(m.channel), of_message(m))
            ):
                yield number, time, channel, raw
    except NotImplementedError:  # what it raises without the package it needs
        raise LocalError(f"{file.name}: {extras.missing('asammdf', 'mf4')}") from None
    except Exception as error:  # what a reader raises for a damaged file is not documented: struct.error, KeyError
        yield number + 1, 0.0, "", Foreign(Damage.CUT_OFF, shortened(str(error)))
