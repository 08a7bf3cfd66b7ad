"""Many short logs in few files: the files of a season's small runs, joined table by table.

A log that is archived has a file of its own in each table. Once there are MANY small ones of a network, they become one
pack, which has a file in each table as a log has, with the rows of all of them. Rule of this file: each log is in the
season at any time. A pack's row group of `runs` is put in place last, and only then its logs' own files go; whoever
reads meanwhile, or after a kill, takes each log from one of them (`Season`).
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from eurobot_od.season import season as tables
from eurobot_od.season.season import ArchivedRun, Season

MANY = 8
"""So many small parts of one network are joined."""

SMALL = 16 << 20
"""Bytes of a part, all its files together, above which it is left as it is."""

ROWS = 1 << 17
"""Rows of a row group."""

Writer = Callable[[Path, pa.Schema], pq.ParquetWriter]
"""Opens a file of a table for writing."""


def pack(folder: Path, begun: Path, opened: Writer, many: int = MANY) -> None:
    """Join the small parts of a season; `begun` is where files are made, `opened` writes them as all others are.

    Does nothing where they are fewer than `many`. Raises OSError.
    """
    with _alone(folder / tables.RUNS) as is_alone:
        season = Season(folder) if is_alone else None
        for parts in _small(season).values() if season else ():
            if season and len(parts) >= many:
                _join(season, parts, begun / f"pack.{secrets.token_hex(4)}", opened)


@contextmanager
def _alone(folder: Path) -> Iterator[bool]:
    """Yield whether nobody else packs here, by a lock on a folder; where there are no locks, nobody is known to."""
    if os.name != "posix":
        yield True
        return
    from fcntl import LOCK_EX, LOCK_NB, flock  # not on Windows

    descriptor = os.open(folder, os.O_RDONLY)
    try:
        flock(descriptor, LOCK_EX | LOCK_NB)
    except BlockingIOError:
        yield False
    except OSError:
        yield True
    else:
        yield True
    finally:
        os.close(descriptor)


def _small(season: Season) -> Mapping[str, list[str]]:
    """Return the names of the parts that may be joined, by the network."""
    sizes = defaultdict[str, int](int)
    for files in season.files.values():
        for file in files:
            sizes[file.stem] += file.stat().st_size
    damaged = {file.stem for file in season.damaged}
    found = defaultdict[str, list[str]](list)
    for name, part in season.parts.items():
        if name not in damaged and sizes[name] < SMALL:
            found[str(part.row["eds"][0])].append(name)
    return found


def _join(season: Season, parts: list[str], folder: Path, opened: Writer) -> None:
    """Make a pack of some parts, put it in place, and remove them."""
    wanted = set(parts)
    folder.mkdir(parents=True)
    try:
        for table, files in season.files.items():
            if some := [file for file in files if file.stem in wanted]:
                _write(folder / f"{table}{tables.SUFFIX}", (_rows(season, file) for file in some), opened)
        seals = {each.stem: tables.Seal.of(each) for each in folder.iterdir() if each.stem != tables.RUNS}
        runs = pa.concat_tables([season.rows_of(each) for each in parts])
        name = tables.pack_name(season.folder, runs["run"].to_pylist())
        schema = runs.schema.with_metadata({tables.SEALS: tables.seals_text(seals)})
        target = folder / f"{tables.RUNS}{tables.SUFFIX}"
        pq.write_table(runs.cast(schema), target, write_page_checksum=True)
        put_in_place(folder, season.folder, name)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    for each in parts:
        remove(season.folder, each)


def _rows(season: Season, file: Path) -> pa.Table:
    """Return the rows of a file, without those of logs that stand elsewhere."""
    rows = pq.read_table(file)
    hidden = season.hidden.get(file.stem)
    if not hidden:
        return rows
    return rows.filter(pc.invert(pc.is_in(rows["run"].cast(pa.large_string()), pa.array(hidden, pa.large_string()))))


def _write(file: Path, parts: Iterable[pa.Table], opened: Writer) -> None:
    joined = pa.concat_tables(parts)
    with opened(file, joined.schema) as writer:
        writer.write_table(joined, row_group_size=ROWS)


def put_in_place(made: Path, season: Path, name: str) -> None:
    """Move the files of a part into a season: a part without its rows in `runs` is not there, so those go last."""
    for each in sorted(made.iterdir(), key=lambda each: each.stem == tables.RUNS):
        target = tables.file_of(season, each.stem, name)
        target.parent.mkdir(exist_ok=True)
        with each.open("rb+") as opened:  # on the disk before it is in place: a power cut leaves no half
            os.fsync(opened.fileno())
        each.replace(target)


def remove(season: Path, name: str) -> None:
    """Remove the files of a part, those in `runs` first: what is left of it then is not there."""
    part = ArchivedRun.read(tables.file_of(season, tables.RUNS, name))
    for table in [tables.RUNS, *(part.seals if part else ())]:
        with suppress(FileNotFoundError):
            tables.file_of(season, table, name).unlink()
