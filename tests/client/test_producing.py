"""SYNC and TIME as a master sends them, in simulated time."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime
from itertools import islice

import pytest

from eurobot_od.client.master import Master
from eurobot_od.client.producing import produce, syncs, times
from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame
from tests.client.wired import Answerer, WiredBus


@pytest.mark.parametrize(
    ("overflow", "data"),
    [(None, [b""] * 5), (2, [b"\1", b"\2", b"\1", b"\2", b"\1"]), (240, [b"\1", b"\2", b"\3", b"\4", b"\5"])],
)
def test_a_sync_may_have_a_counter(overflow: int | None, data: list[bytes]) -> None:
    assert [*islice(syncs(overflow), 5)] == [Frame(0x080, each) for each in data]


@pytest.mark.parametrize("overflow", [0, 1, 241])
def test_a_counter_ends_where_the_standard_allows(overflow: int) -> None:
    with pytest.raises(LocalError, match="2 to 240"):
        syncs(overflow)


def test_time_counts_from_1984() -> None:
    now = datetime(2014, 5, 28, 12, 0, 1, 500_000)
    assert next(times(lambda: now)) == Frame(0x100, (43_201_500).to_bytes(4, "little") + (11_105).to_bytes(2, "little"))


def test_frames_go_out_at_their_times_and_what_was_missed_is_not_made_up() -> None:
    sent: list[float] = []

    def note(_: Frame) -> list[Frame]:
        sent.append(round(bus.now, 2))
        bus.now += 0.25 if len(sent) == 2 else 0.0  # the driver hangs
        return []

    bus = WiredBus(Answerer(note))
    with Master(bus, clock=lambda: bus.now) as master:
        produce(master, islice(syncs(), 5), 0.1)
    assert sent == [0.0, 0.1, 0.4, 0.5, 0.6]


def test_frames_are_made_when_they_are_sent() -> None:
    bus = WiredBus()
    made: list[float] = []

    def frames() -> Iterator[Frame]:
        for _ in range(3):
            made.append(round(bus.now, 1))
            yield Frame(0x100)

    with Master(bus, clock=lambda: bus.now) as master:
        produce(master, frames(), 1.0)
    assert made == [0.0, 1.0, 2.0]
