"""A simulated match of 90 s, and many of them on all cores, as whole processes."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial

from bench.measure import SELDOM, Claim, Contender, Figures, NotHere, Scale, Series, Way
from bench.process import OURS, PYTHON, Words, run
from bench.rows.startup import ALL, LOADING, eds_files

JOBS = 2
SHORT = ("--for", "5")
MORE, FURTHER = 8, 0.7
"""So many matches, of which each after the first is to take at most this share of the first one's time."""


@contextmanager
def one(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield a match with all defaults, and canopen that reads its EDS files."""
    yield {
        "peer": partial(run, [PYTHON, "-c", LOADING, *eds_files(ALL)]),
        "ours": partial(run, [*OURS, "match", *SHORT * scale.short]),
    }


@contextmanager
def many(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield one match, and many: one after the other in one process, which starts only once, and in parallel."""
    words = [*OURS, "match", *SHORT * scale.short]
    seeds = [*words, "--seeds", str(scale.of(MORE, 2)), "--jobs"]
    yield {"one": partial(run, words), "1 job": partial(run, [*seeds, "1"]), "2 jobs": partial(side_by_side, seeds)}


def side_by_side(words: Words) -> Figures:
    """Run matches on two cores; raises NotHere."""
    if (os.cpu_count() or 1) < JOBS:
        raise NotHere("one core only")
    return run([*words, str(JOBS)])


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
        (
            Claim(f"match --seeds {MORE} on 2 cores: on 1", "2 jobs", "1 job", Way.TIMES_AS_FAST, 1.6),
            Claim(f"match --seeds {MORE}: a match of 90 s", "1 job", "one", Way.RATIO, 1 + (MORE - 1) * FURTHER),
        ),
        SELDOM,
    ),
)
