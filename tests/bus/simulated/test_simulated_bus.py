"""A python-can bus in simulated time: time passes in `recv` alone, and frames win the arbitration as all others."""

from __future__ import annotations

import can
import pytest

from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.bus.simulated.simulated_bus import SimulatedBus
from eurobot_od.errors import LocalError
from eurobot_od.frame import Frame


def message(cob_id: int, data: bytes = b"") -> can.Message:
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)


def test_a_frame_reaches_the_others_when_its_bits_are_through() -> None:
    simulation = Simulation(bitrate=500_000)
    one, other = SimulatedBus(simulation), SimulatedBus(simulation)
    one.send(message(0x123, b"\1\2"))
    heard = other.recv(1.0)
    assert heard is not None
    assert (heard.arbitration_id, bytes(heard.data)) == (0x123, b"\1\2")
    assert 60 / 500_000 < heard.timestamp == simulation.now < 100 / 500_000
    assert one.recv(0.5) is None  # nobody hears what he says himself
    assert simulation.now == pytest.approx(heard.timestamp + 0.5)


def test_the_lower_identifier_is_heard_first() -> None:
    simulation = Simulation()
    low, high, ear = (SimulatedBus(simulation) for _ in range(3))
    high.send(message(0x300))
    low.send(message(0x200))
    assert [each.arbitration_id for _ in range(2) if (each := ear.recv(1.0))] == [0x200, 0x300]


def test_periodic_frames_are_sent_until_stopped() -> None:
    simulation, sent = Simulation(), list[tuple[float, Frame]]()
    simulation.observers.append(lambda now, frame: sent.append((round(now, 3), frame)))
    bus = SimulatedBus(simulation)
    task = bus.send_periodic([message(0x080, b"\1"), message(0x080, b"\2")], 0.1, store_task=False)
    assert bus.recv(0.25) is None
    task.stop()
    assert bus.recv(1.0) is None
    assert [(now, frame.data[0]) for now, frame in sent] == [(0.0, 1), (0.1, 2), (0.2, 1)]


def test_a_wait_that_would_never_end_is_refused() -> None:
    with pytest.raises(LocalError, match="waiting without an end would last for ever"):
        SimulatedBus(Simulation()).recv(None)


def test_a_bus_that_is_shut_down_hears_nothing() -> None:
    simulation = Simulation()
    one, other = SimulatedBus(simulation), SimulatedBus(simulation)
    other.shutdown()
    one.send(message(0x123))
    assert one.recv(0.1) is None
    assert len(simulation.observers) == 1
