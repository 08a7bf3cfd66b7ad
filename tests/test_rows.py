"""The rows of a table in one test: all are tried, and those that fail are named."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import nightly
import pytest

from tests.rows import rows

ROOT = Path(__file__).parents[1]

TRIED: list[int] = []


SQUARES = [(1, 1), (2, 5), (3, 9), (4, 17), *((number, number**2) for number in range(5, 42))]


@rows("number, square", SQUARES)
def has_square(number: int, square: int, tmp_path: Path) -> None:
    TRIED.append(number)
    (tmp_path / "of its own").touch(exist_ok=False)
    assert number**2 == square


def test_all_rows_are_tried_and_those_that_fail_are_named(tmp_path: Path) -> None:
    TRIED.clear()
    with pytest.raises(AssertionError, match=r"assert \(2 \*\* 2\) == 5") as error:
        has_square(tmp_path=tmp_path)
    assert [*range(1, 42)] == TRIED
    assert error.value.__notes__ == [
        "2 of 41 rows failed, this is the first of:",
        "  number=2, square=5",
        "  number=4, square=17",
    ]


def test_a_parameter_that_is_no_column_is_a_fixture() -> None:
    assert list(inspect.signature(has_square).parameters) == ["tmp_path"]


def test_a_sample_has_the_same_rows_each_time() -> None:
    tried: list[int] = []

    @rows("number", range(1000), sample=3)
    def take(number: int) -> None:
        tried.append(number)

    for _ in range(20):
        take()
    assert len(tried) == 60
    assert len({*tried}) == 3
    assert set(tried) <= set(range(1000))


def test_the_nightly_run_tries_all_rows() -> None:
    sampled = re.compile(r"^@rows\(.*sample=", re.MULTILINE)
    files = {
        each.relative_to(ROOT).as_posix()
        for each in (ROOT / "tests").rglob("test_*.py")
        if sampled.search(each.read_text("utf-8"))
    }
    assert files == {*nightly.SAMPLED[1:]}


def skip_below(bound: int, number: int) -> None:
    if number < bound:
        pytest.skip(f"{number} is too low")
    TRIED.append(number)


def test_the_test_is_skipped_if_all_rows_are() -> None:
    TRIED.clear()
    over = rows("number", range(41))(skip_below)
    over(bound=40)
    assert TRIED == [40]
    with pytest.raises(pytest.skip.Exception, match="0 is too low"):
        over(bound=41)


def test_a_small_table_is_parametrized() -> None:
    with pytest.raises(pytest.UsageError, match=r"number: 40 rows; a table of up to 40 is pytest.mark.parametrize"):
        rows("number", range(40))(skip_below)(bound=0)
