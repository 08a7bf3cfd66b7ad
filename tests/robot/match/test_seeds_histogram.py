"""The histogram: each value in one row, few rows, bars as long as their share, a single match seen."""

from __future__ import annotations

import pytest

from eurobot_od.robot.match.seeds import MOST_ROWS, WIDTH, histogram


def test_each_number_has_its_row_and_the_most_frequent_the_longest_bar() -> None:
    assert list(histogram([3, 5, 5, 5, 5])) == ["3  ########## 1", "4   0", f"5  {'#' * WIDTH} 4"]


@pytest.mark.parametrize("values", [range(100), [7], [0, 5000], [0, 14], [0, 15], [49, 65]])
def test_many_numbers_share_rows_and_none_is_lost(values: list[int]) -> None:
    lines = list(histogram(values))
    assert len(lines) <= MOST_ROWS
    assert sum(int(line.split()[-1]) for line in lines) == len(values)


def test_a_row_of_several_numbers_names_its_range() -> None:
    first, *_, last = histogram(range(30))
    assert (first.split("  #")[0], last.split("  #")[0]) == (" 0 to  1", "28 to 29")


def test_a_count_above_0_has_a_bar() -> None:
    _, rare = histogram([0] * 100_000 + [1])
    assert rare == "1  # 1"
