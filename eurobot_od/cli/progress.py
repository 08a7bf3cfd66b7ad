"""Shows how far something is that takes its time: a transfer by its bytes, many things by their number."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple, TextIO, TypeVar

from eurobot_od.cli.terminal import redraws
from eurobot_od.sdo.client import Progress, unwatched
from eurobot_od.support.escaping import one_line

WIDTH = 30
"""Characters of the bar."""

REDRAWN = 0.1
"""Seconds between two drawings."""


class Unit(NamedTuple):
    """What is counted, the word for so many of it a second, and how many of it that is."""

    name: str
    rate: str
    number: int


BYTES, PERCENT, OBJECTS = Unit("bytes", "kB/s", 1000), Unit("%", "%/s", 1), Unit("objects", "objects/s", 1)


@contextmanager
def bar(
    what: str,
    stream: TextIO | None = None,
    clock: Callable[[], float] = time.monotonic,
    unit: Unit = BYTES,
    after: float = 0.0,
) -> Iterator[Progress]:
    """Give a function that draws the bar; the bar is gone at the end. Without a terminal nothing is drawn.

    Nothing is drawn of what does not take longer than `after` s either.
    """
    out = stream or sys.stderr
    if not redraws(out):
        yield unwatched
        return
    started = drawn = clock()
    width = 0

    def draw(done: int, size: int | None) -> None:
        nonlocal drawn, width
        now = clock()
        if now - started < after or (width and now - drawn < REDRAWN and done != size):
            return
        drawn = now
        text = line(what, done, size, now - started, unit)
        out.write("\r" + text.ljust(width))
        out.flush()
        width = max(width, len(text))

    try:
        yield draw
    finally:
        if width:
            out.write("\r" + " " * width + "\r")
            out.flush()


def line(what: str, done: int, size: int | None, seconds: float, unit: Unit = BYTES) -> str:
    """Return the bar as text: share, number, number per second, and from `SHORT` on how long it still takes."""
    what = one_line(what)
    rate = f"{done / seconds / unit.number:.1f} {unit.rate}" if seconds > 0 else ""
    if size and done and seconds >= SHORT:
        rate += f", about {_about(seconds / done * (size - done))} left"
    if not size:
        return f"{what}  {done} {unit.name}  {rate}".rstrip()
    filled = done * WIDTH // size
    drawn = f"{'█' * filled}{'░' * (WIDTH - filled)} {done / size:4.0%}"
    return f"{what}  {drawn}  {done} of {size} {unit.name}  {rate}".rstrip()


SHORT = 2.0
"""What takes longer, in seconds, says how long it is still going to take."""


# Many things

Thing = TypeVar("Thing")


@contextmanager
def passing(what: str, things: Iterable[Thing]) -> Iterator[Iterator[Thing]]:
    """Give objects to pass on, one after the other; of `what` takes long the bar is drawn."""
    listed = list(things)
    with bar(what, unit=OBJECTS, after=SHORT) as draw:
        yield _drawn(listed, draw)


def _drawn(things: Sequence[Thing], draw: Progress) -> Iterator[Thing]:
    for done, thing in enumerate(things):
        draw(done, len(things))
        yield thing


LONG = 10.0
"""What takes longer, in seconds, is said to do so; and so often something is said where there is no terminal."""


def counted(
    things: Iterable[Thing],
    number: int,
    what: str,
    at_once: int,
    stream: TextIO | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[Thing]:
    """Pass on a number of things, `what` in words, that so many processes make, and tell how long it takes.

    After the second round of the processes one line says so, if it is going to be long. From then on a terminal has a
    bar; elsewhere there is a line now and then.
    """
    out, meter = stream or sys.stderr, _Meter(number, what, at_once, clock)
    try:
        for count, thing in enumerate(things, 1):
            if hint := meter.hint(count):
                out.write(meter.cleared() + hint)
            out.write(meter.bar(count) if redraws(out) else meter.line(count))
            out.flush()
            yield thing
    finally:
        out.write(meter.cleared())
        out.flush()


class _Meter:
    """Knows how many things there are already, and how long the others are going to take."""

    def __init__(self, number: int, what: str, at_once: int, clock: Callable[[], float]) -> None:
        self._number, self._what, self._at_once, self._clock = number, what, at_once, clock
        self._first, self._told = 0.0, clock()
        self._width = 0

    def hint(self, count: int) -> str:
        """Say how long it is going to take, once and if it is long; the first round starts the processes as well."""
        if count == 1:
            self._first = self._clock()
        if count != 1 + self._at_once or (seconds := self._left(count)) < LONG:
            return ""
        processes = f" on {self._at_once} processes" if self._at_once > 1 else ""
        return f"{self._number} {self._what}, about {_about(seconds)}{processes}\n"

    def line(self, count: int) -> str:
        """Say how far it is, if nothing was said for a while."""
        if count == 1 or self._clock() - self._told < LONG:
            return ""
        self._told = self._clock()
        return f"{count} of {self._number} {self._what}, about {_about(self._left(count))} left\n"

    def bar(self, count: int) -> str:
        """Draw how far it is."""
        filled = count * WIDTH // self._number
        text = f"[{'#' * filled:{WIDTH}}] {count} of {self._number} {self._what}{self._rate(count)}"
        before, self._width = self._width, len(text)
        return "\r" + text.ljust(before)

    def _rate(self, count: int) -> str:
        """Say how many there are a second, and how long it is still going to take, if it is not over soon."""
        seconds = self._clock() - self._first
        if count == 1 or seconds < SHORT:
            return ""
        return f", {(count - 1) / seconds:.1f}/s, about {_about(self._left(count))} left"

    def cleared(self) -> str:
        """Wipe out the bar."""
        return f"\r{' ' * self._width}\r" if self._width else ""

    def _left(self, count: int) -> float:
        """Estimate the seconds for what is still to come."""
        return (self._clock() - self._first) / (count - 1) * (self._number - count)


def _about(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"
