"""The EDS checker: wall time of the whole program, start included, beside dcf-tools' dcfchk.

What an object costs in large devices is measured in `growth`.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from bench.eds import make_eds
from bench.measure import Claim, Contender, Scale, Series, Way
from bench.process import DCFCHK, OURS, run


@contextmanager
def beside_dcfchk(_: Scale) -> Iterator[Mapping[str, Contender]]:
    """Yield both checkers, with the EDS of a device of 200 objects."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "bench.eds")
        file.write_text(make_eds(200))
        yield {
            "dcfchk": partial(run, [*DCFCHK, "-n", "5", file]),
            "ours": partial(run, [*OURS, "lint", file]),
        }


SERIES = (
    Series(
        "lint",
        "lint 200 objects",
        beside_dcfchk,
        (Claim("lint 200 objects: dcfchk", "ours", "dcfchk", Way.RATIO, 0.3),),
    ),
)
