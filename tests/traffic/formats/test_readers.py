"""Each format has a log that its reader reads, and that is recognised by its first bytes."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import can
import pytest

from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import Foreign, Raw
from eurobot_od.traffic.formats import FORMATS
from tests.traffic.formats.test_formats import SENT, write

STATUS = Frame(0x181, bytes.fromhex("3702E8030000"))
BOOT = Frame(0x701, b"\0")
NMEA = Frame(EXTENDED | 0x09F80115, bytes.fromhex("A07DE618C005FBD5"))

TRC_2_1 = "      1       103.250 DT 1      0181 Rx -  6    37 02 E8 03 00 00\n"
SAMPLES: dict[str, tuple[str, list[Raw]]] = {
    "log": ("(1.000000) can0 181#3702E8030000\n(1.5) can0 701#00\n", [STATUS, BOOT]),
    "candump": ("(1.000000) can0 181#3702E8030000\n", [STATUS]),
    "old": ("<0x181> [6] 37 02 e8 03 00 00\n<0x09f80115> [8] a0 7d e6 18 c0 05 fb d5\n", [STATUS, NMEA]),
    "console": ("  can0  181   [6]  37 02 E8 03 00 00\n< can0  701   [1]  00\n", [STATUS, BOOT]),
    "message": (
        "Timestamp:        1.500000    ID:      181    S Rx                DL:  6    37 02 e8 03 00 00\n"
        "Timestamp:        1.600000    ID: 09f80115    X Rx                DL:  8    a0 7d e6 18 c0 05 fb d5"
        "     Channel: can0\n",
        [STATUS, NMEA],
    ),
    "asc": ("   2.501010 1  181             Rx   d 6 37 02 E8 03 00 00\n", [STATUS]),
    "trc": (TRC_2_1, [STATUS]),
    "crtd": ("1320745424.000 CXX a comment\n1320745424.002 1R11 181 37 02 E8 03 00 00\n", [STATUS]),
    "yacht": ("17:33:21.141 R 09F80115 A0 7D E6 18 C0 05 FB D5\r\n", [NMEA]),
    "carbus": (
        "@ TEXT @ 2 @ 64 @ 0 @ 591 @ 38782 @ 00:00:38.782 @\r14,687\t1\t0004\t181\t6\t37 02 E8 03 00 00\t0\t$\r",
        [STATUS],
    ),
    "microchip": (
        "//---------\nMicrochip Technology Inc.\nCAN BUS Analyzer\n//---------\n"
        "1500;RX;0x181;6;0x37;0x02;0xE8;0x03;0x00;0x00\n",
        [STATUS],
    ),
    "csv": ("timestamp,arbitration_id,extended,remote,error,dlc,data\n1.5,0x701,0,0,0,1,AA==\n", [BOOT]),
    "busmaster": ("***BUSMASTER Ver 3.2.2***\n00:00:01:0000 Rx 1 0x701 s 1 00\n", [BOOT]),
    "gvret": ("Time Stamp,ID,Extended,Dir,Bus,LEN,D1\n1000,00000701,false,Rx,0,1,00,\n", [BOOT]),
    "ixxat": (
        'ASCII Trace IXXAT\n"Time";"Identifier (hex)";"Format";"Flags";"Data"\n"00:02:20.66";"701";"Std";"";"00 "\n',
        [BOOT],
    ),
    "kvaser": ("Chn Identifier Flg   DLC  D0...1\n 0    00000701         1  00                154.2 R\n", [BOOT]),
    "columns": ("Time (ms);CAN ID;DLC;Data\n1500;0x181;6;37 02 E8 03 00 00\n", [STATUS]),
}

FILES: dict[str, Callable[[Path], Path]] = {
    "blf": lambda folder: write(folder, "blf", SENT),
    "db": lambda folder: write(folder, "db", SENT),
}
ELSEWHERE = {"mf4": "test_formats.py", "pcap": "test_binary.py", "pcapng": "test_binary.py"}
"""Formats that need a package, or bytes made by hand, and where they are tested."""


def read(text: str, form: str | None = None) -> list[Raw]:
    """Read a log without a name, as from standard input."""
    file = io.BufferedReader(io.BytesIO(text.encode()))
    return [raw for *_, raw in formats.entries(file, form)]


def test_each_format_has_a_sample() -> None:
    assert {*SAMPLES, *FILES, *ELSEWHERE} == set(FORMATS)
    assert all((Path(__file__).parent / each).exists() for each in ELSEWHERE.values())


@pytest.mark.parametrize("form", SAMPLES)
def test_a_reader_reads_its_sample(form: str) -> None:
    text, expected = SAMPLES[form]
    assert read(text, form) == expected


@pytest.mark.parametrize("form", [each for each in SAMPLES if FORMATS[each].beginning])
def test_a_sample_is_recognised_by_its_first_bytes(form: str) -> None:
    text, expected = SAMPLES[form]
    assert read(text) == expected
    assert formats.form_of(io.BufferedReader(io.BytesIO(text.encode()))) == form


@pytest.mark.parametrize("form", FILES)
def test_a_file_is_recognised_by_its_first_bytes(form: str, tmp_path: Path) -> None:
    file = FILES[form](tmp_path)
    with file.open("rb") as opened:
        assert formats.form_of(opened) == form
        assert [raw for *_, raw in formats.entries(opened, form)] == [
            Frame(each.arbitration_id, bytes(each.data)) for each in SENT
        ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        # pieces of TRC without a head, of each version
        ("     1)      1841  0181  6  37 02 E8 03 00 00\n", STATUS),
        ("     1)      1059.9  Rx         0181  6  37 02 E8 03 00 00\n", STATUS),
        ("     1)      1059.9 1  Rx         0181  6  37 02 E8 03 00 00\n", STATUS),
        ("     1)      1059.9 1  Rx         0181 -  6    37 02 E8 03 00 00\n", STATUS),
        ("     1      1059.900 DT     0181 Rx 6  37 02 E8 03 00 00\n", STATUS),
        # candump -8 -l
        ("(1.0) can0 181#3702E80300000000_F\n", Frame(0x181, bytes.fromhex("3702E80300000000"))),
        ("(1.0) can0 701#00\n(1.0) can0 18FF0001#3702E80300000000_9\n", BOOT),
        # CSV of others: by their columns
        ("timestamp,id,data\n1.5,181,3702E8030000\n", STATUS),
        ("time,addr,bus,data\n1.5,0x181,0,0x3702e8030000\n", STATUS),
        ("ID,D0,D1,D2,D3,D4,D5,D6,D7\n181,37,02,E8,03,00,00,,\n", STATUS),
        ("Time,ID,Extended,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n10,181,0,0,6,37,02,E8,03,00,00,0,0\n", STATUS),
        ("No;Timestamp [us];Arbitration ID;DLC;Data bytes\n1;15;181h;6;37 02 E8 03 00 00\n", STATUS),
        ("time\tcob-id\tpayload\n2024-01-02T03:04:05\t0x181\t37:02:E8:03:00:00\n", STATUS),
        ("index,time,id (dec),data\n1,0:01:02.5,385,3702E8030000\n", STATUS),
        ("time,id,rtr,dlc,data\n1.5,701,1,1,\n", RemoteFrame(0x701, b"\0")),
        ("time,id,ide,data\n1.5,181,1,3702E8030000\n", Frame(EXTENDED | 0x181, STATUS.data)),
    ],
)
def test_pasted_logs_are_read(text: str, expected: Raw) -> None:
    assert read(text)[0] == expected


@pytest.mark.parametrize(
    ("text", "time"),
    [
        ("Time (ms);CAN ID;DLC;Data\n1500;0x181;1;37\n", 1.5),
        ("Timestamp [us];ID;Data\n1500;0x181;37\n", 0.0015),
        ("time,id,data\n0:01:02.5,181,37\n", 62.5),
        ("time,id,data\n2024-01-02T03:04:05Z,181,37\n", 1704164645.0),
        ("id,data\n181,37\n", 0.0),
        (SAMPLES["yacht"][0], 63201.141),
        (SAMPLES["carbus"][0], 14.687),
        (SAMPLES["carbus"][0].replace("TEXT @ 2", "TEXT @ 3").replace("14,687", "14,000687"), 14.000687),
        (SAMPLES["microchip"][0], 1.5),
    ],
)
def test_times_are_in_seconds(text: str, time: float) -> None:
    ((_, found, _, _), *_) = formats.entries(io.BufferedReader(io.BytesIO(text.encode())))
    assert found == pytest.approx(time)


def test_messages_of_all_kinds_as_python_can_prints_them_are_read() -> None:
    data = bytes.fromhex("0102")
    messages = [
        can.Message(timestamp=1.0, arbitration_id=0x18EEFF01, data=data, channel="can0"),
        can.Message(timestamp=1.1, arbitration_id=0x181, data=data, is_extended_id=False, is_rx=False),
        can.Message(timestamp=1.2, arbitration_id=0x181, is_remote_frame=True, dlc=3, is_extended_id=False),
        can.Message(timestamp=1.3, arbitration_id=0x181, is_fd=True, data=bytes(12), is_extended_id=False),
        can.Message(timestamp=1.4, is_error_frame=True),
    ]
    one, two, three, fd, error = read("".join(f"{each}\n" for each in messages))
    assert [one, two] == [Frame(EXTENDED | 0x18EEFF01, data), Frame(0x181, data)]
    assert three == RemoteFrame(0x181, bytes(3))
    assert [each.damage.value for each in (fd, error) if isinstance(each, Foreign)] == ["FD frame", "error frame"]


def test_the_start_of_a_measurement_of_fd_hardware_is_not_damage() -> None:
    text = "date Mon Jan 1 10:00:00 2024\nbase hex timestamps absolute\n   0.000000 CANFD Start of measurement\n"
    assert read(text + SAMPLES["asc"][0]) == [STATUS]


PASTED: dict[str, tuple[str, str, list[Raw]]] = {
    "the command that was typed": ("console", "me@box:~$ candump can0\n  can0  701   [1]  00\n", [BOOT]),
    "a program's own words": ("console", "main: starts\n (1.5)  can0  TX - -  701   [1]  00\nmain: ends\n", [BOOT]),
    "a logger's words": (
        "message",
        "DEBUG:can.bus:sending: Timestamp:        0.000000        ID: 0701    S          DLC: 1    00\n",
        [BOOT],
    ),
    "bytes from the last to the first": ("columns", "timestamp,id,len,b1,b0\n1751721260813,0x181,2,0x02,0x37\n", []),
    "bytes by letters": ("columns", "No,Frame_ID,Data_Length,ByteA,ByteB\n1,0x701,1,00,\n", [BOOT]),
}


@pytest.mark.parametrize(("form", "text", "frames"), PASTED.values(), ids=PASTED)
def test_pasted_parts_of_a_log_are_read(form: str, text: str, frames: list[Raw]) -> None:
    file = io.BufferedReader(io.BytesIO(text.encode()))
    assert formats.form_of(file) == form
    read = [raw for *_, raw in formats.read(file, form) if isinstance(raw, Frame)]
    assert read == (frames or [Frame(0x181, b"\x37\x02")])


def test_a_time_in_ms_since_1970_is_one() -> None:
    ((_, time, _, _),) = formats.read(io.BytesIO(b"timestamp,id,data\n1751721260813,0x701,00\n"), "columns")
    assert time == 1751721260.813
