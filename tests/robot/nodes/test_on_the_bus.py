"""A match with a master on the bus: a node that falls silent, a goto that is moved and widened, a blocked drive."""

from __future__ import annotations

import pytest

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import StopDrive
from eurobot_od.robot.model.values import Outcome, TeamColour
from eurobot_od.robot.nodes.motion import IdealChassis, Odometry, WheelCommand
from tests.robot.nodes.harness import Bench, Peer

SILENT = bytes.fromhex("3081")
MASTER = 100
"""Node-ID of the master, which is nobody's."""

WIDE_X = (0x20000110, 0x2000020C, 0x2000030A, 0x20000408, 0x20000510)
"""Goto XY with 16 bits for x: 62 bits."""


class Match(Bench):
    """The three nodes after the start configuration, and a master that configures them over the bus."""

    def __init__(self) -> None:
        super().__init__()
        self.nodes["master"] = Peer(dialects.load("navigation", node_id=MASTER))
        self.network.attach(self.nodes["master"])
        self.core.configure_start(TeamColour.RED)
        self.run(0.1)


@pytest.mark.parametrize("silent", ["drive", "navigation"])
def test_a_node_that_falls_silent_during_a_goto_stops_the_drive(silent: str) -> None:
    match = Match()
    match.run(2.0)
    call = match.core.goto(2500, 1000, 0, 5)
    match.run(0.5)
    assert match.drive.moving
    match.download("master", silent, 0x1017, 0, 0, size=2)
    match.log.clear()
    match.run(3.0)
    assert StopDrive() in [sent.message for sent in match.log]
    assert call.result(0).outcome is Outcome.LOST
    assert not match.drive.moving
    assert [data[:2] for data in match.frames(0x081)] == [SILENT]


def test_goto_xy_moved_and_widened_by_a_master_still_drives_the_robot() -> None:
    match = Match()
    for name, index in (("core", 0x1803), ("drive", 0x1403)):
        match.download("master", name, index, 1, 0x80000000 | match.nodes[name].device.objects.number((index, 1)))
        match.download("master", name, index + 0x200, 0, 0, size=1)
        for subindex, entry in enumerate(WIDE_X, 1):
            match.download("master", name, index + 0x200, subindex, entry)
        match.download("master", name, index + 0x200, 0, len(WIDE_X), size=1)
        match.download("master", name, index, 1, 0x80000123)
        match.download("master", name, index, 1, 0x123)
    call = match.core.goto(700, 1500, 0, 100)
    match.run(10.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    word = 700 | 1500 << 16 | 100 << 38
    assert match.frames(0x123) == [word.to_bytes(8, "little")]


def test_polling_goes_on_after_a_time_in_which_nothing_may_be_sent() -> None:
    match = Match()
    match.command("master", NmtCommand.ENTER_PRE_OPERATIONAL, match.core.device.node_id)
    match.run(5.0)
    assert match.core.withheld > 0
    match.command("master", NmtCommand.START, match.core.device.node_id)
    match.log.clear()
    match.run(1.0)
    assert match.log


class Stuck:
    """Wheels that do not turn, whatever they are told."""

    def advance(self, command: WheelCommand, dt: float) -> Odometry:
        return Odometry(0.0, 0.0)


def test_a_blocked_drive_gives_up_says_so_and_is_well_again_with_the_next_goto() -> None:
    match = Match()
    match.download("master", "drive", 0x2101, 7, 300, size=2)
    match.drive.chassis = Stuck()
    call = match.core.goto(700, 1500, 0, 100)
    match.run(1.0)
    assert call.result(0).outcome is Outcome.BLOCKED
    assert match.frames(0x082) == [bytes.fromhex("02ff810000000000")]
    assert not match.drive.moving
    match.drive.chassis = IdealChassis()
    again = match.core.goto(700, 1500, 0, 100)
    match.run(10.0)
    assert again.result(0).outcome is Outcome.ARRIVED
    assert match.frames(0x082)[-1] == bytes(8)
