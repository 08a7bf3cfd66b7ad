"""Texts in columns."""

from __future__ import annotations

import pytest

from eurobot_od.support.tables import columns

ROWS = [("ID", "count", "from"), ("1", "7", "drive"), ("0200", "12", "core")]


@pytest.mark.parametrize(
    ("align", "lines"),
    [
        ("", ["ID    count  from", "1     7      drive", "0200  12     core"]),
        ("rr", ["  ID  count  from", "   1      7  drive", "0200     12  core"]),
        ("llr", ["ID    count   from", "1     7      drive", "0200  12      core"]),
    ],
)
def test_a_column_is_as_wide_as_its_longest_text(align: str, lines: list[str]) -> None:
    assert list(columns(ROWS, align)) == lines


def test_a_row_is_one_line_and_ends_with_its_last_text() -> None:
    assert list(columns([("a\nb", ""), ("c", "")])) == ["a\\nb", "c"]


def test_no_rows_are_no_lines() -> None:
    assert list(columns([])) == []
