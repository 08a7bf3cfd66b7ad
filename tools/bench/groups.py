"""All rows, in the order in which they are measured.

A series is added to its module's `SERIES`; here is only the order of the subjects.
"""

from __future__ import annotations

from collections.abc import Sequence

from bench.measure import Series
from bench.rows import (
    bus,
    codec,
    configure,
    echo,
    growth,
    lint,
    logs,
    match,
    monitor,
    network,
    receive,
    sdo,
    season,
    socketcan,
    startup,
)

GROUPS: tuple[Sequence[Series], ...] = (
    codec.SERIES,
    receive.SERIES,
    echo.SERIES,
    socketcan.SERIES,
    monitor.SERIES,
    logs.SERIES,
    season.SERIES,
    startup.SERIES,
    lint.SERIES,
    configure.SERIES,
    network.SERIES,
    sdo.SERIES,
    bus.SERIES,
    match.SERIES,
    growth.SERIES,
)
