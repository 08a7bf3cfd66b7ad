"""A season that is there: lazy frames, SQL, logs of several networks, and what cannot be asked."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Callable
from pathlib import Path

import pytest

pytest.importorskip("polars", reason="the extra `season` is not installed")
pytest.importorskip("duckdb", reason="the extra `season` is not installed")

import polars as pl

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.robot import dialects
from eurobot_od.robot.model import messages
from eurobot_od.robot.model.messages import CATALOGUE
from eurobot_od.robot.protocol import EurobotProtocol
from eurobot_od.season import season as season_module
from eurobot_od.season.archive import Archiver, DecodedNetwork
from eurobot_od.season.season import Season, SqlError
from tests.rows import rows
from tests.season.seasons import write_log

GOTO = messages.GotoXY(x=1234, y=567, angle=89, speed=75)


@pytest.fixture(scope="module")
def season(tmp_path_factory: pytest.TempPathFactory) -> Season:
    """A log of a goto in each dialect."""
    folder = tmp_path_factory.mktemp("seasons")
    for number, dialect in enumerate(dialects.names()):
        log = write_log(folder / f"{number}.log", [(1.0 + number, EurobotProtocol.load(dialect).encode(GOTO))])
        Archiver(folder / "season", DecodedNetwork(dialects.load_all(dialect), CATALOGUE))(log)
    return Season.open(folder / "season")


def test_a_table_is_a_lazy_frame_over_all_logs(season: Season) -> None:
    found = season.frames("goto_xy").sort("t").collect()
    assert found.select("t", "x", "y", "angle", "speed").rows() == [(1.0, 1234, 567, 89, 75), (2.0, 1234, 567, 89, 75)]


def test_a_field_that_only_some_logs_have_is_null_for_the_others(season: Season) -> None:
    lazy = season.frames("goto_xy").sort("t").collect()["route"]
    assert lazy.cast(pl.String).to_list() == [None, "planned"]
    assert season.sql("SELECT route FROM goto_xy ORDER BY t")["route"].to_list() == [None, "planned"]


def test_a_run_that_is_being_moved_in_is_not_counted_yet(tmp_path: Path) -> None:
    log = write_log(tmp_path / "a.log", [(1.0, EurobotProtocol.load().encode(GOTO))])
    Archiver(tmp_path / "season", DecodedNetwork(dialects.load_all(), CATALOGUE))(log)
    [file] = (tmp_path / "season" / "goto_xy").iterdir()
    shutil.copy(file, file.with_stem("0123456789abcdef"))  # its row in `runs` comes last
    found = Season.open(tmp_path / "season")
    assert len(found.frames("goto_xy").collect()) == 1
    assert found.sql("SELECT count(*) FROM goto_xy").item() == 1


def test_sql_joins_messages_and_runs(season: Season) -> None:
    query = """
        SELECT m.message, count(*) AS number, max(g.x) AS x FROM goto_xy g JOIN runs r ON g.run = r.run
        JOIN messages m ON m.eds = r.eds AND m."table" = 'goto_xy' GROUP BY m.message"""
    assert season.sql(query).rows() == [("Goto XY", 2, 1234)]


def test_values_are_handed_over_where_they_are_named(season: Season) -> None:
    assert season.sql("SELECT $bitrate * 2 AS twice", {"bitrate": 500, "other": 1}).rows() == [(1000,)]


def test_messages_say_what_is_known_of_each_table(season: Season) -> None:
    found = season.messages.filter(pl.col("table") == "goto_xy")
    assert found.select("message", "cob_id", "senders", "receivers").rows() == [("Goto XY", 8, "core", "drive")] * 2


@pytest.mark.parametrize(
    ("query", "complaint"),
    [
        ("SELECT x FROM nowhere", "Table with name nowhere does not exist!; tables: check_drive_request"),
        ("SELEC", "Parser Error: syntax error"),
        ("SELECT nothing FROM goto_xy", 'Referenced column "nothing" not found'),
    ],
)
def test_what_duckdb_does_not_take_is_one_line(season: Season, query: str, complaint: str) -> None:
    with pytest.raises(SqlError) as error:
        season.sql(query)
    assert complaint in str(error.value)
    assert "\n" not in str(error.value)


def test_a_table_of_no_message_is_an_error(season: Season) -> None:
    with pytest.raises(UnknownName, match="unknown table 'goto'"):
        season.frames("goto")


def test_a_folder_without_logs_is_no_season(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "none"):
        with pytest.raises(LocalError, match="is not a season"):
            Season.open(folder)


def test_who_asks_hears_how_far_it_is(season: Season) -> None:
    told: list[int] = []
    season.sql("SELECT count(*) FROM goto_xy", progress=told.append)
    assert told[-1] == 100
    assert set(told) <= set(range(101))


def test_a_query_that_fails_leaves_no_thread_that_watches_it(season: Season) -> None:
    before = set(threading.enumerate())
    with pytest.raises(SqlError):
        season.sql("SELECT nothing FROM goto_xy", progress=lambda _: None)
    assert set(threading.enumerate()) == before


def test_as_many_rows_as_are_allowed_are_given_and_one_more_is_an_error(
    season: Season, monkeypatch: pytest.MonkeyPatch
) -> None:
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


@rows("query", CONFINED.values())
@rows("progress", [None, lambda _: None])
def test_a_query_reaches_nothing_outside_the_season(
    season: Season, tmp_path: Path, query: str, progress: Callable[[int], object] | None
) -> None:
    outside = tmp_path / "outside"
    with pytest.raises(SqlError):
        season.sql(query.format(outside=outside), {"values": 1}, progress)
    assert not list(tmp_path.iterdir())


def test_a_season_may_have_any_name(tmp_path: Path) -> None:
    folder = tmp_path / 'it\'s a "season"'
    log = write_log(tmp_path / "log.log", [(1.0, EurobotProtocol.load().encode(GOTO))])
    Archiver(folder, DecodedNetwork(dialects.load_all(dialects.DEFAULT), CATALOGUE))(log)
    assert Season.open(folder).sql("SELECT x FROM goto_xy").rows() == [(1234,)]
