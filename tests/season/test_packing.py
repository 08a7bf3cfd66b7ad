"""Many small logs share files, and each is in its season once, also after a kill or with a damaged file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import NOTHING
from eurobot_od.season import packing
from eurobot_od.season.archive import BEGUN, Archived, Archiver, DecodedNetwork, archive, writer
from eurobot_od.season.season import PACK, Season

NETWORK = DecodedNetwork((Dictionary.load("docs/servo.eds", 1),), NOTHING)
LOGS = 12


def logs_in(folder: Path, count: int = LOGS, first: int = 0) -> list[Path]:
    """Write short logs, each with other values."""
    folder.mkdir(exist_ok=True)
    files = [folder / f"{number}.log" for number in range(first, first + count)]
    for number, file in enumerate(files, first):
        file.write_text(
            "".join(f"({n}.5) can0 181#{number:02X}02{n:02X}030000\n" for n in range(20)) + "(99.0) can0 7FE#01\n"
        )
    return files


def rows_of(folder: Path) -> list[tuple[object, ...]]:
    """Return what a season has of all logs, in an order of its own."""
    query = "SELECT run, line, velocity_actual_value, statusword FROM servo_tpdo1 ORDER BY ALL"
    return Season.open(folder).sql(query).rows()


def files_of(folder: Path) -> list[Path]:
    return sorted(each for each in folder.rglob("*.parquet") if each.is_file() and each.parent.name != "fields")


@pytest.fixture
def singly(tmp_path: Path) -> Path:
    """A season in which each log has files of its own."""
    for each in logs_in(tmp_path / "logs"):
        Archiver(tmp_path / "singly", NETWORK)(each)
    return tmp_path / "singly"


@pytest.fixture
def packed(tmp_path: Path) -> Path:
    """A season of the same logs, packed."""
    list(archive(logs_in(tmp_path / "logs"), tmp_path / "packed", NETWORK))
    return tmp_path / "packed"


def test_packing_changes_no_row(singly: Path, packed: Path) -> None:
    assert rows_of(packed) == rows_of(singly)
    assert len(files_of(singly)) == LOGS * len(files_of(packed))
    for table in ("frames", "damage", "runs"):
        query = f"SELECT * FROM {table} ORDER BY ALL"
        assert Season.open(packed).sql(query).equals(Season.open(singly).sql(query))


def again(packed: Path, logs: list[Path]) -> Iterator[Archived]:
    return archive(logs, packed, NETWORK)


def test_packed_logs_are_recognised(packed: Path, tmp_path: Path) -> None:
    before = files_of(packed)
    assert all(each.known for each in again(packed, logs_in(tmp_path / "logs")))
    assert files_of(packed) == before


def test_more_logs_are_appended_and_packed_with_the_others_once_they_are_many(packed: Path, tmp_path: Path) -> None:
    more = logs_in(tmp_path / "logs", 3, first=LOGS)
    assert not any(each.known for each in again(packed, more))
    assert len(set(map(str, rows_of(packed)))) == 20 * (LOGS + 3)
    list(again(packed, logs_in(tmp_path / "logs", 6, first=LOGS + 3)))
    assert {file.stem[: len(PACK)] for file in files_of(packed)} == {PACK}
    assert len(set(map(str, rows_of(packed)))) == 20 * (LOGS + 9)


@pytest.mark.parametrize("removed", [0, *(pytest.param(each, marks=pytest.mark.long) for each in (1, 2, 3))])
def test_each_log_is_there_once_wherever_packing_is_interrupted(
    singly: Path, monkeypatch: pytest.MonkeyPatch, removed: int
) -> None:
    expected = rows_of(singly)
    count = 0

    def remove(season: Path, name: str) -> None:
        nonlocal count
        count += 1
        if count > removed:
            raise KeyboardInterrupt
        remove_really(season, name)

    remove_really = packing.remove
    monkeypatch.setattr(packing, "remove", remove)
    with pytest.raises(KeyboardInterrupt):
        packing.pack(singly, singly / BEGUN, writer)
    monkeypatch.undo()
    assert rows_of(singly) == expected
    assert Season.open(singly).sql("SELECT count(*) FROM runs").item() == LOGS
    assert Season.open(singly).frames("servo_tpdo1").collect().height == len(expected)
    packing.pack(singly, singly / BEGUN, writer)
    assert rows_of(singly) == expected


def test_an_interruption_before_the_pack_is_in_place_changes_nothing(
    singly: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = files_of(singly), rows_of(singly)

    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(packing, "put_in_place", killed)
    with pytest.raises(KeyboardInterrupt):
        packing.pack(singly, singly / BEGUN, writer)
    assert (files_of(singly), rows_of(singly)) == before


def test_a_log_of_a_damaged_pack_is_archived_again(packed: Path, tmp_path: Path) -> None:
    expected = rows_of(packed)
    (file,) = (packed / "servo_tpdo1").iterdir()
    data = bytearray(file.read_bytes())
    data[100] ^= 1
    file.write_bytes(data)
    logs = logs_in(tmp_path / "logs")
    assert not any(each.known for each in again(packed, logs))
    assert rows_of(packed) == expected


def test_large_logs_and_those_of_other_networks_stay_as_they_are(
    singly: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    other = DecodedNetwork((Dictionary.load("docs/servo.eds", 2),), NOTHING)
    Archiver(singly, other)(logs_in(tmp_path / "logs", 1)[0])
    monkeypatch.setattr(packing, "SMALL", 100)
    before = files_of(singly)
    packing.pack(singly, singly / BEGUN, writer)
    assert files_of(singly) == before
    monkeypatch.undo()
    packing.pack(singly, singly / BEGUN, writer)
    names = [file.stem for file in (singly / "runs").iterdir()]
    assert sorted(name.startswith(PACK) for name in names) == [False, True]
