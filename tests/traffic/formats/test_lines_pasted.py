"""Text of other programs as people paste it, recognised by its first lines: candump on a terminal and others."""

from __future__ import annotations

import io
from datetime import UTC, datetime

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import Damage, Foreign, Raw

BOOT = Frame(0x70A, b"\0")
SDO = Frame(0x601, bytes.fromhex("4000100000000000"))


def read(text: str) -> list[tuple[float, str, Raw]]:
    """Read a log without a name, as from standard input."""
    file = io.BufferedReader(io.BytesIO(text.encode()))
    return [(time, channel, raw) for _, time, channel, raw in formats.entries(file)]


CONSOLE = [
    # plain, and with the options -ta, -tz, -x, -8
    ("  can0  70A   [1]  00", 0.0, BOOT),
    (" (1613749650.388103)  can0  70A   [1]  00", 1613749650.388103, BOOT),
    (" (000.000000)  can0  70A   [1]  00", 0.0, BOOT),
    (" (001.500000)  can0  RX - -  70A   [1]  00", 1.5, BOOT),
    (" (001.500000)  can0  TX B E  70A   [1]  00", 1.5, BOOT),
    ("  can0  601   {F}  40 00 10 00 00 00 00 00", 0.0, SDO),
    # -a: letters after the data, also such as look like data
    ("  can0  601   [8]  40 00 10 00 00 00 00 00   '@.......'", 0.0, SDO),
    ("  can0  70A   [1]  00                        'AB'", 0.0, BOOT),
    # no data, 29 bits, remote, error frames, CAN FD
    ("  can0  080   [0] ", 0.0, Frame(0x080)),
    ("  can0  18FF0001   [2]  AA BB", 0.0, Frame(EXTENDED | 0x18FF0001, b"\xaa\xbb")),
    ("  can0  70A   [1]  remote request", 0.0, RemoteFrame(0x70A, b"\0")),
    ("  can0  20000004   [8]  00 00 00 00 00 00 00 00   ERRORFRAME", 0.0, Damage.ERROR_FRAME),
    ("  can0  123  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B", 0.0, Damage.FD),
]


@pytest.mark.parametrize(("line", "time", "raw"), CONSOLE)
def test_candump_on_a_terminal(line: str, time: float, raw: Raw | Damage) -> None:
    ((found_time, channel, found),) = read(f"{line}\n")
    assert (found_time, channel) == (time, "can0")
    assert (found.damage if isinstance(found, Foreign) else found) == raw


def test_a_date_of_candump_is_local_time() -> None:
    ((time, *_),) = read(" (2023-10-19 11:31:44.485261)  can0  70A   [1]  00\n")
    assert time == datetime.fromisoformat("2023-10-19 11:31:44.485261").timestamp()


BUSMASTER = """***BUSMASTER Ver 3.2.2***
***PROTOCOL CAN***
***START DATE AND TIME 8:8:2014 11:49:7:965***
***{base}***
***{mode} MODE***
***<Time><Tx/Rx><Channel><CAN ID><Type><DLC><DataBytes>***
{lines}
***[STOP LOGGING SESSION]***
"""
BUSMASTER_LINES = "00:12:16:6390 Rx 1 0x701 s 1 1F\n00:00:01:0000 Rx 1 0x701 sr 1\n"
DAY = datetime(2014, 8, 8, tzinfo=UTC).timestamp()
BEGAN = datetime(2014, 8, 8, 11, 49, 7, 965000, tzinfo=UTC).timestamp()


STRANGE_HEADS = {
    "a piece of BUSMASTER's": f"{BUSMASTER_LINES}",
    "a line of words behind comments": "# of an old candump\n" * 8 + "interface = can0, family = 29\n<0x701> [1] 1f\n",
}


@pytest.mark.parametrize("text", STRANGE_HEADS.values(), ids=STRANGE_HEADS)
def test_a_log_is_known_behind_any_head(text: str) -> None:
    assert Frame(0x701, b"\x1f") in [raw for *_, raw in read(text)]


@pytest.mark.parametrize(
    ("mode", "times"),
    [("SYSTEM", (DAY + 736.639, DAY + 1)), ("ABSOLUTE", (BEGAN + 736.639, BEGAN + 1)),
     ("RELATIVE", (BEGAN + 736.639, BEGAN + 737.639))],
)  # fmt: skip
def test_busmaster(mode: str, times: tuple[float, float]) -> None:
    found = read(BUSMASTER.format(base="HEX", mode=mode, lines=BUSMASTER_LINES))
    assert [time for time, *_ in found] == pytest.approx(times)
    assert [raw for *_, raw in found] == [Frame(0x701, b"\x1f"), RemoteFrame(0x701, b"\0")]


def test_busmaster_in_decimal_numbers() -> None:
    ((*_, raw),) = read(BUSMASTER.format(base="DEC", mode="SYSTEM", lines="00:00:00:0000 Tx 2 1793 x 2 31 255"))
    assert raw == Frame(EXTENDED | 1793, b"\x1f\xff")


def test_gvret() -> None:
    rows = "166064000,0000021A,false,Rx,0,2,FE,36,\n166064500,18FF0001,true,Rx,1,0,\n"
    new = read(f"Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n{rows}")
    old = read(f"Time Stamp,ID,Extended,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n{rows.replace('Rx,', '')}")
    assert new == old == [
        (166.064, "0", Frame(0x21A, b"\xfe\x36")), (166.0645, "1", Frame(EXTENDED | 0x18FF0001)),
    ]  # fmt: skip


@pytest.mark.parametrize("before", ["\ufeff", "\n\r\n", "# who made it\n\n", "\ufeff\n# both\n"])
def test_lines_before_the_first_entry_are_skipped(before: str) -> None:
    assert [raw for *_, raw in read(f"{before}  can0  70A   [1]  00\n")] == [BOOT]
    assert [raw for *_, raw in read(f"{before}(1.0) can0 70A#00\n")] == [BOOT]


@pytest.mark.parametrize("text", ["", "\n", "# nothing\n"])
def test_a_log_without_entries_is_nothing(text: str) -> None:
    assert read(text) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("hello\nworld\n", "as CSV whose first line names the columns"),
        ("<?xml version='1.0'?>\n", "XML"),
        ("PK\x03\x04abc\n", "zip archive"),
    ],
)
def test_a_log_of_which_nothing_can_be_read_is_an_error_that_says_what_helps(text: str, words: str) -> None:
    with pytest.raises(LocalError, match=f"standard input: nothing in it can be read as a frame.*{words}"):
        read(text)


def test_one_frame_is_enough_to_go_on() -> None:
    assert [type(raw) for *_, raw in read("(1.0) can0 70A#00\nhello\n")] == [Frame, Foreign]
    assert len(read("hello\n(1.0) can0 123##1AB\n")) == 2


IXXAT = """ASCII Trace IXXAT MiniMon V3  Version: 1.0.0.1271
Date: 28.01.2025
Baudrate: 500 kbit/s
"Time"{0}"Identifier (hex)"{0}"Format"{0}"Flags"{0}"Data (hex)"
"""


@pytest.mark.parametrize("separator", [";", ","])
@pytest.mark.parametrize(
    ("entry", "time", "raw"),
    [
        ("00:02:20.66;70A;Std;;00 ", 140.66, BOOT),
        ("01:00:00,5;80;Std;;", 3600.5, Frame(0x080)),
        ("00:00:01.0;18FF0001;Ext;;AA BB ", 1.0, Frame(EXTENDED | 0x18FF0001, b"\xaa\xbb")),
        ("00:00:01.0;70A;Std;Rtr ;Remote request  DLC = 1 ", 1.0, RemoteFrame(0x70A, b"\0")),
    ],
)
def test_ixxat(separator: str, entry: str, time: float, raw: Raw) -> None:
    line = separator.join(f'"{each}"' for each in entry.split(";"))
    assert read(f"{IXXAT.format(separator)}{line}\n") == [(time, "", raw)]


@pytest.mark.parametrize(
    ("entry", "raw"),
    [
        ('"70A","1","00","."', BOOT),
        ('" 80","0","",""', Frame(0x080)),
        ('"601","8","40 00 10 00 00 00 00 00","@",".."', SDO),  # an ASCII column with anything in it
        ('"18FF0001","2","AA BB",".."', Frame(EXTENDED | 0x18FF0001, b"\xaa\xbb")),
    ],
)
def test_ixxats_analyser(entry: str, raw: Raw) -> None:
    head = '"Bus","No","Time (abs)","State","ID (hex)","DLC","Data (hex)","ASCII"\n'
    line = f'"USB-to-CAN compact  CAN-1","1","00:02:20.66","      ",{entry}\n'
    assert read(f"{head}{line}") == [(140.66, "CAN-1", raw)]


KVASER = "Chn Identifier Flg   DLC  D0...1...2...3...4...5...6..D7       Time     Dir\n"


@pytest.mark.parametrize(
    ("entry", "raw"),
    [
        (" 0    0000070A         1  00                                 154.266550 R", BOOT),
        (" 0    0000070A         1  00                                 154.266550 T\r", BOOT),
        (" 0    00000080         0                                      154.266550 R", Frame(0x080)),
        (
            " 0    18FF0001 X       2  AA  BB                             154.266550 R",
            Frame(EXTENDED | 0x18FF0001, b"\xaa\xbb"),
        ),
        (" 0    00000000            ErrorFrame                         154.266550 R", Damage.ERROR_FRAME),
        (" 0    0000070A         2  00                                 154.266550 R", Damage.UNREADABLE),
        (" 0    0CFBFFDB         1  00                                 154.266550 R", Damage.UNREADABLE),
    ],
)
def test_kvaser(entry: str, raw: Raw | Damage) -> None:
    found, *_ = read(f"{KVASER}{entry}\n 1    00000080         0    200.0 R\nLogging stopped.\n")
    read_as = found[2].damage if isinstance(found[2], Foreign) else found[2]
    assert (*found[:2], read_as) == ((0.0, "", raw) if raw is Damage.UNREADABLE else (154.26655, "0", raw))


def test_an_old_log_of_savvycan_has_eight_octets_in_each_line() -> None:
    header = "Time Stamp,ID,Extended,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
    assert read(f"{header}1000000,0000070A,false,0,1,00,01,02,03,04,05,06,07,\n") == [(1.0, "0", BOOT)]


# ASC


ASC = "date Mon Mar 4 10:00:00.000 am 2024\nbase hex  timestamps {times}\n"
ON_FD = "0.01 CANFD 1 Rx {} 120000 120 {flags} 1234 46500250 460a0250 20011736 20010205"


@pytest.mark.parametrize(
    ("words", "flags", "raw"),
    [
        ("705 0 0 1 1 00", "200000", Frame(0x705, b"\0")),
        ("705 Boot_up 0 0 1 1 00", "200000", Frame(0x705, b"\0")),
        ("18FF0001x 0 0 2 2 aa bb", "200000", Frame(EXTENDED | 0x18FF0001, b"\xaa\xbb")),
        ("705 0 0 1 0", "200010", RemoteFrame(0x705, b"\0")),
        ("123 1 0 9 12 00 01 02 03 04 05 06 07 08 09 0a 0b", "303000", Damage.FD),
        ("123 1 0 9 12 00 01 02 03 04 05 06 07 08 09 0a 0b", "0", Damage.FD),  # its length says so
    ],
)
def test_asc_of_hardware_for_can_fd(words: str, flags: str, raw: Raw | Damage) -> None:
    ((*_, found),) = read(ASC.format(times="absolute") + ON_FD.format(words, flags=flags) + "\n")
    assert (found.damage if isinstance(found, Foreign) else found) == raw


def test_relative_times_of_asc_add_up_also_those_of_events() -> None:
    lines = "0.5 1 701 Rx d 1 05\n0.25 Start of measurement\n0.25 1 701 Rx d 1 05\n"
    assert [time for time, *_ in read(ASC.format(times="relative") + lines)] == [0.5, 1.0]


def test_a_remote_frame_of_asc_may_have_a_trailer() -> None:
    lines = "0.5 1 705 Rx r Length = 0 BitCount = 55 ID = 1797\n0.5 1 705 Rx r 1 Length = 0 BitCount = 55 ID = 1797\n"
    assert [raw for *_, raw in read(ASC.format(times="absolute") + lines)] == [
        RemoteFrame(0x705), RemoteFrame(0x705, b"\0"),
    ]  # fmt: skip
