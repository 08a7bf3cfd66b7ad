"""Devices among others: a node that falls silent, and a message that a master moves and widens."""

from __future__ import annotations

import pytest

from tests.kit import lift
from tests.kit.bench import Lift, Peer
from tests.kit.lift import OFFICE, MoveTo, Ride

SILENT = bytes.fromhex("3081")
MASTER = 100
"""Node-ID of the master, which is nobody's."""

WIDE = (0x20000110, 0x20000208, 0x20000308, 0x20000410)
"""Move To in whole bytes: 48 bits."""


class Building(Lift):
    """The lift, and a master that configures its nodes over the bus."""

    def __init__(self) -> None:
        super().__init__()
        self.attach("master", Peer(lift.dictionary("door").renumbered(MASTER)))
        self.run(0.1)


@pytest.mark.parametrize("silent", ["cabin", "door"])
def test_a_node_that_falls_silent_is_missed_once(silent: str) -> None:
    building = Building()
    building.run(2.0)
    building.download("master", silent, 0x1017, 0, 0, size=2)
    building.run(3.0)
    assert building.panel.lost == [building.nodes[silent].device.node_id]
    assert [data[:2] for data in building.frames(0x081)] == [SILENT]


def test_a_drive_stops_when_its_commander_falls_silent() -> None:
    building = Building()
    building.run(2.0)
    building.panel.send(MoveTo(3000, Ride.NORMAL, 5))
    building.run(0.5)
    assert building.cabin.moving
    building.download("master", "panel", 0x1017, 0, 0, size=2)
    building.run(3.0)
    assert not building.cabin.moving
    assert [data[:2] for data in building.frames(0x082)] == [SILENT]


def test_no_heartbeat_is_missed_while_all_nodes_run() -> None:
    building = Building()
    building.run(10.0)
    assert building.frames(0x081) == building.frames(0x082) == []


def test_a_message_that_a_master_moves_and_widens_is_still_acted_on() -> None:
    building = Building()
    for name, index in (("panel", 0x1803), ("cabin", 0x1403)):
        building.download("master", name, index, 1, 0x80000000 | building.nodes[name].device.objects.number((index, 1)))
        building.download("master", name, index + 0x200, 0, 0, size=1)
        for subindex, entry in enumerate(WIDE, 1):
            building.download("master", name, index + 0x200, subindex, entry)
        building.download("master", name, index + 0x200, 0, len(WIDE), size=1)
        building.download("master", name, index, 1, 0x80000123)
        building.download("master", name, index, 1, 0x123)
    call = building.panel.move(MoveTo(700, Ride.SERVICE, 100))
    building.run(10.0)
    assert call.result(0) is None
    assert building.cabin.height == 700
    assert building.frames(0x123) == [(700 | Ride.SERVICE << 16 | 100 << 24).to_bytes(6, "little")]


def test_an_error_of_a_devices_own_is_told_and_is_gone_again() -> None:
    building = Building()
    building.panel.send(OFFICE._replace(doors=0))
    building.run(0.1)
    assert building.frames(0x082) == [bytes.fromhex("02ff810000000000")]
    building.panel.send(OFFICE)
    building.run(0.1)
    assert building.frames(0x082)[-1] == bytes(8)
