"""A receive queue that overflows: the kernel counts, as it does for SocketCAN, and nothing is lost without a word."""

from __future__ import annotations

import socket
import sys
from collections.abc import Iterator

import can
import pytest
from can.interfaces.virtual import VirtualBus

from eurobot_od.bus.live import Live
from eurobot_od.controller import Event
from eurobot_od.od.standard import ErrorCode
from eurobot_od.traffic.monitor import NOTED_AGAIN, BusSource
from tests.bus.live.loose import Reports, wait_for
from tests.kit import lift
from tests.kit.lift import Cabin

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the counters are Linux's")


class CountingBus(VirtualBus):
    """A bus with a socket of the kernel's whose queue holds little; `flood` fills it as a full bus does."""

    def __init__(self, channel: str) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1)
        self.socket.bind(("127.0.0.1", 0))
        super().__init__(channel)

    def flood(self, frames: int) -> None:
        for _ in range(frames):
            self.socket.sendto(bytes(16), self.socket.getsockname())

    def shutdown(self) -> None:
        super().shutdown()
        self.socket.close()


@pytest.fixture
def bus(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[CountingBus]:
    """Register the driver above with python-can as SocketCAN's."""
    monkeypatch.setitem(can.interfaces.BACKENDS, "socketcan", (__name__, CountingBus.__name__))
    monkeypatch.setitem(sys.modules, __name__, sys.modules[CountingBus.__module__])
    with CountingBus(request.node.name) as bus:
        yield bus


def test_overflows_are_counted_and_reported_by_emcy(bus: CountingBus) -> None:
    reports = Reports()
    with VirtualBus(bus.channel_id) as other, Live.node(bus, Cabin(lift.dictionary("cabin")), report=reports) as live:
        bus.flood(1000)
        told = reports.wait_for(Event.FRAMES_LOST)
        emergency = wait_for(other, 0x082)
    assert int.from_bytes(emergency[:2], "little") == ErrorCode.OVERRUN
    assert 0 < live.overflow < 1000
    assert told.text.endswith(" received frames have found no room in the driver's queue so far")
    *_, last = [told, *(report for report in reports.rest() if report.event is Event.FRAMES_LOST)]
    assert last.text.startswith(f"{live.overflow} ")


def test_overflows_of_a_switched_off_node_are_counted(bus: CountingBus) -> None:
    class Late(Cabin):
        """Is switched off while the bus is full: when nobody reads it any more."""

        def switched_off(self) -> None:
            bus.flood(1000)

    reports = Reports()
    with Live.node(bus, Late(lift.dictionary("cabin")), report=reports) as live:
        pass
    assert live.overflow > 0
    assert [report.event for report in reports.rest()].count(Event.FRAMES_LOST) == 1


def test_the_monitor_notes_what_is_missing(bus: CountingBus) -> None:
    now = 100.0
    source = BusSource(bus, lambda: now)
    assert list(source.poll()) == []
    assert source.notes == []
    bus.flood(800)  # and a few more are not twice as many in binary digits
    for seconds in (0.0, 1.0, 1.0 + NOTED_AGAIN, 2.0 + NOTED_AGAIN):
        now = 100.0 + seconds
        assert list(source.poll()) == []
        bus.flood(10)
    source.close()
    lost = [int(note.partition(" ")[0]) for note in source.notes]
    assert lost[0] > 0
    # What is lost in between is told now and then, and at the end: 20 more, and 20 more.
    assert [each - lost[0] for each in lost] == [0, 20, 40]
