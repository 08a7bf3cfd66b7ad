"""Lines of a TRC log: its versions' columns, types of entries, and the time that its header says."""

from __future__ import annotations

import io

import pytest

from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import Damage, Foreign, Raw

HEAD = ";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
"""Two lines."""


def read(text: str) -> list[tuple[int, float, str, Raw]]:
    return list(formats.read(io.BytesIO(text.encode()), "trc"))


@pytest.mark.parametrize(
    ("line", "raw"),
    [
        ("7 103.250 DT 2 0014 Rx - 2 01 02", Frame(0x014, b"\x01\x02")),
        ("7 103.250 DT 2 0014 Tx - 0", Frame(0x014, b"")),
        ("7 103.250 RR 2 0014 Rx - 0", RemoteFrame(0x014)),
        ("7 103.250 FD 2 0014 Rx - 1 01", Foreign(Damage.FD, "014#01")),
        ("7 103.250 FB 2 0014 Rx - 1 01", Foreign(Damage.FD, "014#01")),
        ("7 103.250 FE 2 0014 Rx - 1 01", Foreign(Damage.FD, "014#01")),
        ("7 103.250 BI 2 0014 Rx - 1 01", Foreign(Damage.FD, "014#01")),
        ("7 103.250 ER 2 0014 Rx - 1 01", Foreign(Damage.ERROR_FRAME, "ER 2 0014 Rx - 1 01")),
        ("7 103.250 DT 2 00014 Rx - 1 01", Frame(EXTENDED | 0x014, b"\1")),
        ("7 103.250 DT 2 00000014 Rx - 1 01", Frame(EXTENDED | 0x014, b"\1")),
        ("7 103.250 DT 2 0014 Rx - 2 RTR", RemoteFrame(0x014, bytes(2))),
        ("7 103,250 DT 2 0014 Rx - 2 01 02", Frame(0x014, b"\x01\x02")),  # as PCAN-View writes it in German
        ("7 103.250 DT 2 0014 Rx - 10 00 01 02 03 04 05 06 07 FF FF", Frame(0x014, bytes(range(8)))),
    ],
)
def test_an_entry_is_a_frame_or_says_what_it_is(line: str, raw: Raw) -> None:
    assert read(HEAD + line) == [(3, 0.10325, "2", raw)]


@pytest.mark.parametrize("kind", ["ST", "EC", "EV"])
def test_events_are_no_entries_and_the_next_line_is_read(kind: str) -> None:
    text = f"{HEAD}1 1.0 {kind} 2 Rx 00 00\n\n2 2.0 DT 2 0014 Rx - 1 05"
    assert read(text) == [(5, 0.002, "2", Frame(0x014, b"\x05"))]


def test_a_warning_of_version_1_0_has_no_type() -> None:
    text = "2) 17540 FFFFFFFF 4 00 00 00 08 -- -- -- -- BUSHEAVY\n 3) 17541 0014 1 06"
    assert [raw for *_, raw in read(f";$FILEVERSION=1.0\n{text}")] == [Frame(0x014, b"\x06")]


def test_a_warning_of_version_1_is_no_entry() -> None:
    warning = "1) 1.0 Warng FFFFFFFF 4 00 00 00 08 BUSLIGHT"
    text = f";$FILEVERSION=1.1\n{warning}\n 2) 2.0 Error 0008 1 05\n 3) 3.0 Tx 0014 1 06"
    (_, _, _, error), (_, time, channel, raw) = read(text)
    assert isinstance(error, Foreign)
    assert error.damage is Damage.ERROR_FRAME
    assert (time, channel, raw) == (0.003, "1", Frame(0x014, b"\x06"))


@pytest.mark.parametrize(
    ("version", "line", "channel"),
    [
        ("1.0", " 1) 5 0014 1 01", "1"),
        ("1.1", " 1) 5.0 Rx 0014 1 01", "1"),
        ("1.2", " 1) 5.0 3 Rx 0014 1 01", "3"),
        ("1.3", " 1) 5.0 3 Rx 0014 - 1 01", "3"),
        ("9.9", " 1) 5 0014 1 01", "1"),  # an unknown version is read as the first, until it lists its columns
    ],
)
def test_a_version_has_its_columns(version: str, line: str, channel: str) -> None:
    assert read(f";$FILEVERSION={version}\n{line}") == [(2, 0.005, channel, Frame(0x014, b"\x01"))]


def test_times_count_from_the_start_that_the_header_says() -> None:
    assert [time for _, time, *_ in read(f";$STARTTIME=25569.5\n{HEAD}1 250.0 DT 1 0014 Rx - 0")] == [43200.25]


@pytest.mark.parametrize(
    "line",
    [
        "1 1.0 DT 2 0014 Rx - 2 01",  # a byte short
        "1 1.0 DT 2 0014 Rx - 1 01 02",
        "1 1.0 DT 2 0800 Rx - 0",  # above 11 bits
        "1 1.0 XX 2 0014 Rx - 0",
        "1 1.0 DT 2 0014",
        "1 9e99 DT 2 0014 Rx - 0",
    ],
)
def test_unknown_lines_are_unreadable(line: str) -> None:
    ((_, _, _, raw),) = read(f"{HEAD}{line}\n")
    assert isinstance(raw, Foreign)
    assert raw.damage is Damage.UNREADABLE
