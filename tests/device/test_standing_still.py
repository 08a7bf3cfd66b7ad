"""A node whose process stood still: what it has missed it does once, and says so."""

from __future__ import annotations

import pytest

from eurobot_od.device.node import Node
from eurobot_od.device.timers import LATE
from eurobot_od.frame import Frame
from eurobot_od.od.standard import ErrorCode
from tests.kit import lift
from tests.kit.lift import Cabin, Panel

SYNC_PERIOD, SYNC = 0x1006, 0x1005


def run(node: Node, now: float) -> list[Frame]:
    """Tick until nothing is due any more, as whoever runs a node does."""
    frames: list[Frame] = []
    while node.next_wakeup <= now:
        frames += node.tick(now)
    return frames


@pytest.mark.parametrize("stopped", [600.0, 3600.0], ids=str)
def test_after_a_sigstop_what_was_missed_is_skipped_once_and_said(stopped: float) -> None:
    """600 s used to end with 5600 frames at once, and control steps for 28 s."""
    node = Panel(lift.dictionary("panel"))
    alarms: list[str] = []
    node.alarm = alarms.append
    node.start(0.0)
    with node.guard:
        asked: list[float] = []

        def ask(now: float) -> None:
            asked.append(now)
            node.at(now + 0.1, ask)

        node.at(0.1, ask)
    run(node, 0.35)
    assert len(asked) == 3
    frames = run(node, stopped)
    assert (len(frames), asked[3:]) == (1, [stopped])  # one heartbeat, and one question
    assert alarms == [f"stood still for {stopped - asked[2] - 0.1:.1f} s; what was due meanwhile is skipped"]
    run(node, stopped + 1.05)
    assert len(asked) == 4 + 10
    assert len(alarms) == 1


def test_a_node_that_is_late_by_a_moment_makes_up_for_it() -> None:
    node = Cabin(lift.dictionary("cabin"))
    alarms: list[str] = []
    node.alarm = alarms.append
    node.start(0.0)
    late = 1.0 + LATE
    assert len(run(node, late)) == 2  # the heartbeats of 1 s and 2 s
    assert alarms == []


@pytest.mark.parametrize("errors", [[5.0], [5.0, 500.0]], ids=["the first", "one long after another"])
def test_an_error_on_the_bus_is_told_and_is_no_standstill(errors: list[float]) -> None:
    """After each lost bus the node claimed that it had stood still for an infinite time."""
    node = Cabin(lift.dictionary("cabin"))
    alarms: list[str] = []
    node.alarm = alarms.append
    node.start(0.0)
    for number in range(round(errors[-1]) + 1):
        run(node, float(number))
        if number in errors:
            node.bus_error(ErrorCode.BUS_LOST, float(number))
            assert [frame.cob_id for frame in run(node, float(number))] == [0x082]
    assert alarms == []
