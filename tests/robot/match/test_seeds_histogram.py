"""The histogram: each value in one row, few rows, bars as long as their share, in characters that can be written."""

from __future__ import annotations

import pytest

from eurobot_od.robot.match.seeds import ASCII, BLOCKS, MOST_ROWS, WIDTH, bar_marks, histogram


def test_each_number_has_its_row_and_the_most_frequent_the_longest_bar() -> None:
    assert list(histogram([3, 5, 5, 5, 5], ASCII)) == ["3  ########## 1", "4   0", f"5  {'#' * WIDTH} 4"]


@pytest.mark.parametrize("values", [range(100), [7], [0, 5000], [0, 14], [0, 15], [49, 65]])
def test_there_are_few_rows_and_nothing_is_lost(values: list[int]) -> None:
    lines = list(histogram(values))
    assert len(lines) <= MOST_ROWS
    assert sum(int(line.split()[-1]) for line in lines) == len(values)


def test_a_row_of_several_numbers_says_which() -> None:
    first, *_, last = histogram(range(30), ASCII)
    assert (first.split("  #")[0], last.split("  #")[0]) == (" 0 to  1", "28 to 29")


def test_parts_of_characters_show_small_differences() -> None:
    assert list(histogram([0] * 320 + [1] * 315)) == [f"0  {'█' * 40} 320", f"1  {'█' * 39}▍ 315"]


def test_what_is_not_nothing_is_seen() -> None:
    _, rare = histogram([0] * 100_000 + [1])
    assert rare == "1  ▏ 1"


@pytest.mark.parametrize(
    ("encoding", "expected"), [("utf-8", BLOCKS), ("ascii", ASCII), ("latin-1", ASCII), (None, ASCII), ("none", ASCII)]
)
def test_characters_that_the_encoding_has(encoding: str | None, expected: str) -> None:
    assert bar_marks(encoding) == expected
