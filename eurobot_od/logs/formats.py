"""The log formats, by suffix; a `.gz` behind it is unpacked on the way.

Rule of this file: a log is opened once, read forwards, and never held in memory.
"""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Iterable
from pathlib import PurePath
from typing import Any, BinaryIO, cast

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.logs.asc import Asc
from eurobot_od.logs.binary import read_messages, read_table
from eurobot_od.logs.blf import read_blf
from eurobot_od.logs.candump import Candump
from eurobot_od.logs.csv import Csv
from eurobot_od.logs.lines import LineFormat, Quick, read_lines
from eurobot_od.logs.raw import Damage, Entries, Foreign, Read, Understand, Understood
from eurobot_od.logs.trc import Trc

STANDARD_INPUT = CANDUMP = "log"
"""Format of standard input, unless another is asked for."""


def _lines(form: type[LineFormat]) -> Read[Any]:
    def read(file: Iterable[bytes], understand: Understand[Understood]) -> Entries[Understood]:
        return read_lines(file, form(), understand)

    return read


FORMATS: dict[str, Read[Any]] = {
    CANDUMP: _lines(Candump),
    "asc": _lines(Asc),
    "csv": _lines(Csv),
    "trc": _lines(Trc),
    "blf": read_blf,
    "db": read_table,
    "mf4": read_messages,
}
"""Readers by suffix; the suffixes are those of python-can's readers."""


BY_NAME = ("db", "mf4")
"""Formats that are not read from front to back."""


def read(
    file: BinaryIO,
    understand: Understand[Understood],
    form: str | None = None,
    quick: Quick[Understood] | None = None,
) -> Entries[Understood]:
    """Yield the entries of an open log; `form` is a suffix, left out that of the file's name.

    `quick` is a shorter way to what `understand` gives, for a candump log's frames as they stand there.
    Raises UnknownName for a suffix that stands for no format, LocalError for a pipe where only a file will do.
    """
    suffixes = PurePath(getattr(file, "name", "")).suffixes if form is None else [f".{form}"]
    compressed = suffixes[-1:] == [".gz"]
    suffix = "".join(suffixes[:-1][-1:] if compressed else suffixes[-1:]).lower().lstrip(".")
    if suffix not in FORMATS:
        raise UnknownName("log format", suffix or getattr(file, "name", ""), FORMATS)
    if suffix in BY_NAME and not isinstance(getattr(file, "name", None), str):
        raise LocalError(f"a log in the format {suffix} must be a file")
    source = cast("BinaryIO", gzip.GzipFile(fileobj=file)) if compressed else file
    if suffix == CANDUMP:
        entries = read_lines(source, Candump(), understand, quick)
    else:
        entries = FORMATS[suffix](source, understand)
    return _unpacked(entries, understand) if compressed else entries


def _unpacked(entries: Entries[Understood], understand: Understand[Understood]) -> Entries[Understood]:
    """Pass on the entries of a packed log; if it cannot be unpacked to its end, the last one says so."""
    line, time = 0, 0.0
    try:
        for line, time, channel, what in entries:
            yield line, time, channel, what
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        yield line + 1, time, "", understand(Foreign(Damage.CUT_OFF, str(error)))
