"""What a master does again and again goes on when its bus was lost and is back."""

from __future__ import annotations

from functools import partial
from itertools import islice

import can
import pytest

from eurobot_od.client.master import Master, Reconnecting, produce, syncs
from eurobot_od.client.watch import NodeEvent, NodeWatch, watch_nodes
from eurobot_od.errors import BusError
from tests.client.test_boot import Beating, beats
from tests.client.wired import WiredBus


class Unplugged(WiredBus):
    """A wired bus whose interface is away from a time on, until it is opened again at a later one."""

    away = (2.0, 2.9)

    def _check(self) -> None:
        if self.away[0] <= self.now < self.away[1]:
            self.now += 0.5  # what it takes to notice
            raise can.CanOperationError("Network is down", 100)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self._check()
        super().send(msg, timeout)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        self._check()
        return super().recv(timeout)


def test_syncs_go_on_when_the_bus_is_back() -> None:
    bus, told = Unplugged(), []  # type: ignore[var-annotated]
    master = Master(bus, clock=lambda: bus.now)
    produce(master, islice(syncs(), 10), 0.5, Reconnecting(master, lambda: bus, told.append))
    assert 4 <= len(bus.sent) < 10
    assert bus.now > bus.away[1]
    assert [line.partition(" failed: ")[0].partition(" after ")[0] for line in told] == [
        f"the bus {bus.channel_info}",
        "the bus is back",
    ]


def test_a_node_is_watched_on_when_the_bus_is_back() -> None:
    bus = Unplugged(Beating([(0.5, b"\0"), *beats(1, 1.5, 5, 5.5, 6)]))
    master, events = Master(bus, clock=lambda: bus.now), list[NodeEvent]()
    guard = Reconnecting(master, lambda: bus, lambda _: None)
    watch_nodes(master, NodeWatch(events.append), 6.2, guard)
    assert [event.change.value for event in events] == ["has booted", "is lost", "is back"]


def test_a_bus_that_has_never_worked_is_an_error() -> None:
    bus = Unplugged()
    bus.away = (0.0, 9.0)
    master = Master(bus, clock=lambda: bus.now)
    guard = Reconnecting(master, lambda: bus, pytest.fail)
    with pytest.raises(BusError, match="Network is down"):
        guard(partial(master.send, 0x080, b""))
