"""Durations as people write them: a number and its unit, without which there is no duration."""

from __future__ import annotations

import re
from math import inf

from eurobot_od.errors import LocalError

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
    """Tell whether a text is a duration."""
    match = _DURATION.fullmatch(text)
    return match is not None and match[2] in UNITS


def microseconds(text: str) -> int:
    """Return a duration as whole microseconds, rounded; raises DurationError."""
    return round(seconds(text) * 1_000_000)


def text(seconds: float) -> str:
    """Write a duration as people do: `500 ms`, `1.5 s`."""
    return f"{seconds:g} s" if seconds >= 1 else f"{seconds * 1000:g} ms"
