"""A frame as text, and as the plain value that it is."""

from __future__ import annotations

import pytest

from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame, RemoteFrame

TEXTS = [
    (Frame(0x008, bytes.fromhex("D27423592C01C3A5")), "008#D27423592C01C3A5"),
    (Frame(0x7FF, b"\x00"), "7FF#00"),
    (Frame(0x000), "000#"),
    (RemoteFrame(0x705, bytes(1)), "705#R1"),
    (RemoteFrame(0x705), "705#R"),
]


@pytest.mark.parametrize(("frame", "text"), TEXTS)
def test_a_frame_is_written_like_candump(frame: Frame, text: str) -> None:
    assert str(frame) == text


@pytest.mark.parametrize(("frame", "text"), [*TEXTS, (Frame(0x18A, b"\x01\xab"), "18a#01.aB")])
def test_a_frame_is_read_like_cansend(frame: Frame, text: str) -> None:
    assert Frame.parse(text) == frame


NO_FRAMES = [
    "185",  # no data, not even none
    "85#01",  # an identifier has three digits
    "800#",  # and 11 bits
    "00000185#01",  # 29 bits
    "185#R9",  # a remote frame for nine bytes
    "185#R10",
    "185##101",  # CAN FD
    "185#1",  # half a byte
    "185#010203040506070809",  # nine bytes
    "185#zz",
]


@pytest.mark.parametrize("text", NO_FRAMES)
def test_only_classic_frames_are_read(text: str) -> None:
    with pytest.raises(LocalError, match="is not a frame"):
        Frame.parse(text)


def test_frames_sort_by_bus_priority() -> None:
    assert sorted([Frame(0x100), Frame(0x001, b"\xff"), Frame(0x040)]) == [
        Frame(0x001, b"\xff"),
        Frame(0x040),
        Frame(0x100),
    ]


def test_a_frame_has_no_data_by_default() -> None:
    assert Frame(0x001) == (0x001, b"")
