"""Logs into a season: each is read once, decoded by columns, and written as Parquet, batch after batch.

Rule of this file: a log is in the season whole or not at all, and once. Its name there comes from its bytes and from
those of the EDS files, so that the same file again, under whatever name, is known; its row in `runs` is put in place
last, after all its other files, so that a run that was broken off is done again.
"""

from __future__ import annotations

import hashlib
import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import as_completed
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq

from eurobot_od.campaign.processes import Processes
from eurobot_od.logs import formats
from eurobot_od.logs.services import CanopenService, services
from eurobot_od.od.outline import Outline
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.catalogue import Catalogue
from eurobot_od.pdo.protocol import Protocol
from eurobot_od.season import defects, tables
from eurobot_od.season.batches import FOREIGN, Batch, batches
from eurobot_od.season.columns import LENGTH, WORD, FieldColumn, message_columns, readable

VERSION = b"1"
"""Changes when the same log would come to other tables."""

HASHED = 1 << 20
BEGUN = ".begun"
"""The folder of a season in which runs are made."""


class Network(NamedTuple):
    """The devices of the logs: their files as read, their messages, and by name which message `answers` which."""

    outlines: tuple[Outline, ...]
    catalogue: Catalogue
    answers: tuple[tuple[str, str], ...] = ()

    @property
    def hash(self) -> str:
        """What tells these EDS files from all others, with their node-IDs."""
        digest = hashlib.blake2b(VERSION, digest_size=16)
        for each in self.outlines:
            digest.update(f"{each.node_id} {each.name}\n".encode() + Path(each.file).read_bytes())
        return digest.hexdigest()


class Archived(NamedTuple):
    """What became of a log: its `run`, whether it was `known` before, how many frames, and how much is damaged."""

    log: str
    run: str
    known: bool
    size: int
    frames: int = 0
    damage: int = 0


Told = Callable[[int], object]
"""Called with how many bytes of a log have been read."""


def unwatched(_size: int) -> None:
    """Hear nothing."""


def archive(
    logs: Iterable[Path], season: Path, network: Network, form: str | None, jobs: int, told: Told = unwatched
) -> Iterator[Archived]:
    """Put logs into a season, `jobs` at once, and yield what became of each as it is done.

    `told` hears how many bytes have been read, if that is done in this process.

    Raises UnknownName for a format that is not known, OSError.
    """
    files = list(dict.fromkeys(logs))
    for file in files:
        with file.open("rb") as opened:
            formats.form_of(opened, form)  # complains before anything is done
    (season / BEGUN).mkdir(parents=True, exist_ok=True)
    put = partial(archive_log, season=season, network=network, form=form)
    if min(jobs, len(files)) <= 1:
        yield from map(partial(put, told=told), files)
        return
    with Processes(min(jobs, len(files))) as processes:
        for done in as_completed([processes.submit(put, file) for file in files]):
            yield done.result()


def archive_log(log: Path, season: Path, network: Network, form: str | None = None, told: Told = unwatched) -> Archived:
    """Put one log into a season; `told` hears how many bytes were read. Raises OSError, UnknownName."""
    eds = network.hash
    with log.open("rb") as file:
        run, size = _name(file, eds, form), os.fstat(file.fileno()).st_size
        if tables.file_of(season, tables.RUNS, run).is_file():
            return Archived(str(log), run, True, size)
        file.seek(0)
        begun = season / BEGUN / run
        shutil.rmtree(begun, ignore_errors=True)  # what a run left that was broken off
        try:
            with _Writing(begun, run, network) as writing:
                for batch in batches(file, form):
                    writing.take(batch)
                    told(batch.size)
            row = writing.row() | {
                "log": str(log),
                "format": formats.form_of(file, form)[0],
                "bytes": size,
                "network": " ".join(f"{each.node_id}={each.name}" for each in network.outlines),
                "eds": eds,
            }
            _write_row(begun, run, row)
            _put_in_place(begun, season, run)
        finally:
            shutil.rmtree(begun, ignore_errors=True)
    return Archived(str(log), run, False, size, row["frames"], row["damage"])


def _name(file: BinaryIO, eds: str, form: str | None) -> str:
    digest = hashlib.blake2b(f"{eds} {formats.form_of(file, form)[0]}\n".encode(), digest_size=8)
    while part := file.read(HASHED):
        digest.update(part)
    return digest.hexdigest()


def _write_row(begun: Path, run: str, row: dict[str, Any]) -> None:
    file = tables.file_of(begun, tables.RUNS, run)
    file.parent.mkdir()
    schema = tables.with_metadata(tables.SCHEMAS[tables.RUNS], {})
    pq.write_table(pa.Table.from_pylist([{"run": run} | row], schema), file)


def _put_in_place(begun: Path, season: Path, run: str) -> None:
    """Move a run's files into the season, that of the table `runs` as the last."""
    for file in sorted(begun.glob(f"*/{run}{tables.SUFFIX}"), key=lambda each: each.parent.name == tables.RUNS):
        target = tables.file_of(season, file.parent.name, run)
        target.parent.mkdir(exist_ok=True)
        file.replace(target)


UNREPEATED = ("line", "t", "data")
"""Columns whose values seldom come again: a dictionary of them would be in vain."""


class _Table:
    """One table of a run, written batch after batch; without a row it is there as well, for who asks for it."""

    def __init__(self, file: Path, schema: pa.Schema) -> None:
        file.parent.mkdir(parents=True)
        self._schema = schema
        repeated = [name for name in schema.names if name not in UNREPEATED]
        self._writer = pq.ParquetWriter(file, schema, compression="zstd", compression_level=1, use_dictionary=repeated)
        self.close = self._writer.close

    def write(self, rows: pl.DataFrame) -> None:
        """Write rows with the columns of the schema."""
        if len(rows):
            self._writer.write_table(rows.select(self._schema.names).to_arrow().cast(self._schema))


class _MessageTable:
    """The table of a message: its columns, and where they are written."""

    def __init__(self, binding: Binding, file: Path, answers: str | None) -> None:
        columns = message_columns(binding, tables.PLACE)
        self.checks = defects.MessageChecks(binding)
        self._readable = readable(binding)
        self._columns = [*tables.PLACE, *(each.expression.alias(each.name) for each in columns)]
        self._table = _Table(file, _message_schema(binding, columns, answers))
        self.close = self._table.close

    def take(self, frames: pl.DataFrame) -> None:
        """Decode and write frames of this message."""
        self._table.write(frames.filter(self._readable).select(self._columns))


EMPTY = pl.DataFrame(schema={WORD: pl.UInt64, LENGTH: pl.UInt32})


def _message_schema(binding: Binding, columns: Iterable[FieldColumn], answers: str | None) -> pa.Schema:
    """Return a message's schema: what the expressions give, and what is known of message and columns."""
    made = EMPTY.select(each.expression.alias(each.name) for each in columns).to_arrow().schema
    plain = [(field.name, TYPES.get(str(field.type), field.type)) for field in made]
    said = {
        "message": binding.name,
        "cob_id": f"0x{binding.cob_id:03X}",
        "senders": ", ".join(binding.senders),
        "receivers": ", ".join(binding.receivers),
        "answers": answers or "",
    }
    schema = pa.schema([*tables.PLACE.items(), *plain], said)
    return tables.with_metadata(schema, {each.name: each.metadata for each in columns})


TYPES = {
    "large_string": pa.string(),
    "large_binary": pa.binary(),
    "dictionary<values=large_string, indices=uint32, ordered=0>": tables.PLACE["run"],
}
"""Types for which other programs know a simpler one."""


class _Writing:
    """All tables of a run."""

    def __init__(self, folder: Path, run: str, network: Network) -> None:
        self._run = run
        protocol = Protocol.of_devices(network.outlines, network.catalogue, _left_out)
        self._services = _others(protocol, network)
        file_of = partial(tables.file_of, folder, run=run)
        self._frames, self._damage = (
            _Table(file_of(name), tables.with_metadata(tables.SCHEMAS[name], {}))
            for name in (tables.FRAMES, tables.DAMAGE)
        )
        names = tables.table_names(protocol.names())
        self._messages = {
            each.cob_id: _MessageTable(each, file_of(names[each.name]), dict(network.answers).get(each.name))
            for each in protocol.bindings
        }
        self._stack = ExitStack()
        self._counts = {"frames": 0, "damage": 0}
        self._ends: dict[str, float | None] = {"start": None, "end": None}

    def __enter__(self) -> _Writing:
        closes = [self._frames.close, self._damage.close, *(each.close for each in self._messages.values())]
        for close in closes:
            self._stack.callback(close)
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def row(self) -> dict[str, Any]:
        """Return how much was written, and when it began and ended."""
        return self._counts | self._ends

    def take(self, batch: Batch) -> None:
        """Decode and write a batch."""
        frames = batch.frames.with_columns(
            (pl.col("hex").str.len_bytes() // 2).alias(LENGTH),
            pl.col("hex").str.pad_end(16, "0").str.decode("hex").bin.reinterpret(dtype=pl.UInt64).alias(WORD),
        ).with_columns(self._place())
        wrong = [batch.foreign, *self._of_messages(frames)]
        damage = pl.concat([each.select(FOREIGN.names()).cast(FOREIGN) for each in wrong]).sort("line")
        self._frames.write(frames.with_columns(pl.col("hex").str.decode("hex").alias("data")))
        self._damage.write(damage.with_columns(self._place()).with_columns(pl.col("kind").cast(pl.Categorical)))
        self._count(batch, len(damage))

    def _place(self) -> list[pl.Expr]:
        return [pl.lit(self._run).cast(pl.Categorical).alias("run"), pl.col("channel").cast(pl.Categorical)]

    def _of_messages(self, frames: pl.DataFrame) -> Iterator[pl.DataFrame]:
        """Write the messages; yield what is wrong with them and with all other frames."""
        others = []
        for (cob_id,), some in frames.partition_by("cob_id", as_dict=True).items():
            table = self._messages.get(int(cob_id))
            if table is None:
                others.append(some)
            else:
                table.take(some)
                yield from table.checks.defects(some)
        if others:
            yield from defects.of_others(pl.concat(others), self._services)

    def _count(self, batch: Batch, damaged: int) -> None:
        self._counts["frames"] += len(batch.frames)
        self._counts["damage"] += damaged
        times = [each["t"] for each in (batch.frames, batch.foreign) if len(each)]
        if times:
            begin = self._ends["start"]
            self._ends["start"] = min(each[0] for each in times) if begin is None else begin
            self._ends["end"] = max(each[-1] for each in times)


def _left_out(_: Exception) -> None:
    """Leave out a PDO that does not hold; who loaded the devices has said so."""


def _others(protocol: Protocol, network: Network) -> dict[int, CanopenService]:
    """Return the services that have an identifier which no message has."""
    messages = {each.cob_id for each in protocol.bindings}
    found = services(network.outlines, protocol.catalogue.errors)
    return {cob_id: each for cob_id, each in found.items() if cob_id not in messages}
