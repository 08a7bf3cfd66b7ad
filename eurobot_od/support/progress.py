"""Shows the progress of something slow: of a transfer by its bytes, of many things by their number."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import NamedTuple, TextIO, TypeAlias, TypeVar

from eurobot_od.support.texts import one_line

ENDLESS = 10_000
"""Characters of a line where nothing says how long it may be."""

WITH_COLOURS = {"WT_SESSION", "TERM", "ANSICON", "ConEmuANSI"}
"""What terminals on Windows set that know escape sequences; the old console prints them as they are."""


def redraws(stream: TextIO) -> bool:
    """Return whether a line can be written over: on a terminal, unless it says that it is dumb."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def in_colour(stream: TextIO) -> bool:
    """Return whether colours are wanted and shown: NO_COLOR is not set (no-color.org), and the terminal has them."""
    is_known = os.name != "nt" or bool(WITH_COLOURS & os.environ.keys())
    return is_known and redraws(stream) and not os.environ.get("NO_COLOR")  # set, but empty, it does not count


def columns(stream: TextIO) -> int:
    """Return how many characters a line of a terminal has; practically endless for anything else."""
    try:
        return os.get_terminal_size(stream.fileno()).columns or ENDLESS
    except (OSError, ValueError):  # a text in memory has no file
        return ENDLESS


def folded(text: str, stream: TextIO, indent: int) -> str:
    """Return a line as lines of whole words that fit a terminal, all but the first one indented."""
    width = columns(stream)
    if len(text) <= width or width < 2 * indent:
        return text
    from textwrap import fill  # not with every command: it needs `re`

    return fill(text, width, subsequent_indent=" " * indent, break_on_hyphens=False)


Progress: TypeAlias = Callable[[int, "int | None"], object]
"""Called with how much is done, and how much there is in all, None if that is not known."""

WIDTH, SHORTEST = 30, 5
"""Characters of the bar, and how few they become on a narrow terminal."""

REDRAWN = 0.1
"""Seconds between two drawings."""

SHORT = 2.0
"""Seconds after which the bar also says how long it will still take."""

LONG = 10.0
"""Seconds from which on the time it takes is announced where there is no terminal, and seconds between two lines."""


class Unit(NamedTuple):
    """What is counted, the unit of its rate, and how many of it that unit stands for."""

    name: str
    rate: str
    number: int = 1


BYTES, PERCENT, OBJECTS = Unit("bytes", "kB/s", 1000), Unit("%", "%/s"), Unit("objects", "objects/s")


def unwatched(done: int, size: int | None) -> None:
    """Show nothing."""


@contextmanager
def bar(
    what: str,
    stream: TextIO | None = None,
    clock: Callable[[], float] = time.monotonic,
    unit: Unit = BYTES,
    after: float = 0.0,
) -> Iterator[Progress]:
    """Yield a function that draws the bar, once `after` s have passed; at the end the bar is wiped out.

    Without a terminal nothing is drawn.
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
        # One column stays free: a terminal that has written the last one may begin a new line.
        text = line(what, done, size, now - started, unit, columns(out) - 1)
        out.write("\r" + text.ljust(width))
        out.flush()
        width = max(width, len(text))

    try:
        yield draw
    finally:
        if width:
            out.write("\r" + " " * width + "\r")
            out.flush()


def line(what: str, done: int, size: int | None, seconds: float, unit: Unit = BYTES, most: int = ENDLESS) -> str:
    """Return the bar as text: share, number, number per second, and from `SHORT` on how long it will still take.

    It has `most` characters: first the bar gets shorter, down to `SHORTEST`, then the text is cut off.
    """
    rate = f"{done / seconds / unit.number:.1f} {unit.rate}" if seconds > 0 else ""
    if not size:
        return "  ".join(filter(None, (one_line(what), f"{done} {unit.name}", rate)))[:most]
    if done and seconds >= SHORT:
        rate += f", about {_about(seconds / done * (size - done))} left"
    words = [one_line(what), f"{done / size:4.0%}", f"{done} of {size} {unit.name}", rate]
    width = min(WIDTH, max(SHORTEST, most - len("  ".join(filter(None, words))) - 1))
    filled = done * width // size
    words[1] = f"{'█' * filled}{'░' * (width - filled)} {words[1]}"
    return "  ".join(filter(None, words))[:most]


# Many things

Thing = TypeVar("Thing")


@contextmanager
def passing(what: str, things: Iterable[Thing]) -> Iterator[Iterator[Thing]]:
    """Yield the objects `things` one after the other; if that takes long, a bar for `what` is drawn."""
    listed = list(things)
    with bar(what, unit=OBJECTS, after=SHORT) as draw:

        def drawn() -> Iterator[Thing]:
            for done, thing in enumerate(listed):
                draw(done, len(listed))
                yield thing

        # Not `passing` itself is the generator: an error would then be printed before the bar is wiped out.
        yield drawn()


def counted(
    things: Iterable[Thing],
    number: int,
    what: str,
    at_once: int,
    stream: TextIO | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[Thing]:
    """Pass on `number` things, `what` in words, that are made `at_once` at a time, and show how far it is.

    A terminal has a bar. Elsewhere a line announces how long it will take, if that is long, and others follow.
    """
    out = stream or sys.stderr
    with bar("", out, clock, Unit(what, f"{what}/s")) as draw:
        first = said = clock()
        for count, thing in enumerate(things, 1):
            now = clock()
            if count == 1:
                first = said = now  # the first round also starts the processes, so its time says nothing of the rest
            elif not redraws(out):
                left = (now - first) / (count - 1) * (number - count)
                if count == 1 + at_once and left >= LONG:
                    processes = f" on {at_once} processes" if at_once > 1 else ""
                    out.write(f"{number} {what}, about {_about(left)}{processes}\n")
                if now - said >= LONG:
                    said = now
                    out.write(f"{count} of {number} {what}, about {_about(left)} left\n")
                out.flush()
            draw(count, number)
            yield thing


def _about(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min"
