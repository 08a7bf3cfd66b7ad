"""A bar that shows how far a transfer is: on a terminal, and nothing elsewhere."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

from eurobot_od.escaping import one_line
from eurobot_od.sdo.client import Progress, unwatched

WIDTH = 30
"""Characters of the bar."""

REDRAWN = 0.1
"""Seconds between two drawings."""


@contextmanager
def bar(what: str, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic) -> Iterator[Progress]:
    """Give a function that draws the bar; the bar is gone at the end. Without a terminal nothing is drawn."""
    out = stream or sys.stderr
    if not out.isatty():
        yield unwatched
        return
    started = drawn = clock()
    width = 0

    def draw(done: int, size: int | None) -> None:
        nonlocal drawn, width
        now = clock()
        if width and now - drawn < REDRAWN and done != size:
            return
        drawn = now
        text = line(what, done, size, now - started)
        out.write("\r" + text.ljust(width))
        out.flush()
        width = max(width, len(text))

    try:
        yield draw
    finally:
        out.write("\r" + " " * width + "\r")
        out.flush()


def line(what: str, done: int, size: int | None, seconds: float) -> str:
    """Return the bar as text: share, bytes, and bytes per second."""
    what = one_line(what)
    rate = f"{done / seconds / 1000:.1f} kB/s" if seconds > 0 else ""
    if not size:
        return f"{what}  {done} bytes  {rate}".rstrip()
    filled = done * WIDTH // size
    return f"{what}  {'█' * filled}{'░' * (WIDTH - filled)} {done / size:4.0%}  {done} of {size} bytes  {rate}".rstrip()
