"""Archiving: each log once and whole, many at a time, and what each table holds."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

pytest.importorskip("polars", reason="the extra `season` is not installed")
pytest.importorskip("pyarrow", reason="the extra `season` is not installed")

import pyarrow.parquet as pq

from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.season import archive as archiving
from eurobot_od.season.archive import BEGUN, Archived, Archiver, DecodedNetwork, _begun, archive
from eurobot_od.season.campaign import local
from eurobot_od.season.columns import ColumnBatch
from eurobot_od.season.season import Season, is_described, table_names
from eurobot_od.traffic import formats
from eurobot_od.traffic.meaning import Decoder
from tests.client.servo import SERVO as FILE
from tests.eds_text import DEVICE_TYPE, pdo, variable
from tests.kit import plant
from tests.season.seasons import archived, table, write_log

NETWORK = DecodedNetwork(plant.load_all(), plant.CATALOGUE, (("Move Confirm", "Move To"),))
FRAMES = [(0.5, Frame(0x202, bytes(8))), (0.6, Frame(0x7E6, b"12345678")), (0.7, Frame(0x182))]


@pytest.fixture
def log(tmp_path: Path) -> Path:
    return write_log(tmp_path / "some.log", FRAMES)


def test_a_log_becomes_a_row_of_runs_and_its_frames(log: Path, tmp_path: Path) -> None:
    archived = Archiver(tmp_path / "season", NETWORK)(log)
    assert (archived.known, archived.frames, archived.damage) == (False, 3, 1)
    (row,) = table_rows(tmp_path / "season")
    assert row == {
        "run": archived.run,
        "log": str(log),
        "format": "log",
        "bytes": log.stat().st_size,
        "start": 0.5,
        "end": 0.7,
        "datetime": None,
        "frames": 3,
        "damage": 1,
        "network": "1=panel 2=lift 3=scale",
        "eds": NETWORK.hash(NETWORK.decoder()),
    }
    frames = table(tmp_path / "season", "frames")
    assert frames.select("line", "t", "channel", "cob_id", "data").rows() == [
        (number, time, "can0", *frame) for number, (time, frame) in enumerate(FRAMES, 1)
    ]
    assert table(tmp_path / "season", "damage").select("line", "kind", "text").rows() == [
        (2, "unknown identifier", "7E6#3132333435363738")
    ]


def table_rows(season: Path) -> list[dict[str, object]]:
    import polars as pl

    return pl.read_parquet(season / "runs" / "*.parquet").rows(named=True)


def test_a_run_lasts_from_its_first_entry_to_its_last_of_any_kind(tmp_path: Path) -> None:
    log = tmp_path / "some.log"
    log.write_text("(0.500000) can0 123##1AB\n(0.600000) can0 202#\n(0.700000) can0 123##1AB\n")
    Archiver(tmp_path / "season", NETWORK)(log)
    (row,) = table_rows(tmp_path / "season")
    assert (row["start"], row["end"]) == (0.5, 0.7)


def test_a_log_is_known_by_its_content_under_any_name(log: Path, tmp_path: Path) -> None:
    season, other = tmp_path / "season", tmp_path / "copy.log"
    shutil.copy(log, other)
    first, second = (Archiver(season, NETWORK)(each) for each in (log, other))
    assert (second.known, second.run) == (True, first.run)
    assert len(table_rows(season)) == 1


def test_with_other_eds_files_it_is_another_run(log: Path, tmp_path: Path) -> None:
    season = tmp_path / "season"
    other = DecodedNetwork(plant.load_all(plant.DIALECTS[0]), plant.CATALOGUE)
    runs = {Archiver(season, network)(log).run for network in (NETWORK, other)}
    assert len(runs) == len(table_rows(season)) == 2


def test_with_another_node_id_it_is_another_run(log: Path, tmp_path: Path) -> None:
    """The identifiers in the log then mean another device, though file and name are the same."""
    text = (DEVICE_TYPE + variable("2000", "Speed", "INTEGER16")).encode()
    devices = [Dictionary.read(text, Path("servo.eds"), node_id, "servo") for node_id in (5, 6)]
    runs = {Archiver(tmp_path / "season", DecodedNetwork((each,), plant.CATALOGUE))(log).run for each in devices}
    assert len(runs) == 2


def test_an_unfinished_run_is_archived_again(log: Path, tmp_path: Path) -> None:
    season = tmp_path / "season"
    run = Archiver(season, NETWORK)(log).run
    (season / "runs" / f"{run}.parquet").unlink()  # as if it had ended before the last step
    left = season / BEGUN / run / "frames"
    left.mkdir(parents=True)
    (left / f"{run}.parquet").write_bytes(b"half")
    assert [each.known for each in archive([log], season, NETWORK)] == [False]
    assert len(table(season, "frames")) == len(FRAMES)
    assert list((season / BEGUN).iterdir()) == []


# Remote frames and those with 29 bits, in the middle of others: of a message, of services, of nobody.
ODD_FRAMES = (
    "185#FEFF",
    "185#R",  # of a message
    "185#R2",
    "705#R",  # node guarding asks so
    "085#R8",
    "605#R",
    "7E6#R1",  # of nobody
    "18FF0001#FEFF",  # a message with 29 bits
    "18FF0001#FE",  # ... too short
    "18FF0001#R",
    "18FF0002#AABB",  # of nobody
    "18FF0002#R4",
    "00000185#FEFF",  # the number of a message with 11 bits
    "00000705#05",
    "285#0102",  # off in the file
    "285#R",
    "387#01",  # a guess
    "387#R1",
    "085#0102",  # an EMCY that is too short
    "7E6#01",
)
SERVO = (
    DEVICE_TYPE
    + variable("2000", "Speed", "INTEGER16")
    + pdo(0x1800, "0x20000010", cob_id="0x185")
    + pdo(0x1801, "0x20000010", cob_id="0x80000285")
    + pdo(0x1802, "0x20000010", cob_id="0x38FF0001")
)


def test_remote_frames_and_those_with_29_bits_have_the_decoders_words(tmp_path: Path) -> None:
    file = tmp_path / "odd.log"
    file.write_text("".join(f"({number}.5) can0 {each}\n" for number, each in enumerate(ODD_FRAMES)))
    servo = Dictionary.read(SERVO.encode(), tmp_path / "servo.eds", 5)
    Archiver(tmp_path / "season", DecodedNetwork((servo,), plant.CATALOGUE))(file)
    decoder = Decoder((servo,), plant.CATALOGUE, lambda _: None)
    with file.open("rb") as log:
        said = [
            (number, defect.damage.value, defect.text)
            for number, _, _, raw in formats.read(log, "log")
            for defect in decoder(raw).defects
        ]
    assert table(tmp_path / "season", "damage").select("line", "kind", "text").rows() == said
    assert {kind for _, kind, _ in said} == {"wrong length", "switched off", "unknown identifier"}
    remote = table(tmp_path / "season", "frames").filter(remote=True)["line"].to_list()
    assert remote == [number for number, each in enumerate(ODD_FRAMES, 1) if "#R" in each]


@pytest.mark.long
def test_logs_archived_in_parallel_give_the_same_season(tmp_path: Path) -> None:
    logs = [write_log(tmp_path / f"{n}.log", [(n + time, frame) for time, frame in FRAMES]) for n in range(4)]
    one, other = tmp_path / "one", tmp_path / "other"
    with local(2) as processes:
        done = list(archive(logs, one, NETWORK, None, processes))
    assert done == list(archive(logs, other, NETWORK))
    for name in ("runs", "frames", "damage", "move_to", "move_confirm"):
        query = f"SELECT * FROM {name} ORDER BY ALL"
        assert Season.open(one).sql(query).equals(Season.open(other).sql(query))


def test_two_copies_of_a_log_archived_in_parallel_are_one_run(log: Path, tmp_path: Path) -> None:
    season = tmp_path / "season"
    copy = tmp_path / "copy.log"
    other = list[Archived]()
    shutil.copy(log, copy)

    def meanwhile(_: int) -> None:
        other.append(Archiver(season, NETWORK)(copy))

    archived = Archiver(season, NETWORK, progress=meanwhile)(log)
    assert [each.run for each in other] == [archived.run]
    assert len(table_rows(season)) == 1
    assert len(table(season, "frames")) == len(FRAMES)


def test_an_unknown_format_archives_nothing(log: Path, tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("x")
    with pytest.raises(LocalError, match=r"notes.txt: not a known log"):
        list(archive([log, tmp_path / "notes.txt"], tmp_path / "season", NETWORK))
    assert not (tmp_path / "season").exists()


@pytest.mark.parametrize(
    ("messages", "tables"),
    [
        (["Move To", "Move-To"], ["move_to", "move_to_2"]),
        (["frames", "Runs"], ["frames_2", "runs_2"]),
        (["2nd axis", "\u00c4"], ["message_2nd_axis", "message"]),
    ],
)
def test_no_two_tables_have_the_same_name(messages: list[str], tables: list[str]) -> None:
    assert list(table_names(messages).values()) == tables


@pytest.mark.parametrize(
    ("content", "whole"),
    [
        (b"PAR1" + bytes(8) + b"\x08\0\0\0PAR1", True),
        (b"PAR1" + bytes(8) + b"\x09\0\0\0PAR1", False),  # its description is said to be longer than the file
        (b"PAR1" + bytes(8) + b"\x08\0\0\0PAR2", False),
        (b"PAR2" + bytes(8) + b"\x08\0\0\0PAR1", False),
        (b"PAR1", False),
        (b"", False),
    ],
)
def test_a_parquet_file_is_complete_only_with_head_foot_and_description(
    tmp_path: Path, content: bytes, whole: bool
) -> None:
    file = tmp_path / "a.parquet"
    file.write_bytes(content)
    assert is_described(file, None) is whole


def test_the_pages_have_checksums_that_other_readers_can_verify(log: Path) -> None:
    file = min((archived(log, NETWORK) / "frames").iterdir())
    times = pq.ParquetFile(file).metadata.row_group(0).column(2)
    content = bytearray(file.read_bytes())
    content[times.data_page_offset + times.total_compressed_size - 1] ^= 1  # of the last time
    file.write_bytes(content)
    with pytest.raises(OSError, match="CRC"):
        pq.read_table(file, page_checksum_verification=True)


def test_a_log_whose_files_have_a_flipped_bit_is_archived_again(log: Path) -> None:
    season = archived(log, NETWORK)
    file = min((season / "frames").iterdir())
    sound = file.read_bytes()
    for place in (0, len(sound) // 3, len(sound) - 100):
        file.write_bytes(sound[:place] + bytes([sound[place] ^ 1]) + sound[place + 1 :])
        assert not Archiver(season, NETWORK)(log).known
        assert file.read_bytes() == sound
        assert Archiver(season, NETWORK)(log).known


def test_an_error_names_the_season_on_a_full_disk_and_the_log_if_that_cannot_be_read(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    resource = pytest.importorskip("resource")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        with pytest.raises(OSError, match="File too large") as failed:
            Archiver(tmp_path / "season", NETWORK)(log)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert failed.value.filename == str(tmp_path / "season")
    assert not list((tmp_path / "season" / BEGUN).iterdir())

    def unreadable(*_: object) -> Iterator[ColumnBatch]:
        raise OSError(errno.EIO, "Input/output error")
        yield

    monkeypatch.setattr(archiving, "batches", unreadable)
    with pytest.raises(OSError, match="Input/output error") as failed:
        Archiver(tmp_path / "season", NETWORK)(log)
    assert failed.value.filename == str(log)


def test_the_row_of_a_log_is_in_place_last(log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    placed: list[str] = []
    replace = Path.replace

    def put(made: Path, target: Path) -> Path:
        placed.append(target.parent.name)
        return replace(made, target)

    monkeypatch.setattr(Path, "replace", put)
    Archiver(tmp_path / "season", NETWORK)(log)
    assert len(placed) > 3
    assert placed.index("runs") == len(placed) - 1


def test_files_are_on_the_disk_before_they_are_moved_into_place(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: set[int] = set()
    placed: list[bool] = []
    fsync = os.fsync
    replace = Path.replace

    def sync(descriptor: int) -> None:
        fsync(descriptor)
        synced.add(os.fstat(descriptor).st_ino)

    def put(made: Path, target: Path) -> Path:
        placed.append(made.stat().st_ino in synced)
        return replace(made, target)

    monkeypatch.setattr(os, "fsync", sync)
    monkeypatch.setattr(Path, "replace", put)
    Archiver(tmp_path / "season", NETWORK)(log)
    assert len(placed) > 3
    assert all(placed)


@pytest.mark.skipif(os.name != "posix", reason="the locks are POSIX's")
def test_a_third_process_leaves_the_second_one_s_unfinished_run_alone(tmp_path: Path) -> None:
    with ExitStack() as first:
        first.enter_context(_begun(tmp_path))
        with _begun(tmp_path):
            made = tmp_path / "run"
            made.mkdir()
            first.close()
            with _begun(tmp_path):
                assert made.is_dir()
    with _begun(tmp_path):
        assert not made.exists(), "nobody is at work on it any more"


def test_frames_written_in_parts_are_there_once(log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("eurobot_od.season.archive.MANY", 1)
    Archiver(tmp_path / "season", NETWORK)(log)
    assert table(tmp_path / "season", "move_to")["line"].to_list() == [1]


REMAP = """601#2300180181010080 581#6000180100000000 601#2F001A0000000000 581#60001A0000000000
601#23001A0120006C60 581#60001A0100000000 601#23001A0210004160 581#60001A0200000000
601#2F001A0002000000 581#60001A0000000000 601#2300180181010000 581#6000180100000000"""
BY_FILE, REMAPPED, RESET = "181#3702E8030000", "181#E80300003702", "701#00"


def servo_log(file: Path, lines: str, channel: str = "can0", other: str = "") -> Path:
    """Write a log; `other` are lines that come last, on another channel."""
    pairs = [(each, channel) for each in lines.split()] + [(each, "can9") for each in other.split()]
    file.write_text("".join(f"({number / 1000:.6f}) {name} {line}\n" for number, (line, name) in enumerate(pairs, 1)))
    return file


def test_messages_are_decoded_by_the_mapping_in_force(tmp_path: Path) -> None:
    """Each frame as `decode` has it, on each channel; a mapping without frames leaves no table behind."""
    network = DecodedNetwork((Dictionary.load("docs/servo.eds", 1),), plant.CATALOGUE)
    season = tmp_path / "season"
    Archiver(season, network)(servo_log(tmp_path / "boot.log", f"{REMAP} {REMAPPED}"))
    rows = table(season, "servo_tpdo1").select("velocity_actual_value", "statusword").rows()
    assert rows == [(1000, 0x237)]
    assert table(season, "damage").is_empty()

    later = tmp_path / "later"
    log = servo_log(tmp_path / "later.log", f"{BY_FILE} {REMAP} {REMAPPED} {RESET} {BY_FILE}", other=BY_FILE)
    Archiver(later, network)(log)
    assert table(later, "servo_tpdo1")["line"].to_list() == [1, 16, 17]
    (mapped,) = (each.name for each in later.iterdir() if each.name.startswith("servo_tpdo1_mapped_"))
    assert table(later, mapped).select("line", "velocity_actual_value").rows() == [(14, 1000)]


def test_runs_with_and_without_a_remap_are_one_season(tmp_path: Path) -> None:
    network = DecodedNetwork((Dictionary.load("docs/servo.eds", 1),), plant.CATALOGUE)
    folder = tmp_path / "season"
    for name, lines in (("a", BY_FILE), ("b", f"{REMAP} {REMAPPED}"), ("c", BY_FILE)):
        Archiver(folder, network)(servo_log(tmp_path / f"{name}.log", f"{lines} 70{name}#05"))
    assert Season.open(folder).sql("SELECT count(*) FROM servo_tpdo1").item() == 3
    assert Season.open(folder).frames("servo_tpdo1").collect().height == 3


FD_AND_DATES = """\
(1400000000.25) can0 202#0000000000000000
(1400000000.5) can0 123##1AABB
(1400000000.75) can0 18FF0001##0CC
(1400000001.0) can0 123#R2
"""
NOON = datetime(2014, 5, 13, 16, 53, 20, tzinfo=UTC)


def test_frames_of_can_fd_are_frames_and_times_of_a_log_with_dates_are_timestamps(tmp_path: Path) -> None:
    (tmp_path / "some.log").write_text(FD_AND_DATES)
    season = tmp_path / "season"
    assert Archiver(season, NETWORK)(tmp_path / "some.log")[3:] == (len(FD_AND_DATES), 4, 1, ())
    assert table(season, "frames").select("line", "cob_id", "data", "remote", "fd", "brs").rows() == [
        (1, 0x202, bytes(8), False, False, None),
        (2, 0x123, b"\xaa\xbb", False, True, True),
        (3, 0x38FF0001, b"\xcc", False, True, False),
        (4, 0x123, bytes(2), True, False, None),
    ]
    dates = [NOON + timedelta(milliseconds=250 * number) for number in range(1, 5)]
    assert table(season, "frames")["datetime"].to_list() == dates
    assert table(season, "move_to")["datetime"].to_list() == dates[:1]
    assert table(season, "damage").select("line", "datetime").rows() == [(4, dates[3])]
    assert Season.open(season).frames("runs").collect()["datetime"].to_list() == dates[:1]
    (file,) = (season / "frames").iterdir()
    assert str(pq.read_schema(file).field("datetime").type) == "timestamp[us, tz=UTC]"


def test_a_log_with_relative_times_has_no_dates(log: Path) -> None:
    frames = table(archived(log, NETWORK), "frames")
    assert frames["datetime"].to_list() == [None] * len(FRAMES)


def test_units_and_ranges_are_a_table(log: Path) -> None:
    season = archived(log, NETWORK)
    query = "SELECT unit, allowed, null_is FROM fields WHERE \"table\" = 'move_to' AND field = 'x'"
    found = Season.open(season).sql(query).rows()
    assert found == [("mm", "0..3000 mm", "see x_flag")]
    (file,) = (season / "fields").iterdir()
    assert pq.read_table(file).num_rows == len(Season.open(season).frames("fields").collect()) > 50


SERVICES = """\
(1.0) can0 000#0105
(1.1) can0 705#05
(1.2) can0 605#2B171000F4010000
(1.3) can0 585#6017100000000000
(1.4) can0 705#R1
(1.5) can0 705#85
(1.6) can0 605#2F60600063000000
(1.7) can0 585#8060600030000906
(1.8) can0 085#1223050000000001
(1.9) can0 085#122305
(2.0) can0 605#4018100100000000
(2.1) can0 605#4008100000000000
(2.2) can0 605#C6001F0101000000
(2.3) can0 585#A4001F017F000000
"""


def test_services_have_tables(tmp_path: Path) -> None:
    (tmp_path / "some.log").write_text(SERVICES)
    season = tmp_path / "season"
    Archiver(season, DecodedNetwork((FILE,), plant.CATALOGUE))(tmp_path / "some.log")
    seen = ("line", "node", "direction", "index", "subindex", "value", "content", "size", "how", "whole", "abort")
    assert table(season, "sdo").select(seen).rows() == [
        (4, 5, "write", 0x1017, 0, "500", b"\xf4\x01", 2, "expedited", True, None),
        (8, 5, "write", 0x6060, 0, None, None, 1, "expedited", True, 0x06090030),
        (12, 5, "read", 0x1018, 1, None, None, 0, "expedited", False, None),  # as there is a next request on line 12
        (13, 5, "read", 0x1008, 0, None, None, 0, "expedited", False, None),
        (14, 5, "write", 0x1F00, 1, None, None, 0, "in blocks", False, None),  # cut off by the end of the log
    ]
    last = table(season, "sdo").row(1, named=True)
    assert (last["object"], last["abort_name"]) == ("0x6060:00 Modes of operation", "Value range of parameter exceeded")
    words = "continuous overcurrent at the output, no. 2"
    assert table(season, "emcy").drop("run", "t", "datetime", "channel").rows() == [
        (9, 5, 0x2312, 5, words, bytes([0, 0, 0, 0, 1]))
    ]
    assert table(season, "heartbeat").drop("run", "datetime").rows() == [
        (2, 1.1, "can0", 5, "operational"),
        (6, 1.5, "can0", 5, "operational"),  # the answer to a guarding master
    ]
    assert table(season, "nmt").drop("run", "datetime").rows() == [(1, 1.0, "can0", 5, "start")]


def test_an_incomplete_transfer_is_damage_as_in_decode(tmp_path: Path) -> None:
    killed = "(1.0) can0 605#C6001F01E8030000\n(1.1) can0 585#A4001F017F000000\n(5.0) can0 705#00\n"
    (tmp_path / "some.log").write_text(killed)
    Archiver(tmp_path / "season", DecodedNetwork((FILE,), plant.CATALOGUE))(tmp_path / "some.log")
    text = "705#00: the write of 0x1F00:01 before did not end; 0 of 1000 bytes came"
    assert table(tmp_path / "season", "damage").select("line", "kind", "text").rows() == [
        (3, "incomplete transfer", text)
    ]
