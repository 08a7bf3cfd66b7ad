"""An archived season: its tables as lazy frames, and SQL over them.

    season = Season.open("SEASON")
    season.frames("goto_xy").filter(pl.col("speed") > 50).collect()
    season.sql("SELECT message, count(*) FROM frames JOIN messages USING (cob_id) GROUP BY message")

Nothing is written, and nothing is read before it is needed. Tables are folders of Parquet files, one file per log. Each
table starts with `run`, `line`, `t` and `channel`: the log, the line in it, the time in s by the log's clock, and the
channel.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import time
import zlib
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cached_property, partial
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.season.results import SETTINGS, verified
from eurobot_od.support import texts
from eurobot_od.support.files import UNREADABLE, write_whole
from eurobot_od.support.texts import encodable, first_free

if TYPE_CHECKING:
    import duckdb

RUNS, FRAMES, DAMAGE = "runs", "frames", "damage"
"""Tables of the logs, of all frames, and of all defects, with log and line."""

SDO, EMCY, HEARTBEAT, NMT = "sdo", "emcy", "heartbeat", "nmt"
"""Tables of SDO transfers, and of the frames of the other services."""

EVENTS = "events"
"""Table of what a robot's plug-in knows of a log besides its frames. Each further table is of a message."""

TEXT, OCTETS, WORD = pa.large_string(), pa.large_binary(), pa.dictionary(pa.uint32(), pa.large_string())
"""Types as Polars writes them; WORD is for texts that repeat."""


def _never_null(**types: pa.DataType) -> list[pa.Field]:
    return [pa.field(name, type_, nullable=False) for name, type_ in types.items()]


DATE = pa.field("datetime", pa.timestamp("us", tz="UTC"))
PLACE = [*_never_null(run=WORD, line=pa.uint64(), t=pa.float64()), DATE, *_never_null(channel=WORD)]
SAID = {
    "run": "the log, a row of the table runs",
    "line": "line of the log, or number of the entry where there are no lines",
    "t": "time by the log's clock",
    "datetime": "the date of t; null if the log's clock has none",
    "channel": "channel as the log names it",
    "cob_id": "identifier; one of 29 bits has bit 29 set, as in a COB-ID",
    "remote": "whether it is a remote frame, whose data is zeros of the length that it asks for",
    "fd": "whether it is a frame of CAN FD",
    "brs": "whether the data of a frame of CAN FD came at a higher bit rate; null if the log does not say it",
    "node": "node-ID; of NMT 0 for all nodes",
    "seconds": "from the first frame of the transfer to its last",
    "value": "the value by the object's type; null if that is not known, or the value is bytes",
    "content": "the bytes that were read or written; null if not all of them came, or more than 4096",
    "size": "how many bytes came",
    "whole": "whether the log has the end of the transfer",
    "abort": "abort code; null if the transfer was not aborted",
    "robot": "the robot of the event",
    "points": "points that the event is worth; null if it is not about points",
}
UNITS = {"t": "s", "seconds": "s"}

SUFFIX = ".parquet"

TYPES: Mapping[str, pa.DataType] = {
    name: type_
    for type_, names in (
        (pa.uint8(), ("node", "subindex", "register")),
        (pa.uint16(), ("index", "code")),
        (pa.uint32(), ("size", "abort")),
        (pa.int64(), ("bytes", "frames", "damage", "points")),
        (pa.float64(), ("start", "end", "seconds")),
        (DATE.type, ("datetime",)),
        (pa.string(), ("run", "log", "format", "network", "eds")),
        (pa.bool_(), ("whole",)),
        (WORD, ("kind", "direction", "how", "state", "command", "robot")),
        (TEXT, ("text", "object", "value", "abort_name", "words")),
        (OCTETS, ("content", "info")),
    )
    for name in names
}
"""The types of the columns of the logs, damage and services."""


def _schema(*names: str, place: Iterable[pa.Field] = PLACE) -> pa.Schema:
    return pa.schema([*place, *((name, TYPES[name]) for name in names)])


SCHEMAS: Mapping[str, pa.Schema] = {
    RUNS: _schema(
        *("run", "log", "format", "bytes", "start", "end", "datetime", "frames", "damage", "network", "eds"), place=()
    ),
    FRAMES: pa.schema(
        [*PLACE, *_never_null(cob_id=pa.uint32(), data=OCTETS, remote=pa.bool_(), fd=pa.bool_()), ("brs", pa.bool_())]
    ),
    DAMAGE: _schema("kind", "text"),
    SDO: _schema(
        *("node", "direction", "index", "subindex", "object", "value", "content", "size", "how", "seconds", "whole"),
        *("abort", "abort_name"),
    ),
    EMCY: _schema("node", "code", "register", "words", "info"),
    HEARTBEAT: _schema("node", "state"),
    NMT: _schema("node", "command"),
    EVENTS: _schema("kind", "robot", "text", "points"),
}


def table_names(messages: Iterable[str]) -> dict[str, str]:
    """Return a different table name for each message, such as `goto_xy` for `Goto XY`."""
    taken = [*SCHEMAS]
    names: dict[str, str] = {}
    for message in messages:
        plain = re.sub(r"\W+", "_", message.lower(), flags=re.ASCII).strip("_") or "message"
        # SQL needs quotes for a name that begins with a digit.
        names[message] = first_free(f"message_{plain}" if plain[0].isdigit() else plain, taken)
        taken.append(names[message])
    return names


def file_of(season: Path, table: str, run: str) -> Path:
    """Return the file with a run's rows of a table."""
    return season / table / f"{run}{SUFFIX}"


def with_metadata(schema: pa.Schema, said: Mapping[str, Mapping[str, str]]) -> pa.Schema:
    """Return a schema with descriptions of its columns: units, meaning of null, allowed values."""
    known = {name: {"meaning": text} | ({"unit": UNITS[name]} if name in UNITS else {}) for name, text in SAID.items()}
    known |= {name: dict(texts) for name, texts in said.items()}
    return pa.schema([field.with_metadata(known.get(field.name)) for field in schema], schema.metadata)


MAGIC = b"PAR1"
"""First and last bytes of a Parquet file; the length of its footer, in 4 bytes, is before the last ones."""


SEALS = b"seals"
"""Metadata key in a run's file of `runs`: the seals of its other files by table, as JSON after its CRC-32."""

PIECE = 1 << 20
"""Number of bytes that are read at once."""


class Seal(NamedTuple):
    """CRC-32 of a Parquet file's footer, and of the rest, its pages of rows.

    Parquet has checksums of pages, but none of the footer, and neither DuckDB nor Polars verifies any.
    """

    footer: int
    pages: int

    @classmethod
    def of(cls, file: Path) -> Seal:
        """Compute the seal of a file; raises OSError, and ValueError if it is not a complete Parquet file."""
        footer = footer_of(file)
        pages = 0
        left = file.stat().st_size - len(footer)
        with file.open("rb") as opened:
            while left > 0 and (piece := opened.read(min(PIECE, left))):
                pages, left = zlib.crc32(piece, pages), left - len(piece)
        return cls(zlib.crc32(footer), pages)


def seals_text(seals: Mapping[str, Seal]) -> str:
    """Return seals by table as text, for `seals_of`."""
    text = json.dumps(seals)
    return f"{zlib.crc32(text.encode()):08x} {text}"


def seals_of(text: str) -> dict[str, Seal]:
    """Parse a text with seals; raises ValueError, TypeError or AttributeError if it is damaged."""
    crc, _, rest = text.partition(" ")
    if text.startswith("{"):  # of an earlier version, without a CRC
        rest = text
    elif int(crc, 16) != zlib.crc32(rest.encode()):
        raise ValueError("damaged")
    return {table: Seal(*seal) for table, seal in json.loads(rest).items()}


def footer_of(file: Path) -> bytes:
    """Return a Parquet file's footer; raises OSError, and ValueError if it is truncated, overwritten, or a pipe."""
    if not file.is_file():  # opening a pipe would wait for its writer
        raise ValueError("not a file")
    with file.open("rb") as opened:
        head = opened.read(len(MAGIC))
        size = opened.seek(0, os.SEEK_END)
        opened.seek(max(0, size - 8))
        length = int.from_bytes(opened.read(4), "little")
        end = opened.read(4)
        if not head == end == MAGIC or length > size - 12:  # without the two marks and this length
            raise ValueError("not whole")
        opened.seek(size - 8 - length)
        return opened.read()


def is_described(file: Path, seal: Seal | None) -> bool:
    """Return whether a Parquet file has the footer of its seal; without a seal, whether it has a footer."""
    try:
        footer = footer_of(file)
    except (OSError, ValueError):
        return False
    return seal is None or zlib.crc32(footer) == seal.footer


def is_sound(file: Path, seal: Seal | None) -> bool:
    """Return whether a Parquet file matches its seal, or has none; reads the whole file."""
    try:
        return seal is None or Seal.of(file) == seal
    except (OSError, ValueError):
        return False


PACK = "pack-"
"""Prefix of the file names of several logs; the files of a single log have the name of its run."""


def pack_name(season: Path, runs: Iterable[str]) -> str:
    """Return the name of a new pack of some runs; later packs sort after earlier ones."""
    before = [int(each.stem.split("-")[1]) for each in (season / RUNS).glob(f"{PACK}*{SUFFIX}")]
    digest = hashlib.blake2b("\n".join(runs).encode(), digest_size=8).hexdigest()
    return f"{PACK}{max(before, default=0) + 1:04}-{digest}"


class ArchivedRun(NamedTuple):
    """A log in a season, or a pack of logs: its rows of `runs`, and the seals of its files by table, if any."""

    row: pa.Table
    seals: Mapping[str, Seal]

    @classmethod
    def read(cls, file: Path) -> ArchivedRun | None:
        """Read a file of `runs` and verify its checksums; return None if it is damaged."""
        row = verified(file)
        schema = SCHEMAS[RUNS]
        if row is None or not len(row):
            return None
        try:
            seals = seals_of((row.schema.metadata or {}).get(SEALS, b"{}").decode())
            if DATE.name not in row.column_names:  # of an earlier version
                row = row.append_column(DATE, pa.nulls(len(row), DATE.type))
            rows = pa.Table.from_arrays(row.select(schema.names).columns, schema=schema)
            return cls(rows, seals)
        except (*UNREADABLE, TypeError, AttributeError):  # damaged: not as `archive` writes them
            return None


FIELDS = "fields"
"""Table of the descriptions of all columns, with one file per hash of EDS files."""

FIELD_COLUMNS = pa.schema(
    [(name, pa.string()) for name in ("eds", "table", "field", "unit", "allowed", "words", "null_is", "meaning")]
)


def write_fields(season: Path, eds: str, schemas: Mapping[str, pa.Schema]) -> None:
    """Write the descriptions of all columns, if they do not exist yet; raises OSError."""
    target = file_of(season, FIELDS, eds)
    if verified(target, FIELD_COLUMNS) is not None:
        return
    rows = []
    for table, schema in schemas.items():
        for each in schema:
            said = {key.decode(): text.decode() for key, text in (each.metadata or {}).items()}
            rows.append({"eds": eds, "table": table, "field": each.name, "null_is": said.pop("null", None), **said})
    target.parent.mkdir(exist_ok=True)
    sink = pa.BufferOutputStream()
    pq.write_table(pa.Table.from_pylist(rows, FIELD_COLUMNS), sink, compression="zstd", write_page_checksum=True)
    write_whole(target, sink.getvalue().to_pybytes())


MESSAGES = "messages"
"""Table of the descriptions of the messages' tables, made from their files."""

KNOWN = ("message", "cob_id", "senders", "receivers", "answers")


INTERVAL = 0.1
"""Time between two reports of progress, in s."""

Progress = Callable[[int], object]
"""Called with how much of a query is done, in percent."""


MOST_ROWS = 10_000_000
"""Maximum number of rows of a query: they have to fit in memory, once more as text."""


class SqlError(LocalError):
    """A query that DuckDB rejects."""


def _told(error: str) -> str:
    """Return what DuckDB says of a query, without the lines that repeat it with a mark."""
    first, *others = error.splitlines()
    near = next((each for each in others if each.startswith("Candidate bindings:")), "").partition(":")[2].strip()
    quoted = f"; a text takes single quotes: '{name[1]}'" if (name := COLUMN.search(first)) else ""
    return first + (f"; columns like it: {near}" if near else "") + quoted


COLUMN = re.compile(r'Referenced column "(\w+)" not found')
"""What DuckDB says of an unknown column, or of a text in the wrong quotes."""


class Season:
    """The Parquet files of a season, by table, without `damaged` ones.

    Its `parts` are logs, or packs of several, by the name of their files. If a log is in two parts, as after it was
    archived again or packing was interrupted, its rows in one of them are `hidden`.

    Raises LocalError for a folder without logs.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = checked(folder)
        self.damaged: list[Path] = []
        # Files without a row in `runs` are just being moved here, or this was interrupted.
        self.parts = {
            file.stem: run for file in _files(folder / RUNS) if (run := self._undamaged(file, ArchivedRun.read(file)))
        }
        self.hidden = _hidden(self.parts)
        if not self.parts:
            if (folder / SETTINGS).is_file():
                what = f"ask {folder}/*.parquet by DuckDB or Polars (docs/season.md)"
                raise LocalError(f"{folder} is not a season: it holds a campaign; {what}")
            why = ", ".join(f"{each} is damaged" for each in self.damaged) or "no log is archived in it"
            raise LocalError(f"{folder} is not a season: {why}; `archive` makes one")
        self._verified = {RUNS}
        self.files: dict[str, list[Path]] = {}
        for table in sorted(folder.iterdir()):
            if table.is_dir() and not table.name.startswith("."):  # `archive` makes runs in a hidden folder
                self._add(table.name, _files(table), is_described)

    def _undamaged(self, file: Path, found: Any) -> Any:
        """Return `found`; if it is nothing, note that the file is damaged."""
        if not found:
            self.damaged.append(file)
        return found

    def _add(self, table: str, files: Iterable[Path], is_right: Callable[[Path, Seal | None], bool]) -> None:
        """Add the valid files of a table; a table without any does not exist."""
        known = (file for file in files if file.stem in self.parts)
        seals = ((file, self.parts[file.stem].seals.get(table)) for file in known)
        self.files[table] = [file for file, seal in seals if self._undamaged(file, is_right(file, seal))]
        if not self.files[table]:
            del self.files[table]

    def _verify(self, table: str) -> None:
        """Remove the files of a table whose rows are damaged; done once, when its rows are first read."""
        if table not in self._verified:
            self._verified.add(table)
            self._add(table, self.files[table], is_sound)

    @classmethod
    def open(cls, folder: str | Path) -> Season:
        """Open a season; raises LocalError if the folder is none."""
        return cls(Path(folder))

    def frames(self, table: str) -> pl.LazyFrame:
        """Return a table, of which only checksums are read now; raises UnknownName, LocalError.

        A column that only some logs have, by their EDS files, is null for the others.
        """
        if table == FIELDS:
            return self.fields.lazy()
        if table in self.files:
            self._verify(table)
        self._check_left(table)
        if table not in self.files:
            raise UnknownName("table", table, self.files)
        if table == RUNS:
            return pl.DataFrame(self._rows).lazy()
        # Not patterns, as a folder's name may contain a `*`.
        found = (pl.scan_parquet(files, glob=False).filter(self._is_shown(files[0])) for files in self._alike(table))
        return pl.concat(found, how="diagonal")

    def _is_shown(self, file: Path) -> pl.Expr:
        hidden = self.hidden.get(file.stem)
        return ~pl.col("run").cast(pl.String).is_in(hidden) if hidden else pl.lit(value=True)

    def _check_left(self, table: str) -> None:
        """Check that not all files of a table are damaged; raises LocalError."""
        damaged = [each for each in self.damaged if each.parent.name == table]
        if table not in self.files and damaged:
            named = ", ".join(map(str, damaged))
            raise LocalError(
                f"table {table}: {named} is damaged, and there is no other file of it; `archive` the log again"
            )

    def _alike(self, table: str) -> list[list[Path]]:
        """Return the files of a table in groups with the same columns and hidden rows."""
        groups: dict[tuple[str, ...], list[Path]] = {}
        for file in self.files[table]:
            groups.setdefault((self._eds(file), *self.hidden.get(file.stem, ())), []).append(file)
        return list(groups.values())

    def rows_of(self, name: str) -> pa.Table:
        """Return the rows of `runs` of a part, without hidden ones."""
        rows = self.parts[name].row
        hidden = self.hidden.get(name)
        return rows.filter([run not in hidden for run in rows["run"].to_pylist()]) if hidden else rows

    @property
    def _rows(self) -> pa.Table:
        """The table `runs`, whose files were verified when they were read."""
        return pa.concat_tables(map(self.rows_of, self.parts))

    def _eds(self, file: Path) -> str:
        """Return the hash of the EDS files of a file's logs."""
        return str(self.parts[file.stem].row["eds"][0])

    @cached_property
    def messages(self) -> pl.DataFrame:
        """Descriptions of the messages' tables: table, network, message, COB-ID, nodes, and the message it answers."""
        rows = []
        for table in self.files.keys() - SCHEMAS.keys():
            for file, *_ in self._alike(table):
                said = {key.decode(): text.decode() for key, text in (pq.read_schema(file).metadata or {}).items()}
                rows.append((table, self._eds(file), *(said.get(key, "") for key in KNOWN)))
        # With types, as there may be no row: a bus without files has only frames.
        made = pl.DataFrame(rows, dict.fromkeys(("table", "eds", *KNOWN), pl.String), orient="row")
        number = pl.col("cob_id").str.strip_prefix("0x").str.to_integer(base=16, dtype=pl.UInt32)
        return made.with_columns(number).sort("cob_id", "eds")

    @cached_property
    def fields(self) -> pl.DataFrame:
        """Descriptions of the columns of all tables: unit, range, words, meaning of null; without damaged files."""
        known = sorted({str(each.row["eds"][0]) for each in self.parts.values()})
        files = [file for eds in known if (file := file_of(self.folder, FIELDS, eds)).is_file()]
        found = list(filter(None, (self._undamaged(file, verified(file, FIELD_COLUMNS)) for file in files)))
        made = pl.from_arrow(pa.concat_tables(found) if found else FIELD_COLUMNS.empty_table())
        assert isinstance(made, pl.DataFrame)
        return made

    def sql(
        self,
        query: str,
        values: Mapping[str, Any] | None = None,
        progress: Progress | None = None,
        at_most: float = inf,
    ) -> pl.DataFrame:
        """Return the rows of a query in DuckDB's SQL, with a view per table, and `messages`; raises SqlError.

        The query cannot read or write files outside the season, or load extensions.

        Args:
            query: the query.
            values: values of `$name` in the query; unused ones are ignored.
            progress: called with how much is done in percent, at the end with 100.
            at_most: maximum time in s, after which the query is cancelled.
        """
        import duckdb

        named = {name: value for name, value in (values or {}).items() if f"${name}" in query}
        with duckdb.connect() as connection:
            self._add_views(connection, query)
            try:
                rows = _watched(connection, partial(self._answer, connection, query, named), progress, at_most)
            except duckdb.InterruptException:
                raise SqlError(f"the query has not ended within {texts.text(at_most)}") from None
            except (duckdb.Error, pl.exceptions.PolarsError, pa.ArrowException, NotImplementedError) as error:
                names = ", ".join([*self.files, MESSAGES, FIELDS])
                known = f"; tables: {names}" if "Table with name" in str(error) else ""
                raise SqlError(_told(str(error)) + known) from None
        if len(rows) > MOST_ROWS:
            raise SqlError(f"more than {MOST_ROWS} rows: ask for sums, or for a part by LIMIT")
        return rows

    def _answer(self, connection: duckdb.DuckDBPyConnection, query: str, named: Mapping[str, Any]) -> pl.DataFrame:
        """Return the rows of a query, one more than allowed at most, which shows that there are more."""
        self._confine(connection)
        answer = connection.sql(query, params=named or None)
        rows: pl.DataFrame = pl.DataFrame() if answer is None else _as_text(answer).limit(MOST_ROWS + 1).pl()
        return rows

    def _confine(self, connection: duckdb.DuckDBPyConnection) -> None:
        """Confine queries to the season's folder for good; our own settings have to be made before."""
        # Also in the spelling of the views, with patterns escaped.
        connection.execute(f"SET allowed_directories = [{_quoted(str(self.folder))}, {_quoted(_named(self.folder))}]")
        # With replacements, DuckDB would look up unknown tables among the variables of this program.
        connection.execute("SET enable_external_access = false; SET python_enable_replacements = false")
        connection.execute("SET TimeZone = 'UTC'")  # not that of this machine
        connection.execute("SET lock_configuration = true")  # or the query could change these settings

    def _selected(self, files: list[Path]) -> str:
        """Return the query for the rows of files with the same columns."""
        listed = ", ".join(_quoted(_named(file)) for file in files)
        hidden = self.hidden.get(files[0].stem)
        left_out = f" WHERE run NOT IN ({', '.join(map(_quoted, hidden))})" if hidden else ""
        return f"SELECT * FROM read_parquet([{listed}]){left_out}"

    def _add_views(self, connection: duckdb.DuckDBPyConnection, query: str) -> None:
        """Add a view for each table that the query names, as opening all files takes long."""
        # A word in a string or comment opens a table for nothing; a missed table would be an error.
        words = set(re.findall(r"\w+", query.lower()))
        for table in words & self.files.keys():
            self._verify(table)
        for table in words & {each.parent.name for each in self.damaged}:
            self._check_left(table)
        if RUNS in words:
            connection.register("verified", self._rows)
            connection.execute(f"CREATE TABLE {RUNS} AS SELECT * FROM verified")
        for table in words & self.files.keys() - {RUNS}:
            # BY NAME, as logs of another network may have other columns.
            parts = " UNION ALL BY NAME ".join(map(self._selected, self._alike(table)))
            connection.execute(f'CREATE VIEW "{table}" AS {parts}')
        for table in words & {MESSAGES, FIELDS} - self.files.keys():
            # Copied, as DuckDB reports progress only for its own tables.
            connection.register("known", self.messages if table == MESSAGES else self.fields)
            connection.execute(f"CREATE TABLE {table} AS SELECT * FROM known")


def _hidden(parts: Mapping[str, ArchivedRun]) -> dict[str, list[str]]:
    """Return the hidden runs of each part: a log's own files come before packs, later packs before earlier ones."""
    seen = set[str]()
    hidden = dict[str, list[str]]()
    packs = sorted((name for name in parts if name.startswith(PACK)), reverse=True)
    for name in [*(each for each in parts if not each.startswith(PACK)), *packs]:
        runs = parts[name].row["run"].to_pylist()
        if twice := sorted(seen.intersection(runs)):
            hidden[name] = twice
        seen.update(runs)
    return hidden


def _named(path: Path) -> str:
    """Return a pattern that matches only this path."""
    return re.sub(r"([*?[])", r"[\1]", str(path))


def _quoted(text: str) -> str:
    """Return a text as an SQL literal."""
    return "'" + text.replace("'", "''") + "'"


def checked(folder: Path) -> Path:
    """Return the folder of a season; raises LocalError if the Parquet libraries cannot use its name."""
    if str(folder) != encodable(str(folder)):
        raise LocalError(f"{folder}: the name of a season's folder has to be UTF-8")
    return folder


def _files(table: Path) -> list[Path]:
    """Return the files of a table, without pipes or devices."""
    return sorted(each for each in table.glob(f"*{SUFFIX}") if each.is_file())


OF_DUCKDB = ("INTERVAL", "UNION", "BIT")
"""Types that Polars does not have; such columns become text."""


def _as_text(answer: duckdb.DuckDBPyRelation) -> duckdb.DuckDBPyRelation:
    """Return an answer with DuckDB's own types as text."""
    own = [str(each).partition("(")[0] in OF_DUCKDB for each in answer.types]
    if not any(own):
        return answer
    names = ('"' + name.replace('"', '""') + '"' for name in answer.columns)
    # By position, as two columns may have the same name.
    return answer.project(
        ", ".join(
            f"CAST(#{place} AS VARCHAR) AS {name}" if is_own else f"#{place} AS {name}"
            for place, (name, is_own) in enumerate(zip(names, own), 1)
        )
    )


def _watched(
    connection: duckdb.DuckDBPyConnection, ask: Callable[[], pl.DataFrame], progress: Progress | None, at_most: float
) -> pl.DataFrame:
    """Return the answer of a connection, report its progress, and cancel it after `at_most` s or at Ctrl-C.

    It is asked in another thread, since Ctrl-C waits until the thread that it interrupts returns from DuckDB.
    """
    connection.execute("SET enable_progress_bar = true; SET enable_progress_bar_print = false")
    connection.execute("SET progress_bar_time = 0")  # the default is two seconds
    end = time.monotonic() + at_most
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(ask)
        try:
            while not wait([answer], INTERVAL).done:
                if time.monotonic() > end:  # repeatedly, as a query that has just begun ignores it
                    connection.interrupt()
                if progress and (done := connection.query_progress()) >= 0:  # negative if DuckDB does not know
                    progress(round(done))
        finally:
            while not wait([answer], 0).done:
                connection.interrupt()
                wait([answer], INTERVAL)
    rows = answer.result()
    if progress:
        progress(100)
    return rows
