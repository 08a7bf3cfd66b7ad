"""The EDS checker: wall time beside dcf-tools' dcfchk, and what an object costs in small and great devices.

Whole programs are measured, start-up included.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from bench.eds import make_eds
from bench.measure import Claim, Contender, Figures, Quantity, Scale, Series, Way
from bench.process import DCFCHK, OURS, run


@contextmanager
def beside_dcfchk(_: Scale) -> Iterator[Mapping[str, Contender]]:
    """Give both checkers, with the EDS of a device of 200 objects."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "bench.eds")
        file.write_text(make_eds(200))
        yield {
            "dcfchk": partial(run, [*DCFCHK, "-n", "5", file]),
            "ours": partial(run, [*OURS, "lint", file]),
        }


def per_object(file: Path, count: int) -> Figures:
    """Measure the checker, by the object."""
    return {Quantity.TIME: run([*OURS, "lint", file])[Quantity.TIME] / count}


@contextmanager
def growth(scale: Scale) -> Iterator[Mapping[str, Contender]]:
    """Give the checker with a device of 1000 objects, and with a greater one."""
    with tempfile.TemporaryDirectory() as folder:
        contenders = {}
        for name, count in (("small", 1000), ("great", scale.of(5000, 1500))):
            file = Path(folder, f"{name}.eds")
            file.write_text(make_eds(count))
            contenders[name] = partial(per_object, file, count)
        yield contenders


SERIES = (
    Series(
        "lint",
        "lint 200 objects",
        beside_dcfchk,
        (Claim("lint 200 objects: dcfchk", "ours", "dcfchk", Way.RATIO, 0.3),),
    ),
    Series(
        "lint",
        "lint 5000 objects",
        growth,
        (Claim("lint, time of an object of 5000: of 1000", "great", "small", Way.RATIO),),
    ),
)
