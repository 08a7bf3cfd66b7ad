"""A season that is there: lazy frames, SQL, logs of several networks, and what cannot be asked."""

from __future__ import annotations

import os
import random
import shutil
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import wait
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("polars", reason="the extra `season` is not installed")
pytest.importorskip("duckdb", reason="the extra `season` is not installed")

import polars as pl

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.season import season as season_module
from eurobot_od.season.answers import tables as listed
from eurobot_od.season.archive import Archiver, DecodedNetwork, archive
from eurobot_od.season.results import SETTINGS
from eurobot_od.season.season import Season, SqlError
from tests.kit import plant
from tests.kit.plant import messages as m
from tests.season.seasons import write_log

MOVE = m.MoveTo(x=1234, y=567, angle=89, speed=75)


@pytest.fixture(scope="module")
def season(tmp_path_factory: pytest.TempPathFactory) -> Season:
    """A log of a move in each dialect."""
    folder = tmp_path_factory.mktemp("seasons")
    for number, dialect in enumerate(plant.DIALECTS):
        log = write_log(folder / f"{number}.log", [(1.0 + number, plant.protocol(dialect).encode(MOVE))])
        Archiver(folder / "season", DecodedNetwork(plant.load_all(dialect), plant.CATALOGUE))(log)
    return Season.open(folder / "season")


def test_a_table_is_a_lazy_frame_over_all_logs(season: Season) -> None:
    found = season.frames("move_to").sort("t").collect()
    assert found.select("t", "x", "y", "angle", "speed").rows() == [(1.0, 1234, 567, 89, 75), (2.0, 1234, 567, 89, 75)]


def test_a_field_that_only_some_logs_have_is_null_for_the_others(season: Season) -> None:
    lazy = season.frames("move_to").sort("t").collect()["route"]
    assert lazy.cast(pl.String).to_list() == ["planned", None]
    assert season.sql("SELECT route FROM move_to ORDER BY t")["route"].to_list() == ["planned", None]


def test_an_unfinished_run_is_not_counted(tmp_path: Path) -> None:
    log = write_log(tmp_path / "a.log", [(1.0, plant.protocol().encode(MOVE))])
    Archiver(tmp_path / "season", DecodedNetwork(plant.load_all(), plant.CATALOGUE))(log)
    [file] = (tmp_path / "season" / "move_to").iterdir()
    shutil.copy(file, file.with_stem("0123456789abcdef"))  # its row in `runs` comes last
    found = Season.open(tmp_path / "season")
    assert len(found.frames("move_to").collect()) == 1
    assert found.sql("SELECT count(*) FROM move_to").item() == 1


QUESTIONS = (
    "SELECT * FROM runs ORDER BY run",
    "SELECT * FROM frames ORDER BY run",
    "SELECT * FROM move_to ORDER BY run",
)


def _named_rows(answer: pl.DataFrame) -> Iterator[dict[str, object]]:
    return ({name: value for name, value in row.items() if value is not None} for row in answer.iter_rows(named=True))


def answers(folder: Path) -> tuple[list[Path], set[tuple[object, ...]]]:
    """Ask a season for some tables in each way; return which files are damaged, and the rows of all answers."""
    found = Season.open(folder)
    asked = [*map(found.sql, QUESTIONS), *(found.frames(table).collect() for table in ("runs", "frames", "move_to"))]
    # By their names: another part of a season may have other columns, and which comes first is chance.
    told = [(number, frozenset(row.items())) for number, answer in enumerate(asked) for row in _named_rows(answer)]
    assert set(listed(found)["table"]) <= found.files.keys()
    assert set(found.messages["table"]) < found.files.keys()
    return found.damaged, set(told)


def test_a_flipped_bit_gives_no_wrong_values_and_names_the_file(season: Season, tmp_path: Path) -> None:
    shutil.copytree(season.folder, tmp_path / "season")
    dice = random.Random(2014)
    (_, whole) = answers(season.folder)
    for table in ("runs", "frames", "move_to") * 4:
        file = min((tmp_path / "season" / table).iterdir())
        sound = file.read_bytes()
        bit = dice.randrange(8 * len(sound))
        spoiled = bytearray(sound)
        spoiled[bit // 8] ^= 1 << bit % 8
        file.write_bytes(spoiled)
        damaged, found = answers(tmp_path / "season")
        if table == "runs" and not damaged:  # its footer has words that nobody reads
            assert found == whole, bit
        else:
            assert damaged == [file], (table, bit)
            assert found < whole, (table, bit)
        file.write_bytes(sound)


@pytest.mark.parametrize("name", ["a[1]", "a*", "a?", "[", "it's"])
def test_the_name_of_a_folder_is_not_a_pattern(tmp_path: Path, name: str) -> None:
    for each, dialect in (("a1", 0), ("ab", 0), (name, 1)):
        log = write_log(tmp_path / f"{dialect}.log", [(1.0 + dialect, plant.protocol().encode(MOVE))])
        Archiver(tmp_path / each, DecodedNetwork(plant.load_all(), plant.CATALOGUE))(log)
    found = Season.open(tmp_path / name)
    assert found.sql("SELECT t FROM move_to").rows() == [(2.0,)]
    assert found.frames("move_to").collect()["t"].to_list() == [2.0]
    assert found.sql("SELECT message FROM messages WHERE \"table\" = 'move_to'").rows() == [("Move To",)]


@pytest.mark.posix
def test_a_pipe_or_a_device_is_not_a_file_of_a_season(season: Season, tmp_path: Path) -> None:
    shutil.copytree(season.folder, tmp_path / "season")
    for table in ("runs", "move_to"):
        os.mkfifo(tmp_path / "season" / table / "x.parquet")
        (tmp_path / "season" / table / "y.parquet").symlink_to("/dev/zero")
    found = Season.open(tmp_path / "season")
    assert (found.damaged, len(found.frames("move_to").collect())) == ([], 2)


def test_a_folder_whose_name_is_not_text_is_refused(tmp_path: Path) -> None:
    name = os.fsdecode(b"\xff")
    with pytest.raises(LocalError, match="has to be UTF-8"):
        Season.open(tmp_path / name)
    with pytest.raises(LocalError, match="has to be UTF-8"):
        next(archive([], tmp_path / name, DecodedNetwork(plant.load_all(), plant.CATALOGUE)))


def test_a_season_of_damaged_logs_alone_names_them(season: Season, tmp_path: Path) -> None:
    shutil.copytree(season.folder, tmp_path / "season")
    for file in (tmp_path / "season" / "runs").iterdir():
        file.write_bytes(b"PAR1")
    with pytest.raises(LocalError, match=r"runs.*\.parquet is damaged, .*\.parquet is damaged"):
        Season.open(tmp_path / "season")


def test_sql_joins_messages_and_runs(season: Season) -> None:
    query = """
        SELECT m.message, count(*) AS number, max(g.x) AS x FROM move_to g JOIN runs r ON g.run = r.run
        JOIN messages m ON m.eds = r.eds AND m."table" = 'move_to' GROUP BY m.message"""
    assert season.sql(query).rows() == [("Move To", 2, 1234)]


def test_parameters_of_a_query_are_given_by_name(season: Season) -> None:
    assert season.sql("SELECT $bitrate * 2 AS twice", {"bitrate": 500, "other": 1}).rows() == [(1000,)]


def test_the_table_of_messages_describes_each_table(season: Season) -> None:
    found = season.messages.filter(pl.col("table") == "move_to")
    assert found.select("message", "cob_id", "senders", "receivers").rows() == [("Move To", 0x202, "panel", "lift")] * 2


@pytest.mark.parametrize(
    ("query", "complaint"),
    [
        ("SELECT x FROM nowhere", "Table with name nowhere does not exist!; tables: check_lift_request"),
        ("SELEC", "Parser Error: syntax error"),
        ("SELECT nothing FROM move_to", 'Referenced column "nothing" not found'),
        ("SELECT tim FROM move_to", '; columns like it: "'),
        ('SELECT * FROM messages WHERE message = "Move To2"', "Referenced column"),
        ('SELECT * FROM messages WHERE message = "move"', "; a text takes single quotes: 'move'"),
    ],
)
def test_an_error_of_duckdb_is_one_line(season: Season, query: str, complaint: str) -> None:
    with pytest.raises(SqlError) as error:
        season.sql(query)
    assert complaint in str(error.value)
    assert "\n" not in str(error.value)


def test_an_unknown_table_is_an_error(season: Season) -> None:
    with pytest.raises(UnknownName, match="unknown table 'move'"):
        season.frames("move")


def test_a_folder_without_logs_is_no_season(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "none"):
        with pytest.raises(LocalError, match="is not a season"):
            Season.open(folder)


def test_a_query_reports_its_progress(season: Season) -> None:
    told: list[int] = []
    season.sql("SELECT count(*) FROM move_to", progress=told.append)
    assert told[-1] == 100
    assert set(told) <= set(range(101))


def test_a_failed_query_leaves_no_watching_thread(season: Season) -> None:
    before = set(threading.enumerate())
    with pytest.raises(SqlError):
        season.sql("SELECT nothing FROM move_to", progress=lambda _: None)
    assert set(threading.enumerate()) == before


ENDLESS = "SELECT sum(a.range * b.range) FROM range(1000000) a, range(10000000) b"


@pytest.mark.parametrize("progress", [None, lambda _: None], ids=["unwatched", "watched"])
def test_a_query_ends_after_its_time_limit(season: Season, progress: Callable[[int], object] | None) -> None:
    with pytest.raises(SqlError, match="has not ended within 200 ms"):
        season.sql(ENDLESS, progress=progress, at_most=0.2)
    assert len(season.sql("SELECT * FROM range(3)", at_most=60)) == 3


@pytest.mark.posix
def test_ctrl_c_ends_a_query_at_once(season: Season, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*given: Any) -> Any:  # while the query is waited for: its progress may never be known
        monkeypatch.undo()
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)
        return wait(*given)

    monkeypatch.setattr(season_module, "wait", interrupted)
    with pytest.raises(KeyboardInterrupt):
        season.sql(ENDLESS, at_most=60)


def test_one_row_more_than_the_limit_is_an_error(season: Season, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(season_module, "MOST_ROWS", 3)
    assert len(season.sql("SELECT * FROM range(3)")) == 3
    with pytest.raises(SqlError, match="more than 3 rows"):
        season.sql("SELECT * FROM range(4)")


def test_a_column_that_is_shown_as_text_keeps_its_name(season: Season) -> None:
    found = season.sql("""SELECT INTERVAL 1 DAY AS "a ""quoted"" name", 1 AS plain""")
    assert found.columns == ['a "quoted" name', "plain"]


CONFINED = {
    "a file elsewhere": "SELECT * FROM read_text('/etc/hostname')",
    "a file elsewhere by its name": "SELECT * FROM '/etc/hostname'",
    "a copy to elsewhere": "COPY (SELECT 1) TO '{outside}'",
    "a database elsewhere": "ATTACH '{outside}'",
    "an extension": "INSTALL httpfs",
    "the confinement lifted": "SET enable_external_access = true; COPY (SELECT 1) TO '{outside}'",
    "another folder allowed": "SET allowed_directories = ['/']; COPY (SELECT 1) TO '{outside}'",
    "a setting of any kind": "SET threads = 1",
    "a variable of Python": "SELECT * FROM values",
}


@pytest.mark.parametrize("query", CONFINED.values())
@pytest.mark.parametrize("progress", [None, lambda _: None])
def test_a_query_reaches_nothing_outside_the_season(
    season: Season, tmp_path: Path, query: str, progress: Callable[[int], object] | None
) -> None:
    outside = tmp_path / "outside"
    with pytest.raises(SqlError):
        season.sql(query.format(outside=outside), {"values": 1}, progress)
    assert not list(tmp_path.iterdir())


def test_a_season_may_have_any_name(tmp_path: Path) -> None:
    folder = tmp_path / 'it\'s a "season"'
    log = write_log(tmp_path / "log.log", [(1.0, plant.protocol().encode(MOVE))])
    Archiver(folder, DecodedNetwork(plant.load_all(), plant.CATALOGUE))(log)
    assert Season.open(folder).sql("SELECT x FROM move_to").rows() == [(1234,)]


def test_a_campaign_is_no_season_and_the_error_says_how_to_ask_it(tmp_path: Path) -> None:
    (tmp_path / SETTINGS).touch()
    with pytest.raises(LocalError, match=r"is not a season: it holds a campaign; ask .*\*\.parquet by DuckDB"):
        Season.open(tmp_path)
