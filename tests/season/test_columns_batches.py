"""Batches beside the readers of logs: the same entries, whatever stands in the log and wherever it is cut."""

from __future__ import annotations

import gzip
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

pytest.importorskip("polars", reason="the extra `season` is not installed")

from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame, RemoteFrame
from eurobot_od.season import columns as module
from eurobot_od.season.columns import batches
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import Damage, Foreign, LogEntry, Raw
from eurobot_od.traffic.formats import lines

LINES = (
    b"(1.500000) can0 008#D27423592C01C3A5\n",
    b"(1.600000) can0 008#D27423592C01C3A5 R\n",
    b"(2.000000) can1 7ff# T\r\n",
    b"(2.5) vcan0 123#00\n",
    b"\n",
    b"   \n",
    b"garbage\n",
    b"(3.000000) can1 123#R\n",
    b"(3.100000) can1 123##1AB\n",
    b"(3.200000) can1 00000123#AB\n",
    b"(3.300000) can1 20000004#0004000000000000\n",
    b"(3.400000)  can1   123#AB\n",
    b"(3.500000) \xc3\xa9n 123#AB\n",
    b"(3.600000) \xff\xfe 123#AB\n",
    b"(3.700000) can1 123#ABC\n",
    b"(3.800000) can1 123#000102030405060708\n",
    b"(3.900000) can1 800#00\n",
    b"(99999999999.5) can1 123#00\n",
    b"(-1.5) can1 123#00\n",
    b"(4.000000) can1 1_2#00\n",
    b"(4.100000) can1 123#00 X\n",
    b"(1.000000) can1 123#00\n",
    b"\x0b\x0c(5.000000) can0 001#\n",
    "(\u0661.\u0662) can0 001#\n".encode(),
)
"""Lines that each reader has to take the same way: frames, other things, and what cannot be read."""


FD = Damage.FD.value


def entries(file: Path) -> list[LogEntry]:
    """All entries of a log by its batches, in the order of the lines."""
    return sorted(_entries(file), key=lambda entry: entry[0])


def _entries(file: Path) -> Iterator[LogEntry]:
    with file.open("rb") as opened:
        for frames, foreign, _ in batches(opened):
            for line, time, channel, cob_id, data, remote, fd, brs in frames.rows():
                raw = (RemoteFrame if remote else Frame)(cob_id, data)
                yield line, time, channel, Foreign(FD, f"{raw} {brs}") if fd else raw  # type: ignore[arg-type]
            for line, time, channel, kind, text in foreign.rows():
                yield line, time, channel, Foreign(kind, text)


def read(file: Path) -> list[LogEntry]:
    """All entries of a log by its reader, damage by its name."""
    with file.open("rb") as opened:
        return [(line, time, channel, _named(raw)) for line, time, channel, raw in formats.read(opened)]


def _named(raw: Raw) -> Raw:
    if isinstance(raw, Frame):
        return raw
    text = f"{Frame(*raw.frame)} {raw.has_bit_rate_switch}" if raw.frame else raw.text
    return Foreign(raw.damage.value, text)  # type: ignore[arg-type]


@pytest.mark.parametrize("line", LINES)
@pytest.mark.parametrize("ending", [b"", b"(9.000000) can0 009#09\n", b"(9.00"])
def test_a_fast_line_reader_agrees_with_the_general_one(line: bytes, ending: bytes, tmp_path: Path) -> None:
    file = tmp_path / "one.log"
    file.write_bytes(LINES[0] + line + ending)
    assert entries(file) == read(file)


@pytest.mark.parametrize("size", [1, 7, 64, 1 << 20])
@pytest.mark.parametrize("packed", [False, True])
def test_batches_do_not_depend_on_the_size_of_the_pieces(
    size: int, packed: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(lines, "PIECE", size)
    monkeypatch.setattr(module, "ROWS", 5)
    file = tmp_path / ("all.log.gz" if packed else "all.log")
    content = b"".join(LINES)[:-1]
    file.write_bytes(gzip.compress(content) if packed else content)
    assert entries(file) == read(file)


def test_small_parts_make_larger_batches(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lines, "PIECE", 1)
    monkeypatch.setattr(module, "ROWS", 3)
    file = tmp_path / "small.log"
    file.write_bytes((LINES[0] + b"garbage\n" + LINES[3]) * 2 + LINES[0])
    with file.open("rb") as opened:
        assert [(len(frames), len(foreign)) for frames, foreign, _ in batches(opened)] == [(2, 1), (2, 1), (1, 0)]


def test_a_batch_has_the_number_of_bytes_read_if_known(tmp_path: Path) -> None:
    file = tmp_path / "some.log"
    for some in (LINES, LINES[:2]):
        file.write_bytes(b"".join(some))
        with file.open("rb") as opened:
            assert sum(each.size for each in batches(opened)) == file.stat().st_size
    packed = tmp_path / "some.log.gz"
    packed.write_bytes(gzip.compress(b"".join(LINES)))
    with packed.open("rb") as opened:
        assert sum(each.size for each in batches(opened)) == packed.stat().st_size


@pytest.mark.parametrize(("suffix", "form"), [("asc", "log"), ("log", "asc")])
def test_the_format_can_be_given(suffix: str, form: str, tmp_path: Path) -> None:
    named = tmp_path / f"some.{form}"
    with can.Logger(named) as log:
        for number in range(3):
            log(can.Message(timestamp=number, arbitration_id=8 + number, data=b"1", is_extended_id=False, channel=1))
    file = tmp_path / f"some.{suffix}"
    file.write_bytes(b"another head\n" + named.read_bytes())  # by its own, a log says its format
    with file.open("rb") as opened:
        assert [cob_id for each in batches(opened, form) for cob_id in each.frames["cob_id"]] == [8, 9, 10]


@pytest.mark.parametrize("content", [b"", b"\n", b"(1.0) can0 001#"])
def test_short_logs(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "short.log"
    file.write_bytes(content)
    assert entries(file) == read(file)


@pytest.mark.parametrize("name", ["letter.log", "letter.asc"])
def test_a_log_of_which_nothing_can_be_read_is_an_error(name: str, tmp_path: Path) -> None:
    file = tmp_path / name
    file.write_bytes(b"Dear Sir,\nplease\n")
    with file.open("rb") as opened, pytest.raises(LocalError, match="nothing in it can be read"):
        list(batches(opened))


def test_a_truncated_gzip_log_gives_its_complete_lines_and_an_error(tmp_path: Path) -> None:
    file = tmp_path / "cut.log.gz"
    file.write_bytes(gzip.compress(b"".join(LINES) * 50)[:-20])
    found = entries(file)
    assert found[-1][3] == Foreign("cut off", "Compressed file ended before the end-of-stream marker was reached")  # type: ignore[arg-type]
    assert found[-1][0] == found[-2][0] + 1
    assert found[:-1] == read(file)[: len(found) - 1]


@pytest.mark.parametrize("suffix", ["asc", "blf", "csv", "trc", "db"])
def test_other_formats_go_through_their_readers(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(formats, "MANY", 3)
    file = tmp_path / f"some.{suffix}"
    with can.Logger(file) as log:
        for number in range(7):
            log(can.Message(timestamp=number / 10, arbitration_id=8 + number, data=bytes(number), is_extended_id=False))
    found = entries(file)
    assert len(found) == 7
    assert found == read(file)
