"""Durations as people write them: what is one, and what is not."""

from __future__ import annotations

import pytest

from eurobot_od.support.durations import DurationError, is_duration, microseconds, seconds, text
from tests.rows import rows

VALID = [
    ("500ms", 0.5),
    ("500 ms", 0.5),
    ("  2s ", 2.0),
    ("1.5 min", 90.0),
    ("250 us", 0.00025),
    ("0 s", 0.0),
]

INVALID = [
    "500",  # no unit: seconds or milliseconds?
    "ms",  # no number
    "",
    "5 h",  # no unit of ours
    "5 S",  # siemens
    "-1 s",  # the past
    "1e3 ms",
    ".5 s",
    "1, 5 s",
    "5 ms 3",
]


@pytest.mark.parametrize(("written", "expected"), VALID)
def test_reads(written: str, expected: float) -> None:
    assert seconds(written) == pytest.approx(expected)
    assert microseconds(written) == round(expected * 1_000_000)
    assert is_duration(written)


@rows("written", INVALID)
def test_refuses(written: str) -> None:
    with pytest.raises(DurationError) as error:
        seconds(written)
    expected = f"{written!r} is not a duration; write a number and one of us, ms, s, min, such as 500 ms"
    assert str(error.value) == expected
    assert not is_duration(written)


@pytest.mark.parametrize(
    ("duration", "shown"), [(0.0, "0 ms"), (0.00025, "0.25 ms"), (0.1, "100 ms"), (1.0, "1 s"), (90.5, "90.5 s")]
)
def test_writes(duration: float, shown: str) -> None:
    assert text(duration) == shown
