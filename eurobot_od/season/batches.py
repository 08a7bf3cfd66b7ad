"""A log of any format as batches of columns: frames with line, time, channel, identifier and data; and all else.

Rule of this file: a batch has what `traffic.formats` reads from the same log, entry by entry. candump's format, which
long logs are in, is taken apart by columns; a line in any other form than candump's and python-can's own goes through
the format's reader, and so do all lines of the other formats. Memory holds a few batches, however long the log is. As
lines taken apart need far more than what they say, they are taken from small chunks, and batches made of many of these.
"""

from __future__ import annotations

import gzip
import zlib
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from itertools import islice
from typing import Any, BinaryIO, NamedTuple, cast

import polars as pl

from eurobot_od.frame import Frame
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import LARGEST, Damage, LogEntry
from eurobot_od.traffic.formats.lines import CandumpFormat, read_lines

CHUNK = 1 << 20
"""Bytes of a log that are parsed at once."""

ENTRIES = 1 << 14
"""Entries per part where a reader yields them one by one."""

ROWS = 1 << 17
"""A batch has about this many entries, if the log has them."""

AHEAD = 2
"""Batches made ahead: some take longer to be written than others."""

USUAL = (
    r"^\((?<t>[0-9]{1,10}\.[0-9]{1,9})\) (?<channel>[!-~]+) "
    r"(?<cob_id>[0-7][0-9A-Fa-f]{2})#(?<hex>(?:[0-9A-Fa-f]{2}){0,8})(?: [RT])?\r?$"
)
"""A line with a classic base data frame as candump and python-can write it."""

ENTRY: Mapping[str, pl.DataType] = {"line": pl.UInt64(), "t": pl.Float64(), "channel": pl.Categorical()}
FRAMES = pl.Schema({**ENTRY, "cob_id": pl.UInt32(), "data": pl.Binary(), "remote": pl.Boolean()})
FOREIGN = pl.Schema({**ENTRY, "kind": pl.String(), "text": pl.String()})


class ColumnBatch(NamedTuple):
    """Consecutive entries of a log: the `frames`, and the `foreign` entries that are not frames; `size` in bytes.

    `size` is how much of the log was read for it, 0 if that is unknown.
    """

    frames: pl.DataFrame
    foreign: pl.DataFrame
    size: int = 0


def batches(file: BinaryIO, form: str | None = None) -> Iterator[ColumnBatch]:
    """Yield the batches of an open log, making the next ones meanwhile; errors as `formats.read`."""
    suffix, packed = formats.form_of(file, form)
    if suffix == formats.CANDUMP:
        parts = _candump_batches(_unpacked_chunks(file) if packed else _chunks(file))
    else:
        entries = formats.read(file, form)
        parts = map(_batch, iter(lambda: list(islice(entries, ENTRIES)), []))
    return _ahead(_joined(_read_at_all(parts, file)))


def _read_at_all(parts: Iterator[ColumnBatch], file: BinaryIO) -> Iterator[ColumnBatch]:
    """Yield batches; raises LocalError at the end of a log that has entries, and none that can be read."""
    unread = (Damage.UNREADABLE.value, Damage.CUT_OFF.value)
    has_some = is_read = False
    for part in parts:
        has_some |= bool(len(part.foreign))
        is_read |= bool(len(part.frames)) or not part.foreign["kind"].is_in(unread).all()
        yield part
    if has_some and not is_read:
        file.seek(0)
        formats.refuse(file.name, formats.likely(file.read(formats.BEGINNING)))


def _joined(parts: Iterator[ColumnBatch]) -> Iterator[ColumnBatch]:
    """Join small batches into batches of about ROWS entries."""
    taken, rows = list[ColumnBatch](), 0
    for part in parts:
        taken.append(part)
        rows += len(part.frames) + len(part.foreign)
        if rows >= ROWS:
            yield _one(taken)
            taken, rows = [], 0
    if taken:
        yield _one(taken)


def _one(parts: list[ColumnBatch]) -> ColumnBatch:
    frames, foreign, sizes = zip(*parts)
    return ColumnBatch(pl.concat(frames), pl.concat(foreign), sum(sizes))


def _ahead(made: Iterator[ColumnBatch]) -> Iterator[ColumnBatch]:
    """Yield batches; a thread makes the next ones while the caller works on the last one."""
    with ThreadPoolExecutor(1) as thread:  # one: the batches come out of one generator
        coming = deque(thread.submit(next, made, None) for _ in range(AHEAD))
        while (batch := coming.popleft().result()) is not None:
            coming.append(thread.submit(next, made, None))
            yield batch


# Entries one by one


def _batch(entries: Iterable[LogEntry]) -> ColumnBatch:
    frames: list[tuple[Any, ...]] = []
    foreign: list[tuple[Any, ...]] = []
    for line, time, channel, raw in entries:
        if isinstance(raw, Frame):
            frames.append((line, time, channel, raw.cob_id, raw.data, raw.is_remote))
        else:
            foreign.append((line, time, channel, raw.damage.value, raw.text))
    return ColumnBatch(
        pl.DataFrame(frames, FRAMES, orient="row"),
        pl.DataFrame(foreign, FOREIGN, orient="row"),
    )


# candump


class _Chunk(NamedTuple):
    """Whole lines of a log; `cut` says why the rest cannot be unpacked."""

    content: bytes
    cut: str = ""


def _chunks(file: BinaryIO) -> Iterator[_Chunk]:
    """Yield a file's whole lines; the rest after the last line end is a line, too."""
    left = b""
    while new := file.read(CHUNK):
        # Cut at a line end: a chunk is parsed by itself, and half a line would be damage in both.
        whole, end, left = (left + new).rpartition(b"\n")
        yield _Chunk(whole + end)
    yield _Chunk(left)


def _unpacked_chunks(file: BinaryIO) -> Iterator[_Chunk]:
    """Yield a packed file's whole lines, as far as it can be unpacked."""
    unpacked = gzip.GzipFile(fileobj=file)
    parts: list[bytes] = []
    left, cut = b"", ""
    try:
        # read1, as read would drop what it has unpacked before the place where the file is damaged.
        while part := unpacked.read1(CHUNK):
            parts.append(part)
            if sum(map(len, parts)) >= CHUNK:
                whole, end, left = (left + b"".join(parts)).rpartition(b"\n")
                parts.clear()
                yield _Chunk(whole + end)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        cut = str(error)
    rest = left + b"".join(parts)
    if cut:  # an incomplete line is dropped
        rest = b"".join(rest.rpartition(b"\n")[:2])
    yield _Chunk(rest, cut)


def _candump_batches(chunks: Iterator[_Chunk]) -> Iterator[ColumnBatch]:
    lines, time = 0, 0.0
    for content, cut in chunks:
        batch = _of_lines(content, lines, time)
        lines += content.count(b"\n")
        # The last line of either kind: a damaged line at the start of the next chunk gets the time of the line above
        # it.
        ends = [(table["line"][-1], table["t"][-1]) for table in (batch.frames, batch.foreign) if len(table)]
        time = cast(float, max(ends)[1]) if ends else time
        if cut:
            end = pl.DataFrame([(lines + 1, time, "", Damage.CUT_OFF.value, cut)], FOREIGN, orient="row")
            batch = batch._replace(foreign=pl.concat([batch.foreign, end]))
        yield batch


def _of_lines(content: bytes, before: int, time: float) -> ColumnBatch:
    """Parse lines; `before` is the number of lines ahead of them, `time` that of the entry ahead of them."""
    # What is not ASCII is not candump: replaced, it goes to the reader of odd lines.
    text = content.removesuffix(b"\n").decode("ascii", "replace")
    found = (
        pl.DataFrame({"text": [text]})
        .select(pl.col("text").str.split("\n").explode())
        .with_row_index("line", before + 1)
        .select(pl.col("line").cast(pl.UInt64), pl.col("text").str.extract_groups(USUAL).alias("groups"))
        .unnest("groups")
    )
    usual = found.filter(pl.col("hex").is_not_null())
    frames = usual.select(
        "line",
        pl.col("t").cast(pl.Float64),
        pl.col("channel").cast(pl.Categorical),
        pl.col("cob_id").str.to_integer(base=16, dtype=pl.UInt32),
        pl.col("hex").str.decode("hex").alias("data"),
        pl.lit(value=False).alias("remote"),
    )
    if len(usual) == len(found) or not content:  # no content is one line without text
        return ColumnBatch(frames, pl.DataFrame(schema=FOREIGN), len(content))
    odd = found.filter(pl.col("hex").is_null())["line"].to_list()
    return _with_odd(frames, content, odd, before, time)


def _with_odd(frames: pl.DataFrame, content: bytes, odd: list[int], before: int, time: float) -> ColumnBatch:
    """Add the lines that need candump's own reader; a line that cannot be read gets the time of the line above it."""
    lines = BytesIO(content).readlines()
    batch = _batch(
        (number, time, channel, raw)
        # One by one, as they are few: whatever the expression for the usual line does not know, candump's own reader
        # does, so that `archive` and `decode` say the same of it.
        for number in odd
        for part in read_lines(BytesIO(lines[number - before - 1]), CandumpFormat(), LARGEST)
        for _, time, channel, raw in part.entries()
    )
    unread = pl.col("kind").is_in([Damage.UNREADABLE.value, Damage.CUT_OFF.value])
    of_foreign = batch.foreign.select("line", pl.when(~unread).then("t"))
    timed = pl.concat([frames.select("line", "t"), batch.frames.select("line", "t"), of_foreign])
    known = timed.sort("line").with_columns(pl.col("t").fill_null(strategy="forward").fill_null(time))
    foreign = batch.foreign.drop("t").join(known, on="line", how="left").select(FOREIGN.names())
    return ColumnBatch(pl.concat([frames, batch.frames]).sort("line"), foreign, len(content))
