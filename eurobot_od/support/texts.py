"""Text for output: made harmless, one line, in columns; and durations.

Every writer of output calls `one_line` once for each text from outside: names in an EDS, channels of a log, steps of a
suite, strings of a node. XML, HTML and JSON add their own escapes.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Container, Iterable, Iterator, Sequence
from enum import Enum
from itertools import count
from math import inf
from typing import Any, NamedTuple

from eurobot_od.errors import LocalError


def one_line(text: str) -> str:
    r"""Return a text as one printable line: control characters and line ends become `\x1b`, `\n`."""
    if text.isprintable():
        return text
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in text)


def encodable(text: str) -> str:
    r"""Return a text that UTF-8 can encode: lone surrogates, as in file names that are not UTF-8, become `\udcff`."""
    return text.encode(errors="backslashreplace").decode()


def described(error: BaseException) -> str:
    """Return an exception's type and text in one line."""
    try:
        said = " ".join(str(error).split())
    except (Exception, SystemExit):  # a foreign exception whose `__str__` raises
        said = "what it says cannot be read"
    return f"{type(error).__name__}: {said}"


def parameters(function: Callable[..., object], without: int = 0) -> str:
    """Format a function's parameters, `(file, *, store=True)`, `without` the first ones."""
    from inspect import Signature, signature  # here, as every command imports this module

    each = [*signature(function).parameters.values()][without:]
    shown = [one.replace(default=_Member(one.default)) if isinstance(one.default, Enum) else one for one in each]
    return str(Signature([one.replace(annotation=Signature.empty) for one in shown]))


class _Member(NamedTuple):
    """A member of an enum as a program writes it."""

    member: Enum

    def __repr__(self) -> str:
        return f"{type(self.member).__name__}.{self.member.name}" if self.member.name else repr(self.member)


def amount(number: int, thing: str, things: str = "") -> str:
    """Format a number of things: `1 frame`, `2 frames`; `things` is an irregular plural."""
    return f"{number} {thing if number == 1 else things or thing + 's'}"


# Tables

FORMULA = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""Characters that begin a formula in a spreadsheet, also as East Asian full-width characters.

From OWASP's page "CSV Injection", without tab and line ends, which cannot begin a cell of one line.
"""


def first_free(name: str, taken: Container[object]) -> str:
    """Return the first name of `status`, `status_2`, `status_3`, ... that is not in `taken`."""
    names = (f"{name}_{number}" if number > 1 else name for number in count(1))
    return next(each for each in names if each not in taken)


def cell(value: Any) -> Any:
    """Return a value for CSV: a text in one line, with `'` before what a spreadsheet would take for a formula."""
    if not isinstance(value, str):  # a negative number begins with a minus
        return value
    return f"'{one_line(value)}" if value.startswith(FORMULA) else one_line(value)


GAP = "  "
"""Space between two columns."""


def columns(rows: Iterable[Sequence[str]], align: str = "") -> Iterator[str]:
    """Yield the rows as lines for a terminal; a column is as wide as its longest text.

    `align` has one letter for each column, `l` for left or `r` for right; columns without one are left-aligned.
    """
    lines = [[*map(one_line, row)] for row in rows]
    widths = [max(map(len, column)) for column in zip(*lines)]
    places = [str.rjust if letter == "r" else str.ljust for letter in align.ljust(len(widths), "l")]
    for line in lines:
        yield GAP.join(place(text, width) for place, text, width in zip(places, line, widths)).rstrip()


UNITS = {"us": 1e-6, "ms": 1e-3, "s": 1.0, "min": 60.0}
"""Length of each unit in s."""

_DURATION = re.compile(r"\s*(\d+(?:\.\d+)?)\s*([a-z]+)\s*")


class DurationError(LocalError):
    """A text that is not a duration."""

    def __init__(self, text: str) -> None:
        super().__init__(f"{text!r} is not a duration; write a number and one of {', '.join(UNITS)}, such as 500 ms")


def seconds(text: str) -> float:
    """Parse `500 ms`, `2s` or `1.5 min` and return it in s; raises DurationError."""
    match = _DURATION.fullmatch(text)
    number = float(match[1]) if match else inf  # `float` makes 400 digits infinity
    if match is None or match[2] not in UNITS or number == inf:
        raise DurationError(text)
    return number * UNITS[match[2]]


def is_duration(text: str) -> bool:
    """Return whether a text is a duration."""
    match = _DURATION.fullmatch(text)
    return match is not None and match[2] in UNITS


def microseconds(text: str) -> int:
    """Parse a duration and return it in whole microseconds, rounded; raises DurationError."""
    return round(seconds(text) * 1_000_000)


def text(seconds: float, digits: int = 9) -> str:
    """Format a duration: `500 ms`, `1.5 s`; rounded to `digits` decimals of a second."""
    seconds = round(seconds, digits)
    return f"{seconds:g} s" if seconds >= 1 else f"{seconds * 1000:g} ms"
