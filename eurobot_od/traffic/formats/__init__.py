"""Log formats, recognised by a log's first bytes or else its suffix; gzip is unpacked.

A log is opened once, read forwards, and never held in memory.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from importlib import import_module
from itertools import chain, islice
from pathlib import PurePath
from typing import Any, BinaryIO, NamedTuple, cast

from eurobot_od.errors import FileError, LocalError, look_up
from eurobot_od.frame import Frame
from eurobot_od.support.files import opened
from eurobot_od.traffic.entries import LARGEST, Batch, Damage, Entries, Foreign, Raw, gathered
from eurobot_od.traffic.formats.lines import read_lines

STANDARD_INPUT = CANDUMP = "log"
"""Format of standard input, unless its first bytes or an option name another."""


class LogFormat(NamedTuple):
    """A format: its module in this package, its reader there, and the first bytes that identify it.

    Blank lines and comments may stand before those of text. One `by_name` is not read from front to back.
    """

    module: str
    reader: str
    beginning: bytes = b""
    is_text: bool = True
    by_name: bool = False


_CONSOLE = rb"\s*(?:[<>]\s+)?(?:\([-:. \d]+\)\s+)?\S+\s+(?:[RT]X [-B] [-E]\s+)?[0-9A-F]{3,8}\s+[\[{][0-9A-F]{1,2}[\]}]"
_PCAP = rb"\xd4\xc3\xb2\xa1|\xa1\xb2\xc3\xd4|\x4d\x3c\xb2\xa1|\xa1\xb2\x3c\x4d"
_ASC = rb"date |base +(?:hex|dec)|[ \t]*\d+\.\d+ +(?:\d+ +[0-9A-Fa-f]+x? +|CANFD +\d+ +)[RT]x "
_TRC = rb";\$|[ \t]*\d+\)?[ \t]+[\d.,]+[ \t]+(?:\d[ \t]+)?(?:[RT]x|DT|[0-9A-F]{4,8})[ \t]+(?:\d[ \t]+)?[0-9A-F]"
_CARBUS = rb"@ TEXT @|\d+,\d+\t\d+\t[0-9A-Fa-f]+\t[0-9A-Fa-f]+\t\d\t"
_COLUMNS = (
    rb"(?i:(?=[^\n]*(?:\b|_)(?:(?:can|frame)[ _]?id|id|identifier|addr|address|cob[ _-]?id)\b)"
    rb"(?=[^\n]*(?:\b(?:data|payload|[db][01]|byte ?[01a])|bytes\b))[^\n]*[,;\t][^\n]*\n)"
)
"""Patterns of first lines; a pasted log may begin in the middle."""

FORMATS: Mapping[str, LogFormat] = {
    CANDUMP: LogFormat("lines", "CandumpFormat", rb"\(\d+\.\d+\) \S+ +[0-9A-Fa-f]+#"),
    "candump": LogFormat("lines", "CandumpFormat"),
    "console": LogFormat("lines", "ConsoleFormat", _CONSOLE),
    "old": LogFormat("pasted", "OldFormat", rb"[ \t]*<0x[0-9A-Fa-f]+>[ \t]+\["),
    "message": LogFormat("pasted", "MessageFormat", rb"[^\n]*\bTimestamp:[ \t]*[\d.]+[ \t]+ID:"),
    "asc": LogFormat("lines", "AscFormat", _ASC),
    "trc": LogFormat("lines", "TrcFormat", _TRC),
    "crtd": LogFormat("pasted", "CrtdFormat", rb"\d+\.\d+ \d*(?:[RT](?:11|29)|C[A-Z]{2}) "),
    "yacht": LogFormat("pasted", "YachtFormat", rb"\d\d:\d\d:\d\d\.\d+ [RT] [0-9A-Fa-f]{8} "),
    "carbus": LogFormat("pasted", "CarbusFormat", _CARBUS),
    "microchip": LogFormat("pasted", "MicrochipFormat", rb"//-+\r?\n[^\n]*Microchip|\d+;[RT]X;0x"),
    "csv": LogFormat("lines", "CsvFormat", rb"timestamp,arbitration_id,extended,remote,error,dlc,data"),
    "busmaster": LogFormat("lines", "BusmasterFormat", rb"\*{3}BUSMASTER|\d+:\d+:\d+:\d+ [RT]x \d+ "),
    "gvret": LogFormat("lines", "GvretFormat", rb"Time Stamp,ID,Extended,"),
    "ixxat": LogFormat("lines", "IxxatFormat", rb"ASCII Trace IXXAT|\"Bus\"[;,]\"No\"[;,]\"Time"),
    "kvaser": LogFormat("lines", "KvaserFormat", rb"Chn +Identifier +Flg"),
    "columns": LogFormat("pasted", "ColumnsFormat", _COLUMNS),
    "blf": LogFormat("binary", "read_blf", rb"LOGG", is_text=False),
    "db": LogFormat("python_can", "read_table", rb"SQLite format 3\0", is_text=False, by_name=True),
    "mf4": LogFormat("python_can", "read_mf4", rb"MDF {5}", is_text=False, by_name=True),
    "pcap": LogFormat("binary", "read_pcap", _PCAP, is_text=False),
    "pcapng": LogFormat("binary", "read_pcapng", rb"\n\r\r\n", is_text=False),
}
"""Formats by suffix, or by a name without one; the first match is used."""

BY_NAME = tuple(suffix for suffix, each in FORMATS.items() if each.by_name)
"""Formats that need a file, as they are not read from front to back."""


def _content_pattern() -> re.Pattern[bytes]:
    """Return the pattern for the first bytes of a log, with a group for each format."""

    def beginning(suffix: str, each: LogFormat) -> bytes:
        return b"(?P<%b>%b)" % (suffix.encode(), each.beginning)

    known = {suffix: each for suffix, each in FORMATS.items() if each.beginning}
    binary = b"|".join(beginning(suffix, each) for suffix, each in known.items() if not each.is_text)
    text = b"|".join(beginning(suffix, each) for suffix, each in known.items() if each.is_text)
    return re.compile(rb"%b|(?:\xef\xbb\xbf)?(?:[ \t]*(?:#[^\n]*)?\r?\n)*(?:%b)" % (binary, text))


CONTENT = _content_pattern()
"""First bytes that identify a format; blank lines and comments may stand before those of text."""

LIKELY = (
    (rb"\xff\xfe|\xfe\xff", "it is text in UTF-16: `iconv -f UTF-16 -t UTF-8` converts it"),
    (rb"PK\x03\x04", "it is a zip archive: unpack it first"),
    (rb"BZh|\xfd7zXZ|\x28\xb5\x2f\xfd", "it is packed: `bunzip2`, `unxz` or `unzstd` unpacks it (gzip is read)"),
    (rb"\s*<\?xml", "it is XML: export the frames as ASC or BLF from the program that made it"),
    (rb"MDF {5}", "it is MF4 with measured values alone: record the frames of the bus, too"),
    (rb"\s*\[(?i:fileinfo|deviceinfo)\]", "it is a device's file: --eds names it, as in --eds 5=FILE"),
    (rb"\s*VERSION \"", "it is a DBC: --dbc names it"),
    (rb".*(?i:canalyser)", "it looks like IXXAT's canAnalyser: export it as ASC or CSV from there"),
)
"""Beginnings of logs in unsupported formats, with advice."""

OTHERS = (
    f"--format names its format ({', '.join(FORMATS)}); any other program's frames are read as CSV "
    "whose first line names the columns: time, id, data"
)
"""Advice for other unsupported formats."""

PACKED = b"\x1f\x8b"
"""First bytes of a gzip file (RFC 1952)."""

BEGINNING = 1024
"""Number of first bytes that are examined."""

STRANGE = re.compile(rb"^(?![ \t]*(?:#|\r?$))[^\n]*\n", re.MULTILINE)
"""A line that is neither a comment nor blank."""

MOST_STRANGE = 3
"""Maximum number of other lines before the first frame, as a paste often begins with the typed command."""


MANY = 1 << 11
"""Number of entries in a batch of a format without lines."""


def batches(file: BinaryIO, form: str | None = None, largest: int = LARGEST) -> Iterator[Batch]:
    """Yield the entries of an open log in batches; lines and records are cut at `largest` bytes.

    `form` is the suffix of its format; left out, the first bytes decide, or else the name. What a pipe has is yielded
    before more is waited for. Raises UnknownName for a `form` that is not one, LocalError for a name that says none,
    for a pipe where only a file will do, and, at its end, for a log that has entries of which none can be read.
    """
    beginning = _beginning(file)
    return _read_at_all(_batches(file, form, largest), beginning, getattr(file, "name", None))


def entries(file: BinaryIO, form: str | None = None, largest: int = LARGEST) -> Entries:
    """Yield the entries of an open log one by one; errors as `batches`."""
    return chain.from_iterable(map(Batch.entries, batches(file, form, largest)))


def read(file: BinaryIO, form: str | None = None, largest: int = LARGEST) -> Entries:
    """Yield the entries of a log as `entries` does, even if none can be read."""
    return chain.from_iterable(map(Batch.entries, _batches(file, form, largest)))


def _batches(file: BinaryIO, form: str | None, largest: int) -> Iterator[Batch]:
    name = getattr(file, "name", None)
    (content, beginning) = _content(file)
    most = MANY if file.seekable() else 1
    found = _reader(form or _said_by(beginning, name), name, most)(content, largest)
    # A separate generator, so that this function raises its errors at once.
    return found if content is file else _until_it_breaks(found)


def _read_at_all(found: Iterator[Batch], beginning: bytes, name: object) -> Iterator[Batch]:
    first: int | Raw | None = None
    for batch in found:
        yield batch
        if batch.is_read:
            break
        first = first or batch.heads[0]
    else:
        if isinstance(first, Foreign):
            shown = name if isinstance(name, str) and name != "<stdin>" else "standard input"
            raise LocalError(f"{shown}: nothing in it can be read as a frame{_reason(first, beginning)}")
    yield from found


def _reason(first: Foreign, beginning: bytes) -> str:
    """Return why nothing can be read of a log with these first bytes and this first entry, and what helps."""
    known = CONTENT.match(beginning)
    is_text = known is None or FORMATS[known.lastgroup or CANDUMP].is_text
    advice = likely(beginning)
    if is_text and not beginning.startswith(PACKED):
        return f"; {advice}"
    return f": {first.text}" if advice is OTHERS else f": {first.text}; {advice}"


def likely(beginning: bytes) -> str:
    """Return advice for a log that cannot be read."""
    return next((words for start, words in LIKELY if re.match(start, beginning)), OTHERS)


def form_of(file: BinaryIO, form: str | None = None) -> str:
    """Return the suffix of a log's format; the log must be seekable. Errors as `read`."""
    content, beginning = _content(file)
    if content is not file:
        file.seek(0)  # it has been read from
    name = getattr(file, "name", None)
    suffix = form or _said_by(beginning, name)
    _reader(suffix, name)  # raises for an unsuitable format
    return suffix


def is_log(file: str) -> bool:
    """Return whether a file is a log: whether a frame is among its first entries."""
    with suppress(LocalError, FileError), opened(file) as log:
        return any(isinstance(raw, Frame) for *_, raw in islice(entries(log), MOST_STRANGE))
    return False


def _content(file: BinaryIO) -> tuple[BinaryIO, bytes]:
    """Return a log's unpacked content and its first bytes, none if they cannot be unpacked."""
    beginning = _beginning(file)
    if not beginning.startswith(PACKED):
        return file, beginning
    import gzip
    import zlib

    content = cast("BinaryIO", gzip.GzipFile(fileobj=file))
    with suppress(EOFError, zlib.error, gzip.BadGzipFile):
        return content, _beginning(content)
    return content, b""


def _beginning(file: BinaryIO) -> bytes:
    """Return the first bytes of a log without consuming them; none if it cannot be peeked at."""
    peek: Callable[[int], bytes] | None = getattr(file, "peek", None)
    return peek(BEGINNING) if peek else b""


def _said_by(beginning: bytes, name: object) -> str:
    """Return the suffix of a format by the first bytes, or else the file's name.

    Standard input and other files without a name are read as candump's. Raises LocalError for a name without one.
    """
    starts = (0, *islice((each.end() for each in STRANGE.finditer(beginning)), MOST_STRANGE))
    found = next(filter(None, (CONTENT.match(beginning, start) for start in starts)), None)
    if found is not None and found.lastgroup is not None:
        return found.lastgroup
    if not isinstance(name, str) or name == "<stdin>":
        return STANDARD_INPUT
    suffixes = PurePath(name.lower()).suffixes
    # For `match.asc.gz` it is `asc`; `match.gz` says nothing about its content.
    suffix = "".join(suffixes[:-1][-1:] if suffixes[-1:] == [".gz"] else suffixes[-1:]).lstrip(".")
    if suffix not in FORMATS:  # a file name, so that similar format names are no help
        raise LocalError(f"{name}: not a known log; {likely(beginning)}")
    return suffix


def _reader(suffix: str, name: object, most: int = MANY) -> Callable[[BinaryIO, int], Iterator[Batch]]:
    """Return the reader of a format; without lines, in batches of at most `most` entries."""
    form = look_up("log format", suffix, FORMATS)
    if form.by_name and not isinstance(name, str):  # SQLite and asammdf open the file themselves
        raise LocalError(f"a log in the format {suffix} must be a file")
    found: Any = getattr(import_module(f"eurobot_od.traffic.formats.{form.module}"), form.reader)
    if isinstance(found, type):
        return lambda file, largest: read_lines(file, found(), largest)
    return lambda file, largest: gathered(found(file, largest), most)


def _until_it_breaks(found: Iterator[Batch]) -> Iterator[Batch]:
    """Yield the batches of a packed log; an unpacking error becomes the last entry."""
    import gzip
    import zlib

    line, time = 0, 0.0
    try:
        for batch in found:
            yield batch
            line, time = batch.lines[-1], batch.times[-1]
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        yield Batch.of([(line + 1, time, "", Foreign(Damage.CUT_OFF, str(error)))])
