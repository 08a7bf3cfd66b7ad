"""The master's share of a bus."""

from __future__ import annotations

import pytest

from eurobot_od.bus.live import Driver, open_bus
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame
from eurobot_od.web.session import MOST_WAITING, Tap
from tests.web.scene import channel

ANSWER, BEAT = Frame(0x582, bytes(8)), Frame(0x702, b"\x05")


def test_the_master_receives_only_answers() -> None:
    tap = Tap(lambda *_: True)
    for frame in (BEAT, ANSWER, Frame(0x100, bytes(5))):
        tap.give(frame, 0.0)
    first, second = tap.recv(0), tap.recv(0)
    assert first is not None
    assert (first.arbitration_id, bytes(first.data), second) == (*ANSWER, None)
    tap.shutdown()


def test_answers_come_from_where_a_file_has_moved_them() -> None:
    tap = Tap(lambda *_: True, [0x6A1])
    tap.give(Frame(0x6A1, bytes(8)), 0.0)
    message = tap.recv(0)
    assert message is not None
    assert message.arbitration_id == 0x6A1
    tap.shutdown()


def test_unread_frames_are_dropped_oldest_first() -> None:
    tap = Tap(lambda *_: True)
    for number in range(MOST_WAITING + 2):
        tap.give(Frame(ANSWER.cob_id, number.to_bytes(8, "little")), 0.0)
    waiting = []
    while (message := tap.recv(0)) is not None:
        waiting.append(int.from_bytes(message.data, "little"))
    assert waiting == list(range(2, MOST_WAITING + 2))
    tap.shutdown()


def test_nothing_is_sent_while_there_is_trouble() -> None:
    name = channel()
    with open_bus("virtual", name) as bus, open_bus("virtual", name) as other:
        tap = Tap(Driver(bus).send)
        tap.trouble = "it was pulled out"
        with pytest.raises(BusError, match="it was pulled out"):
            tap.send_frame(BEAT)
        tap.trouble = ""
        tap.send_frame(BEAT)
        heard = other.recv(1.0)
    assert heard is not None
    assert heard.arbitration_id == BEAT.cob_id
    tap.shutdown()
