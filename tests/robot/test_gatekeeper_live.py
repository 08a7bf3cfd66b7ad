"""The mailboxes of a robot's node on a bus whose driver does not take what it is given."""

from __future__ import annotations

from collections.abc import Iterator

import can
import pytest

from eurobot_od.bus.live import Live
from eurobot_od.bus.live.buses import LONGEST_PAUSE
from eurobot_od.controller import Event as What
from eurobot_od.robot.gatekeeper import MAILBOX_WAIT, Gatekeeper
from tests.bus.live.loose import Reports
from tests.bus.live.test_live import PROTOCOL, URGENT, Clock, Driver
from tests.kit.lift import CheckCabinRequest


@pytest.fixture
def driver() -> Iterator[Driver]:
    bus = Driver()
    yield bus
    bus.shutdown()


def test_a_frame_that_the_driver_refuses_is_dropped_after_50_ms_and_reported(driver: Driver) -> None:
    clock = Clock()
    reports = Reports()
    driver.error = can.CanOperationError("transmit buffer full")
    with Live(driver, Gatekeeper(PROTOCOL, report=reports), clock=clock) as live:
        for message in URGENT:  # three find a mailbox, the fourth waits for one
            live.send(message)
        driver.wait_for_tries(3)
        clock.now = 0.049
        driver.wait_for_tries(3)
        assert reports.empty()
        clock.now = 0.050
        report = reports.wait_for(What.FRAME_DROPPED)
        counts = live.controller.statistics().transmit
    assert (report.name, report.text) == ("0x345", "345# found no mailbox for 50 ms, 1 dropped so far")
    assert (counts.submitted, counts.dropped, counts.loaded, counts.completed) == (4, 1, 3, 0)
    assert live.failure is None  # a full buffer is not a failure of the bus


def test_the_keeper_wakes_when_a_frame_expires(driver: Driver) -> None:
    driver.error = can.CanOperationError("transmit buffer full")
    live = Live(driver, Gatekeeper(PROTOCOL), clock=lambda: 5.0)
    live.send(CheckCabinRequest())
    for message in URGENT:
        live.send(message)
    while live._sender.pause < LONGEST_PAUSE:
        live._sender.retry()
    assert live._next_look() == 5.0 + MAILBOX_WAIT
