"""The core ends the match (decision 19)."""

from __future__ import annotations

import pytest

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.robot.model.messages import (
    StopDrive,
)
from eurobot_od.robot.model.values import (
    Outcome,
)
from tests.robot.nodes.driving import (
    BRAKED,
    CORE_ID,
    FAR,
    NAVIGATION_ID,
    NEAR,
    commands,
    drive_off,
    nmt,
)
from tests.robot.nodes.harness import Bench

# 19: the core ends the match


def test_19_a_match_that_ends_stops_the_drive_and_no_goto_goes_out_until_the_next_one(bench: Bench) -> None:
    bench.core.start_match(2.0)
    begun = bench.now
    call = drive_off(bench, FAR, 1.99)
    bench.run(0.02)
    report = call.result(0)
    assert (report.outcome, report.why) == (Outcome.STOPPED, "the match is over")
    assert bench.times(StopDrive)[-1] - begun == pytest.approx(2.0, abs=0.001)
    bench.run(BRAKED)
    assert not bench.drive.moving
    assert str(bench.core.goto(*NEAR).exception(0)) == "no goto after the match"
    bench.core.start_match(60.0)
    drive_off(bench, FAR, 1.0)


def test_19_the_stop_at_the_end_is_repeated(bench: Bench) -> None:
    bench.core.start_match(2.0)
    drive_off(bench, FAR, 1.9)
    bench.lose(StopDrive, count=2)
    bench.run(0.1 + BRAKED)
    assert not bench.drive.moving


def test_19_a_match_lasts_as_long_as_the_setting_says(bench: Bench) -> None:
    bench.core.start_match()
    bench.run(89.9)
    assert not bench.core.match_over
    bench.run(0.2)
    assert bench.core.match_over
    bench.core.device.objects.put((0x2105, 1), 3)
    bench.core.start_match()
    bench.run(2.9)
    assert not bench.core.match_over
    bench.run(0.2)
    assert bench.core.match_over


def test_19_a_match_that_is_started_again_begins_anew(bench: Bench) -> None:
    bench.core.start_match(2.0)
    bench.run(1.5)
    bench.core.start_match(2.0)
    bench.run(1.9)
    assert not bench.core.match_over
    bench.run(0.2)
    assert bench.core.match_over


@pytest.mark.parametrize("before", [1.0, 3.0])
def test_19_an_nmt_reset_does_not_prolong_the_match(bench: Bench, before: float) -> None:
    end = bench.now + 2.0
    bench.core.start_match(2.0)
    bench.run(before)
    nmt(bench, NmtCommand.RESET_NODE, CORE_ID)
    bench.run(max(end - bench.now - 0.1, 0.5))
    assert bench.core.match_over is (before > 2.0)
    bench.run(0.3)
    assert bench.core.match_over
    bench.configure()
    bench.core.start_match(9.0)
    drive_off(bench, FAR, 1.0)


def test_19_a_configuration_does_not_open_a_match_that_is_over(bench: Bench) -> None:
    bench.core.start_match(0.5)
    bench.run(1.0)
    bench.configure()
    assert str(bench.core.goto(*NEAR).exception(0)) == "no goto after the match"


def test_19_a_goto_that_waits_for_lost_nodes_does_not_outlive_the_match(bench: Bench) -> None:
    bench.run(2.5)
    bench.core.start_match(1.0)
    bench.core.heartbeat_lost(NAVIGATION_ID)
    bench.network.detach(bench.stations["navigation"])
    call = bench.core.goto(*NEAR)
    bench.run(2.0)
    assert call.result(0).outcome is Outcome.STOPPED
    assert commands(bench)[-1] == StopDrive() or NEAR not in commands(bench)
