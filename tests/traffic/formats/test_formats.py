"""Every format that python-can writes is read as python-can reads it, and what is damaged in it costs nothing else."""

from __future__ import annotations

import gzip
import io
import re
import sqlite3
import struct
import tracemalloc
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import can
import pytest

from eurobot_od.errors import LocalError, UnknownName
from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import Damage, Foreign, Raw

SENT = [
    can.Message(timestamp=1.0, arbitration_id=0x008, data=bytes.fromhex("D27423592C01C3A5"), is_extended_id=False),
    can.Message(timestamp=1.25, arbitration_id=0x00C, is_extended_id=False, is_rx=False),
    can.Message(timestamp=1.5, arbitration_id=0x014, data=b"\x01\x02\x03", is_extended_id=False),
    can.Message(timestamp=2.0, arbitration_id=0x7FF, data=b"\xff", is_extended_id=False),
]
FRAMES = [Frame(each.arbitration_id, bytes(each.data)) for each in SENT]

FOREIGN = [
    (can.Message(timestamp=3.0, is_error_frame=True), Damage.ERROR_FRAME),
    (can.Message(timestamp=3.0, arbitration_id=0x008, is_fd=True, data=bytes(12), is_extended_id=False), Damage.FD),
]
NOT_WRITTEN = {
    ("csv", Damage.FD),
    ("db", Damage.FD),
    ("trc", Damage.ERROR_FRAME),
    ("trc", Damage.FD),
}
"""What python-can's writers leave out or write as something else."""

EXTENDED_FRAME = can.Message(timestamp=3.0, arbitration_id=0x18FF0001, data=b"\xaa", is_extended_id=True)
REMOTE_FRAME = can.Message(timestamp=3.0, arbitration_id=0x008, is_remote_frame=True, is_extended_id=False, dlc=2)

WRITTEN = ("log", "asc", "csv", "trc", "blf", "db")


def write(folder: Path, form: str, messages: list[can.Message]) -> Path:
    file = folder / f"bus.{form}"
    if form == "db":
        write_table(file, messages)
    else:
        with can.Logger(file) as logger:
            for message in messages:
                logger(message)
    return file


def write_table(file: Path, messages: list[can.Message]) -> None:
    """Write what python-can's SqliteWriter writes, which itself forgets the last messages when it is stopped."""
    with closing(sqlite3.connect(file)) as connection:
        connection.execute("CREATE TABLE messages (ts, arbitration_id, extended, remote, error, dlc, data)")
        for each in messages:
            flags = each.is_extended_id, each.is_remote_frame, each.is_error_frame
            row = each.timestamp, each.arbitration_id, *flags, each.dlc, bytes(each.data)
            connection.execute("INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)", row)
        connection.commit()


def read(file: Path) -> list[tuple[int, float, str, Raw]]:
    with file.open("rb") as opened:
        return list(formats.read(opened))


def raws(file: Path) -> list[Raw]:
    return [raw for *_, raw in read(file)]


def read_by_python_can(file: Path) -> Iterator[tuple[float, str, Raw]]:
    with can.LogReader(file) as reader:
        for each in reader:
            channel = "" if each.channel is None else str(each.channel)
            yield round(each.timestamp, 6), channel, Frame(each.arbitration_id, bytes(each.data))


@pytest.mark.parametrize("form", WRITTEN)
def test_frames_times_and_channels_are_those_that_python_can_reads(tmp_path: Path, form: str) -> None:
    file = write(tmp_path, form, SENT)
    found = read(file)
    assert [(round(time, 6), channel, raw) for _, time, channel, raw in found] == list(read_by_python_can(file))
    assert [raw for *_, raw in found] == FRAMES


@pytest.mark.parametrize("form", WRITTEN)
def test_entries_have_lines_or_numbers(tmp_path: Path, form: str) -> None:
    found = read(write(tmp_path, form, SENT))
    lines = [line for line, *_ in found]
    assert lines == list(range(lines[0], lines[0] + len(SENT)))


@pytest.mark.parametrize("form", WRITTEN)
def test_frames_with_29_bit_identifiers(tmp_path: Path, form: str) -> None:
    assert raws(write(tmp_path, form, [*SENT, EXTENDED_FRAME]))[-1] == Frame(EXTENDED | 0x18FF0001, b"\xaa")


@pytest.mark.parametrize("form", [each for each in WRITTEN if each != "trc"])  # python-can writes none there
def test_remote_frames(tmp_path: Path, form: str) -> None:
    found = raws(write(tmp_path, form, [*SENT, REMOTE_FRAME]))[-1]
    assert found == RemoteFrame(0x008, bytes(0 if form == "log" else 2))  # its candump log has no length


@pytest.mark.parametrize(("message", "damage"), FOREIGN)
@pytest.mark.parametrize("form", WRITTEN)
def test_frames_other_than_classic_base_data_frames_are_foreign(
    tmp_path: Path, form: str, message: can.Message, damage: Damage
) -> None:
    if (form, damage) in NOT_WRITTEN:
        pytest.skip("python-can does not write it")
    found = raws(write(tmp_path, form, [*SENT, message, SENT[-1]]))
    foreign = found[len(SENT)]
    assert isinstance(foreign, Foreign)
    assert foreign.damage is damage
    assert [each for each in found if each is not foreign] == [*FRAMES, FRAMES[-1]]


BROKEN_LINES = {
    "asc": ["garbage", " 2.5 1 222 Rx d", " 2.5 1 222 Rx d 8 01 02", " 2.5 1 XYZ Rx d 1 00", " 2.5 1 222 Up d 1 00"],
    "trc": [
        "garbage",
        "  9  1.0 DT  1  0008 Rx -  8  01",
        "  9  1.0 DT  1  XYZ Rx -  1  01",
        "  9  1.0 ZZ  1  0008 Rx -  0",
    ],
}


@pytest.mark.parametrize(("form", "line"), [(form, line) for form, lines in BROKEN_LINES.items() for line in lines])
def test_an_unreadable_line_costs_no_other(tmp_path: Path, form: str, line: str) -> None:
    file = write(tmp_path, form, SENT)
    text = file.read_text().splitlines(keepends=True)
    place = next(number for number, each in enumerate(text) if "14" in each)
    file.write_text("".join([*text[:place], line + "\n", *text[place:]]))
    found = read(file)
    assert [(number, raw.damage) for number, _, _, raw in found if isinstance(raw, Foreign)] == [
        (place + 1, Damage.UNREADABLE)
    ]
    assert [raw for *_, raw in found if isinstance(raw, Frame)] == FRAMES


ASC = """date Sat Sep 30 15:06:13.191 2017
base {base}  timestamps absolute
no internal events logged
// version 9.0.0
Begin Triggerblock Sat Sep 30 15:06:13.191 2017
   0.000000 Start of measurement
   0.100000 CAN 1 Status:chip status error active
   1.000000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%
   2.000000 2  {identifier}             Rx   d {data}  Length = 1704000 BitCount = 145 ID = 8
End TriggerBlock
"""


@pytest.mark.parametrize(("base", "identifier", "data"), [("hex", "1C0", "2 0A FF"), ("dec", "448", "2 10 255")])
def test_asc_headers_and_events_are_no_frames(base: str, identifier: str, data: str) -> None:
    text = ASC.format(base=base, identifier=identifier, data=data)
    found = list(formats.read(io.BytesIO(text.encode()), "asc"))
    assert found == [(9, 2.0, "1", Frame(0x1C0, b"\x0a\xff"))]


TRC = {
    "1.0": "  1)  1841 0014 3  01 02 03",
    "1.1": ";$FILEVERSION=1.1\n;$STARTTIME=0\n  1)  1841.0  Rx  0014  3  01 02 03",
    "1.3": ";$FILEVERSION=1.3\n;$STARTTIME=0\n  1)  1841.0 2  Rx  0014 -  3  01 02 03",
    "2.0": ";$FILEVERSION=2.0\n;$STARTTIME=0\n;$COLUMNS=N,O,T,I,d,l,D\n  1  1841.0 DT  0014 Rx 3  01 02 03",
    "2.1": ";$FILEVERSION=2.1\n;$STARTTIME=0\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n 1 1841.0 DT 2 0014 Rx - 3 01 02 03",
}


@pytest.mark.parametrize("text", TRC.values(), ids=TRC)
def test_trc_versions(text: str) -> None:
    ((_, _, _, raw),) = formats.read(io.BytesIO(text.encode()), "trc")
    assert raw == Frame(0x014, b"\x01\x02\x03")


# Files that end in the middle


def test_a_blf_file_that_is_cut_off_gives_what_is_there_and_says_so(tmp_path: Path) -> None:
    many = [
        can.Message(timestamp=float(n), arbitration_id=0x014, data=n.to_bytes(3, "big"), is_extended_id=False)
        for n in range(10_000)
    ]
    file = write(tmp_path, "blf", many)
    file.write_bytes(file.read_bytes()[:-2000])
    *found, last = raws(file)
    assert 5_000 < len(found) < 10_000
    assert found == [Frame(0x014, n.to_bytes(3, "big")) for n in range(len(found))]
    assert isinstance(last, Foreign)
    assert last.damage is Damage.CUT_OFF


def test_times_of_a_blf_file_count_from_the_start_that_it_says(tmp_path: Path) -> None:
    start = datetime(2014, 5, 28, 12, 34, 56, 789000, UTC).timestamp()
    late = [can.Message(timestamp=start + n, arbitration_id=0x014, is_extended_id=False) for n in (0, 0.5)]
    assert [round(time - start, 3) for _, time, *_ in read(write(tmp_path, "blf", late))] == [0, 0.5]


@pytest.mark.parametrize("content", [b"", b"LOGG", b"no BLF at all" * 20])
def test_a_file_that_is_no_blf_is_unreadable(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "bus.blf"
    file.write_bytes(content)
    (raw,) = raws(file)
    assert isinstance(raw, Foreign)


@pytest.mark.parametrize(
    ("place", "value", "damage"),
    [
        # the size of the first container, and of the first object in it: nothing, too much, and more than there is
        (144 + 8, 0, Damage.UNREADABLE),
        (144 + 8, 1 << 31, Damage.UNREADABLE),
        (144 + 32 + 8, 0, Damage.UNREADABLE),
        (144 + 8, 1 << 19, Damage.CUT_OFF),
        (144 + 32 + 8, 16, Damage.UNREADABLE),
        (144 + 32 + 8, 1 << 19, Damage.CUT_OFF),
        (144 + 32 + 8, 1 << 31, Damage.UNREADABLE),
        # no container, and no object
        (144, 0, Damage.UNREADABLE),
        (144 + 32, 0, Damage.UNREADABLE),
        # an unknown compression
        (144 + 16, 9, Damage.UNREADABLE),
    ],
)
def test_a_blf_file_with_impossible_numbers(tmp_path: Path, place: int, value: int, damage: Damage) -> None:
    file = tmp_path / "bus.blf"
    with can.BLFWriter(file, compression_level=0) as writer:
        for message in SENT:
            writer.on_message_received(message)
    data = bytearray(file.read_bytes())
    data[place : place + 4] = value.to_bytes(4, "little")
    file.write_bytes(bytes(data))
    *_, last = raws(file)
    assert isinstance(last, Foreign)
    assert last.damage is damage


def test_a_blf_container_with_garbage(tmp_path: Path) -> None:
    file = write(tmp_path, "blf", SENT)
    data = bytearray(file.read_bytes())
    start = data.index(b"LOBJ") + 32
    data[start : start + 4] = b"\xff\xff\xff\xff"
    file.write_bytes(bytes(data))
    (raw,) = raws(file)
    assert isinstance(raw, Foreign)
    with pytest.raises(zlib.error):
        zlib.decompress(bytes(data[start:]))


def test_a_table_that_is_none(tmp_path: Path) -> None:
    file = tmp_path / "bus.db"
    sqlite3.connect(file).close()
    file.write_bytes(b"")
    (raw,) = raws(file)
    assert isinstance(raw, Foreign)


def test_an_unpacked_and_a_packed_log_are_the_same(tmp_path: Path) -> None:
    file = write(tmp_path, "log", SENT)
    packed = tmp_path / "bus.log.gz"
    packed.write_bytes(gzip.compress(file.read_bytes()))
    assert read(packed) == read(file)


@pytest.mark.parametrize("spoil", [lambda data: data[:-12], lambda data: data[:10] + bytes(20), lambda _: b"no gzip"])
def test_a_packed_log_that_cannot_be_unpacked_ends_with_an_entry_that_says_so(
    tmp_path: Path, spoil: Callable[[bytes], bytes]
) -> None:
    packed = tmp_path / "bus.log.gz"
    packed.write_bytes(spoil(gzip.compress(write(tmp_path, "log", SENT).read_bytes())))
    *_, last = raws(packed)
    assert isinstance(last, Foreign)
    assert last.damage is Damage.CUT_OFF


def test_unknown_suffix() -> None:
    with pytest.raises(UnknownName, match=r"unknown log format 'xyz'; known: log, candump, console"):
        formats.read(io.BytesIO(), "xyz")


def test_mf4(tmp_path: Path) -> None:
    pytest.importorskip("asammdf", reason="the extra mf4 is not installed")
    found = read(write(tmp_path, "mf4", [*SENT, EXTENDED_FRAME]))
    assert [raw for *_, raw in found[:-1]] == FRAMES
    assert found[-1][3] == Frame(EXTENDED | 0x18FF0001, b"\xaa")


def test_an_mf4_file_of_measured_values_alone_is_not_an_empty_log(tmp_path: Path) -> None:
    asammdf = pytest.importorskip("asammdf", reason="the extra mf4 is not installed")
    with asammdf.MDF() as measured:
        measured.append(asammdf.Signal([20.5, 20.7], [0.0, 1.0], name="Temperature"))
        measured.save(file := tmp_path / "measured.mf4")
    with file.open("rb") as opened, pytest.raises(LocalError, match=r"nothing in it .*MF4 with measured values alone"):
        list(formats.entries(opened))


def test_mf4_without_its_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("can.io.mf4.asammdf", None)
    file = tmp_path / "bus.mf4"
    file.write_bytes(b"")
    with pytest.raises(LocalError, match="the extra `mf4` brings it"):
        read(file)


@pytest.mark.parametrize("form", ["db", "mf4"])
def test_some_formats_must_be_files(form: str) -> None:
    with pytest.raises(LocalError, match="must be a file"):
        formats.read(io.BytesIO(), form)


# One bad entry costs no other


def test_a_frame_that_cannot_be_in_a_blf_file_costs_no_other(tmp_path: Path) -> None:
    impossible = can.Message(timestamp=3.0, arbitration_id=0x7FF, data=b"\xff", is_extended_id=False)
    impossible.arbitration_id = 0x900
    found = raws(write(tmp_path, "blf", [*SENT, impossible, SENT[-1]]))
    assert found == [*FRAMES, Foreign(Damage.UNREADABLE, "2304"), FRAMES[-1]]


GOOD_ROW = (1.0, 0x014, 0, 0, 0, 3, b"\x01\x02\x03")
BAD_ROWS = [
    ("late", *GOOD_ROW[1:]),
    (float("inf"), *GOOD_ROW[1:]),
    (None, *GOOD_ROW[1:]),
    (1.0, "x", *GOOD_ROW[2:]),
    (1.0, -5, *GOOD_ROW[2:]),
    (1.0, 0x900, *GOOD_ROW[2:]),
    (*GOOD_ROW[:5], "three", b"\x01"),
    (None,) * 7,
]


@pytest.mark.parametrize("row", BAD_ROWS)
def test_a_row_with_values_of_wrong_types_costs_no_other(tmp_path: Path, row: tuple[object, ...]) -> None:
    file = tmp_path / "bus.db"
    write_table(file, [])
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.executemany("INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)", (GOOD_ROW, row, GOOD_ROW))
    first, bad, last = raws(file)
    assert (first, last) == (Frame(0x014, b"\x01\x02\x03"),) * 2
    assert isinstance(bad, Foreign)
    assert bad.damage is Damage.UNREADABLE


HUGE = "9" * 4400
"""More digits than Python makes a number of."""

BAD_HEADERS = [";$STARTTIME=abc", ";$STARTTIME=1e300", ";$STARTTIME=nan", f";$STARTTIME={HUGE}", ";$COLUMNS=X"]
BAD_NUMBERS = {
    "asc": [f" 2.5 1 {HUGE} Rx d 1 00", f" {HUGE} 1 8 Rx d 1 00", f" 2.5 {HUGE} 8 Rx d 1 00", f"2.5 1 8 Rx d {HUGE} 0"],
    "trc": [f" 9  1.0 DT  1  0008 Rx -  {HUGE}  01", *BAD_HEADERS],
    "log": [f"({HUGE}) can0 008#00", f"(1.5) can0 {HUGE}#00"],
}


@pytest.mark.parametrize(("form", "line"), [(form, line) for form, lines in BAD_NUMBERS.items() for line in lines])
def test_numbers_that_are_none_are_counted_and_reading_goes_on(tmp_path: Path, form: str, line: str) -> None:
    file = write(tmp_path, form, SENT)
    text = file.read_text().splitlines(keepends=True)
    file.write_text("".join([*text[:-2], line + "\n", *text[-2:]]))
    found = raws(file)
    assert [raw.damage for raw in found if isinstance(raw, Foreign)] == [Damage.UNREADABLE]
    assert [raw for raw in found if isinstance(raw, Frame)] == FRAMES


# What a log is, is what it begins with


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("form", WRITTEN)
def test_a_log_is_judged_by_what_it_begins_with(tmp_path: Path, form: str, packed: bool) -> None:
    content = write(tmp_path, form, SENT).read_bytes()
    if packed and form in formats.BY_NAME:
        pytest.skip("a database cannot be read through gzip")
    file = tmp_path / "bus.wrong"
    file.write_bytes(gzip.compress(content) if packed else content)
    assert [raw for raw in raws(file) if isinstance(raw, Frame)] == FRAMES


@pytest.mark.parametrize("suffix", ["candump", "log"])
def test_a_log_that_does_not_say_what_it_is_goes_by_its_name(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"bus.{suffix}"
    file.write_text("garbage\n(1.0) can0 014#010203\n")
    assert raws(file) == [Foreign(Damage.UNREADABLE, "garbage"), Frame(0x014, b"\x01\x02\x03")]


def test_an_explicit_format_takes_precedence(tmp_path: Path) -> None:
    file = write(tmp_path, "blf", SENT)
    with file.open("rb") as opened:
        assert {type(raw) for *_, raw in formats.read(opened, "csv")} == {Foreign}


# Sizes


FRAME_LINE, LONG = b"(1.0) can0 014#010203\n", 5000


@pytest.mark.parametrize("line", [b"x" * LONG, b"(1.0) can0 008#" + b"00" * LONG, b"(1.0) " + b"c" * LONG + b" 014#01"])
def test_of_a_line_that_is_too_long_the_rest_is_passed_over(line: bytes) -> None:
    content = io.BytesIO(FRAME_LINE + line + b"\n" + FRAME_LINE)
    (_, *_, first), (_, *_, long), (number, *_, last) = formats.read(content, "log", 1000)
    assert (first, last, number) == (Frame(0x014, b"\x01\x02\x03"), first, 3)
    assert isinstance(long, Foreign)
    assert (long.damage, len(long.text) <= 60) == (Damage.UNREADABLE, True)


def test_a_larger_bound_reads_longer_lines() -> None:
    content = io.BytesIO(b"(1.0) can0" + b" " * LONG + b"014#010203\n")
    ((*_, raw),) = formats.read(content, "log", 2 * LONG)
    assert raw == Frame(0x014, b"\x01\x02\x03")


@pytest.mark.parametrize("form", ["log", "blf", "pcap"])
def test_memory_does_not_grow_with_what_is_packed(tmp_path: Path, form: str) -> None:
    """A megabyte of gzip may stand for a gigabyte, and so may a container of BLF."""
    heads = {"log": b"", "blf": write(tmp_path, "blf", SENT).read_bytes(), "pcap": b"\xd4\xc3\xb2\xa1" + bytes(20)}
    packed = io.BytesIO(gzip.compress(heads[form] + bytes(40 << 20), 1))
    tracemalloc.start()
    entries = sum(1 for _ in formats.read(packed, form, 1 << 16))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert entries >= 1
    assert most < 4 << 20


def test_a_blf_container_is_unpacked_piece_by_piece() -> None:
    content = zlib.compress(bytes(64 << 20), 1)
    container = struct.pack("<4sHHLLH6xL4x", b"LOBJ", 16, 1, 32 + len(content), 10, 2, 0) + content
    packed = io.BytesIO(struct.pack("<4sL136x", b"LOGG", 144) + container)
    tracemalloc.start()
    (*_, last) = (raw for *_, raw in formats.read(packed, "blf"))
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert last == Foreign(Damage.UNREADABLE, "no object where one should start")
    assert most < 4 << 20


# BLF without containers, and of hardware for CAN FD


def bare_blf(*objects: tuple[int, bytes]) -> bytes:
    """Return a BLF file whose objects, of a type and a body, stand in it without a container; times count in ns."""
    head = struct.pack("<4sL32x8H", b"LOGG", 144, *[0] * 8).ljust(144, b"\0")
    made = [struct.pack("<4sHHLLL4xQ", b"LOBJ", 32, 1, 32 + len(body), kind, 2, 10**9) + body for kind, body in objects]
    return head + b"".join(each + bytes(len(each) % 4) for each in made)


BARE = {
    "classic": (1, struct.pack("<HBBL8s", 1, 0, 1, 0x705, b"\5"), Frame(0x705, b"\5")),
    "FD object, classic": (100, struct.pack("<HBBLLBBB5x64s", 1, 0, 1, 0x705, 0, 0, 0, 1, b"\5"), Frame(0x705, b"\5")),
    "FD object, remote": (100, struct.pack("<HBBLLBBB5x", 1, 0x80, 1, 0x705, 0, 0, 0, 0), RemoteFrame(0x705, b"\0")),
    "FD object, FD": (100, struct.pack("<HBBLLBBB5x64s", 1, 0, 8, 0x123, 0, 0, 1, 8, bytes(8)), Damage.FD),
    "FD 64 object, classic": (101, struct.pack("<4B7LHBBL2s", 1, 2, 2, 0, 1 << 31 | 8, *[0] * 10, b"\1\2"),
                              Frame(EXTENDED | 8, b"\1\2")),
    "FD 64 object, remote": (101, struct.pack("<4B7LHBBL", 1, 2, 0, 0, 8, 0, 0x10, *[0] * 8), RemoteFrame(8, bytes(2))),
    "FD 64 object, FD": (101, struct.pack("<4B7LHBBL12s", 1, 9, 12, 0, 8, 0, 0x1000, *[0] * 8, b""), Damage.FD),
}  # fmt: skip


@pytest.mark.parametrize(("kind", "body", "raw"), BARE.values(), ids=BARE)
def test_blf_without_containers_and_what_hardware_for_can_fd_records(kind: int, body: bytes, raw: Raw | Damage) -> None:
    found = list(formats.read(io.BytesIO(bare_blf((kind, body), (kind, body))), "blf"))
    assert [(time, channel) for _, time, channel, _ in found] == [(1.0, "0")] * 2
    assert [each.damage if isinstance(each, Foreign) else each for *_, each in found] == [raw] * 2


# A new format: what may have been forgotten


def test_each_format_is_identified_by_its_first_bytes() -> None:
    assert formats.FORMATS.keys() - formats.CONTENT.groupindex.keys() == {"candump"}  # another name of `log`


def test_the_page_lists_each_format() -> None:
    page = (Path(__file__).parents[3] / "docs" / "watching.md").read_text("utf-8")
    (listed,) = re.findall(r"`--format` names it: (.+?)\.", page, flags=re.DOTALL)
    assert listed.replace("`", "").replace("\n", " ").split(", ") == [*formats.FORMATS]
