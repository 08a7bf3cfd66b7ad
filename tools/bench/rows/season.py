"""Logs into a season, compared with other programs: text by cantools, Parquet by hand; and memory over the length.

The traffic is random (see `traffic`). After each of our runs all frames must be in the season, and the values of a
message must be those that `Protocol` decodes (the tests of `season` prove it for all messages).
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from bench.measure import SELDOM, Claim, Contender, Figures, NotHere, Quantity, Scale, Series, Way, Wrong
from bench.process import CANTOOLS, OURS, PROGRAMS, PYTHON, run
from bench.shared import protocol
from bench.traffic import random_traffic, write_candump
from eurobot_od.export.dbc import dbc_text

FULL, SHORT = 1_000_000, 300
TIMES = 10
"""How many times as many lines as the short log the long one has."""


def archived(log: Path, count: int) -> Figures:
    """Archive a log into an empty season; raises Wrong if a frame is missing."""
    from eurobot_od.season.season import Season

    folder = log.with_suffix(".season")
    shutil.rmtree(folder, ignore_errors=True)
    figures = run([*OURS, "archive", log, "-o", folder])
    found = Season.open(folder).sql("SELECT count(*) AS number FROM frames").item()
    if found != count:
        raise Wrong(f"{found} frames of {count}")
    return figures


def by_hand(program: str, log: Path, dbc: Path) -> Figures:
    """Write the files with a peer."""
    with tempfile.TemporaryDirectory() as folder:
        return run([PYTHON, PROGRAMS / program, log, dbc, folder])


COUNT = "SELECT cob_id, count(*) FROM {} GROUP BY cob_id"


def counted(log: Path) -> Mapping[str, Contender]:
    """Return what counts the frames of a season: our command, and DuckDB by itself."""
    folder = log.with_suffix(".season")
    files = COUNT.format(f"'{folder}/frames/*.parquet'")
    alone = f"import duckdb; print(duckdb.sql({files!r}))"
    return {
        "query": partial(run, [*OURS, "query", folder, COUNT.format("frames")]),
        "duckdb": partial(run, [PYTHON, "-c", alone]),
    }


@contextmanager
def opened(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Write both logs, and yield the programs."""
    missing = [name for name in ("polars", "duckdb", "pyarrow") if find_spec(name) is None]
    if missing:
        raise NotHere(f"{', '.join(missing)} not installed")
    count = scale.of(FULL, SHORT)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log, long, dbc = folder / "one.log", folder / "ten.log", folder / "robot.dbc"
        dbc.write_text(dbc_text(protocol()))
        write_candump(log, random_traffic(count))
        with long.open("wb") as target:
            for _ in range(TIMES):
                target.write(log.read_bytes())
        yield {
            "cantools": partial(run, [*CANTOOLS, "decode", "-s", dbc], log),
            "by hand": partial(by_hand, "peer_parquet.py", log, dbc),
            "polars": partial(by_hand, "peer_polars.py", log, dbc),
            "ours": partial(archived, log, count),
            **counted(log),
            "ours, ten times": partial(archived, long, TIMES * count),
        }


NAME = "archive 1 000 000 lines"

SERIES = (
    Series(
        "season",
        NAME,
        opened,
        (
            Claim(f"{NAME}: cantools decode -s", "ours", "cantools", Way.TIMES_AS_FAST, 15),
            Claim(f"{NAME}: python-can, cantools, pyarrow", "ours", "by hand", Way.TIMES_AS_FAST),
            Claim(f"{NAME}: Polars by hand", "ours", "polars", Way.RATIO, 1.2),
            Claim("query of a count: DuckDB itself", "query", "duckdb", Way.RATIO, 2),
            Claim(f"{NAME}, CPU: cantools", "ours", "cantools", Way.TIMES_AS_FAST, None, Quantity.CPU_TIME),
            Claim("archive ten times the lines", "ours, ten times", "ours", Way.RATIO, TIMES),
            Claim("archive ten times the lines, CPU", "ours, ten times", "ours", Way.RATIO, None, Quantity.CPU_TIME),
            Claim("archive ten times the lines, memory", "ours, ten times", "ours", Way.RATIO, 1.2, Quantity.MEMORY),
        ),
        SELDOM,
    ),
)
