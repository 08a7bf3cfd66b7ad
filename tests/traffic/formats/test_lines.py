"""Lines of candump's format: which frame each is, or why it is none."""

from __future__ import annotations

import io

import pytest

from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.traffic import formats
from eurobot_od.traffic.entries import Damage, Foreign, Raw

GOTO = "008#D27423592C01C3A5"
GOTO_FRAME = Frame(0x008, bytes.fromhex("D27423592C01C3A5"))


def read(text: str) -> list[tuple[int, float, str, Raw]]:
    return list(formats.read(io.BytesIO(text.encode("latin-1")), "log"))


VALID = [
    # as candump writes it
    (f"(1396.123456) can0 {GOTO}", 1396.123456, "can0", GOTO_FRAME),
    # no data
    ("(0.5) vcan0 00C#", 0.5, "vcan0", Frame(0x00C)),
    # received and sent, as python-can writes it
    (f"(0.5) can0 {GOTO} R", 0.5, "can0", GOTO_FRAME),
    (f"(0.5) can0 {GOTO} T", 0.5, "can0", GOTO_FRAME),
    # zeros in front, small letters, more space
    ("(0000000001.250000)  can1   014#aBcDeF", 1.25, "can1", Frame(0x014, b"\xab\xcd\xef")),
    # highest identifier
    ("(1.0) can0 7FF#00", 1.0, "can0", Frame(0x7FF, b"\0")),
    # remote frames, of a length that is said or not; a DLC above 8 is 8 bytes
    ("(1.0) can0 008#R", 1.0, "can0", RemoteFrame(0x008)),
    ("(1.0) can0 705#R1", 1.0, "can0", RemoteFrame(0x705, b"\0")),
    ("(1.0) can0 008#RF", 1.0, "can0", RemoteFrame(0x008, bytes(8))),
    # 29-bit identifiers, also small ones
    ("(1.0) can0 18FF0001#AABB", 1.0, "can0", Frame(EXTENDED | 0x18FF0001, b"\xaa\xbb")),
    ("(1.0) can0 00000008#", 1.0, "can0", Frame(EXTENDED | 0x008)),
    ("(1.0) can0 18FF0001#R2", 1.0, "can0", RemoteFrame(EXTENDED | 0x18FF0001, bytes(2))),
]

FOREIGN = [
    ("20000080#0000000000000000", Damage.ERROR_FRAME),
    ("20000004#", Damage.ERROR_FRAME),
    ("008##1AABBCC", Damage.FD),
    ("18FF0001##0", Damage.FD),
]

UNREADABLE = [
    "garbage",
    "(1.0) can0",
    # half a byte
    "(1.0) can0 008#D27",
    # nine bytes
    "(1.0) can0 008#000000000000000000",
    # identifiers with too many bits or digits
    "(1.0) can0 800#00",
    "(1.0) can0 0008#00",
    # numbers that only a lenient reader would take
    "(1.0) can0 +08#00",
    "(1.0) can0 0_8#00",
    "(1.0) can0 008#0_",
    "(nan) can0 008#00",
    "(-1.0) can0 008#00",
    "(inf) can0 008#00",
    "1.0 can0 008#00",
    "(x) can0 008#00",
    # no hexadecimal digits
    "(1.0) can0 008#XY",
    "(1.0) can0 XYZ#00",
    "(1.0) can\xe40 008#00",
]


@pytest.mark.parametrize(("line", "time", "channel", "frame"), VALID)
def test_frames(line: str, time: float, channel: str, frame: Frame) -> None:
    assert read(line + "\n") == [(1, time, channel, frame)]


@pytest.mark.parametrize(("token", "damage"), FOREIGN)
def test_frames_other_than_classic_base_data_frames_are_foreign(token: str, damage: Damage) -> None:
    assert read(f"(1.0) can0 {token}\n") == [(1, 1.0, "can0", Foreign(damage, token))]


@pytest.mark.parametrize("line", UNREADABLE)
def test_unreadable_lines_cost_no_other_line(line: str) -> None:
    before, broken, after = read(f"(1.0) can0 00C#\n{line}\n(2.0) can0 00C#\n")
    assert (before[3], after[3]) == (Frame(0x00C), Frame(0x00C))
    assert broken[0] == 2
    assert isinstance(broken[3], Foreign)
    assert broken[3].damage is Damage.UNREADABLE


def test_an_unreadable_end_without_line_end_is_cut_off() -> None:
    (_, _, _, last) = read("(1.0) can0 00C#\n(2.0) can0 008#D2")[1]
    assert last == Frame(0x008, b"\xd2")
    (_, _, _, last) = read("(1.0) can0 00C#\n(2.0) can0 00")[1]
    assert last == Foreign(Damage.CUT_OFF, "(2.0) can0 00")


def test_empty_lines_are_nothing_and_count_as_lines() -> None:
    assert [line for line, *_ in read("\n\n(1.0) can0 00C#\n  \n")] == [3]
