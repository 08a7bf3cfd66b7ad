"""A log of any format as batches of columns: frames with line, time, channel, identifier and data; and all else.

Rule of this file: a batch has what `traffic.formats` reads, and nothing is read here. Memory holds a few batches,
however long the log is.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import BinaryIO, NamedTuple

import polars as pl

from eurobot_od.frame import Frame
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import Batch

ROWS = 1 << 17
"""A batch has about this many entries, if the log has them."""

AHEAD = 2
"""Batches made ahead: some take longer to be written than others."""

ENTRY: Mapping[str, pl.DataType] = {"line": pl.UInt64(), "t": pl.Float64(), "channel": pl.Categorical()}
FRAMES = pl.Schema({**ENTRY, "cob_id": pl.UInt32(), "data": pl.Binary(), "remote": pl.Boolean()})
FOREIGN = pl.Schema({**ENTRY, "kind": pl.String(), "text": pl.String()})
NOTHING = pl.DataFrame(schema=FOREIGN)


class ColumnBatch(NamedTuple):
    """Consecutive entries of a log: the `frames`, and the `foreign` entries that are not frames; `size` in bytes.

    `size` is how much of the log was read for it, 0 if that is unknown.
    """

    frames: pl.DataFrame
    foreign: pl.DataFrame
    size: int = 0


def batches(file: BinaryIO, form: str | None = None) -> Iterator[ColumnBatch]:
    """Yield the batches of an open log, making the next ones meanwhile; errors as `formats.batches`."""
    made = _joined(map(_columns, formats.batches(file, form)), file)
    with ThreadPoolExecutor(1) as thread:  # one: the batches come out of one generator
        coming = deque(thread.submit(next, made, None) for _ in range(AHEAD))
        while (batch := coming.popleft().result()) is not None:
            coming.append(thread.submit(next, made, None))
            yield batch


def _joined(parts: Iterator[ColumnBatch], file: BinaryIO) -> Iterator[ColumnBatch]:
    """Join small batches into batches of about ROWS entries."""
    taken, rows, read = list[ColumnBatch](), 0, 0
    for part in parts:
        taken.append(part)
        rows += len(part.frames) + len(part.foreign)
        if rows >= ROWS:
            yield _one(taken, file.tell() - read)
            taken, rows, read = [], 0, file.tell()
    if taken:
        yield _one(taken, file.tell() - read)


def _one(parts: list[ColumnBatch], size: int) -> ColumnBatch:
    frames, foreign, _ = zip(*parts)
    return ColumnBatch(pl.concat(frames), pl.concat(foreign), size)


def _columns(batch: Batch) -> ColumnBatch:
    """Return the entries of a batch as tables."""
    heads = [head if head.__class__ is int else None for head in batch.heads]
    # Nearly always one: a text that is the same in each row is made once.
    channels = batch.channels[:1] if batch.is_of_one_channel else batch.channels
    columns: tuple[Sequence[object], ...] = batch.lines, list(batch.times), channels, heads, batch.data, [False]
    made = [pl.Series(name, each, FRAMES[name]) for name, each in zip(FRAMES, columns)]
    frames = pl.DataFrame([each if len(each) > 1 else each.new_from_index(0, len(heads)) for each in made])
    if None not in heads:
        return ColumnBatch(frames, NOTHING)
    others = [entry for entry, head in zip(batch.entries(), heads) if head is None]
    remote = [(*place, raw.cob_id, raw.data, True) for *place, raw in others if isinstance(raw, Frame)]
    foreign = [(*place, raw.damage.value, raw.text) for *place, raw in others if not isinstance(raw, Frame)]
    frames = pl.concat([frames.drop_nulls("cob_id"), pl.DataFrame(remote, FRAMES, orient="row")])
    return ColumnBatch(frames.sort("line"), pl.DataFrame(foreign, FOREIGN, orient="row"))
