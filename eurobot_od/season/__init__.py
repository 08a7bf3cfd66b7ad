"""A season of logs as columns: Parquet files that Polars, DuckDB and everything else in that world reads.

    logs  ->  batches of columns      `columns`: any format, in streaming
          ->  messages and defects    `columns`: expressions on the data as a 64-bit integer
          ->  files of a run          `archive`: Parquet, table by table; names in `season`
          ->  SEASON/TABLE/RUN.parquet   `archive`: whole or not at all, each log once
    SEASON/  ->  lazy frames and SQL  `season`; ready questions, texts and pictures in `answers`

It needs the extra `season`: polars, duckdb and pyarrow. Nothing here knows which devices there are.
"""

MOST_JOBS = 60
"""More processes than these cannot be waited for on Windows."""
