"""The summary: every frame is counted under its name, and the bus load is that of its bits."""

from __future__ import annotations

from dataclasses import replace

import pytest

from eurobot_od.bus import frame_bits
from eurobot_od.frame import Frame
from eurobot_od.robot.match.summary import FrameCounter, Summary
from eurobot_od.robot.model.messages import GotoXY, StopDrive
from eurobot_od.robot.protocol import EurobotProtocol

PROTOCOL = EurobotProtocol.load()
GOTO = PROTOCOL.encode(GotoXY(1500, 1000, 90, 80))


def summary(*frames: Frame, seconds: float = 1.0) -> Summary:
    counter = FrameCounter(PROTOCOL)
    for frame in frames:
        counter.count(frame)
    return counter.summary(seconds, 500_000)


def test_messages_are_counted_under_their_names_in_the_order_of_their_priority() -> None:
    frames = summary(GOTO, PROTOCOL.encode(StopDrive()), GOTO).frames
    assert list(frames) == PROTOCOL.names()
    assert {name: count for name, count in frames.items() if count} == {"Stop Drive": 1, "Goto XY": 2}


def test_in_words_every_count_has_a_line_and_errors_and_reports_follow_the_totals() -> None:
    counted = replace(
        summary(GOTO, GOTO, Frame(0x701, b"\x05")),
        errors=[3.3, 3.3],
        reports=["one lost"],
        points={"ours": 12},
        touches={"pool": 1, "fire": 2},
        at_fault=2,
    )
    lines = str(counted).splitlines()
    assert [line.rsplit(maxsplit=1) for line in lines if line.startswith(("Goto XY", "Heartbeat", "total"))] == [
        ["Goto XY", "2"],
        ["Heartbeat", "1"],
        ["total", "3"],
    ]
    assert lines[-5:] == [
        f"1 of {len(PROTOCOL.names())} messages in 1.0 s, bus load {counted.load:.2%}",
        "2 places reached, position error 3.3 mm on average, 3.3 mm at most",
        "points: ours 12",
        "touches: 1 x pool, 2 x fire; 2 of 3 by our fault",
        "gatekeeper: one lost",
    ]


def test_a_match_without_touches_says_so() -> None:
    lines = str(replace(summary(GOTO), points={"ours": 0, "enemy 1": 3})).splitlines()
    assert lines[-2:] == ["points: ours 0, enemy 1 3", "touches: none"]


@pytest.mark.parametrize(
    ("frame", "name"),
    [
        (Frame(0x701, b"\x00"), "Boot-up"),
        (Frame(0x77F, b"\x00"), "Boot-up"),
        (Frame(0x701, b"\x05"), "Heartbeat"),
        (Frame(0x702, b"\x7f"), "Heartbeat"),
        (Frame(0x081, bytes(8)), "EMCY"),
        (Frame(0x000, b"\x81\x00"), "NMT"),
        (Frame(0x601, bytes(8)), "SDO"),
        (Frame(0x700, b"\x05"), "Other"),  # no node has node-ID 0
    ],
)
def test_frames_of_no_message_are_counted_by_their_service(frame: Frame, name: str) -> None:
    counted = summary(frame)
    assert counted.others == {name: 1}
    assert counted.messages_sent == 0


def test_the_identifier_of_an_emcy_that_is_a_messages_counts_as_the_message() -> None:
    assert summary(Frame(0x080, bytes(5))).frames["Navi Position Response"] == 1


def test_a_frame_of_a_message_counts_whatever_its_length() -> None:
    assert summary(Frame(0x008, b"")).frames["Goto XY"] == 1


def test_messages_sent_are_those_seen_at_least_once() -> None:
    assert summary(GOTO, GOTO).messages_sent == 1
    assert summary().messages_sent == 0


def test_the_load_is_the_share_of_time_that_the_bits_take() -> None:
    load = summary(GOTO, GOTO, seconds=0.5).load
    assert load == pytest.approx(2 * frame_bits(GOTO) / 500_000 / 0.5)
    assert summary(seconds=0.0).load == 0.0


def test_the_summary_as_data_is_plain() -> None:
    data = summary(GOTO).as_data()
    assert data["messages_sent"] == 1
    assert data["frames"]["Goto XY"] == 1
