"""The pages and lists that are made from the code are those of today."""

from __future__ import annotations

from pathlib import Path

import lint_mutants
import make_pages
import pytest

from tests.lint.mutations import DEFECTS


@pytest.mark.parametrize("file", make_pages.MADE, ids=lambda file: file.name)
def test_each_generated_file_is_up_to_date(file: Path) -> None:
    assert file.read_text("utf-8") == make_pages.MADE[file](), "run .venv/bin/python tools/make_pages.py"


def test_a_file_that_is_out_of_date_is_named_and_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = tmp_path / "old.md", tmp_path / "new.md"
    old.write_text("yesterday", "utf-8")
    new.write_text("today", "utf-8")
    monkeypatch.setattr(make_pages, "ROOT", tmp_path)
    monkeypatch.setattr(make_pages, "MADE", {old: lambda: "today", new: lambda: "today"})
    assert make_pages.main(["--check"]) == 1
    assert capsys.readouterr().out == "old.md: out of date; run tools/make_pages.py\n"
    assert (make_pages.main([]), old.read_text("utf-8"), make_pages.main(["--check"])) == (0, "today", 0)


def test_other_programs_are_asked_only_about_defects_that_the_page_does_not_have(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first, *others = DEFECTS
    monkeypatch.setattr(lint_mutants, "DEFECTS", [first._replace(what="of today"), *others])
    monkeypatch.setattr(lint_mutants, "verdict_of", lambda _, defect: f"asked about {defect.what}")
    asked = {line for line in lint_mutants.page().splitlines() if "asked about" in line}
    assert asked == {f"| {first.code} | of today | asked about of today | asked about of today |"}
