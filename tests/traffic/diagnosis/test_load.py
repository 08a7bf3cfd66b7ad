"""The load of a bus: exact where it is told, and no memory without end where time does not pass."""

from __future__ import annotations

import pytest

from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.traffic.diagnosis.incidents import Incidents, ObservedBus
from eurobot_od.traffic.diagnosis.load import MOST, BusLoad
from eurobot_od.traffic.meaning import Decoder


def loaded(frame: Frame, number: int) -> tuple[BusLoad, list[str]]:
    """Return the load of a bus of 10 kbit/s on which so many frames came in a second, and what it told."""
    incidents = Incidents()
    bus = ObservedBus("", Decoder([]), lambda _: {}, lambda: (0.0, "", 0), incidents.at)
    load = BusLoad(bus, 10_000)
    load.restart(0.0)
    for _ in range(number):
        load.take(frame)
    load.judge(1.0)
    return load, [each.text.partition(" of 10 kbit/s")[0] for each in incidents.sorted() if "burst" not in each.rule.id]


@pytest.mark.parametrize(
    ("frame", "number", "told"),
    [
        (Frame(0x185, bytes(8)), 60, []),
        (Frame(0x185, bytes(8)), 70, ["a load of 87%"]),
        (Frame(0x185, b"\x55" * 8), 75, ["a load of 84%"]),
        (Frame(EXTENDED | 0x123, bytes(8)), 60, ["a load of 88%"]),
        (RemoteFrame(0x705, bytes(8)), 160, []),
    ],
    ids=["too much only if all bits were stuffed", "many stuff bits", "few", "29 bits", "remote: without data"],
)
def test_the_load_that_is_told_has_the_stuff_bits_that_there_are(frame: Frame, number: int, told: list[str]) -> None:
    assert loaded(frame, number)[1] == told


def test_frames_of_a_log_without_times_are_not_kept() -> None:
    load, _ = loaded(Frame(0x185), 0)
    for _ in range(2 * MOST):
        load.take(Frame(0x185))
    assert len(load._frames) <= MOST
