"""Other people's programs agree with us; the questions are those of `tools/interop.py`."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from interop_rows.row import Row
from interop_rows.table import ROWS

PAGE = Path(__file__).parents[2] / "docs" / "interop.md"


@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row.tool.name} {row.asked}")
def test_agrees(row: Row, tmp_path: Path) -> None:
    needed = row.tool.in_ci and os.environ.get("CI") == "true"
    if not (row.tool.present() or needed):
        pytest.skip(f"{row.tool.name} is not here: {row.tool.remedy}")
    row.ask(tmp_path)


def test_the_page_has_every_question_in_its_order() -> None:
    lines = [each.split(" | ") for each in PAGE.read_text().splitlines() if each.startswith("| ")][2:]
    asked = [(tool.removeprefix("| "), question) for tool, _, question, *_ in lines]
    assert asked == [(f"{row.tool.name} ({row.tool.source})", row.asked) for row in ROWS]


def test_no_answer_on_the_page_differs() -> None:
    assert "| differs |" not in PAGE.read_text()
