"""Why a goto is not possible, as far as the core can tell."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import pytest

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.errors import StateError
from eurobot_od.robot import dialects
from eurobot_od.robot.model import robot_file
from eurobot_od.robot.model.messages import GotoXY, StartConfigurationSet
from eurobot_od.robot.model.places import Point
from eurobot_od.robot.model.values import Barriers, Outcome, Passage, TeamColour
from eurobot_od.robot.nodes import Core
from eurobot_od.robot.nodes.core.flows import why_not_possible
from tests.robot.nodes.driving import CORE_ID, FAR, NEAR, drive_off, match_under_way, nmt
from tests.robot.nodes.harness import DICTIONARIES, RED, Bench

FACTS = robot_file.read(robot_file.file_for(dialects.load("drive").file))
FORCED_POOL = Barriers.of({7: Passage.FORCED})
REASONS = {
    "speed": (GotoXY(900, 900, 0, 0), "at speed 0 no place is reached"),
    "field": (GotoXY(900, 2001, 0, 50), "(900, 2001) is outside the field of 3000 x 2000 mm"),
    "barrier": (GotoXY(900, 900, 0, 50, FORCED_POOL), "(900, 900) is inside pool 1, which is forced"),
    "a barrier that may be crossed": (GotoXY(900, 900, 0, 50, Barriers.of({7: Passage.NORMAL})), "no way there"),
    "a place beside a barrier": (GotoXY(900, 1060, 0, 50, FORCED_POOL), "no way there"),
}


@pytest.mark.parametrize(("goto", "why"), REASONS.values(), ids=REASONS.keys())
def test_a_goto_that_is_not_possible_has_a_reason(goto: GotoXY, why: str) -> None:
    assert why_not_possible(FACTS, goto).startswith(why)


def restarted(bench: Bench) -> None:
    """Put a new core in the place of one whose program has died."""
    bench.replace("core", Core(DICTIONARIES["core"]))
    bench.run(0.1)


def nmt_reset(bench: Bench) -> None:
    """Reset the core by NMT, and wait for its questions."""
    nmt(bench, NmtCommand.RESET_NODE, CORE_ID)
    bench.run(0.5)


def under_way_far_off() -> Bench:
    """A match of 60 s in which the robot has driven for 3 s."""
    bench = match_under_way()
    drive_off(bench, seconds=3.0)
    return bench


BEGINNINGS = {"a new program": restarted, "an NMT reset": nmt_reset}


@pytest.mark.parametrize("begin", BEGINNINGS.values(), ids=BEGINNINGS)
@pytest.mark.parametrize("navigation", [True, False])
def test_a_core_that_begins_again_goes_on_from_what_the_drive_remembers(
    begin: Callable[[Bench], None], navigation: bool
) -> None:
    bench = under_way_far_off()
    if not navigation:
        bench.network.detach(bench.stations["navigation"])
        bench.run(3.0)
    left = bench.core.time_left
    asked = bench.now
    begin(bench)
    bench.run(2.0)
    there = bench.pose()
    recovered = bench.core.recover()
    bench.run(8.0)
    assert recovered.result(0)[:2] == pytest.approx(tuple(there.point), abs=20)
    assert bench.core.configuration == RED
    assert bench.core.time_left == pytest.approx(left - (bench.now - asked), abs=0.3)
    call = bench.core.goto(*NEAR)
    bench.run(10.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    assert bench.drive.chassis.pose.distance(Point(*NEAR[:2])) < 50  # type: ignore[attr-defined]
    bench.run(bench.core.time_left + 0.1)
    assert bench.core.match_over


def test_after_an_nmt_reset_the_next_goto_alone_goes_on() -> None:
    """Nobody calls `recover` on the page: it resets the core, and sends it to a place."""
    bench = under_way_far_off()
    nmt_reset(bench)
    bench.run(2.0)
    call = bench.core.goto(*NEAR)
    bench.run(12.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    assert bench.drive.chassis.pose.distance(Point(*NEAR[:2])) < 50  # type: ignore[attr-defined]


@pytest.mark.parametrize("seconds", [1.0, 6.0])
def test_a_drive_that_hangs_while_the_core_is_reset_is_asked_again(seconds: float) -> None:
    bench = under_way_far_off()
    bench.network.freeze(bench.stations["drive"], bench.now + seconds)
    nmt_reset(bench)
    bench.run(1.0)
    with suppress(StateError):
        bench.core.goto(*NEAR)
    bench.run(7.0)
    if bench.core.shut_down:  # a robot that nobody has seen to stand
        bench.core.recover()
        bench.run(3.0)
    call = bench.core.goto(*NEAR)
    bench.run(12.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    assert bench.core.time_left < 60.0


def test_a_drive_that_has_booted_as_well_has_nothing_to_go_back_to() -> None:
    bench = under_way_far_off()
    bench.drive.reset()
    restarted(bench)
    recovered = bench.core.recover()
    bench.run(5.0)
    assert isinstance(recovered.exception(0), StateError)
    assert StartConfigurationSet not in {type(each.message) for each in bench.log if each.time > bench.now - 5.0}


def test_a_core_that_begins_again_holds_the_shutdown_of_the_one_before() -> None:
    bench = under_way_far_off()
    bench.core.emergency_shutdown()
    bench.run(2.0)
    nmt_reset(bench)
    assert bench.core.shut_down
    with pytest.raises(StateError, match="recover"):
        bench.core.goto(*FAR)


def test_a_match_that_is_over_stays_over() -> None:
    bench = match_under_way()
    bench.run(61.0)
    restarted(bench)
    bench.core.recover()
    bench.run(5.0)
    assert bench.core.match_over
    call = bench.core.goto(*NEAR)
    assert isinstance(call.exception(0), StateError)


@pytest.mark.parametrize(("drives", "in_match", "says_so", "starts_over"), [
    (False, True, False, True),  # nobody has driven: the start place still holds
    (True, False, False, True),  # no match: the robot has been put back
    (True, True, False, False),
    (True, True, True, True),  # whoever calls configure_start() in a match has put the robot back
])  # fmt: skip
def test_a_start_configuration_in_a_match_leaves_the_place_unless_somebody_says_so(
    drives: bool, in_match: bool, says_so: bool, starts_over: bool
) -> None:
    bench = match_under_way()
    if not in_match:
        bench.drive._match_end = None
    if drives:
        drive_off(bench)
    there = bench.pose()
    if says_so:
        bench.core.configure_start(*RED)
        bench.run(0.01)
    else:
        bench.drive.handle(RED)
    start = bench.drive.facts.start(TeamColour.RED)
    assert (bench.pose() == start) is starts_over or there == start
    assert starts_over or bench.pose() == there
