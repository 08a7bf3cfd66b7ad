"""The plan: whatever a frame makes a device plan is noted, so nobody needs to look at all plans after each frame."""

from __future__ import annotations

from collections.abc import Callable
from math import inf

import pytest

from eurobot_od.device.nmt import NmtCommand, NmtState, error_control
from eurobot_od.device.timers import Plan
from eurobot_od.frame import Frame
from eurobot_od.od.values import NOT_VALID
from tests.device.master import Wire, wired
from tests.kit.lift import StateRequest, StateResponse

STATE = 0x1801
"""Communication parameters of State Response."""

PANEL = 1


def test_the_soonest_time_counts() -> None:
    plan = Plan()
    assert plan.soonest == inf
    for time, soonest in ((3.0, 3.0), (2.0, 2.0), (4.0, 2.0)):
        plan.at(time)
        assert plan.soonest == soonest


# What makes a device plan something: what is done before, and the frame, or the message it sends.

CLIENT_IS_AWAITED = Frame(0x602, bytes.fromhex("4008100000000000"))  # upload of the name, which has two segments
SHORT_MOVE, LONG_REQUEST = Frame(0x108, bytes(2)), Frame(0x110, bytes(1))


def watch_panel(wire: Wire) -> None:
    wire.write(0x1016, 1, PANEL << 16 | 2000)


def inhibit_state(wire: Wire) -> None:
    wire.write(STATE, 1, NOT_VALID | 0x114)
    wire.write(STATE, 3, 1000, size=2)
    wire.write(STATE, 1, 0x114)
    wire.device.pdo_service.send(StateResponse(3), wire.now)


def inhibit_emcy(wire: Wire) -> None:
    wire.write(0x1015, 0, 1000, size=2)
    wire.send(SHORT_MOVE)


def stop_with_event_timer(wire: Wire) -> None:
    wire.write(STATE, 5, 200, size=2)
    wire.command(NmtCommand.STOP)


Step = Callable[[Wire], object]
PLANS: dict[str, tuple[Step, Step, float]] = {
    "a client is awaited": (lambda _: None, lambda wire: wire.send(CLIENT_IS_AWAITED), 1.0),
    "heartbeats, by a master": (lambda _: None, lambda wire: wire.write(0x1017, 0, 50, size=2), 0.05),
    "another's heartbeat": (watch_panel, lambda wire: wire.send(error_control(PANEL, NmtState.OPERATIONAL)), 2.0),
    "an event timer, by a master": (lambda _: None, lambda wire: wire.write(STATE, 5, 200, size=2), 0.2),
    "an event timer, by a start": (stop_with_event_timer, lambda wire: wire.command(NmtCommand.START), 0.2),
    "a TPDO held back": (inhibit_state, lambda wire: wire.device.pdo_service.send(StateResponse(2), wire.now), 0.1),
    "an EMCY held back": (inhibit_emcy, lambda wire: wire.send(LONG_REQUEST), 0.1),
}


@pytest.mark.parametrize(("before", "step", "due"), PLANS.values(), ids=PLANS)
def test_each_step_updates_the_next_wakeup(before: Step, step: Step, due: float) -> None:
    wire = wired()
    wire.write(0x1017, 0, 0, size=2)
    before(wire)
    wire.device.plan.soonest = wire.device.next_wakeup  # as whoever keeps the time has looked
    assert wire.device.next_wakeup == inf
    step(wire)
    assert wire.device.plan.soonest == wire.device.next_wakeup == pytest.approx(due)


def test_a_message_plans_nothing() -> None:
    wire = wired()
    wire.device.plan.soonest = inf
    assert wire.send(wired("panel").device.pdo_service.transmit(StateRequest())).message == StateRequest()
    assert wire.device.plan.soonest == inf
