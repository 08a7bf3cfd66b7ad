"""Where the monitor's frames come from: logs at any speed, and a bus with whatever is on it."""

from __future__ import annotations

import time
from collections.abc import Generator

import can
import pytest

from eurobot_od.errors import BusError
from eurobot_od.frame import EXTENDED, Frame, RemoteFrame
from eurobot_od.traffic.entries import Foreign, LogEntry
from eurobot_od.traffic.monitor.sources import BusSource, LogSource, Timed


def entries() -> Generator[tuple[str, LogEntry], None, None]:
    yield from (("a.log", (time - 99, float(time), "", Frame(time))) for time in range(100, 110))


@pytest.mark.parametrize(
    ("speed", "polls"),
    [
        (1.0, [(0.0, 1, 100.0), (1.5, 1, 101.5), (4.0, 3, 104.0), (100.0, 5, 109.0)]),
        (2.0, [(0.0, 1, 100.0), (2.0, 4, 104.0), (100.0, 5, 109.0)]),
        (float("inf"), [(0.0, 10, 109.0)]),
    ],
)
def test_a_log_is_played_at_its_speed(speed: float, polls: list[tuple[float, int, float]]) -> None:
    now = [50.0]
    source = LogSource(entries(), speed, lambda: now[0])
    for after, count, shown in polls:
        now[0] = 50.0 + after
        assert len(list(source.poll())) == count
        assert source.now == shown
        assert source.place == ("a.log", int(shown) - 99)
    assert source.ended


def test_an_empty_log_ends_at_once() -> None:
    nothing: list[tuple[str, LogEntry]] = []
    source = LogSource((each for each in nothing), 1.0)
    assert list(source.poll()) == []
    assert source.ended


class Driver(can.BusABC):
    """A bus with these messages on it, which fails after them."""

    def __init__(self, *messages: can.Message) -> None:
        super().__init__("driver")
        self.channel_info = "driver"
        self._messages = list(messages)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._messages:
            raise can.CanOperationError("pulled out")
        return self._messages.pop(0), False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise NotImplementedError


def receive(source: BusSource, found: list[Timed], count: int) -> None:
    """Append what comes to `found` until there are so many."""
    until = time.monotonic() + 5
    while len(found) < count and time.monotonic() < until:
        found.extend(source.poll())


def test_a_bus_is_read_whatever_is_on_it() -> None:
    with can.Bus(interface="virtual", channel="monitor") as sender:
        source = BusSource(can.Bus(interface="virtual", channel="monitor"))
        sender.send(can.Message(arbitration_id=0x00C, is_extended_id=False))
        sender.send(can.Message(arbitration_id=0x18FF0001, is_extended_id=True, data=b"\1"))
        found: list[Timed] = []
        receive(source, found, 2)
        assert [raw for _, raw in found] == [Frame(0x00C), Frame(EXTENDED | 0x18FF0001, b"\1")]
        source.close()


def test_times_are_the_drivers_until_the_bus_fails() -> None:
    frame = can.Message(timestamp=5.0, arbitration_id=0x00C, is_extended_id=False)
    remote = can.Message(timestamp=5.5, arbitration_id=0x00C, is_extended_id=False, is_remote_frame=True)
    source = BusSource(Driver(frame, remote), lambda: 70.0)
    found: list[Timed] = []
    with pytest.raises(BusError, match="the bus driver failed: pulled out"):
        receive(source, found, 3)
    assert found == [(5.0, Frame(0x00C)), (5.5, RemoteFrame(0x00C))]
    assert source.now == 5.5
    source.close()


def test_a_bus_that_is_opened_again_is_read_on_and_the_gap_noted() -> None:
    first, second = (can.Message(timestamp=at, arbitration_id=0x00C, is_extended_id=False) for at in (5.0, 6.0))
    too_long = can.Message(timestamp=7.0, arbitration_id=0x00C, data=bytes(300), is_extended_id=False)
    source = BusSource(Driver(first), opener=lambda: Driver(second, too_long))
    found: list[Timed] = []
    receive(source, found, 3)
    assert [(time, type(raw)) for time, raw in found] == [(5.0, Frame), (6.0, Frame), (7.0, Foreign)]
    assert source.notes[0] == "the bus driver failed: pulled out; it is opened again"
    assert source.notes[1].startswith("the bus is back after a gap of 0.")
    source.close()
