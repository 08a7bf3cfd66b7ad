"""Archives logs in a season: each is read once, decoded by columns, and written as Parquet, batch by batch.

Each log is in the season once, complete or not at all. The name of its run is a hash of its bytes and of the EDS files,
so the same log under another name is recognised. Its row in `runs` is written last, after all its other files, so an
interrupted run is done again. Several processes may write to one season at once: each makes its runs in its own folder;
of two runs with the same bytes the last one stays.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cached_property, partial
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq

from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.binding import Binding
from eurobot_od.pdo.kinds import Catalogue
from eurobot_od.season import campaign, columns, packing
from eurobot_od.season import season as tables
from eurobot_od.season.campaign import BLOCK, HERE, Workers
from eurobot_od.season.columns import ENTRY, FOREIGN, FROM_DATA, LENGTH, ColumnBatch, batches
from eurobot_od.season.events import EventsOfLog, LogEvent, no_events
from eurobot_od.support import files
from eurobot_od.support.texts import encodable
from eurobot_od.traffic import formats
from eurobot_od.traffic.dbc import ForeignMessage, FramesOfDevice, only_canopen, read_dbc
from eurobot_od.traffic.decoding import HEARTBEATS, OF_DATES, DecoderSpan, TrackingDecoder
from eurobot_od.traffic.entries import Damage
from eurobot_od.traffic.meaning import Decoder, SdoTransfer
from eurobot_od.traffic.services import EMCY_NAME, HEARTBEAT, NMT, SDO, CanopenService, Fields

VERSION = b"8"
"""Version of the table format; bump it so that logs are archived again."""


class DecodedNetwork(NamedTuple):
    """The devices of the logs: their dictionaries and messages, and by name which message `answers` which.

    `errors` are texts for EMCY error codes by node-ID, `dbc` the files that describe other protocols. `frames` returns
    the non-CANopen frames of a device, `beside` the events that a robot's plug-in knows of a log, with times from its
    first frame; both must be picklable.
    """

    dictionaries: tuple[Dictionary, ...]
    catalogue: Catalogue
    answers: tuple[tuple[str, str], ...] = ()
    errors: Mapping[int, Mapping[int, str]] = {}
    dbc: tuple[str, ...] = ()
    frames: FramesOfDevice = only_canopen
    beside: EventsOfLog = no_events

    def decoder(self) -> Decoder:
        """Return the decoder of the frames; raises LocalError without cantools, FileError."""
        # Invalid PDOs are left out; they were reported when the devices were loaded.
        others = read_dbc(self.dbc)

        return Decoder(
            self.dictionaries, self.catalogue, lambda _: None, self.errors, others=others, frames=self.frames
        )

    def hash(self, decoder: Decoder) -> str:
        """Return a hash of the EDS files with their node-IDs, and of everything else that names frames."""
        digest = hashlib.blake2b(VERSION, digest_size=16)
        # Including node-ID and name, which are not in the file: COB-IDs and tables depend on them.
        for each in self.dictionaries:
            digest.update(f"{each.node_id} {each.name}\n".encode() + each.content)
        named = {cob_id: (each.name, dict(each.units)) for cob_id, each in decoder.others.items()}
        if named or self.errors:
            digest.update(repr((named, self.errors)).encode())
        for file in self.dbc:
            digest.update(files.read_whole(file))
        return digest.hexdigest()


class NetworkDecoding:
    """Converts the frames of a network to rows of tables."""

    def __init__(self, network: DecodedNetwork, shown: Decoder | None = None, eds: str = "") -> None:
        self.decoder = shown or network.decoder()
        self._devices = network
        protocol = self.decoder.protocol
        others = self.decoder.foreign
        names = tables.table_names(dict.fromkeys([*protocol.names(), *(each.name for each in others.values())]))
        answers = dict(network.answers)
        self.eds = eds or network.hash(self.decoder)
        self.network = " ".join(f"{each.node_id}={each.name}" for each in network.dictionaries)
        self.messages: dict[int, MessageDecoding] = {
            cob_id: ForeignDecoding(cob_id, each, names[each.name]) for cob_id, each in others.items()
        }
        self.messages |= {
            each.cob_id: BoundDecoding(each, names[each.name], answers.get(each.name, "")) for each in protocol.bindings
        }
        # A message takes precedence over a service with the same COB-ID.
        found = self.decoder.services
        self.services = {cob_id: each for cob_id, each in found.items() if cob_id not in self.messages}

    def as_shown(self, decoder: Decoder) -> NetworkDecoding:
        """Return the decoding of the same network with another decoder, after its configuration has changed."""
        return NetworkDecoding(self._devices, decoder, self.eds)


EMPTY = pl.DataFrame(schema={columns.WORD: pl.UInt64, LENGTH: pl.UInt32})


NO_COLUMNS = pa.schema([])


class MessageDecoding:
    """Converts the frames of one message to the rows of its `table`."""

    def __init__(self, table: str, schema: pa.Schema, metadata: Mapping[str, Mapping[str, str]]) -> None:
        self.table = table
        self.schema = tables.with_metadata(schema, metadata)
        said_of_columns = repr([(each.name, str(each.type)) for each in self.schema]).encode()
        self.fingerprint = hashlib.blake2b(said_of_columns, digest_size=3).hexdigest()

    def __call__(self, frames: pl.DataFrame) -> tuple[pl.DataFrame, list[pl.DataFrame]]:
        """Return the rows of the readable frames, and the defects of all frames."""
        raise NotImplementedError


class BoundDecoding(MessageDecoding):
    """Converts the frames of a PDO that are long enough."""

    def __init__(self, binding: Binding, table: str, answers: str) -> None:
        place = [each.name for each in tables.PLACE if each is not tables.DATE]
        fields = columns.message_columns(binding, [*place, tables.DATE.name])
        # Polars computes the types of the expressions, from no rows.
        made = EMPTY.select(each.expression.alias(each.name) for each in fields).to_arrow().schema
        said = {"message": binding.name, "cob_id": f"0x{binding.cob_id:03X}", "answers": answers}
        said |= {"senders": ", ".join(binding.senders), "receivers": ", ".join(binding.receivers)}
        super().__init__(table, pa.schema([*tables.PLACE, *made], said), {each.name: each.metadata for each in fields})
        self._checks = columns.MessageChecks(binding)
        self._readable = columns.readable(binding)
        self._columns = [*place, *(each.expression.alias(each.name) for each in fields)]

    def __call__(self, frames: pl.DataFrame) -> tuple[pl.DataFrame, list[pl.DataFrame]]:
        wrong = list(self._checks.defects(frames))
        return (frames.filter(self._readable) if wrong else frames).select(self._columns), wrong


class ForeignDecoding(MessageDecoding):
    """Converts the frames of a message of another protocol."""

    def __init__(self, cob_id: int, message: ForeignMessage, table: str) -> None:
        place = [each.name for each in tables.PLACE]
        self._columns = columns.ForeignColumns(message, place)
        made = pl.DataFrame(schema=self._columns.types).to_arrow().schema
        said = {"message": message.name, "cob_id": f"0x{cob_id:03X}", "senders": ", ".join(message.nodes)}
        super().__init__(table, pa.schema([*tables.PLACE, *made], said), self._columns.metadata)

    def __call__(self, frames: pl.DataFrame) -> tuple[pl.DataFrame, list[pl.DataFrame]]:
        return self._columns.rows(frames).select(*(each for each in self.schema.names if each != tables.DATE.name)), []


# Files

ENCODINGS = {"line": "DELTA_BINARY_PACKED", "t": "BYTE_STREAM_SPLIT", "datetime": "DELTA_BINARY_PACKED"}
"""Encodings of columns that grow from row to row: a third of the size, and faster to compress."""

UNREPEATED = (*ENCODINGS, "data")
"""Columns whose values seldom repeat, so that a dictionary does not pay."""

REMAPPED = "_mapped_"
"""Part of the table name of a message whose mapping has changed, before a hash of its columns.

So one mapping has the same table name in all logs.
"""

MANY = 1 << 16
"""Number of frames of a message that are decoded and written together."""


def writer(file: Path, schema: pa.Schema) -> pq.ParquetWriter:
    """Open a file of a table for writing."""
    return pq.ParquetWriter(
        file,
        schema,
        compression="zstd",
        compression_level=1,
        use_dictionary=[name for name in schema.names if name not in UNREPEATED],
        column_encoding={name: each for name, each in ENCODINGS.items() if name in schema.names},
        write_page_checksum=True,
        write_statistics=list(ENCODINGS),  # sorted, so that a reader can skip most row groups for a time or line
    )


DATE = pl.when(pl.col("t") >= OF_DATES).then((pl.col("t") * 1e6).round().cast(pl.Int64)).cast(pl.Datetime("us", "UTC"))
"""Expression for the date of a time."""


class TableRows:
    """The rows of one table of a run: in memory, and in a file once there are many, or when the run is finished."""

    def __init__(self, file: Path, schema: pa.Schema) -> None:
        self.schema = schema
        self._file = file
        self._kept = list[pa.Table]()
        self._number = 0
        self._writer: pq.ParquetWriter | None = None

    @property
    def is_begun(self) -> bool:
        """Whether some rows are in the file."""
        return self._writer is not None

    def write(self, rows: pl.DataFrame) -> None:
        """Add rows with the columns of the schema."""
        if len(rows):
            arrays = rows.with_columns(DATE.alias(tables.DATE.name)).select(self.schema.names).to_arrow().columns
            self._kept.append(pa.Table.from_arrays(arrays, schema=self.schema))
            self._number += len(rows)
            if self._number >= packing.ROWS:
                self._flush()

    def add(self, other: TableRows) -> None:
        """Add the rows that the same table of another run has in memory."""
        self._kept += other._kept

    def _flush(self) -> None:
        if self._writer is None:
            self._file.parent.mkdir(parents=True, exist_ok=True)
            self._writer = writer(self._file, self.schema)
        if self._kept:
            joined = pa.concat_tables(self._kept).unify_dictionaries()
            self._writer.write_table(joined, row_group_size=packing.ROWS)
        self._kept = []
        self._number = 0

    def close(self, *, is_wanted: bool = True) -> None:
        """Write the rest, and close the file, which exists even without rows; without `is_wanted` only close it."""
        if is_wanted:
            self._flush()
        if self._writer is not None:
            self._writer.close()


OF_SERVICES = {SDO: tables.SDO, EMCY_NAME: tables.EMCY, HEARTBEAT: tables.HEARTBEAT, NMT: tables.NMT}
"""The tables of the services, by the service's name."""


EVENT_ROW = {"t": pl.Float64(), **dict.fromkeys(("kind", "robot", "text"), pl.String())}


def rows_of(table: str) -> pl.Schema:
    """Return the columns of a service's table, without the run and the date."""
    made = pl.from_arrow(tables.SCHEMAS[table].empty_table())
    assert isinstance(made, pl.DataFrame)
    return pl.Schema({name: type_ for name, type_ in made.schema.items() if name not in ("run", tables.DATE.name)})


def of_transfer(transfer: SdoTransfer) -> Fields:
    """Return the row of an SDO transfer, without time and place."""
    said = transfer.fields | {"object": transfer.object, "whole": transfer.is_whole}
    return said | ({"value": str(said["value"])} if "value" in said else {})


def service_rows(service: CanopenService, frames: pl.DataFrame) -> pl.DataFrame:
    """Return the rows of a service's frames, all with one COB-ID, except those with a wrong length."""
    right = frames.filter(pl.col(LENGTH).is_in(service.lengths))
    wanted = rows_of(OF_SERVICES[service.name])
    different = right["data"].unique()  # most data repeat
    types = {"data": pl.Binary()} | {name: type_ for name, type_ in wanted.items() if name not in ENTRY}
    rows = [
        {"data": each} | {name: value for name, value in service.fields(each).items() if name in types}
        for each in different
    ]
    said = pl.DataFrame(rows, types)
    return right.join(said, on="data", maintain_order="left").select("run", *wanted.names())


def _by_channel(frames: pl.DataFrame) -> Iterator[tuple[str, pl.DataFrame]]:
    """Yield the frames of each channel."""
    if frames["channel"].n_unique() < 2:
        yield frames["channel"][0] if len(frames) else "", frames
        return
    for (channel,), some in frames.partition_by("channel", as_dict=True, maintain_order=True).items():
        yield str(channel), some


def _followed(frames: pl.DataFrame, decoder: Decoder, after: int) -> Iterator[tuple[int, float, int, Frame]]:
    """Yield the frames after a line that may change the decoder; of heartbeats only boot-ups."""
    is_state = pl.col("cob_id").is_in([cob_id for cob_id in HEARTBEATS if cob_id in decoder.followed])
    wanted = pl.col("cob_id").is_in(list(decoder.followed)) & (~is_state | (pl.col("data") == bytes(1)))
    some = frames.filter((pl.col("line") > after) & ~pl.col("remote") & wanted)
    for line, time, cob_id, data in some.select("line", "t", "cob_id", "data").iter_rows():
        yield line, time, line, Frame(cob_id, data)


class RunTables:
    """The tables of one run, or of several small ones; those with many rows are in files in a folder.

    Frames are collected before they are decoded and written, as few cost as much as many: in `_plain` those whose
    mapping is that of the files, in `_kept` those of each message.
    """

    def __init__(self, folder: Path, run: str, decoding: NetworkDecoding) -> None:
        self.folder = folder
        self._decoding = decoding
        self.run = run
        self._constant = pl.lit(run).cast(pl.Categorical).alias("run")
        self.tables: dict[str, TableRows] = {}
        self._frames, self._damage, self._events, *services = (
            self._table(name, tables.with_metadata(tables.SCHEMAS[name], {}))
            for name in (tables.FRAMES, tables.DAMAGE, tables.EVENTS, *OF_SERVICES.values())
        )
        self._services = dict(zip(OF_SERVICES, services))
        self._said: dict[str, list[pl.DataFrame]] = {name: [] for name in OF_SERVICES}
        self._transfers: list[Fields] = []
        self._heard: dict[tuple[str, int], Fields] = {}
        self._kept: dict[MessageDecoding, list[pl.DataFrame]] = {each: [] for each in decoding.messages.values()}
        self._plain, self._wrong = list[pl.DataFrame](), list[pl.DataFrame]()
        self._now: dict[str, NetworkDecoding] = {}
        self._following = TrackingDecoder(decoding.decoder)
        self.frames = 0
        self.damaged = Counter[str]()
        self._ends: dict[str, float | None] = {"start": None, "end": None}

    def _table(self, name: str, schema: pa.Schema) -> TableRows:
        if name not in self.tables:
            self.tables[name] = TableRows(self.folder / f"{name}{tables.SUFFIX}", schema)
        return self.tables[name]

    def _of_message(self, decoding: MessageDecoding) -> TableRows:
        """Return the table of a message; the first mapping with rows has the message's name."""
        name = decoding.table
        known = self.tables.get(decoding.table)
        if known is not None and not known.schema.equals(decoding.schema):
            name = f"{name}{REMAPPED}{decoding.fingerprint}"
        return self._table(name, decoding.schema)

    def __enter__(self) -> RunTables:
        return self

    def __exit__(self, error: type[BaseException] | None, *_: object) -> None:
        if error is not None:
            self.close(is_wanted=False)
            return
        for channel, last, transfer in self._following.unfinished():
            assert isinstance(last.raw, Frame)
            self._transfers.append(self._heard[channel, last.raw.cob_id] | of_transfer(transfer))
        self._keep_transfers()
        if self._now or not self.is_small:
            self._flush()

    def _flush(self) -> None:
        """Decode and write the collected frames."""
        self._wrong += self._of_plain()
        self._wrong += [wrong for each in self._kept for wrong in self._flushed(each)]
        self._write_services()
        self._write_damage()
        for message in self._decoding.messages.values():
            if message.table not in self.tables:  # a table without rows exists, too, for queries
                self._of_message(message)

    def join(self, others: Iterable[RunTables]) -> None:
        """Add other small runs with the same `eds`."""
        for other in others:
            self._plain += other._plain
            self._wrong += other._wrong
            for name, parts in other._said.items():
                self._said[name] += parts
            self.damaged += other.damaged
            for name, table in other.tables.items():
                self.tables[name].add(table)

    def close(self, *, is_wanted: bool = True) -> None:
        """Close all files, after writing the rest if it is wanted."""
        if is_wanted:
            self._flush()
        for each in self.tables.values():
            each.close(is_wanted=is_wanted)

    @property
    def is_small(self) -> bool:
        """Whether all rows are in memory."""
        return not any(each.is_begun for each in self.tables.values())

    @property
    def eds(self) -> str:
        """Hash of the EDS files and of changed mappings: runs with the same hash have the same columns."""
        said = {**tables.SCHEMAS, **{each.table: each.schema for each in self._decoding.messages.values()}}
        found = {name: each.schema for name, each in self.tables.items()}
        others = sorted(
            (name, str(each)) for name, each in found.items() if not each.equals(said.get(name, NO_COLUMNS))
        )
        if not others:
            return self._decoding.eds
        return hashlib.blake2b(f"{self._decoding.eds} {others}".encode(), digest_size=16).hexdigest()

    def notes(self) -> tuple[str, ...]:
        """Return what the log does not show."""
        return tuple(self._following.notes())

    def row(self) -> dict[str, Any]:
        """Return the run's row without the number of defects: network, number of frames, start and end."""
        start = self._ends["start"]
        date = None if start is None or start < OF_DATES else datetime.fromtimestamp(start, UTC)
        known = {"network": self._decoding.network, "eds": self.eds, tables.DATE.name: date}
        return known | {"frames": self.frames} | self._ends

    def take(self, batch: ColumnBatch) -> None:
        """Decode and write a batch."""
        frames = batch.frames.with_columns(self._constant, *FROM_DATA)
        self._frames.write(frames)
        # CAN FD frames are no damage, but other traffic.
        foreign = batch.foreign.filter(pl.col("kind") != Damage.FD.value)
        classic = frames.filter(~pl.col("fd")) if frames["fd"].any() else frames
        self._wrong.append(foreign.with_columns(self._constant))
        self._wrong += self._decoded(classic)
        if not self._plain:
            self._keep_transfers()
            self._write_services()
            self._write_damage()
        self.frames += len(batch.frames)
        times = [each["t"] for each in (batch.frames, batch.foreign) if len(each)]
        if times:
            begin = self._ends["start"]
            self._ends["start"] = min(each[0] for each in times) if begin is None else begin
            self._ends["end"] = max(each[-1] for each in times)

    def add_events(self, events: Sequence[LogEvent]) -> None:
        """Add the events of the log that its frames do not show, once all frames are taken."""
        rows = pl.DataFrame(events, {**EVENT_ROW, "points": pl.Int64}, orient="row").with_row_index("line", 1)
        start = pl.col("t") + (self._ends["start"] or 0.0)
        self._events.write(rows.with_columns(self._constant, start, channel=pl.lit("")))

    def _decoded(self, frames: pl.DataFrame) -> Iterator[pl.DataFrame]:
        """Write the messages by the current configuration of the devices; yield all defects."""
        for channel, some in _by_channel(frames):
            for span in self._following.spans(channel, partial(_followed, some)):
                yield from self._of_transfers(channel, span)
                last = span.last
                wanted = pl.col("line") > span.after
                if last is not None:
                    wanted &= pl.col("line") <= last
                part = some if last is None and span.after < 0 else some.filter(wanted)
                decoding = self._decoding_of(channel, span)
                if decoding is self._decoding:
                    self._plain.append(part)
                if decoding is not self._decoding or sum(map(len, self._plain)) >= packing.ROWS:
                    yield from self._of_plain()
                if decoding is not self._decoding:
                    yield from self._of_messages(part, decoding)

    def _of_plain(self) -> Iterator[pl.DataFrame]:
        """Write the messages with the mapping of the files; yield all defects."""
        if self._plain:
            frames = pl.concat(self._plain)
            self._plain.clear()
            yield from self._of_messages(frames, self._decoding)

    def _decoding_of(self, channel: str, span: DecoderSpan) -> NetworkDecoding:
        decoding = self._now.get(channel, self._decoding)
        if decoding.decoder is not span.decoder:
            decoding = self._now[channel] = self._decoding.as_shown(span.decoder)
            self._kept |= {each: [] for each in decoding.messages.values()}
        return decoding

    def _of_transfers(self, channel: str, span: DecoderSpan) -> Iterator[pl.DataFrame]:
        """Collect the SDO transfers of a span; yield the frames of them that the log lacks."""
        lacking: list[Fields] = []
        for line, (time, said) in span.followed.items():
            place = {"line": line, "t": time, "channel": channel}
            if said.name == SDO:
                self._heard[channel, said.raw[0]] = place  # type: ignore[index]
            if said.transfer:
                self._transfers.append(place | of_transfer(said.transfer))
            lost = (each.text for each in said.defects if each.damage is Damage.INCOMPLETE)
            lacking += [place | {"kind": Damage.INCOMPLETE.value, "text": text} for text in lost]
        yield pl.DataFrame(lacking, FOREIGN).with_columns(self._constant)

    def _of_messages(self, frames: pl.DataFrame, decoding: NetworkDecoding) -> Iterator[pl.DataFrame]:
        """Write the messages; yield the defects of these and of all other frames."""
        others = []
        remote = frames["remote"]
        if remote.any():  # a remote frame has no data to decode
            others.append(frames.filter(remote))
            frames = frames.filter(~remote)
        for (cob_id,), some in frames.partition_by("cob_id", as_dict=True).items():
            if message := decoding.messages.get(int(cob_id)):
                self._kept[message].append(some)
                # A batch has a few frames of each message; writing them at once would make many small row groups, which
                # are slow to read.
                if sum(map(len, self._kept[message])) >= MANY:
                    yield from self._flushed(message)
            else:
                others.append(some)
                service = decoding.services.get(int(cob_id))
                if service and service.name in self._said and service.name != SDO:
                    self._said[service.name].append(service_rows(service, some))
        if others:
            unmapped = decoding.decoder.unmapped
            yield from columns.of_others(pl.concat(others), decoding.services, decoding.messages, unmapped)

    def _flushed(self, message: MessageDecoding) -> list[pl.DataFrame]:
        """Decode and write the collected frames of a message; return their defects."""
        kept, self._kept[message] = self._kept[message], []
        if not kept:
            return []
        rows, wrong = message(pl.concat(kept))
        self._of_message(message).write(rows)
        return wrong

    def _keep_transfers(self) -> None:
        rows = pl.DataFrame(self._transfers, rows_of(tables.SDO))
        self._said[SDO].append(rows.select(self._constant, pl.all()))
        self._transfers.clear()

    def _write_services(self) -> None:
        for name, parts in self._said.items():
            if parts:
                self._services[name].write(pl.concat(parts).sort("run", "line"))
                parts.clear()

    def _write_damage(self) -> None:
        parts = [each.select("run", *FOREIGN.names()).cast(FOREIGN) for each in self._wrong if len(each)]
        self._wrong.clear()
        if parts:
            damage = pl.concat(parts).sort("run", "line")  # they are in the order of messages
            self._damage.write(damage.with_columns(pl.col("kind").cast(pl.Categorical)))
            self.damaged.update(damage["run"].cast(pl.String))


TOGETHER = 1 << 20
"""Size of small logs that are archived together, in bytes: one or two seconds of work, the loss if killed."""

PACKED = 16
"""Number of groups of logs after which their files are packed; also at the end."""

HASHED = 1 << 20
BEGUN = ".begun"
"""Folder of a season in which runs are made."""


class Archived(NamedTuple):
    """The result for one log: its `run`, whether it was `known` before, its contents, and what it does not show."""

    log: str
    run: str
    known: bool
    size: int
    frames: int = 0
    damage: int = 0
    notes: tuple[str, ...] = ()


def _archived(log: ReadLog, damaged: int) -> Archived:
    """Return the result for a log."""
    name = str(log.log)
    size = log.file["bytes"]
    if log.tables is None:
        return Archived(name, log.run, True, size, notes=tuple(log.notes))
    return Archived(name, log.run, False, size, log.tables.frames, damaged, (*log.notes, *log.tables.notes()))


Progress = Callable[[int], object]
"""Called with the number of bytes of a log that have been read."""


def unwatched(_size: int) -> None:
    """Ignore progress."""


def archive(
    logs: Iterable[Path],
    season: Path,
    network: DecodedNetwork,
    form: str | None = None,
    workers: Workers = HERE,
    progress: Progress = unwatched,
) -> Iterator[Archived]:
    """Archive logs in a season, in parallel if there are workers, and yield their results in order.

    `progress` is called with the size of each part read, if that happens in this process.

    Raises UnknownName for an unknown format, FileError for a log that cannot be opened, OSError.
    """
    tables.checked(season)
    # Two workers must not archive the same log at once.
    each_once = list(dict.fromkeys(logs))
    for log in each_once:
        with files.opened(log) as opened:
            formats.form_of(opened, form)  # raises before anything is done
    # Another process cannot move a progress bar on this terminal.
    archiver = Archiver(season, network, form, unwatched if workers.executor else progress)
    groups = list(_together(each_once, workers.number))
    with _begun(season / BEGUN):
        for number, some in enumerate(campaign.run(archiver.put, groups, workers._replace(block=BLOCK)), 1):
            yield from some
            if number % PACKED == 0 or number == len(groups):
                # Files of this call are joined at once, with those of earlier calls only when there are many.
                packing.pack(season, season / BEGUN, writer, packing.MANY if number == 1 else 2)


def _together(logs: Sequence[Path], workers: int) -> Iterator[tuple[Path, ...]]:
    """Yield logs in groups of TOGETHER bytes, or smaller ones if there are several workers."""
    sizes = [log.stat().st_size for log in logs]
    most = min(TOGETHER, sum(sizes) // workers)
    some = list[Path]()
    size = 0
    for log, added in zip(logs, sizes):
        if some and size + added > most:
            yield tuple(some)
            some = []
            size = 0
        some.append(log)
        size += added
    if some:
        yield tuple(some)


@contextmanager
def _begun(folder: Path) -> Iterator[None]:
    """Provide the folder in which runs are made; leftovers of interrupted runs are removed if no program uses it.

    A program that uses it holds a lock, which the operating system releases with the program. Without POSIX, or on a
    file system without locks, leftovers stay.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if os.name != "posix":
        yield
        return
    from fcntl import LOCK_EX, LOCK_NB, LOCK_SH, flock  # not on Windows

    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            flock(descriptor, LOCK_EX | LOCK_NB)  # granted only if no other program uses it
            for left in folder.iterdir():
                shutil.rmtree(left, ignore_errors=True)
        with suppress(OSError):
            flock(descriptor, LOCK_SH)  # shared by all programs that use it, so that none removes the files of others
        yield
    finally:
        os.close(descriptor)


class ReadLog(NamedTuple):
    """A log that was read: its run, its file's data, its tables, None if it is in the season already, and notes."""

    log: Path
    run: str
    file: dict[str, Any]
    tables: RunTables | None = None
    notes: Sequence[str] = ()


@dataclass(frozen=True)
class Archiver:
    """Archives logs in a season; `progress` is called with the size of each part read."""

    season: Path
    network: DecodedNetwork
    form: str | None = None
    progress: Progress = unwatched

    @cached_property
    def _decoding(self) -> NetworkDecoding:
        """The decoding of all logs, most of the work for a short one; made once per block of logs."""
        return NetworkDecoding(self.network)

    def __call__(self, log: Path) -> Archived:
        """Archive one log; raises OSError, UnknownName."""
        (archived,) = self.put([log])
        return archived

    def put(self, logs: Sequence[Path]) -> list[Archived]:
        """Archive several logs, small ones of a network in common files; raises as for one.

        If a log cannot be read, those before it are archived.
        """
        # A folder of its own, as another process may archive the same log.
        begun = self.season / BEGUN / secrets.token_hex(8)
        read = list[ReadLog]()
        damaged = Counter[str]()
        try:
            for log in logs:
                read.append(self._read_log(log, begun))
        finally:
            try:
                damaged += self._place(read)
            finally:
                shutil.rmtree(begun, ignore_errors=True)
        return [_archived(each, damaged[each.run]) for each in read]

    def _read_log(self, log: Path, begun: Path) -> ReadLog:
        """Read a log, unless it is in the season."""
        with files.opened(log) as file:
            form = formats.form_of(file, self.form)
            size = os.fstat(file.fileno()).st_size
            # The hash includes the EDS files, which decide the tables. It includes the log's bytes, not its name or
            # date, so that a copy is the same run.
            digest = hashlib.blake2b(f"{self._decoding.eds} {form}\n".encode(), digest_size=8)
            while part := file.read(HASHED):
                digest.update(part)
            events, notes = self._events_of(log)
            digest.update(repr(events).encode() if events else b"")
            run = digest.hexdigest()
            known = {"run": run, "log": encodable(str(log)), "format": form, "bytes": size}
            # If one table is missing or damaged, the log is archived again.
            if run in self._known or self._is_there(run):
                return ReadLog(log, run, known, None, notes)
            file.seek(0)
            with files.naming(self.season), RunTables(begun / run, run, self._decoding) as made:
                for batch in self._read(file):
                    made.take(batch)
                    self.progress(batch.size)
                made.add_events(events)
        self._known.add(run)
        return ReadLog(log, run, known, made, notes)

    def _events_of(self, log: Path) -> tuple[Sequence[LogEvent], list[str]]:
        """Return the events of a log, and a note if their file is damaged."""
        try:
            return self.network.beside(log), []
        except LocalError as error:
            return [], [str(error)]

    def _place(self, read: Sequence[ReadLog]) -> Counter[str]:
        """Move the read logs into the season; return the number of defects of each run."""
        groups = defaultdict[str, list[ReadLog]](list)
        damaged = Counter[str]()
        for each in read:
            if each.tables is not None:
                groups[each.tables.eds if each.tables.is_small else each.run].append(each)
        with files.naming(self.season):
            for some in groups.values():
                damaged += self._put(some)
        return damaged

    def _put(self, logs: Sequence[ReadLog]) -> Counter[str]:
        """Move logs with the same tables into common files.

        Their rows of `runs`, with the seals of the others, come last.
        """
        made = [each.tables for each in logs if each.tables is not None]
        first, *others = made
        rows = [each.file | tables_.row() for each, tables_ in zip(logs, made)]
        first.join(others)
        first.close()
        schemas = {name: each.schema for name, each in first.tables.items()}
        tables.write_fields(self.season, first.eds, schemas)
        seals = {each.stem: tables.Seal.of(each) for each in first.folder.iterdir()}
        schema = tables.with_metadata(tables.SCHEMAS[tables.RUNS], {}).with_metadata(
            {tables.SEALS: tables.seals_text(seals)}
        )
        rows = [each | {"damage": first.damaged[each["run"]]} for each in rows]
        target = first.folder / f"{tables.RUNS}{tables.SUFFIX}"
        pq.write_table(pa.Table.from_pylist(rows, schema), target, write_page_checksum=True)
        name = tables.pack_name(self.season, (each.run for each in logs)) if others else first.run
        packing.put_in_place(first.folder, self.season, name)
        return first.damaged

    def _is_there(self, part: str) -> bool:
        """Return whether all files of a part exist and none is damaged."""
        names = (*tables.SCHEMAS, *(each.table for each in self._decoding.messages.values()))
        there = tables.ArchivedRun.read(tables.file_of(self.season, tables.RUNS, part))
        return there is not None and all(
            name in there.seals and tables.is_sound(tables.file_of(self.season, name, part), there.seals[name])
            for name in {*names, *there.seals} - {tables.RUNS}
        )

    @cached_property
    def _known(self) -> set[str]:
        """The logs in undamaged packs, as found before the first log was archived, and those archived since."""
        found = (self.season / tables.RUNS).glob(f"{tables.PACK}*{tables.SUFFIX}")
        packs = (tables.ArchivedRun.read(file) for file in sorted(found) if self._is_there(file.stem))
        return {run for each in packs if each for run in each.row["run"].to_pylist()}

    def _read(self, file: BinaryIO) -> Iterator[ColumnBatch]:
        with files.naming(Path(file.name)):
            yield from batches(file, self.form)
