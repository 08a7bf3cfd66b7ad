"""The log formats, by suffix; a log with `.gz` after it is unpacked on the way.

Rule of this file: a log is opened once, read forwards, and never held in memory.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import PurePath
from typing import Any, BinaryIO, cast

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.logs.entries import Damage, Entries, Foreign, Read
from eurobot_od.logs.lines import read_lines

STANDARD_INPUT = CANDUMP = "log"
"""Format of standard input, unless another is asked for."""


FORMATS = {
    CANDUMP: ("candump", "CandumpFormat"),
    "asc": ("asc", "AscFormat"),
    "csv": ("csv", "CsvFormat"),
    "trc": ("trc", "TrcFormat"),
    "blf": ("blf", "read_blf"),
    "db": ("binary", "read_table"),
    "mf4": ("binary", "read_messages"),
}
"""Formats by suffix, which are those of python-can's readers: a module of this package, and in it a LineFormat or a
function; imported when they are needed."""

BY_NAME = ("db", "mf4")
"""Formats that are not read from front to back."""


def form_of(file: BinaryIO, form: str | None = None) -> tuple[str, bool]:
    """Return the suffix of an open log's format, and whether the log is packed.

    `form` is the suffix; left out, the file's name says it. Raises UnknownName for a suffix that stands for no format,
    LocalError for a pipe where only a file will do.
    """
    name = getattr(file, "name", None)
    suffixes = PurePath(str(name)).suffixes if form is None else [f".{form}"]
    packed = suffixes[-1:] == [".gz"]
    suffix = "".join(suffixes[:-1][-1:] if packed else suffixes[-1:]).lower().lstrip(".")
    if suffix not in FORMATS:
        raise UnknownName("log format", suffix or str(name), FORMATS)
    if suffix in BY_NAME and not isinstance(name, str):
        raise LocalError(f"a log in the format {suffix} must be a file")
    return suffix, packed


def read(file: BinaryIO, form: str | None = None) -> Entries:
    """Yield the entries of an open log; errors as `form_of`."""
    suffix, packed = form_of(file, form)
    module, name = FORMATS[suffix]
    found: Any = getattr(import_module(f"eurobot_od.logs.{module}"), name)
    reader: Read = (lambda lines: read_lines(lines, found())) if isinstance(found, type) else found
    return _unpacked(reader, file) if packed else reader(file)


def _unpacked(reader: Read, file: BinaryIO) -> Entries:
    """Yield the entries of a packed log; if it cannot be unpacked to its end, the last one says so."""
    import gzip
    import zlib

    line, time = 0, 0.0
    try:
        for line, time, channel, raw in reader(cast("BinaryIO", gzip.GzipFile(fileobj=file))):
            yield line, time, channel, raw
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        yield line + 1, time, "", Foreign(Damage.CUT_OFF, str(error))
