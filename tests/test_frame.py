"""A frame as text, and as the plain value that it is."""

from __future__ import annotations

import pytest

from eurobot_od.frame import Frame

TEXTS = [
    (Frame(0x008, bytes.fromhex("D27423592C0D9702")), "008#D27423592C0D9702"),
    (Frame(0x7FF, b"\x00"), "7FF#00"),
    (Frame(0x000), "000#"),
]


@pytest.mark.parametrize(("frame", "text"), TEXTS)
def test_is_written_as_candump_does(frame: Frame, text: str) -> None:
    assert str(frame) == text


def test_sorts_as_frames_win_the_bus() -> None:
    assert sorted([Frame(0x100), Frame(0x001, b"\xff"), Frame(0x040)]) == [
        Frame(0x001, b"\xff"),
        Frame(0x040),
        Frame(0x100),
    ]


def test_has_no_data_unless_given() -> None:
    assert Frame(0x001) == (0x001, b"")
