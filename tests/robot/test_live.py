"""The robot's nodes on a bus in real time: its start, and a core whose bus is lost while a goto is under way."""

from __future__ import annotations

import pytest
from can.interfaces.virtual import VirtualBus

from eurobot_od.bus.live import Live
from eurobot_od.controller import Event
from eurobot_od.robot import dialects
from eurobot_od.robot.model.values import Outcome, TeamColour
from eurobot_od.robot.nodes import Core, Drive, Navigation
from tests.bus.live.loose import LONG, Cable, Reports

UNPLUGGED = OSError(100, "Network is down")


def test_a_core_checks_its_nodes_ends_its_goto_with_the_bus_and_recovers_before_the_next(
    request: pytest.FixtureRequest,
) -> None:
    cable = Cable(request.node.name)
    reports = Reports()
    core = Core(dialects.load("core"))
    with (
        Live.node(VirtualBus(cable.channel), Drive(dialects.load("drive"))),
        Live.node(VirtualBus(cable.channel), Navigation(dialects.load("navigation"))),
        Live.node(cable.open(), core, opener=cable.open, report=reports),
    ):
        assert list(core.check_nodes().result(LONG)) == ["drive", "navigation"]
        core.configure_start(TeamColour.RED).result(LONG)
        goto = core.goto(1500, 1000, 0, 50)
        cable.error = UNPLUGGED
        assert goto.result(LONG).outcome is Outcome.LOST
        cable.error = None
        reports.wait_for(Event.BUS_BACK)
        core.stop().result(LONG)
        assert core.goto(350, 1750, 0, 100).result(LONG).outcome is not Outcome.LOST
