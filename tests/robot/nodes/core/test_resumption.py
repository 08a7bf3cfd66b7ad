"""After a loss the next goto, or one call, has the robot go on, from where it really is (decisions 16 and 20)."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from eurobot_od.errors import NoAnswer, StateError
from eurobot_od.frame import Frame
from eurobot_od.robot.model.messages import (
    CheckDriveRequest,
    GotoXY,
    NaviPositionResponse,
    StartConfigurationConfirm,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.values import (
    Outcome,
    TeamColour,
)
from eurobot_od.robot.nodes.core.flows import NotStanding, PlaceLost
from eurobot_od.robot.nodes.estimate import Estimate
from eurobot_od.robot.nodes.node import NO_MATCH, TIME_LEFT
from tests.kit.bench import put
from tests.robot.nodes.driving import (
    BRAKED,
    CORE_ID,
    FAR,
    NAVIGATION_ID,
    NEAR,
    Runaway,
    drive_off,
    match_under_way,
    ready,
    reboot,
    true_robot,
)
from tests.robot.nodes.harness import DICTIONARIES, RED, Bench


@pytest.mark.parametrize(("after", "place"), [(0.1, "unknown"), (0.5, "unknown"), (2.0, "seen"), (5.0, "seen")])
def test_16_a_drive_that_boots_loses_its_goto_and_the_next_one_recovers_it(
    bench: Bench, after: float, place: str
) -> None:
    """Once the beacons have seen a drive that has booted, it knows its place, and nothing may erase that."""
    true_robot(bench)
    bench.run(2.5)  # positions are polled
    call = drive_off(bench)
    reboot(bench, "drive")
    bench.run(0.01)
    assert call.result(0).outcome is Outcome.LOST
    bench.run(after)
    assert not bench.drive.moving
    begun = len(bench.log)
    next_goto = bench.core.goto(*FAR)
    bench.run(8.0)
    assert next_goto.result(0).outcome is Outcome.ARRIVED
    order = [type(each) for each in bench.messages()[begun:]]
    configured = [StartConfigurationSet] if place == "unknown" else []
    steps = [CheckDriveRequest, *configured, NaviPositionResponse, GotoXY]
    assert sorted(steps, key=order.index) == steps
    assert order.count(StartConfigurationSet) == len(configured)
    assert next_goto.result(0).ended < call.result(0).ended + 6.0  # it began where the beacons saw it


@pytest.mark.parametrize("attempts", [1, 3])
@pytest.mark.parametrize("after", [0.05, 0.5, 5.0])
def test_16_a_drive_that_has_lost_its_place_is_not_driven(bench: Bench, after: float, attempts: int) -> None:
    """After it has booted it says "unknown", and after the configuration its start place: neither is to be believed."""
    bench.run(2.5)
    drive_off(bench, FAR._replace(speed=100))
    reboot(bench, "drive")
    bench.run(after)
    booted = bench.now
    for _ in range(attempts):
        call = bench.core.goto(*FAR)
        bench.run(5.0)
        error = call.exception(0)
        assert isinstance(error, StateError)
        assert str(error).startswith("the drive has lost its place: it was last seen at (")
    assert GotoXY not in {type(message) for time, message in bench.log if time > booted}
    assert not bench.drive.moving
    bench.configure()
    drive_off(bench, FAR, 1.0)


def test_16_beacons_that_see_the_robot_again_bring_it_back(bench: Bench) -> None:
    robot = true_robot(bench)
    bench.run(2.5)
    drive_off(bench, FAR._replace(speed=100))
    robot.clear = False
    reboot(bench, "drive")
    bench.run(0.5)
    lost = bench.core.goto(*FAR)
    bench.run(3.0)
    assert isinstance(lost.exception(0), StateError)
    robot.clear = True
    call = bench.core.goto(*FAR)
    bench.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED


def test_16_a_navigation_that_boots_is_configured_before_the_next_goto_and_this_one_goes_on(bench: Bench) -> None:
    true_robot(bench)
    bench.run(2.5)
    call = drive_off(bench)
    reboot(bench, "navigation")
    bench.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    back = bench.core.goto(2000, 1700, 180, 50)
    bench.run(8.0)
    assert back.result(0).outcome is Outcome.ARRIVED
    assert bench.navigation.configuration == RED


@pytest.mark.parametrize("name", ["drive", "navigation"])
def test_16_after_a_lost_heartbeat_no_goto_goes_out_before_checks_and_a_healthy_drive_keeps_its_place(
    name: str,
) -> None:
    bench = Bench()
    bench.run(1.5)  # a heartbeat of each
    bench.configure()
    true_robot(bench)
    bench.core.goto(*FAR._replace(speed=1))
    bench.run(0.5)
    lost = bench.now
    frozen = bench.now + 2.8
    bench.network.freeze(bench.stations[name], frozen)
    bench.run(2.2)
    assert bench.core.is_commanding is False
    call = bench.core.goto(*FAR)
    while bench.now < frozen:
        bench.run(0.05)
        assert GotoXY not in {type(message) for time, message in bench.log if time > lost}
    bench.run(12.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    order = [type(message) for time, message in bench.log if time > lost]
    steps = [CheckDriveRequest, GotoXY]
    assert sorted(steps, key=order.index) == steps
    assert StartConfigurationSet not in order


def test_16_a_goto_that_replaces_another_after_a_loss_has_the_drive_stand_first(bench: Bench) -> None:
    """The navigation boots and dies: nobody would look at the drive during its checks, which are not answered."""
    bench.run(2.5)
    slow = FAR._replace(speed=10)
    first = drive_off(bench, slow, 1.0)
    reboot(bench, "navigation")
    bench.run(0.05)
    bench.network.detach(bench.stations["navigation"])
    second = bench.core.goto(*FAR)
    bench.run(BRAKED)
    assert first.result(0).outcome is Outcome.REPLACED
    assert not bench.drive.moving
    bench.run(20.0)
    assert second.done()
    assert not bench.drive.moving


def test_16_a_stop_is_watched_on_while_a_goto_waits_for_lost_nodes(bench: Bench) -> None:
    bench.run(2.5)
    drive_off(bench, FAR._replace(speed=10), 1.0)
    bench.lose(StopDrive, CheckDriveRequest)
    bench.core.heartbeat_lost(NAVIGATION_ID)
    bench.core.goto(*FAR)
    bench.run(0.5)
    assert bench.drive.moving
    bench.lose(CheckDriveRequest)
    bench.run(BRAKED)
    assert not bench.drive.moving


@pytest.mark.parametrize("name", ["drive", "navigation"])
def test_16_a_node_that_boots_while_it_is_configured_is_configured_again(half: Bench, name: str) -> None:
    call = half.core.configure_start(*RED)
    half.run(0.01)
    half.say("navigation", StartConfigurationConfirm())
    half.say(name, Frame(0x700 + half.nodes[name].device.node_id, b"\x00"))
    half.check()
    assert call.done()
    half.core.goto(*FAR)
    half.run(0.01)
    assert half.messages()[-1] == CheckDriveRequest()


def test_16_a_goto_that_is_cancelled_while_it_waits_for_lost_nodes_is_never_sent(bench: Bench) -> None:
    bench.lose(CheckDriveRequest)
    bench.core.heartbeat_lost(NAVIGATION_ID)
    call = bench.core.goto(*FAR)
    bench.run(1.5)
    assert call.cancel()
    bench.lose()
    bench.run(5.0)
    assert FAR not in bench.messages()
    assert not bench.drive.moving


def test_16_a_goto_that_waits_for_lost_nodes_ends_when_the_robot_does_not_stand() -> None:
    bench = Bench()
    drive = Runaway(DICTIONARIES["drive"])
    bench.replace("drive", drive)
    bench.run(0.1)
    bench.configure()
    drive_off(bench, FAR._replace(speed=10), 0.5)
    bench.lose(CheckDriveRequest)
    bench.core.heartbeat_lost(NAVIGATION_ID)
    call = bench.core.goto(*NEAR)
    bench.run(3.0)
    assert isinstance(call.exception(0), NotStanding)
    assert bench.core.shut_down
    drive.tamed = True
    bench.run(BRAKED)
    assert not drive.moving


@pytest.mark.parametrize("pause", [1.0, 3.0, 5.0])
def test_20_a_drive_that_knows_its_place_is_not_configured_again(bench: Bench, pause: float) -> None:
    """Without the navigation only the drive knows the place: a start configuration would put it at its start."""
    true_robot(bench)
    bench.core.start_match(90.0)
    drive_off(bench)
    bench.network.detach(bench.stations["navigation"])
    bench.run(3.0)
    drive_off(bench, GotoXY(500, 500, 0, 50))
    bench.network.freeze(bench.stations["core"], bench.now + pause)
    bench.run(pause + 3.0)
    begun = len(bench.log)
    call = bench.core.goto(*FAR)
    bench.run(20.0)
    assert call.result(0).outcome is Outcome.ARRIVED
    assert StartConfigurationSet not in {type(each) for each in bench.messages()[begun:]}


def lose_for(bench: Bench, what: str, seconds: float) -> None:
    """Freeze a node, or have the bus off, for so long, and give the core time to find out."""
    end = bench.now + seconds
    if what == "bus":
        bench.network.cut(end)
    else:
        bench.network.freeze(bench.stations[what], end)
    bench.run(seconds + 3.0)


def shut_down_far_off(bench: Bench) -> None:
    """Shut down far from the start, when only the drive knows where the robot is."""
    true_robot(bench)
    bench.core.start_match(90.0)
    drive_off(bench)
    bench.network.detach(bench.stations["navigation"])
    bench.run(3.0)
    bench.core.emergency_shutdown()
    bench.run(1.0)


@pytest.mark.parametrize("what", ["drive", "bus"])
def test_20_a_loss_that_ends_in_a_shutdown_leaves_the_drive_its_place(bench: Bench, what: str) -> None:
    """A start configuration alone ends the safe state, and only the drive knows where the robot is."""
    true_robot(bench)
    bench.core.start_match(90.0)
    drive_off(bench)
    bench.network.detach(bench.stations["navigation"])
    bench.run(3.0)
    drive_off(bench, GotoXY(500, 500, 0, 50))
    lose_for(bench, what, 5.0)
    assert bench.core.shut_down
    there = bench.pose()
    recovered = bench.core.recover()
    bench.run(15.0)
    assert recovered.result(0)[:2] == tuple(round(each) for each in there.point)
    call = bench.core.goto(*FAR)
    bench.run(20.0)
    assert call.result(0).outcome is Outcome.ARRIVED


def test_20_a_drive_that_does_not_answer_is_not_configured_in_a_recovery(bench: Bench) -> None:
    """Unasked to keep its place, it would forget it."""
    shut_down_far_off(bench)
    begun = len(bench.log)
    bench.network.freeze(bench.stations["drive"], bench.now + 10.0)
    recovered = bench.core.recover()
    bench.run(6.0)
    assert isinstance(recovered.exception(0), NoAnswer)
    assert bench.core.shut_down
    assert StartConfigurationSet not in {type(each) for each in bench.messages()[begun:]}


@pytest.mark.parametrize(
    ("done", "kept"),
    [
        (lambda _: None, True),
        (lambda bench: bench.drive.heartbeat_lost(CORE_ID), False),  # whoever wanted it kept is gone
        (lambda bench: bench.drive.booted(CORE_ID), False),
        (lambda bench: bench.drive.configure(RED), False),  # it has been kept once
        (lambda bench: bench.drive.reset(), False),  # there is no place to keep
    ],
)
def test_20_the_place_is_kept_once_and_for_the_core_that_asked(done: Callable[[Bench], object], kept: bool) -> None:
    bench = ready()
    shut_down_far_off(bench)
    there = bench.pose()
    put(bench.drive, TIME_LEFT, NO_MATCH)  # in a match it is kept in any case
    put(bench.drive, "Place.Keep place", 1)
    done(bench)
    bench.drive.configure(RED)
    assert (bench.drive.estimate.pose == there) is kept
    assert bench.drive.estimate.pose == (there if kept else bench.drive.facts.start(TeamColour.RED))
    assert not bench.drive.keep_place


def test_20_a_recovery_that_is_to_start_over_does(bench: Bench) -> None:
    shut_down_far_off(bench)
    put(bench.core, "Place.Keep place", 0)
    recovered = bench.core.recover()
    bench.run(15.0)
    assert isinstance(recovered.exception(0), PlaceLost)
    assert bench.pose() == bench.drive.facts.start(TeamColour.RED)


@pytest.mark.parametrize(("setting", "found"), [(1400, False), (1600, True)])
def test_20_a_robot_that_was_moved_farther_than_the_setting_is_not_recovered(
    bench: Bench, setting: int, found: bool
) -> None:
    shut_down_far_off(bench)
    put(bench.core, "Recovery.Displacement", setting)
    bench.drive.estimate = Estimate(bench.drive.estimate.tuning, bench.pose().moved(-1500.0, 0.0))
    recovered = bench.core.recover()
    bench.run(15.0)
    assert isinstance(recovered.exception(0), PlaceLost) is not found


# After an Emergency Shutdown


def test_one_call_has_the_robot_go_on_after_a_shutdown() -> None:
    bench = match_under_way()
    drive_off(bench)
    bench.core.emergency_shutdown()
    bench.run(2.0)
    with pytest.raises(StateError, match=r"`await core\.recover\(\)` ends it"):
        bench.core.goto(*NEAR)
    recovered = bench.core.recover()
    bench.run(2.0)
    place = recovered.result(0)
    assert (place.x, place.y) == pytest.approx(bench.pose().point, abs=1)
    call = bench.core.goto(*NEAR)
    bench.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED


def test_a_recovery_without_a_navigation_that_sees_the_robot_is_refused() -> None:
    bench = Bench()
    bench.configure()
    drive_off(bench)
    bench.core.emergency_shutdown()
    bench.run(2.0)
    bench.core.position()
    bench.run(0.5)
    bench.drive.reset()  # it knows no place any more, and begins at its start
    recovered = bench.core.recover()
    bench.run(2.0)
    assert "the drive has lost its place" in str(recovered.exception(0))
    fresh = Bench()
    nothing = fresh.core.recover()
    fresh.run(5.0)
    assert "there is nothing to go back to" in str(nothing.exception(0))
