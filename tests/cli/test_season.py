"""`archive` and `query`: what is kept of logs, tables, CSV, JSON, pictures, reports, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from eurobot_od.cli import main
from eurobot_od.support import extras
from tests.cli.console import Terminal, run

for needed in ("polars", "duckdb", "pyarrow"):
    pytest.importorskip(needed, reason="the extra `season` is not installed")


@pytest.fixture
def season(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> str:
    log = tmp_path / "some.log"
    log.write_text("(1.000000) can0 202#D27423592C01C3A5\n(1.250000) can0 182#\n")
    folder = str(tmp_path / "season")
    assert run(capsys, "archive", str(log), "-o", folder).status == 0
    return folder


SQL = "SELECT line, hex(data) AS hex, data, t, NULL AS nothing FROM frames ORDER BY line"


def test_a_table_is_aligned_and_rounded(season: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "query", season, SQL).out == (
        "line  hex               data                 t  nothing\n"
        "   1  D27423592C01C3A5  D27423592C01C3A5     1\n"
        "   2                                      1.25\n"
    )


def test_options_and_the_query_come_in_any_order(season: str, capsys: pytest.CaptureFixture[str]) -> None:
    orders = [
        [season, "--csv", SQL],
        ["--csv", season, SQL],
        [season, SQL, "--csv"],
        [season, "-b", "125000", SQL, "--csv"],
    ]
    first, *others = [run(capsys, "query", *order).out for order in orders]
    assert first.startswith("line,hex")
    assert others == [first] * 3


def test_csv_and_json_have_all_rows(season: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(capsys, "query", season, SQL, "--csv").out.splitlines()[:2] == [
        "line,hex,data,t,nothing",
        "1,D27423592C01C3A5,D27423592C01C3A5,1.0,",
    ]
    first, second = run(capsys, "query", season, SQL, "--json").out.splitlines()
    assert json.loads(first) == {
        "line": 1, "hex": "D27423592C01C3A5", "data": "D27423592C01C3A5", "t": 1.0, "nothing": None
    }  # fmt: skip
    assert json.loads(second)["line"] == 2


def test_query_without_sql_lists_the_tables(season: str, capsys: pytest.CaptureFixture[str]) -> None:
    lines = run(capsys, "query", season).out.splitlines()
    assert "frames                   2  run, line, t, datetime, channel, cob_id, data, remote, fd, brs" in lines


def test_a_report_is_printed_and_drawn(season: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "answers.svg"
    said = run(capsys, "query", season, "--report", "answers", "--plot", str(picture))
    assert said.out.splitlines()[1].split()[:8] == ["Move", "To", "Move", "Confirm", "1", "1", "250", "250"]
    assert "From a request to its answer" in picture.read_text()


def test_the_answer_to_any_query_is_drawn(season: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "some.svg"
    assert run(capsys, "query", season, "SELECT t, line FROM frames", "--plot", str(picture)).status == 0
    assert "<polyline" in picture.read_text()


def test_a_terminal_shows_the_progress_of_a_query(season: str, monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr("eurobot_od.support.progress.SHORT", 0.0)
    monkeypatch.setattr("sys.stderr", terminal)
    main(["query", season, "SELECT count(*) FROM frames"])
    assert "100 of 100 %" in terminal.getvalue()


def test_reports_are_listed_without_a_season(capsys: pytest.CaptureFixture[str]) -> None:
    names = [line.split()[0] for line in run(capsys, "query", "none", "--report", "list").out.splitlines()]
    assert names == ["periods", "answers", "load", "damage"]


HOSTILE = """
    SELECT 'a' || chr(27) || '[2J' || chr(10) || 'b' AS text, '=cmd|1' AS formula, [1, 2] AS list, {'x': 'y'} AS record,
    INTERVAL 90 SECOND AS took
"""


@pytest.mark.parametrize(
    ("form", "shown"),
    [
        ([], [r"a\x1b[2J\nb", "=cmd|1", "[1, 2]", "{'x': 'y'}", "00:01:30"]),
        (["--csv"], [r"a\x1b[2J\nb,'=cmd|1,", '"[1, 2]"', "00:01:30"]),
        (["--json"], [r"a\u001b[2J\nb", "[1,2]"]),
    ],
)
def test_texts_of_a_log_cannot_break_the_table(
    season: str, form: list[str], shown: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    status, out, _ = run(capsys, "query", season, HOSTILE, *form)
    assert status == 0
    assert "\x1b" not in out
    assert [each for each in shown if each not in out] == []


@pytest.mark.parametrize(
    "sql", ["SELECT union_value(a := 1) AS u", "SELECT INTERVAL 1 MONTH AS m", "SELECT 1::BIT AS b"]
)
@pytest.mark.parametrize("form", ["--csv", "--json", "--plot=x.svg"])
def test_a_column_of_any_type_is_printed_or_refused_in_one_line(
    season: str,
    sql: str,
    form: str,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    said = run(capsys, "query", season, sql, form)
    assert said.status in (0, 2), said
    assert "Traceback" not in said.err


def test_more_rows_than_fit_are_refused(season: str, capsys: pytest.CaptureFixture[str]) -> None:
    said = run(capsys, "query", season, "SELECT * FROM range(100000000)")
    assert (said.status, said.out) == (2, "")
    assert said.complaint == "eurobot-od: more than 10000000 rows: ask for sums, or for a part by LIMIT"


def damaged(file: Path, how: str) -> None:
    content = file.read_bytes()
    file.write_bytes({"cut off": content[: len(content) // 2], "empty": b"", "other": b"x" * len(content)}[how])


@pytest.mark.long
@pytest.mark.parametrize(("table", "how"), [("frames", "cut off"), ("move_to", "empty"), ("runs", "other")])
def test_a_damaged_file_is_named_and_left_out_and_mended_by_the_next_archive(
    season: str, tmp_path: Path, table: str, how: str, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other.log"
    other.write_text("(1.000000) can0 202#D27423592C0D9702\n")
    assert run(capsys, "archive", str(other), "-o", season).status == 0
    file = min((Path(season) / table).iterdir())
    damaged(file, how)
    said = run(capsys, "query", season, f"SELECT count(DISTINCT run) AS n FROM {table}")
    assert (said.status, said.out) == (0, "n\n1\n")
    assert said.err == f"eurobot-od: left out: {file} is damaged; archive its log again\n"
    assert run(capsys, "query", season).status == 0
    again = run(capsys, "archive", str(other), str(tmp_path / "some.log"), "-o", season).out
    assert again.count(": known, ") == 1
    assert run(capsys, "query", season, f"SELECT count(DISTINCT run) AS n FROM {table}")[1:] == ("n\n2\n", "")


def test_a_folder_without_files_is_no_table(season: str, capsys: pytest.CaptureFixture[str]) -> None:
    (Path(season) / "mine").mkdir()
    said = run(capsys, "query", season, "SELECT * FROM mine")
    assert said.status == 2
    assert "Table with name mine does not exist" in said.complaint
    assert run(capsys, "query", season).status == 0


def test_at_most_ends_a_query_that_would_never_end(season: str, capsys: pytest.CaptureFixture[str]) -> None:
    endless = "SELECT sum(a.range * b.range) FROM range(1000000) a, range(10000000) b"
    said = run(capsys, "query", season, endless, "--at-most", "200ms")
    assert said == (2, "", "eurobot-od: the query has not ended within 200 ms\n")


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["SELECT 1", "--report", "load"], "a query is SQL or --report, not both"),
        (["--report", "answrs"], "unknown report 'answrs'; did you mean answers?"),
        (["SELECT x FROM y"], "Table with name y does not exist"),
        (["SELECT 'a' AS b", "--plot", "x.svg"], "nothing to draw"),
    ],
)
def test_wrong_queries_are_one_line(
    season: str, words: list[str], complaint: str, capsys: pytest.CaptureFixture[str]
) -> None:
    said = run(capsys, "query", season, *words)
    assert (said.status, said.out) == (2, "")
    assert complaint in said.complaint


# archive


pytest.importorskip("polars", reason="the extra `season` is not installed")


@pytest.fixture
def log(tmp_path: Path) -> str:
    file = tmp_path / "some.log"
    file.write_text("(1.000000) can0 302#\n(2.000000) can0 7E6#00\n")
    return str(file)


def test_archive_prints_a_line_for_each_log(log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["archive", log, "-o", str(tmp_path / "season")]
    first, again = run(capsys, *words), run(capsys, *words)
    assert first.status == again.status == 0
    assert first.out.startswith(f"{log}: ")
    assert first.out.endswith(", 2 frames, 1 defect\n")
    assert again.out.startswith(f"{log}: known, ")


def test_requests_of_several_answering_nodes_are_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("duckdb", reason="the extra `season` is not installed")
    log = tmp_path / "start.log"
    season = str(tmp_path / "season")
    log.write_text("(1.000000) can0 481#1901\n(1.001000) can0 483#\n(1.002000) can0 483#\n")
    run(capsys, "archive", str(log), "-o", season)
    said = run(capsys, "query", season, "--report", "answers", "--csv").out.splitlines()
    assert [line.split(",")[:5] for line in said[1:]] == [["Order Set", "Order Confirm", "1", "1", "1.0"]]


@pytest.mark.parametrize(
    ("words", "status", "complaint"),
    [
        (["none.log"], 2, "eurobot-od: none.log: No such file or directory"),
        ([__file__], 2, "not a known log; --format names its format"),
        (["--jobs", "0", "x"], 2, "0 is not a number of processes; allowed: 1..60"),
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


def test_without_the_extra_the_install_command_is_printed(
    log: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    for name in [each for each in sys.modules if each.startswith("eurobot_od.season")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "polars", None)
    said = run(capsys, "archive", log, "-o", str(tmp_path / "season"))
    assert said.status == 2
    assert said.complaint == f"eurobot-od: {extras.missing('polars', 'season')}"


def test_the_name_of_a_log_cannot_break_the_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "a\x1b[2J\nb.log"
    log.write_text("(1.0) can0 182#\n")
    said = run(capsys, "archive", str(log), "-o", str(tmp_path / "season"))
    assert said.status == 0
    assert r"a\x1b[2J\nb.log: " in said.out
