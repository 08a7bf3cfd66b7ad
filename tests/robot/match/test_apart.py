"""A match that a core leads alone: what it says about the truth when the world cannot be asked."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

import pytest

from eurobot_od.bus.live import Live
from eurobot_od.robot import dialects
from eurobot_od.robot.match.stage import play_led
from eurobot_od.robot.match.summary import FrameCounter
from eurobot_od.robot.model.options import MatchOptions, WorldAddress
from eurobot_od.robot.nodes import Core, Drive, Navigation
from eurobot_od.robot.protocol import EurobotProtocol
from eurobot_od.robot.world.server import RemoteVehicle
from eurobot_od.robot.world.world import EventKind, MatchEvent
from eurobot_od.support.connections import Address
from tests.client.peers import new_channel, open_bus
from tests.kit.bench import put

NOWHERE = WorldAddress(Address("127.0.0.1", 9))
"""The port of a service that nobody offers any more."""


@pytest.fixture
def core() -> Iterator[Live]:
    """Run the three nodes, whose wheels and beacons are not those of a world; gives the core's bus."""
    channel = new_channel()
    nodes = (Drive(dialects.load("drive")), Navigation(dialects.load("navigation")), Core(dialects.load("core")))
    put(nodes[-1], "Position polling.Start delay", 0)
    with ExitStack() as stack:
        yield [stack.enter_context(Live.node(open_bus(channel), node)) for node in nodes][-1]


async def short_way(core: Core) -> None:
    await core.goto(240, 1800, 0, speed=30)


def test_where_the_truth_is_not_known_there_is_no_position_error(core: Live) -> None:
    events: list[MatchEvent] = []
    assert core.station is not None
    node = core.station.node
    assert isinstance(node, Core)
    vehicle = RemoteVehicle(NOWHERE, lambda _: None)
    options = MatchOptions(enemies=0, confederates=0, duration=1.0)
    counter = FrameCounter(EurobotProtocol.load())
    summary = play_led(core, node, vehicle, options, short_way, counter, events.append)
    assert [event.kind for event in events if event.kind in (EventKind.ARRIVED, EventKind.END)] == [
        EventKind.ARRIVED,
        EventKind.END,
    ]
    assert (summary.errors, summary.points, summary.failure) == ([], {}, None)
