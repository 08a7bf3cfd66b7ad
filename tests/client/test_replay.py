"""A log on a bus again: at its times, by its senders, to a node that takes yesterday's others for today's."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf

import pytest

from eurobot_od.client.master import Replayed, replay
from eurobot_od.frame import Frame
from eurobot_od.traffic.filters import by_sender
from tests.client.wired import Station, WiredBus, wired
from tests.kit import plant
from tests.kit.plant import messages as m

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


def test_late_frames_are_sent_at_once_and_counted() -> None:
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


def test_an_empty_log_replays_nothing() -> None:
    assert replay(wired(Listening()), [], 1.0) == Replayed()


def test_a_lift_confirms_the_moves_of_yesterday() -> None:
    protocol, lift = plant.protocol(), plant.NODES["lift"](plant.load("lift"))
    lift.start(0.0)
    station: Station = lift
    master = wired(station)
    confirmed: list[bytes] = []
    master.listeners[protocol.cob_id(m.MoveConfirm)] = confirmed.append
    without_lift = by_sender(plant.load_all(), protocol, [], ["lift"])
    sent = [(time, frame) for time, frame in plant.shift() if isinstance(frame, Frame) and without_lift(frame)]
    replay(master, sent, 1.0)
    moves = [frame for _, frame in sent if frame.cob_id == protocol.cob_id(m.MoveTo)]
    assert len(confirmed) == len(moves) > 0
