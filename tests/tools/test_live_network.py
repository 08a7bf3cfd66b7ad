"""A bus in real time whose nodes hang, and which can be off."""

from __future__ import annotations

import asyncio
from math import inf
from threading import RLock

import can
import pytest
from live_network import CutBus, LiveNetwork

from tests.kit import plant

CHECK, CHECKED = 0x303, 0x283


def test_frames_for_a_frozen_node_wait_until_it_goes_on() -> None:
    network = LiveNetwork()
    station = network.attach(plant.NODES["scale"](plant.load("scale")))
    peer = CutBus(network)
    until = network.now + 0.3
    guard = station.node.guard
    assert isinstance(guard, type(RLock()))

    async def program() -> float:
        network.freeze(station, until)
        while guard.acquire(blocking=False):  # until the other thread has it
            guard.release()
        peer.send(can.Message(arbitration_id=CHECK, is_extended_id=False))
        while (answer := peer.recv(10.0)) is not None and answer.arbitration_id != CHECKED:
            pass
        assert answer is not None
        return network.now

    assert network.run(program()) >= until
    peer.shutdown()


def test_a_bus_that_is_off_takes_no_frame() -> None:
    network = LiveNetwork()
    one, other = CutBus(network), CutBus(network)
    network.cut(inf)
    with pytest.raises(can.CanOperationError):
        one.send(can.Message(arbitration_id=1))
    network.cut(0.0)
    one.send(can.Message(arbitration_id=1))
    assert other.recv(1.0) is not None
    one.shutdown()
    other.shutdown()
    network.run(asyncio.sleep(0))
