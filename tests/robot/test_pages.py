"""README and the pages about the protocol say what its files say; links of README and docs lead to files."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "docs" / "from-table-to-method.md"]
SOURCES = {"yaml": ROOT / "eds" / "protocol.yaml", "ini": ROOT / "eds" / "canopen" / "drive.eds"}
LINK = re.compile(r"(?<=\]\()(?!https?:|#)([^)#\s]+)")


@pytest.mark.parametrize("page", PAGES, ids=lambda each: each.name)
@pytest.mark.parametrize("language", SOURCES)
def test_lines_of_the_table_and_of_the_eds_are_in_them(page: Path, language: str) -> None:
    there = set(SOURCES[language].read_text(encoding="utf-8").splitlines())
    blocks = re.findall(rf"^```{language}\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    assert blocks
    assert [line for block in blocks for line in block.splitlines() if line not in there] == []


@pytest.mark.parametrize("page", [ROOT / "README.md", *(ROOT / "docs").glob("*.md")], ids=lambda each: each.name)
def test_every_link_leads_to_a_file_of_the_tree(page: Path) -> None:
    links = LINK.findall(page.read_text(encoding="utf-8"))
    assert [each for each in links if not (page.parent / each).exists()] == []
