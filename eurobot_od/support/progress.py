"""Progress bars on a terminal, and lines of progress elsewhere."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from typing import NamedTuple, TextIO, TypeAlias, TypeVar

from eurobot_od.support.texts import one_line

ENDLESS = 10_000
"""Width of a line that has no limit, in characters."""

WITH_COLOURS = {"WT_SESSION", "TERM", "ANSICON", "ConEmuANSI"}
"""Variables that are set by Windows terminals with escape sequences; the old console prints the sequences."""


def redraws(stream: TextIO) -> bool:
    """Return whether a line can be overwritten: the stream is a terminal and not a dumb one."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def in_colour(stream: TextIO) -> bool:
    """Return whether to use colours: the terminal has them, and NO_COLOR is not set (no-color.org)."""
    is_known = os.name != "nt" or bool(WITH_COLOURS & os.environ.keys())
    return is_known and redraws(stream) and not os.environ.get("NO_COLOR")  # an empty NO_COLOR does not count


def columns(stream: TextIO) -> int:
    """Return the width of a terminal in characters; `ENDLESS` for anything else."""
    try:
        return os.get_terminal_size(stream.fileno()).columns or ENDLESS
    except (OSError, ValueError):  # a text in memory has no file
        return ENDLESS


def folded(text: str, stream: TextIO, indent: int) -> str:
    """Wrap a line between words to fit the terminal, and indent all lines but the first."""
    width = columns(stream)
    if len(text) <= width or width < 2 * indent:
        return text
    from textwrap import fill  # not with every command: it needs `re`

    return fill(text, width, subsequent_indent=" " * indent, break_on_hyphens=False)


Progress: TypeAlias = Callable[[int, "int | None"], object]
"""Called with the amount that is done, and the whole amount, None if it is unknown."""

WIDTH, SHORTEST = 30, 5
"""Width of the bar, and its width on a narrow terminal, in characters."""

REDRAWN = 0.1
"""Time between two drawings, in s."""

SHORT = 2.0
"""Time after which a bar shows the time left, and a late one is drawn, in s."""

LONG = 10.0
"""Without a terminal: shortest expected time that is announced, and time between two lines, in s."""


class Unit(NamedTuple):
    """What is counted, and the unit of its rate, which stands for `number` of them."""

    name: str
    rate: str
    number: int = 1


BYTES = Unit("bytes", "kB/s", 1000)
PERCENT = Unit("%", "%/s")
OBJECTS = Unit("objects", "objects/s")


def unwatched(done: int, size: int | None) -> None:
    """Show nothing; a `Progress` for streams that are not a terminal."""


@contextmanager
def bar(
    what: str,
    stream: TextIO | None = None,
    clock: Callable[[], float] = time.monotonic,
    unit: Unit = BYTES,
    late: bool = False,
) -> Iterator[Progress]:
    """Yield a `Progress` that draws a bar, if `late` once `SHORT` s have passed; the bar is erased at the end.

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
        if (late and now - started < SHORT) or (width and now - drawn < REDRAWN and done != size):
            return
        drawn = now
        # One column stays free: writing the last one may begin a new line.
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
    """Return the bar as text: share, number, rate and, after `SHORT` seconds, the time left.

    It has at most `most` characters: the bar is shortened to `SHORTEST`, then the text is cut off.
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
    """Yield an iterator over `things` that draws a bar for `what` if the loop takes long."""
    with bar(what, unit=OBJECTS, late=True) as draw:
        # As a context manager, `passing` erases the bar before an error is printed.
        yield reporting(list(things), draw)


def reporting(things: Collection[Thing], progress: Progress) -> Iterator[Thing]:
    """Yield things, and report before each how many are done."""
    for done, thing in enumerate(things):
        progress(done, len(things))
        yield thing


def counted(
    things: Iterable[Thing],
    number: int,
    what: str,
    at_once: int,
    stream: TextIO | None = None,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[Thing]:
    """Yield `number` things that are made `at_once` at a time, and show the progress; `what` names them.

    A terminal shows a bar. Elsewhere a line announces a long time, and further lines tell the time left.
    """
    out = stream or sys.stderr
    with bar("", out, clock, Unit(what, f"{what}/s")) as draw:
        first = said = clock()
        for count, thing in enumerate(things, 1):
            now = clock()
            if count == 1:
                first = said = now  # the first one also starts the processes, so its time does not count
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
