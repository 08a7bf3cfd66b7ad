"""Which of the frames that a driver gives are received, which are foreign, and which came too long ago."""

from __future__ import annotations

from collections.abc import Callable

import can
import pytest

from eurobot_od.bus.live import Driver
from eurobot_od.bus.live.buses import Connection
from eurobot_od.bus.live.reader import ENDURED, HEARD_AGAIN, BusSilence, Reader
from eurobot_od.controller import Report

AHEAD = 1_000_000.0
"""The driver's clock is ahead of ours by that."""


def message(cob_id: int = 0x123, stamp: float = AHEAD, data: bytes = b"\1", **flags: bool) -> can.Message:
    return can.Message(stamp, cob_id, is_extended_id=flags.pop("extended", False), data=data, **flags)


class Script(can.BusABC):
    """A bus that gives messages at times, None where none came, and closes its connection at the end."""

    channel_info = "script"

    def __init__(self, *read: tuple[float, can.Message | Exception | None]) -> None:
        self.left, self.now = list(read), 0.0
        self.close: Callable[[], object] = lambda: None

    def recv(self, timeout: float | None = None) -> can.Message | None:
        if not self.left:
            self.close()
            return None
        self.now, message = self.left.pop(0)
        if isinstance(message, Exception):
            raise message
        return message

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise NotImplementedError

    def shutdown(self) -> None:
        self._is_shutdown = True


class Scene:
    """What a reader makes of a script."""

    def __init__(self, *script: tuple[float, can.Message | Exception | None], clock: bool = True) -> None:
        self.received: list[tuple[int, bytes, float]] = []
        self.foreign: list[can.Message | None] = []
        self.missed: list[int] = []
        bus = Script(*script)
        connection = Connection(Driver(bus), None, lambda: 0.0, lambda *_: None, lambda: None, lambda _: None)
        bus.close = connection.close
        Reader(
            connection,
            lambda cob_id, data, now: self.received.append((cob_id, bytes(data), now)),
            (lambda: bus.now) if clock else None,
            self.foreign.append,
            self.missed.append,
            lambda cob_id: cob_id == 0x001,
        ).read()
        self.failure = connection.failure


def test_a_frame_has_the_time_of_our_clock_or_the_drivers() -> None:
    for cob_id in (0x000, 0x7FF):
        script = (5.0, message(cob_id, AHEAD, bytes(8)))
        assert Scene(script).received == [(cob_id, bytes(8), 5.0)]
        assert Scene(script, clock=False).received == [(cob_id, bytes(8), AHEAD)]


@pytest.mark.parametrize(
    "foreign",
    [
        message(extended=True),
        message(is_remote_frame=True, data=b""),
        message(is_error_frame=True),
        message(is_fd=True),
    ],
)
def test_other_frames_than_classic_base_data_frames_are_foreign(foreign: can.Message) -> None:
    scene = Scene((1.0, foreign), (1.0, message(0x005)))
    assert scene.foreign == [foreign]
    assert [cob_id for cob_id, *_ in scene.received] == [0x005]


def test_malformed_frames_are_foreign() -> None:
    high, negative, long = message(), message(), message()
    high.arbitration_id, negative.arbitration_id, long.data = 0x800, -1, bytearray(9)
    scene = Scene(*((1.0, each) for each in (high, negative, long)))
    assert (scene.foreign, scene.received) == ([high, negative, long], [])


GARBLED: tuple[float, Exception] = (1.0, ValueError("invalid frame"))


def test_a_driver_that_can_make_no_sense_of_a_frame_is_read_on() -> None:
    several = [GARBLED] * (ENDURED - 1)
    scene = Scene(*several, (1.0, message(0x100)), *several, (1.0, message(0x101)), *several)
    assert [cob_id for cob_id, *_ in scene.received] == [0x100, 0x101]
    assert scene.foreign == [None] * 3 * (ENDURED - 1)
    assert scene.failure is None


def test_a_driver_that_never_makes_sense_has_failed() -> None:
    assert str(Scene(*[GARBLED] * ENDURED).failure) == "the bus script failed: invalid frame"


def test_frames_received_while_the_process_stood_still_are_dropped_and_counted_except_lasting_ones() -> None:
    scene = Scene(
        (1.0, message(0x100, AHEAD + 1.0)),
        (9.0, message(0x101, AHEAD + 2.0)),
        (9.0, message(0x001, AHEAD + 2.5)),
        (9.0, message(0x102, AHEAD + 3.0)),
        (9.0, message(0x103, AHEAD + 9.0)),
        (9.1, message(0x104, AHEAD + 9.1)),
    )
    assert [cob_id for cob_id, *_ in scene.received] == [0x100, 0x001, 0x103, 0x104]
    assert scene.missed == [3]


def test_a_pause_of_the_bus_is_no_standstill() -> None:
    quiet = [(1.0 + n / 10, None) for n in range(80)]
    scene = Scene((1.0, message(0x100, AHEAD + 1.0)), *quiet, (9.0, message(0x101, AHEAD + 2.0)))
    assert [cob_id for cob_id, *_ in scene.received] == [0x100, 0x101]
    assert scene.missed == []


REGULAR_BEATS = [(1.0, 0x701), (2.0, 0x701), (2.5, 0x181)]
SILENT = "nothing has been heard for 5 s"


@pytest.mark.parametrize(
    ("frames", "end", "told", "why"),
    [
        (REGULAR_BEATS, 12.0, [(7.6, SILENT)], "no frame, after regular heartbeats"),
        (REGULAR_BEATS, 7.5, [], "not yet"),
        ([*REGULAR_BEATS, (6.0, 0x181), (10.0, 0x181)], 14.9, [], "another frame is no heartbeat, but is heard"),
        ([*REGULAR_BEATS, (9.0, 0x181)], 13.9, [(7.6, SILENT), (9.0, HEARD_AGAIN)], "it comes back"),
        ([*REGULAR_BEATS, (9.0, 0x181)], 15.0, [(7.6, SILENT), (9.0, HEARD_AGAIN), (14.1, SILENT)], "and goes again"),
        ([(1.0, 0x181), (2.0, 0x181)], 30.0, [], "no heartbeats: a bus of events is silent for minutes"),
        ([(1.0, 0x701), (9.0, 0x702)], 30.0, [], "two heartbeats that are not regular"),
        ([(1.0, 0x700), (2.0, 0x700), (3.0, 0x780), (4.0, 0x780)], 30.0, [], "no node has such a heartbeat"),
        ([], 30.0, [], "alone from the beginning"),
    ],
)
def test_a_bus_on_which_nothing_more_is_heard_is_silent(
    frames: list[tuple[float, int]], end: float, told: list[tuple[float, str]], why: str
) -> None:
    assert [(time, text[: len(SILENT)]) for time, text in heard(BusSilence(), frames, end)] == [
        (time, text[: len(SILENT)]) for time, text in told
    ], why


def heard(silence: BusSilence, frames: list[tuple[float, int]], end: float) -> list[tuple[float, str]]:
    """Hand over frames at their times, look every 0.1 s until the end, and return what is reported."""
    told, left = list[Report](), list(frames)
    for tenth in range(round(10 * end) + 1):
        now = tenth / 10
        while left and left[0][0] <= now:
            silence.heard(left.pop(0)[1], now)
        silence.watch("can0", told.append, now)
    return [(each.timestamp, each.text) for each in told]


def test_a_process_that_stood_still_or_lost_its_bus_does_not_report_silence() -> None:
    silence, told = BusSilence(), list[Report]()
    assert heard(silence, REGULAR_BEATS, 3.0) == []
    silence.watch("can0", told.append, 60.0)  # it was stopped for a minute: what came meanwhile is still to be read
    for second in range(1, 20):
        silence.watch("can0", told.append, 60.0 + second, is_open=False)
    for second in range(1, 7):
        silence.watch("can0", told.append, 79.0 + second)
    assert [(each.timestamp, each.text[: len(SILENT)]) for each in told] == [(85.0, SILENT.replace("5", "6"))]
