"""Converts a candump log to Parquet by Polars, one file of all frames and one for each message.

`peer_polars.py LOG DBC FOLDER`
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import cantools
import polars as pl


def main(log: str, dbc: str, folder: str) -> None:
    """Write the files."""
    database: Any = cantools.database.load_file(dbc)
    read = pl.read_csv(log, has_header=False, separator=" ", new_columns=["t", "channel", "frame"])
    frame = pl.col("frame")
    frames = read.with_row_index("line", 1).select(
        "line",
        pl.col("t").str.strip_chars("()").cast(pl.Float64),
        pl.col("channel").cast(pl.Categorical),
        frame.str.head(3).str.to_integer(base=16).cast(pl.UInt32).alias("cob_id"),
        frame.str.slice(4).str.decode("hex").alias("data"),
    )
    frames.write_parquet(Path(folder, "frames.parquet"), compression="zstd", compression_level=1)
    word = (pl.col("data") + bytes(8)).bin.head(8).bin.reinterpret(dtype=pl.UInt64)
    for message in database.messages:
        fields = [(word // (1 << s.start) & (1 << s.length) - 1).alias(s.name) for s in message.signals]
        rows = frames.filter(pl.col("cob_id") == message.frame_id).select("line", "t", "channel", *fields)
        rows.write_parquet(Path(folder, f"{message.name}.parquet"), compression="zstd", compression_level=1)


main(*sys.argv[1:])
