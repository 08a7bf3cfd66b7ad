"""What python-can writes: rows of an SQLite table, and lines of CSV."""

from __future__ import annotations

import io
import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import can
import pytest

from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import Damage, Foreign, Raw
from eurobot_od.traffic.formats.python_can import CREATE, write_table

GOOD = (1.5, 0x014, 0, 0, 0, 2, b"\x01\x02")
PLACES = "ts, arbitration_id, extended, remote, error, dlc"


def read(file: Path) -> list[tuple[int, float, str, Raw]]:
    with file.open("rb") as opened:
        return list(formats.read(opened))


def table(folder: Path, *rows: tuple[object, ...]) -> Path:
    file = folder / "bus.db"
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.execute(CREATE)
        connection.executemany("INSERT INTO messages VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
    return file


@pytest.mark.parametrize(
    ("row", "raw"),
    [
        (GOOD, Frame(0x014, b"\x01\x02")),
        ((1.5, 0x014, 0, 0, 0, 0, None), Frame(0x014, b"")),
        ((1.5, 0x014, 1, 0, 0, 1, b"\xaa"), Frame(EXTENDED | 0x014, b"\xaa")),
        ((1.5, 0x014, 0, 1, 0, 8, b""), RemoteFrame(0x014, bytes(8))),
        ((1.5, 0x014, 1, 1, 0, 0, b""), RemoteFrame(EXTENDED | 0x014)),
        ((1.5, 0x014, 1, 1, 1, 0, b""), Foreign(Damage.ERROR_FRAME, "00000014#")),
        ((1.5, 0x014, 0, 0, 0, 8, bytes(8)), Frame(0x014, bytes(8))),
        ((1.5, 0x014, 0, 0, 0, 9, bytes(9)), Foreign(Damage.FD, "014#" + "00" * 9)),
    ],
)
def test_a_row_is_a_frame_or_says_what_it_is(tmp_path: Path, row: tuple[object, ...], raw: Raw) -> None:
    ((number, time, channel, found),) = read(table(tmp_path, row))
    assert (number, time, channel) == (1, 1.5, "")
    if isinstance(raw, Foreign):
        assert isinstance(found, Foreign)
        assert found.damage is raw.damage
    else:
        assert found == raw


@pytest.mark.parametrize("length", [1, 3])
def test_a_row_of_another_length_than_its_data_is_unreadable_and_counted(tmp_path: Path, length: int) -> None:
    bad = (1.5, 0x014, 0, 0, 0, length, b"\x01\x02")
    (first, _, _, _), (second, _, _, raw), (third, _, _, _) = read(table(tmp_path, GOOD, bad, GOOD))
    assert (first, second, third) == (1, 2, 3)
    assert raw == Foreign(Damage.UNREADABLE, f"014#0102 with length {length}")


def typeless(folder: Path, *rows: tuple[object, ...]) -> Path:
    """Make a table whose columns take values of any type, as they are."""
    file = folder / "odd.db"
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.execute("CREATE TABLE messages (dlc, data, ts, arbitration_id, extended, remote, error)")
        connection.executemany(f"INSERT INTO messages ({PLACES}, data) VALUES (?, ?, ?, ?, ?, ?, ?)", rows)
    return file


@pytest.mark.parametrize(
    ("row", "text"),
    [
        (("soon", 0x014, 0, 0, 0, 2, b"ab"), "ts is 'soon'"),
        ((None, 0x014, 0, 0, 0, 2, b"ab"), "ts is None"),
        ((1.5, "014", 0, 0, 0, 2, b"ab"), "arbitration_id is '014'"),
        ((1.5, 20.5, 0, 0, 0, 2, b"ab"), "arbitration_id is 20.5"),
        ((1.5, 0x014, 0, 0, 0, "2", b"ab"), "dlc is '2'"),
        ((1.5, 0x014, 0, 1, 0, None, b""), "dlc is None"),
        ((1.5, 0x014, 0, 0, 0, 2, "ab"), "data is 'ab'"),
        ((1.5, 0x014, 0, 0, 0, 2, 1.5), "data is 1.5"),
    ],
)
def test_a_value_of_another_type_than_its_columns_is_named(tmp_path: Path, row: tuple[object, ...], text: str) -> None:
    first, (*_, raw), last = read(typeless(tmp_path, GOOD, row, GOOD))
    assert raw == Foreign(Damage.UNREADABLE, text)
    assert first[1:] == last[1:] == (1.5, "", Frame(0x014, b"\x01\x02"))


def test_text_that_is_not_utf8_costs_no_other_row(tmp_path: Path) -> None:
    file = typeless(tmp_path, GOOD, GOOD)
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.execute("UPDATE messages SET data = CAST(x'FF' AS TEXT) WHERE rowid = 1")
    (*_, bad), (*_, good) = read(file)
    assert (bad, good) == (Foreign(Damage.UNREADABLE, "data is '\ufffd'"), Frame(0x014, b"\x01\x02"))


def test_a_table_whose_damaged_name_sqlite_quotes_is_told(tmp_path: Path) -> None:
    file = typeless(tmp_path, GOOD)
    file.write_bytes(file.read_bytes().replace(b"messages", b"mess\xe7ges"))
    ((*_, raw),) = read(file)
    assert raw == Foreign(Damage.CUT_OFF, "SQLite reads no further: no table messages")
    file.write_bytes(file.read_bytes().replace(b"TABLE mess", b"TABBE mess"))
    ((*_, raw),) = read(file)
    assert raw == Foreign(Damage.CUT_OFF, "SQLite reads no further: malformed database schema (mess\ufffd...")


ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"


@pytest.mark.parametrize(
    ("made", "text"),
    [
        (f"VIEW messages AS {ENDLESS} SELECT i AS ts, * FROM n", "no table messages"),
        ("TABLE others (ts)", "no table messages"),
        ("TABLE messages (ts, arbitration_id, extended, remote, error, data)", "no such column: dlc"),
        (f"TABLE messages ({PLACES}, data AS (zeroblob(1 << 24)))", "string or blob too big"),
    ],
)
def test_views_and_virtual_tables_are_not_read(tmp_path: Path, made: str, text: str) -> None:
    file = tmp_path / "odd.db"
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.execute(f"CREATE {made}")
        if "TABLE messages" in made:
            connection.execute("INSERT INTO messages DEFAULT VALUES")
    ((*_, raw),) = read(file)
    assert raw == Foreign(Damage.CUT_OFF, f"SQLite reads no further: {text}")


HEADER, LINE = "timestamp,arbitration_id,extended,remote,error,dlc,data\n", "1.5,0x14,0,0,0,2,AQI=\n"


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("garbage", "no columns"),
        ("late,0x14,0,0,0,2,AQI=", "no time"),
        ("1.5,20x,0,0,0,2,AQI=", "no identifier"),
        (f"1.5,0x14,0,0,0,{'9' * 4400},AQI=", "more digits than Python reads"),
        (f"1.5,0x14,0,0,0,2,{'A' * 2000}", "a line over the bound"),
        ("1.5,0x14,0,0,0,2,A", "half of its data"),
    ],
)
def test_a_line_of_csv_that_cannot_be_read_costs_no_other(line: str, reason: str) -> None:
    content = io.BytesIO((HEADER + LINE + f"{line}\n" + LINE).encode())
    first, (number, time, _, bad), last = formats.read(content, "csv", 1000)
    assert first[1:] == last[1:] == (1.5, "", Frame(0x014, b"\x01\x02")), reason
    assert isinstance(bad, Foreign)
    assert (number, time, bad.damage) == (3, 1.5, Damage.UNREADABLE)


def test_a_line_of_csv_with_another_length_than_its_data_costs_no_other() -> None:
    content = io.BytesIO((HEADER + LINE + LINE.replace(",2,", ",3,") + LINE).encode())
    assert [raw for *_, raw in formats.read(content, "csv")] == [
        Frame(0x014, b"\x01\x02"),
        Foreign(Damage.UNREADABLE, "1.5,0x14,0,0,0,3,AQI="),
        Frame(0x014, b"\x01\x02"),
    ]


def test_a_written_table_is_read_again(tmp_path: Path) -> None:
    messages = [
        can.Message(timestamp=1.5, arbitration_id=0x014, data=b"\x01\x02", is_extended_id=False),
        can.Message(timestamp=2.5, arbitration_id=0x014, data=b"\x03", is_extended_id=True),
        can.Message(timestamp=3.5, arbitration_id=0x014, is_remote_frame=True, is_extended_id=False),
        can.Message(timestamp=4.5, is_error_frame=True),
    ]
    write_table(tmp_path / "bus.db", messages)
    found = read(tmp_path / "bus.db")
    assert [time for _, time, *_ in found] == [1.5, 2.5, 3.5, 4.5]
    assert [raw.damage if isinstance(raw, Foreign) else raw for *_, raw in found] == [
        Frame(0x014, b"\x01\x02"),
        Frame(EXTENDED | 0x014, b"\x03"),
        RemoteFrame(0x014),
        Damage.ERROR_FRAME,
    ]


def test_a_table_that_cannot_be_written_is_an_oserror_with_the_file(tmp_path: Path) -> None:
    file = table(tmp_path)
    with pytest.raises(OSError, match=r"table messages already exists: '.*bus\.db'"):
        write_table(file, [])


def test_asammdf_is_imported_for_mf4_alone(tmp_path: Path) -> None:
    (tmp_path / "asammdf.py").write_text("import sys\nprint('asammdf!', file=sys.stderr)\nraise ImportError\n")
    (tmp_path / "bus.log").write_text("(1.0) can0 705#05\n")
    (tmp_path / "bus.mf4").write_bytes(b"MDF     4.10    " + bytes(100))
    said = {}
    for log in ("bus.log", "bus.mf4"):
        eds = Path(__file__).parents[3] / "docs" / "motor.eds"
        command = [sys.executable, "-m", "eurobot_od", "decode", "--eds", f"5={eds}", str(tmp_path / log)]
        known = os.pathsep.join([str(tmp_path), *sys.path])
        ended = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": known})
        said[log] = ended.returncode, ended.stderr
    assert said["bus.log"] == (0, "")
    status, words = said["bus.mf4"]
    assert status == 2
    assert words.startswith("asammdf!\n")
    assert "asammdf is not installed; the extra `mf4` brings it" in words
