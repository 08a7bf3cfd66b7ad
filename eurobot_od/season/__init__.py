"""A season of logs as columns: Parquet files for Polars, DuckDB and other programs.

    logs  ->  batches of columns      `columns`: any format, as a stream
          ->  messages and defects    `columns`: expressions on the data as a 64-bit integer
          ->  files of a run          `archive`: Parquet, table by table; names in `season`
          ->  SEASON/TABLE/RUN.parquet   `archive`: each log once, complete or not at all

    SEASON/  ->  lazy frames and SQL  `season`; ready questions, texts and pictures in `answers`

It needs the extra `season`: polars, duckdb and pyarrow. It knows no particular devices.
"""

MOST_JOBS = 60
"""Maximum number of processes: Windows cannot wait for more."""
