"""Logs that do not consist of lines: python-can's SQLite tables, and MF4, which only python-can knows.

Rule of this file: a log that ends in the middle, or that its reader gives up, ends with an entry that says so.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from eurobot_od.errors import LocalError
from eurobot_od.logs.entries import MAX_LENGTH, Damage, Entries, Foreign, Raw, frame, shortened

if TYPE_CHECKING:
    import can

QUERY = "SELECT ts, arbitration_id, extended, remote, error, dlc, data FROM messages"
"""The table of python-can's SqliteWriter."""


def of_message(message: can.Message) -> Raw:
    """Return what python-can read, from a log or from a bus."""
    damage = (
        Damage.ERROR_FRAME
        if message.is_error_frame
        else Damage.FD
        if message.is_fd
        else Damage.REMOTE
        if message.is_remote_frame
        else Damage.EXTENDED
        if message.is_extended_id
        else None
    )
    return _raw(damage, message.arbitration_id, bytes(message.data))


def _raw(damage: Damage | None, cob_id: int, data: bytes) -> Raw:
    return Foreign(damage, shortened(f"{cob_id:03X}#{data.hex().upper()}")) if damage else frame(cob_id, data)


# SQLite


def read_table(file: BinaryIO) -> Entries:
    """Read the table `messages` of an SQLite file."""
    with closing(sqlite3.connect(f"{Path(file.name).absolute().as_uri()}?mode=ro", uri=True)) as connection:
        rows = _rows(connection)
        for number, (time, *row) in enumerate(rows, 1):
            if isinstance(time, Foreign):
                yield number, 0.0, "", time
            else:
                yield number, time, "", _of_row(*row)


def _rows(connection: sqlite3.Connection) -> Iterator[tuple[Any, ...]]:
    try:
        yield from connection.execute(QUERY)
    except sqlite3.DatabaseError as error:
        yield (Foreign(Damage.CUT_OFF, str(error)),)


def _of_row(cob_id: int, extended: int, remote: int, error: int, length: int, data: bytes | None) -> Raw:
    octets = data or b""
    if error or remote or extended:
        return _raw(Damage.ERROR_FRAME if error else Damage.REMOTE if remote else Damage.EXTENDED, cob_id, octets)
    if len(octets) != length:
        return Foreign(Damage.UNREADABLE, f"{cob_id:03X}#{octets.hex()} with length {length}")
    return _raw(Damage.FD if len(octets) > MAX_LENGTH else None, cob_id, octets)


# Whatever else python-can knows


def read_messages(file: BinaryIO) -> Entries:
    """Read a log by python-can's reader for the file's suffix; raises LocalError if that needs an extra."""
    import can

    number = 0
    try:
        with can.LogReader(file.name) as messages:
            for number, message in enumerate(messages, 1):
                yield number, message.timestamp, _channel(message.channel), of_message(message)
    except NotImplementedError:  # what it raises without the package it needs
        raise LocalError(f"{file.name}: reading it needs the extra `mf4`: pip install 'eurobot-od[mf4]'") from None
    except (
        Exception
    ) as error:  # what a reader raises for a damaged file is not said anywhere: struct.error, KeyError, ...
        yield number + 1, 0.0, "", Foreign(Damage.CUT_OFF, shortened(str(error)))


def _channel(channel: Any) -> str:
    return "" if channel is None else str(channel)
