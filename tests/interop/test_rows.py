"""The page of other people's programs has what `tools/interop.py` asks; .ci/run asks it each time."""

from __future__ import annotations

from pathlib import Path

from interop_rows.table import ROWS

PAGE = Path(__file__).parents[2] / "docs" / "interop.md"


def test_the_page_has_every_question_in_its_order() -> None:
    lines = [each.split(" | ") for each in PAGE.read_text().splitlines() if each.startswith("| ")][2:]
    asked = [(tool.removeprefix("| "), question) for tool, _, question, *_ in lines]
    assert asked == [(f"{row.tool.name} ({row.tool.source})", row.asked) for row in ROWS]


def test_no_answer_on_the_page_differs() -> None:
    assert "| differs |" not in PAGE.read_text()
