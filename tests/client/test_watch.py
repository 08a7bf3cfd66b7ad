"""Watching nodes: found, lost, back and booted, by heartbeats of any period and by guarding, in simulated time."""

from __future__ import annotations

from math import inf
from pathlib import Path

import pytest

from eurobot_od.client.network import SimulatedNetwork
from eurobot_od.client.watch import Heartbeats, NodeChange, NodeEvent, NodeWatch, watch_nodes, without_heartbeat
from eurobot_od.device.nmt import NmtState
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from tests.client.wired import wired
from tests.eds_text import DEVICE_TYPE, variable

FOUND, BOOTED, LOST, BACK = NodeChange.FOUND, NodeChange.BOOTED, NodeChange.LOST, NodeChange.BACK


@pytest.mark.parametrize(
    ("period", "beats", "deadline"),
    [
        (1.0, [], inf),  # not heard yet: not lost either
        (1.0, [5.0], 7.0),  # twice the period that it should have
        (0.0, [5.0], inf),  # one heartbeat says nothing of a period
        (0.0, [5.0, 5.5], 6.5),  # what is heard does
        (1.0, [5.0, 15.0], 35.0),  # and counts more than what it should be
        (0.0, [1.0, 1.1, 1.2, 61.2, 61.3], 61.5),  # a long silence is not a period
    ],
)
def test_the_deadline_of_a_pulse(period: float, beats: list[float], deadline: float) -> None:
    pulse = Heartbeats(period)
    for beat in beats:
        pulse.beat(beat)
    assert pulse.deadline == pytest.approx(deadline)


def test_the_first_heartbeat_after_a_boot_up_says_nothing_of_the_period() -> None:
    pulse = Heartbeats()
    pulse.boot(1.0)
    pulse.beat(1.1)
    assert pulse.deadline == inf
    pulse.beat(2.1)
    assert pulse.deadline == pytest.approx(4.1)


class Beating:
    """A station that sends error control frames at given times; guarded, it answers while it is `alive`."""

    def __init__(self, beats: list[tuple[float, bytes]], alive: range = range(0), stuck: bool = False) -> None:
        self._beats, self._alive, self._stuck = list(beats), alive, stuck
        self._toggle = 0

    @property
    def next_wakeup(self) -> float:
        return self._beats[0][0] if self._beats else inf

    def receive(self, frame: Frame, now: float) -> list[Frame]:
        return []

    def tick(self, now: float) -> list[Frame]:
        _, data = self._beats.pop(0)
        self._toggle = 0 if data == b"\0" else self._toggle
        return [Frame(0x705, data)]

    def asked(self, cob_id: int, now: float) -> list[Frame]:
        if cob_id != 0x705 or int(now) not in self._alive:
            return []
        data = bytes([self._toggle | NmtState.STOPPED])
        self._toggle ^= 0 if self._stuck else 0x80
        return [Frame(0x705, data)]


def seen(station: Beating, end: float, **options: object) -> list[tuple[float, NodeChange]]:
    """Watch a bus with this station to a time; return when what happened to node 5."""
    events: list[NodeEvent] = []
    with wired(station) as master:
        watch_nodes(master, NodeWatch(events.append, **options), end)  # type: ignore[arg-type]
    assert {event.node_id for event in events} <= {5}
    return [(round(event.time, 1), event.change) for event in events]


def beats(*times: float) -> list[tuple[float, bytes]]:
    return [(time, b"\x05") for time in times]


@pytest.mark.parametrize(
    ("frames", "happened"),
    [
        (beats(1, 2, 3, 4, 5, 6, 7, 8), [(1.0, FOUND)]),
        (beats(1, 2, 3), [(1.0, FOUND), (5.0, LOST)]),
        (beats(1, 2, 3, 7, 8), [(1.0, FOUND), (5.0, LOST), (7.0, BACK)]),
        ([*beats(1, 2), (7, b"\0"), *beats(7.1, 8.1)], [(1.0, FOUND), (4.0, LOST), (7.0, BOOTED)]),
        ([(1, b"\0"), (3, b"\0")], [(1.0, BOOTED), (3.0, BOOTED)]),  # without heartbeat it is never lost
        ([(1, b""), (2, b"\5\5"), (3, b"\x33")], []),  # no error control frames
    ],
)
def test_what_happens_to_a_node_is_told(
    frames: list[tuple[float, bytes]], happened: list[tuple[float, NodeChange]]
) -> None:
    assert seen(Beating(frames), 9.0) == happened


def test_a_node_that_has_to_be_there_is_lost_if_it_is_not_heard() -> None:
    assert seen(Beating(beats(4)), 5.0, expected=[5], patience=3.0) == [(3.0, LOST), (4.0, BACK)]


@pytest.mark.parametrize(
    ("station", "happened"),
    [
        (Beating([], range(10)), [(0.0, FOUND)]),
        (Beating([], range(4)), [(0.0, FOUND), (5.0, LOST)]),  # asked at 3 s for the last time with an answer
        (Beating([], range(5, 9)), [(2.0, LOST), (5.0, BACK)]),
        (Beating([], range(10), stuck=True), [(0.0, FOUND), (2.0, LOST)]),
        # The answer at 3 s, the first after its boot-up, has the toggle bit 0 as the one at 2 s had.
        (Beating([(2.5, b"\0")], range(4)), [(0.0, FOUND), (2.5, BOOTED), (5.0, LOST)]),
    ],
)
def test_a_guarded_node_is_asked_and_has_to_toggle(station: Beating, happened: list[tuple[float, NodeChange]]) -> None:
    assert seen(station, 6.5, guarded={5: 1.0}) == happened


def test_a_node_with_a_heartbeat_is_not_guarded() -> None:
    """It does not answer: guarded, it would be lost between two heartbeats."""
    heartbeat = DEVICE_TYPE + variable("1017", "Producer heartbeat time", "UNSIGNED16", "1000")
    texts = {5: heartbeat, 6: DEVICE_TYPE, 7: heartbeat.replace("=1000", "=0")}
    events: list[NodeEvent] = []
    with SimulatedNetwork() as network:
        for node_id, text in texts.items():
            network.simulate(Dictionary.read(text.encode(), Path("a.eds"), node_id))
        master = network[5]._node.master
        guarded = without_heartbeat(master, [*texts, 8])
        watch = NodeWatch(events.append, expected=[5], guarded=dict.fromkeys(guarded, 0.2))
        watch_nodes(master, watch, master.clock() + 4)
    assert guarded == [6, 7, 8]
    assert [event.change for event in events if event.node_id == 5] == [FOUND]


def test_an_event_has_the_last_state() -> None:
    events: list[NodeEvent] = []
    watch = NodeWatch(events.append, periods={5: 1.0})
    watch.receive(5, b"\x7f", 1.0)
    watch.tick(4.0)
    assert events == [
        NodeEvent(1.0, 5, FOUND, NmtState.PRE_OPERATIONAL),
        NodeEvent(4.0, 5, LOST, NmtState.PRE_OPERATIONAL),
    ]
