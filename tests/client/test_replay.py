"""A log on a bus again: at its times, by its senders, to a node that takes yesterday's others for today's."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import pytest

from eurobot_od.client.master import Replayed, replay
from eurobot_od.frame import Frame
from eurobot_od.robot import dialects
from eurobot_od.robot.match import MatchOptions
from eurobot_od.robot.match.stage import play_simulated
from eurobot_od.robot.model import messages
from eurobot_od.robot.nodes import Drive
from eurobot_od.robot.protocol import EurobotProtocol
from eurobot_od.traffic.filters import by_sender
from tests.client.wired import Station, WiredBus, wired

LOG = [(100.0, Frame(0x123, b"a")), (100.5, Frame(0x124)), (100.5, Frame(0x125)), (102.0, Frame(0x126))]


class Listening:
    """A station that only notes when it hears what."""

    next_wakeup = inf

    def __init__(self) -> None:
        self.heard: list[tuple[float, Frame]] = []

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        self.heard.append((round(now, 6), frame))
        return []

    def tick(self, now: float) -> list[Frame]:
        return []


@pytest.mark.parametrize(("speed", "times"), [(1, [0, 0.5, 0.5, 2]), (2, [0, 0.25, 0.25, 1]), (0.5, [0, 1, 1, 4])])
def test_frames_come_at_their_old_times(speed: float, times: list[float]) -> None:
    station = Listening()
    assert replay(wired(station), LOG, speed) == Replayed(4, 0, 0.0)
    assert station.heard == [(time, frame) for time, (_, frame) in zip(times, LOG)]


def test_what_is_late_is_sent_at_once_and_counted() -> None:
    station = Listening()
    master = wired(station)
    bus: WiredBus = master.bus  # type: ignore[assignment]

    def slow() -> Iterator[tuple[float, Frame]]:
        for number, timed in enumerate(LOG):
            if number == 1:
                bus.now += 0.75
            yield timed

    assert replay(master, slow(), 1.0) == Replayed(4, 2, 0.25)
    assert [time for time, _ in station.heard] == [0, 0.75, 0.75, 2]


def test_nothing_is_replayed_of_an_empty_log() -> None:
    assert replay(wired(Listening()), [], 1.0) == Replayed()


def test_a_drive_confirms_the_gotos_of_yesterday() -> None:
    frames: list[tuple[float, Frame]] = []
    play_simulated(MatchOptions(duration=15.0), lambda _: None, lambda time, frame: frames.append((time, frame)))
    protocol, drive = EurobotProtocol.load(), Drive(dialects.load("drive"))
    drive.start(0.0)
    station: Station = drive
    master = wired(station)
    confirmed: list[bytes] = []
    master.listeners[protocol.cob_id(messages.GotoConfirm)] = confirmed.append
    without_drive = by_sender(dialects.load_all(), protocol, [], ["drive"])
    sent = [(time, frame) for time, frame in frames if without_drive(frame)]
    replay(master, sent, 1.0)
    gotos = [frame for _, frame in sent if frame.cob_id == protocol.cob_id(messages.GotoXY)]
    assert len(confirmed) == len(gotos) > 0
