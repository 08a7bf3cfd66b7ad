"""Logs into a season: each is read once, decoded by columns, and written as Parquet, batch after batch.

Rule of this file: a log is in the season whole or not at all, and once. Its name there comes from its bytes and from
those of the EDS files, so that the same file again, under whatever name, is known; its row in `runs` is put in place
last, after all its other files, so that an interrupted run is done again. Any number of processes may work on
one season at once: each makes its runs in folders of its own; of two with the same bytes the last one is there.
"""

from __future__ import annotations

import hashlib
import os
import secrets
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from eurobot_od.season import campaign, tables
from eurobot_od.season.batches import batches
from eurobot_od.season.campaign import BLOCK, HERE, Workers
from eurobot_od.season.writing import DecodedNetwork, NetworkDecoding, RunTables
from eurobot_od.traffic import formats

HASHED = 1 << 20
BEGUN = ".begun"
"""The folder of a season in which runs are made."""


class Archived(NamedTuple):
    """The result for a log: its `run`, whether it was `known` before, how many frames, and how much is damaged."""

    log: str
    run: str
    known: bool
    size: int
    frames: int = 0
    damage: int = 0


Progress = Callable[[int], object]
"""Called with how many bytes of a log have been read."""


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
    """Put logs into a season, several at once if there are workers, and yield what became of each, in their order.

    `progress` is called with the bytes of each part read, if that happens in this process.

    Raises UnknownName for a format that is not known, OSError.
    """
    # A log named twice would be put in by two workers at once.
    files = list(dict.fromkeys(logs))
    for file in files:
        with file.open("rb") as opened:
            formats.form_of(opened, form)  # complains before anything is done
    # A bar on this terminal cannot be moved by another process.
    archiver = Archiver(season, network, form, unwatched if workers.executor else progress)
    with _begun(season / BEGUN):
        yield from campaign.run(archiver, files, workers._replace(block=BLOCK))


@contextmanager
def _begun(folder: Path) -> Iterator[None]:
    """Provide the folder in which runs are made; leftovers of interrupted runs go if no other program is at work.

    A program at work holds a lock on it, which the operating system releases with the program. Without POSIX, or on a
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
            flock(descriptor, LOCK_EX | LOCK_NB)  # granted only if nobody else is at work: what is here is left over
            for left in folder.iterdir():
                shutil.rmtree(left, ignore_errors=True)
        with suppress(OSError):
            flock(descriptor, LOCK_SH)  # shared by all who work here; nobody else can clear away meanwhile
        yield
    finally:
        os.close(descriptor)


@dataclass(frozen=True)
class Archiver:
    """Puts one log after the other into a season; `progress` is called with the bytes of each part read."""

    season: Path
    network: DecodedNetwork
    form: str | None = None
    progress: Progress = unwatched

    @cached_property
    def _decoding(self) -> NetworkDecoding:
        """What all logs have in common, most of the work for a short one: made once for each block of logs."""
        return NetworkDecoding(self.network)

    def __call__(self, log: Path) -> Archived:
        """Put a log into the season. Raises OSError, UnknownName."""
        with log.open("rb") as file:
            form, size = formats.form_of(file, self.form)[0], os.fstat(file.fileno()).st_size
            # The same log read by other EDS files gives other tables, so they are part of its name.
            # Its bytes, not its name or its date: the same log copied to another folder is the same run.
            digest = hashlib.blake2b(f"{self._decoding.eds} {form}\n".encode(), digest_size=8)
            while part := file.read(HASHED):
                digest.update(part)
            run = digest.hexdigest()
            names = (*tables.SCHEMAS, *(each.table for each in self._decoding.messages.values()))
            # One table that is missing or damaged is reason enough to put the log in again.
            if tables.file_of(self.season, tables.RUNS, run).is_file() and all(
                tables.is_whole(tables.file_of(self.season, name, run)) for name in names
            ):
                return Archived(str(log), run, True, size)
            file.seek(0)
            row = self._put(file, {"run": run, "log": str(log), "format": form, "bytes": size})
        return Archived(str(log), run, False, size, row["frames"], row["damage"])

    def _put(self, file: BinaryIO, known: dict[str, Any]) -> dict[str, Any]:
        """Write all tables of a run, and move them into the season; return its row in the table `runs`."""
        run = known["run"]
        # A folder of its own: another process may be at work on the same log.
        begun = self.season / BEGUN / f"{run}.{secrets.token_hex(4)}"
        try:
            with RunTables(begun, run, self._decoding) as written:
                for batch in batches(file, self.form):
                    written.take(batch)
                    self.progress(batch.size)
            row = known | written.row()
            schema = tables.with_metadata(tables.SCHEMAS[tables.RUNS], {})
            pq.write_table(pa.Table.from_pylist([row], schema), begun / f"{tables.RUNS}{tables.SUFFIX}")
            # The table `runs` goes last: a run without its row there is not in the season, and is made again.
            for made in sorted(begun.iterdir(), key=lambda each: each.stem == tables.RUNS):
                target = tables.file_of(self.season, made.stem, run)
                target.parent.mkdir(exist_ok=True)
                with made.open("rb+") as opened:  # what is in place is on the disk: a power cut leaves no half of it
                    os.fsync(opened.fileno())
                made.replace(target)
        finally:
            shutil.rmtree(begun, ignore_errors=True)
        return row
