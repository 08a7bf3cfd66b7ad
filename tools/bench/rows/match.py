"""A simulated match of 90 s, and many of them on all cores.

Whole processes are measured.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial

from bench.measure import Claim, Contender, NotHere, Scale, Series, Way
from bench.process import OURS, PYTHON, run
from bench.rows.startup import ALL, LOADING, eds_files

JOBS = 2
SHORT = ("--duration", "5")
MORE, FURTHER = 4, 0.7
"""So many matches, of which each after the first is to take at most this share of the first one's time."""


@contextmanager
def one(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Give a match with all defaults, and canopen that reads its EDS files."""
    yield {
        "peer": partial(run, [PYTHON, "-c", LOADING, *eds_files(ALL)]),
        "ours": partial(run, [*OURS, "match", *SHORT * scale.short]),
    }


@contextmanager
def many(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Give many matches, one after the other and side by side; raises NotHere."""
    explained = subprocess.run([*OURS, "match", "--help"], capture_output=True, text=True, check=False).stdout
    if "--seeds" not in explained:
        raise NotHere("match has no --seeds")
    if (os.cpu_count() or 1) < JOBS:
        raise NotHere("one core only")
    words = [*OURS, "match", *SHORT * scale.short, "--seeds", str(scale.of(8, 2)), "--jobs"]
    yield {f"{jobs} jobs": partial(run, [*words, str(jobs)]) for jobs in (1, JOBS)}


@contextmanager
def more(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Give one match, and some in one process: the start and what is worked out once count only for the first."""
    words = [*OURS, "match", *SHORT * scale.short]
    yield {"one": partial(run, words), "ours": partial(run, [*words, "--seeds", str(MORE), "--jobs", "1"])}


SERIES = (
    Series(
        "match",
        "match",
        one,
        (Claim("a match of 90 s: canopen reading its files", "ours", "peer", Way.RATIO, 6.0),),
    ),
    Series(
        "match",
        "match --seeds",
        many,
        (Claim("match --seeds 8 on 2 cores: on 1", "2 jobs", "1 jobs", Way.TIMES_AS_FAST, 1.6),),
    ),
    Series(
        "match",
        "match, seeds after the first",
        more,
        (Claim(f"match --seeds {MORE}: a match of 90 s", "ours", "one", Way.RATIO, 1 + (MORE - 1) * FURTHER),),
    ),
)
