"""Texts where they leave the program: whatever files and peers say, it stays in its place, and it shows.

Rule of this file: whatever writes output calls `one_line` once for each text that is not its own: a name in an EDS, a
channel of a log, a step of a suite, a node's string. XML, HTML and JSON add their own escapes.
"""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator, Sequence
from itertools import count
from math import inf
from typing import Any

from eurobot_od.errors import LocalError


def one_line(text: str) -> str:
    r"""Return a text as one line that a terminal shows as it is: control characters and line ends as `\x1b`, `\n`."""
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in text)


def encodable(text: str) -> str:
    r"""Return a text that UTF-8 can hold: half a surrogate pair, as in a file's name that is not UTF-8, as `\udcff`."""
    return text.encode(errors="backslashreplace").decode()


def described(error: BaseException) -> str:
    """Return an exception's type and its text, in one line; the type alone if the text cannot be had."""
    try:
        said = " ".join(str(error).split())
    except (Exception, SystemExit):  # somebody's class, whose `__str__` raises
        said = "what it says cannot be read"
    return f"{type(error).__name__}: {said}"


def amount(number: int, thing: str, things: str = "") -> str:
    """Say how many there are of a thing: `1 frame`, `2 frames`; `things` is a plural that has more than an s."""
    return f"{number} {thing if number == 1 else things or thing + 's'}"


# Tables

FORMULA = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""What a spreadsheet takes for the beginning of a formula, also in full width, as input methods of East Asia write it.

They are those of OWASP's page "CSV Injection"; tab and line ends, which it lists too, never begin a cell of one line.
"""


def first_free(name: str, taken: Container[object]) -> str:
    """Return the first of `status`, `status_2`, `status_3`, ... that is not taken."""
    names = (f"{name}_{number}" if number > 1 else name for number in count(1))
    return next(each for each in names if each not in taken)


def cell(value: Any) -> Any:
    """Return a value for CSV: a text in one line, and with `'` in front if a spreadsheet would calculate it."""
    if not isinstance(value, str):  # a number may begin with a minus
        return value
    return f"'{one_line(value)}" if value.startswith(FORMULA) else one_line(value)


GAP = "  "
"""Between two columns."""


def columns(rows: Iterable[Sequence[str]], align: str = "") -> Iterator[str]:
    """Write a line for each row, as a terminal shows it; a column is as wide as its longest text.

    `align` has a letter for each column, `l` or `r` for flush left or right; columns without one are flush left.
    """
    lines = [[*map(one_line, row)] for row in rows]
    widths = [max(map(len, column)) for column in zip(*lines)]
    places = [str.rjust if letter == "r" else str.ljust for letter in align.ljust(len(widths), "l")]
    for line in lines:
        yield GAP.join(place(text, width) for place, text, width in zip(places, line, widths)).rstrip()


UNITS = {"us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0}
"""Seconds for each unit."""

_DURATION = re.compile(r"\s*(\d+(?:\.\d+)?)\s*([a-z]+)\s*")


class DurationError(LocalError):
    """A text that does not say a duration."""

    def __init__(self, text: str) -> None:
        super().__init__(f"{text!r} is not a duration; write a number and one of {', '.join(UNITS)}, such as 500 ms")


def seconds(text: str) -> float:
    """Return the seconds of `500 ms`, `2s` or `1.5 min`; raises DurationError."""
    match = _DURATION.fullmatch(text)
    number = float(match[1]) if match else inf  # `float` gives infinity for 400 digits, too
    if match is None or match[2] not in UNITS or number == inf:
        raise DurationError(text)
    return number * UNITS[match[2]]


def is_duration(text: str) -> bool:
    """Return whether a text is a duration."""
    match = _DURATION.fullmatch(text)
    return match is not None and match[2] in UNITS


def microseconds(text: str) -> int:
    """Return a duration as whole microseconds, rounded; raises DurationError."""
    return round(seconds(text) * 1_000_000)


def text(seconds: float, digits: int = 9) -> str:
    """Write a duration as people do: `500 ms`, `1.5 s`; rounded to so many digits of a second."""
    seconds = round(seconds, digits)
    return f"{seconds:g} s" if seconds >= 1 else f"{seconds * 1000:g} ms"
