"""The drive misses the core: what the wheels do when its heartbeats stay away, or it boots (decision 15)."""

from __future__ import annotations

from eurobot_od.robot.model.values import (
    Outcome,
)
from eurobot_od.robot.nodes import Core, Drive
from tests.robot.nodes.driving import (
    FAR,
    HEARTBEAT_LOST,
    drive_off,
)
from tests.robot.nodes.harness import DICTIONARIES, Bench

# 15: the drive watches the core

CORE_WATCHED = 0.75
"""Silence of the core after which the drive brakes, in s (its 0x1016)."""


def test_15_a_core_that_is_gone_brakes_the_drive_and_only_a_new_goto_moves_it() -> None:
    bench = Bench()
    bench.configure()
    drive_off(bench)
    bench.network.detach(bench.stations["core"])
    gone = bench.now
    while not bench.emergencies("drive"):
        bench.run(0.01)
    assert bench.now - gone <= CORE_WATCHED + 0.01
    bench.run(0.5)
    assert not bench.drive.moving
    assert bench.emergencies("drive") == [HEARTBEAT_LOST]
    bench.run(5.0)
    assert not bench.drive.moving
    bench.attach("core", Core(DICTIONARIES["core"]))
    bench.run(2.0)
    assert bench.emergencies("drive") == [HEARTBEAT_LOST, 0]
    assert not bench.drive.moving
    bench.configure()
    drive_off(bench, FAR, 1.0)


def test_15_a_core_without_heartbeats_is_not_watched() -> None:
    bench = Bench()
    bench.replace("drive", Drive(DICTIONARIES["drive"]))  # it has never heard the core before
    core = Core(DICTIONARIES["core"])
    core.device.objects.put((0x1017, 0), 0)
    bench.replace("core", core)
    bench.run(0.01)
    bench.configure()
    call = bench.core.goto(*FAR)
    bench.run(3.0)
    assert bench.drive.moving
    assert bench.emergencies("drive") == []
    bench.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED


def test_15_a_core_that_is_gone_right_after_its_first_goto_is_missed() -> None:
    """Its next heartbeat would have come 250 ms after its boot-up."""
    bench = Bench()
    bench.configure()
    bench.core.goto(*FAR)
    bench.run(0.1)
    bench.network.detach(bench.stations["core"])
    bench.run(CORE_WATCHED)
    assert bench.emergencies("drive") == [HEARTBEAT_LOST]
    bench.run(0.5)
    assert not bench.drive.moving


def test_15_a_core_that_boots_brakes_the_drive(bench: Bench) -> None:
    drive_off(bench)
    bench.replace("core", Core(DICTIONARIES["core"]))
    bench.run(0.5)
    assert not bench.drive.moving
    bench.run(5.0)
    assert not bench.drive.moving


def test_15_a_core_that_hangs_for_a_moment_is_not_missed(bench: Bench) -> None:
    call = drive_off(bench)
    bench.network.freeze(bench.stations["core"], bench.now + 0.4)
    bench.run(8.0)
    assert call.result(0).outcome is Outcome.ARRIVED


def test_15_a_core_that_hangs_for_long_finds_its_goto_stopped(bench: Bench) -> None:
    call = drive_off(bench)
    bench.network.freeze(bench.stations["core"], bench.now + 5.0)
    bench.run(CORE_WATCHED + 0.5)
    assert not bench.drive.moving
    bench.run(6.0)
    assert call.result(0).outcome is Outcome.LOST  # it asks once more, and hears that the drive has no goto
    assert not bench.drive.moving
