"""What data has beside the fields: frames of CAN FD, and the dates of logs that have some."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.pdo.kinds import NOTHING
from eurobot_od.season.archive import DecodedNetwork, archive
from eurobot_od.season.season import Season
from eurobot_od.traffic.decoding import CsvOutput, Decoding, JsonOutput, Output
from eurobot_od.traffic.meaning import Decoder

LOG = b"(1400000000.250000) can0 123##1AABB\n(1400000001.000000) can0 18FF0001##0CC\n(1400000002.0) can0 701#00\n"


def lines(output: Output, log: bytes = LOG) -> str:
    return output.header + "".join(Decoding(Decoder([]), output).lines(io.BytesIO(log), "x.log", "log"))


def test_frames_of_can_fd_have_identifier_data_and_flags() -> None:
    one, two, classic = map(json.loads, lines(JsonOutput()).splitlines())
    assert (one["id"], one["data"], one["fd"], one["brs"]) == ("0x123", "AABB", True, True)
    assert (two["id"], two["data"], two["fd"], two["brs"]) == ("0x18FF0001", "CC", True, False)
    assert "fd" not in classic
    rows = list(csv.DictReader(io.StringIO(lines(CsvOutput([])))))
    assert [(each["id"], each["data"], each["fd"], each["brs"]) for each in rows] == [
        ("0x123", "AABB", "True", "True"),
        ("0x18FF0001", "CC", "True", "False"),
        ("0x701", "00", "", ""),
    ]


def test_times_of_a_log_with_dates_are_dates_too() -> None:
    first, *_ = map(json.loads, lines(JsonOutput()).splitlines())
    assert (first["time"], first["datetime"]) == (1400000000.25, "2014-05-13T16:53:20.250000+00:00")
    row = next(csv.DictReader(io.StringIO(lines(CsvOutput([])))))
    assert (row["timestamp"], row["datetime"]) == ("1400000000.250000", "2014-05-13T16:53:20.250000+00:00")


def test_a_log_with_relative_times_has_no_dates() -> None:
    log = b"(1396.5) can0 701#00\n"
    assert "datetime" not in json.loads(lines(JsonOutput(), log))
    assert next(csv.DictReader(io.StringIO(lines(CsvOutput([]), log))))["datetime"] == ""


def test_a_query_of_a_table_whose_only_file_is_damaged_says_which(tmp_path: Path) -> None:
    (tmp_path / "x.log").write_bytes(LOG)
    list(archive([tmp_path / "x.log"], tmp_path / "season", DecodedNetwork((), NOTHING)))
    (file,) = (tmp_path / "season" / "frames").iterdir()
    file.write_bytes(file.read_bytes()[:-1])
    season = Season.open(tmp_path / "season")
    with pytest.raises(LocalError, match=f"table frames: {file} is damaged"):
        season.sql("SELECT * FROM frames")
    with pytest.raises(LocalError, match="is damaged"):
        season.frames("frames")
