"""`eurobot-od archive`: what it prints, and what it refuses."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.support import extras

pytest.importorskip("polars", reason="the extra `season` is not installed")
pytest.importorskip("pyarrow", reason="the extra `season` is not installed")

from tests.cli.console import run
from tests.rows import rows


@pytest.fixture
def log(tmp_path: Path) -> str:
    file = tmp_path / "some.log"
    file.write_text("(1.000000) can0 010#\n(2.000000) can0 7E6#00\n")
    return str(file)


def test_it_says_what_became_of_each_log(log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["archive", log, "-o", str(tmp_path / "season")]
    first, again = run(capsys, *words), run(capsys, *words)
    assert first.status == again.status == 0
    assert first.out.startswith(f"{log}: ")
    assert first.out.endswith(", 2 frames, 1 damaged\n")
    assert again.out.startswith(f"{log}: known, ")


def test_what_answers_what_is_kept_also_where_two_nodes_answer(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("duckdb", reason="the extra `season` is not installed")
    log, season = tmp_path / "start.log", str(tmp_path / "season")
    log.write_text("(1.000000) can0 2C0#DD86\n(1.001000) can0 300#\n(1.002000) can0 300#\n")
    run(capsys, "archive", str(log), "-o", season)
    said = run(capsys, "query", season, "--report", "answers", "--csv").out.splitlines()
    assert [line.split(",")[:5] for line in said[1:]] == [
        ["Start Configuration Set", "Start Configuration Confirm", "1", "1", "1.0"]
    ]


@rows(
    "words, status, complaint",
    [
        (["none.log"], 3, "eurobot-od: none.log: No such file or directory"),
        ([__file__], 2, "unknown log format 'py'"),
        (["--jobs", "0", "x"], 2, "0 is not a number from 1 to 60"),
        (["--eds", "none.eds", "x"], 2, "none.eds"),
    ],
)
def test_wrong_input_is_one_line(
    words: list[str], status: int, complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "archive", "-o", str(tmp_path / "season"), *words)
    assert (said.status, said.out) == (status, "")
    assert complaint in said.complaint
    assert len(said.err.splitlines()) == 1


def test_without_the_extra_it_says_what_to_install(
    log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    for name in [each for each in sys.modules if each.startswith("eurobot_od.season")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "polars", None)
    said = run(capsys, "archive", log, "-o", str(tmp_path / "season"))
    assert said.status == 2
    assert said.complaint == f"eurobot-od: {extras.missing('polars', 'season')}"


def test_a_logs_name_stays_in_its_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "a\x1b[2J\nb.log"
    log.write_text("(1.0) can0 00C#\n")
    said = run(capsys, "archive", str(log), "-o", str(tmp_path / "season"))
    assert said.status == 0
    assert r"a\x1b[2J\nb.log: " in said.out
