"""Gotos and start configurations that a user writes into the core's objects, such as by the page."""

from __future__ import annotations

import pytest

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.frame import Frame
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.pdo.kinds import Message, field_name
from eurobot_od.robot.model.messages import GotoXY, StartConfigurationSet
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import Obstacle, TeamColour
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.nodes.node import Detection
from eurobot_od.sdo.client import download
from tests.robot.nodes.core.test_doubts import ROOT, reports, with_stranger
from tests.robot.nodes.driving import CORE_ID, NEAR, drive_off, match_under_way, nmt
from tests.robot.nodes.harness import DICTIONARIES, PROTOCOL, RED, Bench, Peer

ORDERS = {GotoXY: "Goto XY", StartConfigurationSet: "Start configuration"}


def order(bench: Bench, message: Message) -> None:
    """Write a message into the core's object, as a master does."""
    core = DICTIONARIES["core"]
    (_, raw) = PROTOCOL.unpack(*PROTOCOL.encode(message))
    index = core.data_index(ORDERS[type(message)])
    assert index is not None
    for subindex, variable in core.members[index].items():
        if (field := field_name(variable.name)) in raw:
            content = raw[field].to_bytes((len(variable) + 7) // 8, "little")
            (request,) = download((index, subindex), content, 1.0).start(0.0)
            bench.nodes["stranger"].put(Frame(0x600 + CORE_ID, request))
            bench.run(0.01)


def distance(bench: Bench) -> float:
    """How far the robot is from where it was ordered to go, mm."""
    return bench.pose().distance(Point(*NEAR[:2]))


def test_a_goto_is_driven_and_watched_by_the_core() -> None:
    bench = with_stranger()
    order(bench, NEAR)
    assert bench.core.is_commanding
    bench.run(10.0)
    assert distance(bench) < 50
    assert reports(bench) == ""


def test_it_replaces_the_goto_under_way() -> None:
    bench = with_stranger()
    call = drive_off(bench)
    order(bench, NEAR)
    bench.run(10.0)
    assert call.result(0).outcome.value == "replaced"
    assert distance(bench) < 50


def test_a_core_that_was_reset_recovers_and_drives() -> None:
    bench = with_stranger()
    drive_off(bench)
    nmt(bench, NmtCommand.RESET_NODE, CORE_ID)
    bench.run(0.2)
    order(bench, NEAR)
    bench.run(12.0)
    assert distance(bench) < 50


def test_a_core_that_nobody_has_configured_asks_the_drive() -> None:
    bench = with_stranger()
    bench.replace("core", Core(DICTIONARIES["core"]))
    bench.run(0.1)
    order(bench, NEAR)
    bench.run(12.0)
    assert distance(bench) < 50


def test_after_an_emergency_shutdown_a_start_configuration_comes_first() -> None:
    bench = with_stranger()
    bench.core.emergency_shutdown()
    bench.run(1.0)
    order(bench, NEAR)
    bench.run(1.0)
    assert not bench.drive.moving
    there = bench.pose()
    order(bench, RED)
    order(bench, NEAR)  # it waits until that is done
    bench.run(0.1)
    assert bench.pose().distance(there.point) < 20, "in a match the drive keeps its place"
    bench.run(10.0)
    assert distance(bench) < 50


def test_what_fails_is_told() -> None:
    bench = match_under_way()
    bench.attach("stranger", Peer(Dictionary.load(ROOT / "docs" / "io.eds", 9)))
    bench.run(61.0)
    order(bench, NEAR)
    bench.run(1.0)
    assert "an order by SDO has failed: no goto after the match" in reports(bench)


class SomethingAhead:
    """A sensor that sees the robot drive into something."""

    distance = 700.0

    def look(self, _now: float) -> Detection:
        self.distance = max(self.distance - 40.0, 0.0)
        return Detection(Obstacle.OBJECT, self.distance, 0.0)


def test_a_goto_that_was_stopped_is_told_with_its_reason() -> None:
    bench = with_stranger()
    bench.core.sensor = SomethingAhead()
    order(bench, NEAR)
    bench.run(3.0)
    assert not bench.drive.moving
    assert "an order by SDO has failed: goto stopped, object ahead" in reports(bench)


@pytest.mark.parametrize("message", [NEAR, StartConfigurationSet(TeamColour.RED, 0, 0, 30, 0)])
def test_nothing_is_ordered_from_a_core_that_is_held_or_by_contradictory_values(message: Message) -> None:
    bench = with_stranger()
    if isinstance(message, GotoXY):
        nmt(bench, NmtCommand.ENTER_PRE_OPERATIONAL, CORE_ID)
        bench.run(3.0)
    before = len(bench.log)
    order(bench, message)
    bench.run(1.0)
    assert type(message) not in {type(each.message) for each in bench.log[before:]}
