"""Converts a log to Parquet with three libraries: python-can reads, cantools decodes, pyarrow writes."""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path
from typing import Any

import can
import cantools
import pyarrow as pa
import pyarrow.parquet as pq

ROWS = 100_000
"""Rows of a message that are written at once."""


def main(log: str, dbc: str, folder: str) -> None:
    """Write a file for each message."""
    database: Any = cantools.database.load_file(dbc)
    rows: dict[str, list[dict[str, Any]]] = defaultdict(list)
    writers: dict[str, pq.ParquetWriter] = {}

    def write(name: str) -> None:
        table = pa.Table.from_pylist(rows[name])
        if name not in writers:
            writers[name] = pq.ParquetWriter(Path(folder, f"{name}.parquet"), table.schema)
        writers[name].write_table(table)
        rows[name].clear()

    with can.LogReader(log) as messages:
        for each in messages:
            try:
                found = database.get_message_by_frame_id(each.arbitration_id)
            except KeyError:
                continue
            values = found.decode(each.data, decode_choices=False) if found.length else {}
            rows[found.name].append({"t": each.timestamp, **values})
            if len(rows[found.name]) >= ROWS:
                write(found.name)
    for name in [name for name in rows if rows[name]]:
        write(name)
    for writer in writers.values():
        writer.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
