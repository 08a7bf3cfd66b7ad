"""Lines of an ASC log: which are frames, which are what else was on the bus, and which are none at all."""

from __future__ import annotations

import io

import pytest

from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import Damage, Foreign, Raw


def read(line: str) -> list[tuple[int, float, str, Raw]]:
    return list(formats.read(io.BytesIO(line.encode()), "asc"))


@pytest.mark.parametrize("direction", ["Rx", "Tx", "TxRq"])
def test_frames_of_all_directions_are_read(direction: str) -> None:
    assert read(f" 2.5 1 1C0 {direction} d 2 0A FF") == [(1, 2.5, "0", Frame(0x1C0, b"\x0a\xff"))]


@pytest.mark.parametrize(
    ("line", "channel", "foreign"),
    [
        (" 2.5 3 18FF0001x Rx d 1 AA", "2", Frame(EXTENDED | 0x18FF0001, b"\xaa")),
        (" 2.5 3 18FF0001X Rx d 1 AA", "2", Frame(EXTENDED | 0x18FF0001, b"\xaa")),
        (" 2.5 1 1C0 Rx r 8", "0", RemoteFrame(0x1C0, bytes(8))),
        (" 2.5 1 1C0 Tx R", "0", RemoteFrame(0x1C0)),
        (" 2.5 1 18FF0001x Rx r", "0", RemoteFrame(EXTENDED | 0x18FF0001)),
        (" 2.5 2 ErrorFrame", "1", Foreign(Damage.ERROR_FRAME, "ErrorFrame")),
        (" 2.5 CANFD 2 Rx 1C0 1 0 1 1 0A 0 0 303000", "1", Foreign(Damage.FD, "1C0#0A")),
        (" 2.5 canfd 2 Rx 1C0 1 0 1 1 0A 0 0 303000", "1", Foreign(Damage.FD, "1C0#0A")),
    ],
)
def test_frames_other_than_classic_base_data_frames_are_foreign(line: str, channel: str, foreign: Foreign) -> None:
    assert read(line) == [(1, 2.5, channel, foreign)]


@pytest.mark.parametrize(
    "line",
    [
        " 2.5 1 1C0 Up d 1 00",  # another direction
        " 2.5 1 1C0 Rx e 1 00",  # another kind
        " 2.5 1 1C0 Rx d 2 00",  # a byte short
        " 2.5 1 1C0 Rx d",
        " 2.5 1 1C0",
        " 2.5 1 800 Rx d 0",  # above 11 bits
    ],
)
def test_unknown_lines_are_unreadable(line: str) -> None:
    ((_, _, _, raw),) = read(line + "\n")
    assert isinstance(raw, Foreign)
    assert raw.damage is Damage.UNREADABLE


@pytest.mark.parametrize(("length", "data"), [("8", bytes(range(8))), ("9", bytes(range(8))), ("0", b"")])
def test_a_frame_has_as_many_bytes_as_its_length_says_up_to_8(length: str, data: bytes) -> None:
    assert read(f" 2.5 1 1C0 Rx d {length} 00 01 02 03 04 05 06 07 Length = 3") == [(1, 2.5, "0", Frame(0x1C0, data))]


@pytest.mark.parametrize(
    "line",
    [
        "date Sat Sep 30 15:06:13.191 2017",
        "base hex timestamps absolute",
        "no internal events logged",
        "internal events logged",
        "// version 9.0.0",
        "Begin Triggerblock",
        "End TriggerBlock",
        "previous log file: a.asc",
        "",
        " 0.0 Start of measurement",
        " 0.1 CAN 1 Status:chip status error active",
        " 1.0 1  Statistic: D 0 R 0",
        " 1.0 1  J1939TP FEE3p",
        " 1.0 1  TxTrc 1 2",
        " 1.0 1  Trigger 1",
    ],
)
def test_headers_and_events_are_no_entries(line: str) -> None:
    assert read(line) == []


def test_the_base_holds_from_its_line_on() -> None:
    assert [raw for *_, raw in read("base dec\n 1.0 1 448 Rx d 1 16\nBASE HEX\n 2.0 1 1C0 Rx d 1 10")] == [
        Frame(0x1C0, b"\x10")
    ] * 2
