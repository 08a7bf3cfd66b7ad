"""Joins the files of many short logs, table by table.

An archived log has its own file in each table. Once a network has MANY small ones, they become one pack, which has one
file per table with the rows of all of them. Each log is in the season at any time: the pack's file in `runs` is moved
into place last, and only then are the logs' own files removed. A reader in between, or after a kill, takes each log
from one of them (`Season`).
"""

from __future__ import annotations

import os
import secrets
import shutil
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from eurobot_od.season import season as tables
from eurobot_od.season.season import ArchivedRun, Season

MANY = 8
"""Minimum number of small parts of a network that are joined."""

SMALL = 16 << 20
"""Maximum size of a part that is joined, with all its files, in bytes."""

ROWS = 1 << 17
"""Number of rows of a row group."""

Writer = Callable[[Path, pa.Schema], pq.ParquetWriter]
"""Opens a file of a table for writing."""


def pack(folder: Path, begun: Path, opened: Writer, many: int = MANY) -> None:
    """Join the small parts of a season if there are at least `many`; raises OSError.

    Files are made in `begun`, and `opened` opens them.
    """
    with _alone(folder / tables.RUNS) as is_alone:
        if not is_alone:
            return
        season = Season(folder)
        for parts in _small(season).values():
            if len(parts) >= many:
                _join(season, parts, begun / f"pack.{secrets.token_hex(4)}", opened)


@contextmanager
def _alone(folder: Path) -> Iterator[bool]:
    """Yield whether no other program packs here, by a lock on a folder; without locks, always true."""
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
    """Return the names of the parts that may be joined, by network."""
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
    """Make a pack of some parts, move it into place, and remove the parts."""
    wanted = set(parts)
    folder.mkdir(parents=True)
    try:
        for table, files in season.files.items():
            if some := [file for file in files if file.stem in wanted]:
                joined = pa.concat_tables(_rows(season, file) for file in some)
                with opened(folder / f"{table}{tables.SUFFIX}", joined.schema) as writer:
                    writer.write_table(joined, row_group_size=ROWS)
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
    """Return the rows of a file, without those of logs that are in another part, too."""
    rows = pq.read_table(file)
    hidden = season.hidden.get(file.stem)
    if not hidden:
        return rows
    return rows.filter(pc.invert(pc.is_in(rows["run"].cast(pa.large_string()), pa.array(hidden, pa.large_string()))))


def put_in_place(made: Path, season: Path, name: str) -> None:
    """Move the files of a part into a season; its rows of `runs` go last, as without them it does not count."""
    for each in sorted(made.iterdir(), key=lambda each: each.stem == tables.RUNS):
        target = tables.file_of(season, each.stem, name)
        target.parent.mkdir(exist_ok=True)
        with each.open("rb+") as opened:  # on the disk before it is moved, in case of a power cut
            os.fsync(opened.fileno())
        each.replace(target)


def remove(season: Path, name: str) -> None:
    """Remove the files of a part, those in `runs` first, so that the rest no longer counts."""
    part = ArchivedRun.read(tables.file_of(season, tables.RUNS, name))
    for table in [tables.RUNS, *(part.seals if part else ())]:
        with suppress(FileNotFoundError):
            tables.file_of(season, table, name).unlink()
