"""The index of a long log: any part of it is read by itself, and as the whole log is read."""

from __future__ import annotations

import gzip
from pathlib import Path

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import Damage, LogEntry
from eurobot_od.traffic.formats import lines
from eurobot_od.traffic.formats.index import LogIndex
from tests.traffic.formats.test_readers import SAMPLES

HEADS = {
    "asc": "date Mon Jan 1 00:00:00.000 am 2024\nbase dec  timestamps relative\n",
    "columns": "Time (ms);CAN ID;DLC;Data\n",
    "kvaser": "Chn Identifier Flg   DLC  D0...1\n",
    "ixxat": 'ASCII Trace IXXAT\n"Time";"Identifier (hex)";"Format";"Flags";"Data"\n',
    "busmaster": "***BUSMASTER Ver 3.2.2***\n***DEC***\n***RELATIVE MODE***\n",
}
"""Heads whose settings hold for all lines behind them."""

LINES = {
    "asc": " 0.5 1  {id}             Rx   d 1 7\n",
    "columns": "{n};0x{id:x};1;07\n",
    "kvaser": " 0    00000{id:x}         1  00                {n}.5 R\n",
    "ixxat": '"00:02:{n:02}.66";"{id:x}";"Std";"";"00 "\n',
    "busmaster": "00:00:01:0000 Rx 1 {id} s 1 7\n",
}


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read a few lines at once, so that a short log has many places."""
    monkeypatch.setattr(lines, "PIECE", 100)


def index_of(file: Path, form: str | None = None) -> LogIndex:
    found = LogIndex.of(file, form)
    assert found is not None
    for _ in found.build():
        pass
    return found


def read_whole(file: Path, form: str | None = None) -> list[LogEntry]:
    with file.open("rb") as log:
        return list(formats.read(log, form))


def read_from(index: LogIndex, place: int, end: int | None = None) -> list[LogEntry]:
    return [entry for each in index.batches(place, end) for entry in each.batch.entries()]


def candump(folder: Path, count: int) -> Path:
    file = folder / "run.log"
    text = "".join(f"({100 + each / 10:.6f}) can0 {0x181 + each % 3:03X}#{each:04X}\n" for each in range(count))
    file.write_text("# a comment\n" + text + "(not a line\n(111.500000) can0 080#")
    return file


def test_each_place_reads_on_as_the_whole_log_is_read(tmp_path: Path) -> None:
    file = candump(tmp_path, 100)
    index, whole = index_of(file), read_whole(file)
    assert len(index.places) > 20
    assert index.total == len(whole)
    for place, each in enumerate(index.places):
        assert read_from(index, place) == whole[each.number :]


@pytest.mark.parametrize("form", sorted(HEADS))
def test_the_head_of_a_log_holds_from_each_place_on(form: str, tmp_path: Path) -> None:
    file = tmp_path / f"run.{form}"
    file.write_text(HEADS[form] + "".join(LINES[form].format(id=0x100 + n, n=n) for n in range(40)))
    index, whole = index_of(file, form), read_whole(file, form)
    assert len(index.places) > 5
    assert all(isinstance(each[3], Frame) for each in whole)
    for place, each in enumerate(index.places):
        assert read_from(index, place) == whole[each.number :]


@pytest.mark.parametrize("form", sorted(SAMPLES))
def test_every_format_of_lines_has_places(form: str, tmp_path: Path) -> None:
    file = tmp_path / "run.txt"
    file.write_bytes(SAMPLES[form][0].encode())
    index = index_of(file, form)
    assert read_from(index, 0) == read_whole(file, form)
    assert (index.is_complete, index.read) == (True, index.size)


def test_a_part_is_read_up_to_the_next_place(tmp_path: Path) -> None:
    file = candump(tmp_path, 100)
    index, whole = index_of(file), read_whole(file)
    first, last = index.places[3], index.places[5]
    assert read_from(index, 3, 5) == whole[first.number : last.number]


def test_a_time_leads_to_the_place_that_has_the_next_entry(tmp_path: Path) -> None:
    index = index_of(candump(tmp_path, 100))
    for tenth in range(99):
        place = index.place_at(100 + tenth / 10)
        times = [entry[1] for entry in read_from(index, place, place + 1)]
        assert max(times) > 100 + tenth / 10
        assert all(entry[1] <= 100 + tenth / 10 for entry in read_from(index, 0, place))
    assert index.place_at(1e9) == len(index.places) - 1


def test_entries_are_counted_by_key_and_places_without_a_key_are_not_read(tmp_path: Path) -> None:
    file = tmp_path / "run.log"
    frames = ["181#00"] * 50 + ["081#00"] + ["181#00"] * 50 + ["101##0AA"]
    file.write_text("".join(f"({each}.000000) can0 {frame}\n" for each, frame in enumerate(frames)))
    index = index_of(file)
    assert index.counts_before(len(index.places)) == {0x181: 100, 0x81: 1, Damage.FD: 1}
    (found,) = index.batches(0, None, frozenset([0x81]))
    assert 0x81 in found.batch.heads
    assert index.last_before(len(index.places))[Damage.FD] == len(index.places) - 1


def test_a_packed_log_and_one_of_records_have_no_places(tmp_path: Path) -> None:
    packed, records = tmp_path / "run.log.gz", tmp_path / "run.blf"
    packed.write_bytes(gzip.compress(b"(1.000000) can0 181#00\n"))
    records.write_bytes(b"LOGG")
    assert (LogIndex.of(packed), LogIndex.of(records)) == (None, None)


def test_a_file_that_is_no_log_is_refused_by_its_name(tmp_path: Path) -> None:
    file = tmp_path / "run.odt"
    file.write_bytes(b"something")
    with pytest.raises(LocalError, match=r"run\.odt: not a known log"):
        LogIndex.of(file)


def test_a_byte_order_mark_counts_as_bytes_of_the_file(tmp_path: Path) -> None:
    file = candump(tmp_path, 40)
    file.write_bytes(b"\xef\xbb\xbf" + file.read_bytes())
    index, whole = index_of(file), read_whole(file)
    for place, each in enumerate(index.places):
        assert read_from(index, place) == whole[each.number :]
