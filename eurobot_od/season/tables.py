"""The tables of a season and where they lie: a folder of Parquet files for each, a file for each log in it.

These are names and columns only; nothing is read or computed here. All tables start with `run`, `line`, `t` and
`channel`: which log, which line of it, when in seconds by the log's own clock, on which channel.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

import pyarrow as pa

from eurobot_od.pdo.catalogue import first_free

RUNS, FRAMES, DAMAGE = "runs", "frames", "damage"
"""The logs; all frames; what was wrong, with log and line. Every other table is of a message."""

TEXT, OCTETS, WORD = pa.large_string(), pa.large_binary(), pa.dictionary(pa.uint32(), pa.large_string())
"""Types as Polars gives them; WORD is for texts that repeat."""

PLACE = tuple(
    pa.field(name, type_, nullable=False)
    for name, type_ in (("run", WORD), ("line", pa.uint64()), ("t", pa.float64()), ("channel", WORD))
)
SAID = {
    "run": "the log, a row of the table runs",
    "line": "line of the log, or number of the entry where there are no lines",
    "t": "time by the log's clock",
    "channel": "channel as the log names it",
    "cob_id": "identifier; one of 29 bits has bit 29 set, as in a COB-ID",
    "remote": "whether it is a remote frame, whose data is zeros of the length that it asks for",
}
UNITS = {"t": "s"}

SUFFIX = ".parquet"

SCHEMAS: Mapping[str, pa.Schema] = {
    RUNS: pa.schema(
        [
            ("run", pa.string()),
            ("log", pa.string()),
            ("format", pa.string()),
            ("bytes", pa.int64()),
            ("start", pa.float64()),
            ("end", pa.float64()),
            ("frames", pa.int64()),
            ("damage", pa.int64()),
            ("network", pa.string()),
            ("eds", pa.string()),
        ]
    ),
    FRAMES: pa.schema(
        [
            *PLACE,
            pa.field("cob_id", pa.uint32(), nullable=False),
            pa.field("data", OCTETS, nullable=False),
            pa.field("remote", pa.bool_(), nullable=False),
        ]
    ),
    DAMAGE: pa.schema([*PLACE, ("kind", WORD), ("text", TEXT)]),
}


def table_names(messages: Iterable[str]) -> dict[str, str]:
    """Return the table of each message: `Goto XY` is in `goto_xy`; no two are one."""
    taken = [RUNS, FRAMES, DAMAGE]
    names: dict[str, str] = {}
    for message in messages:
        plain = re.sub(r"\W+", "_", message.lower(), flags=re.ASCII).strip("_") or "message"
        # SQL takes a name that begins with a digit only in quotes.
        names[message] = first_free(f"message_{plain}" if plain[0].isdigit() else plain, taken)
        taken.append(names[message])
    return names


def file_of(season: Path, table: str, run: str) -> Path:
    """Return the file with a run's rows of a table."""
    return season / table / f"{run}{SUFFIX}"


def with_metadata(schema: pa.Schema, said: Mapping[str, Mapping[str, str]]) -> pa.Schema:
    """Return a schema whose columns say what is known of them: units, what null means, what is allowed."""
    known = {name: {"meaning": text} | ({"unit": UNITS[name]} if name in UNITS else {}) for name, text in SAID.items()}
    known |= {name: dict(texts) for name, texts in said.items()}
    return pa.schema([field.with_metadata(known.get(field.name)) for field in schema], schema.metadata)


MAGIC = b"PAR1"
"""Begins and ends a Parquet file; before the end stands the length of what describes the file, in 4 bytes."""


def is_whole(file: Path) -> bool:
    """Tell whether a Parquet file has its beginning and its end: one that was cut off or overwritten does not."""
    try:
        with file.open("rb") as opened:
            head, size = opened.read(len(MAGIC)), opened.seek(0, os.SEEK_END)
            opened.seek(max(0, size - 8))
            length, end = opened.read(4), opened.read(4)
    except OSError:
        return False
    # 12 bytes: the two marks and this length itself.
    return head == end == MAGIC and int.from_bytes(length, "little") <= size - 12
