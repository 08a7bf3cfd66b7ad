"""A histogram of whole numbers in lines of text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

BLOCKS = " ▏▎▍▌▋▊▉█"
"""Nothing, parts of a character, and a whole one."""

ASCII = " #"

WIDTH = 40
"""Characters of the longest bar."""

MOST_ROWS = 15
"""The greatest number of rows; each covers as many values as that takes."""

STEPS = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000)


def marks(encoding: str | None) -> str:
    """Return the characters for bars that an encoding has."""
    try:
        BLOCKS.encode(encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return ASCII
    return BLOCKS


def rows(values: Sequence[int], characters: str = BLOCKS) -> Iterator[str]:
    """Draw how often values of 0 and more come, with a row for each step from the least to the greatest."""
    step = next((each for each in STEPS if max(values) // each - min(values) // each < MOST_ROWS), STEPS[-1])
    counts = Counter(value // step for value in values)
    most, width = max(counts.values()), len(str(max(counts) * step + step - 1))
    parts = len(characters) - 1
    # Empty rows are drawn as well: a gap in the middle is worth seeing.
    for number in range(min(counts), max(counts) + 1):
        first, last = number * step, number * step + step - 1
        name = f"{first:>{width}}" if step == 1 else f"{first:>{width}} to {last:>{width}}"
        length = round(counts[number] / most * WIDTH * parts) or (counts[number] > 0)  # a single match is visible, too
        bar = characters[-1] * (length // parts) + characters[length % parts].strip()
        yield f"{name}  {bar} {counts[number]}"
