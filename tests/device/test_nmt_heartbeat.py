"""Heartbeats: produced by 0x1017, watched by 0x1016, and what a lost one does (CiA 301, 7.5.2.19, 7.5.2.32)."""

from __future__ import annotations

from math import inf

import pytest

from eurobot_od.device.nmt import HeartbeatConsumer, NmtState, error_control, heartbeat_entry
from eurobot_od.frame import Frame
from eurobot_od.od.values import ERROR_CONTROL_BASE
from tests.device.master import Wire, wired

DRIVE = 2
NAVIGATION = 3
SILENT_DRIVE = Frame(0x081, bytes.fromhex("3081110200000000"))
ALL_IS_WELL = Frame(0x081, bytes(8))


@pytest.mark.parametrize(
    ("entry", "node_id", "seconds", "why"),
    [
        (0x000207D0, 2, 2.0, "node 2, 2000 ms"),
        (0x007F0001, 127, 0.001, "the highest node-ID"),
        (0x00020000, 2, 0.0, "no time: not used"),
        (0x000003E8, 0, 0.0, "no node: not used"),
        (0x008003E8, 128, 0.0, "no such node: not used"),
    ],
)
def test_an_entry_names_a_node_and_a_time(entry: int, node_id: int, seconds: float, why: str) -> None:
    assert heartbeat_entry(entry) == (node_id, seconds), why


def test_a_node_is_watched_from_its_first_heartbeat_on() -> None:
    consumer = HeartbeatConsumer()
    consumer.configure([0x000207D0])
    assert consumer.next == inf
    assert consumer.overdue(1000.0) == []
    consumer.heard(DRIVE, 1000.0)
    assert consumer.next == 1002.0


def test_a_boot_up_message_alone_begins_nothing_and_ends_nothing() -> None:
    consumer = HeartbeatConsumer()
    consumer.configure([0x000207D0])
    assert consumer.booted(DRIVE, 0.0) is False
    assert consumer.next == inf
    consumer.heard(DRIVE, 1.0)
    consumer.booted(DRIVE, 2.0)  # it has heartbeats: they are awaited from here on
    assert consumer.next == 4.0
    assert consumer.overdue(4.0) == [DRIVE]
    assert consumer.booted(DRIVE, 5.0) is True
    assert consumer.next == inf


def test_a_silent_node_is_lost_once_and_comes_back() -> None:
    consumer = HeartbeatConsumer()
    consumer.configure([0x000207D0])
    assert consumer.heard(DRIVE, 0.0) is False
    assert consumer.overdue(1.999) == []
    assert consumer.overdue(2.0) == [DRIVE]
    assert consumer.overdue(9.0) == []
    assert consumer.missed == {DRIVE}
    assert consumer.heard(DRIVE, 10.0) is True
    assert consumer.missed == set()


def test_a_rewritten_consumer_entry_restarts_only_itself() -> None:
    consumer = HeartbeatConsumer()
    consumer.configure([0x000207D0, 0x000307D0])
    consumer.heard(DRIVE, 0.0)
    consumer.heard(NAVIGATION, 0.5)
    consumer.configure([0x000203E8, 0x000307D0])
    assert consumer.next == 2.5
    assert consumer.identifiers == {0x702, 0x703}


def test_only_configured_producers_are_watched() -> None:
    consumer = HeartbeatConsumer()
    consumer.configure([0x000207D0])
    assert consumer.heard(NAVIGATION, 0.0) is False
    assert consumer.next == inf


# The device


def panel_that_heard_the_cabin() -> Wire:
    wire = wired("panel")
    wire.write(0x1017, 0, 0, size=2)
    wire.send(error_control(DRIVE, NmtState.OPERATIONAL))
    wire.sent()
    return wire


def test_a_lost_heartbeat_is_reported_within_its_time_and_when_it_is_back() -> None:
    wire = panel_that_heard_the_cabin()
    assert wire.device.next_wakeup == 2.0
    assert wire.wait(1.999).lost == ()
    reaction = wire.wait(0.001)
    assert reaction.lost == (DRIVE,)
    assert reaction.frames == [SILENT_DRIVE]
    assert wire.read(0x1001) == 0b0001_0001
    assert wire.send(error_control(DRIVE, NmtState.OPERATIONAL)).frames == [ALL_IS_WELL]
    assert wire.read(0x1001) == 0


@pytest.mark.parametrize(
    ("behaviour", "state"),
    [(0, NmtState.PRE_OPERATIONAL), (1, NmtState.OPERATIONAL), (2, NmtState.STOPPED)],
)
def test_the_error_behaviour_says_what_becomes_of_the_device(behaviour: int, state: NmtState) -> None:
    wire = panel_that_heard_the_cabin()
    wire.write(0x1029, 1, behaviour, size=1)
    wire.wait(2.0)
    assert wire.device.state is state


def test_a_changed_consumer_time_is_live() -> None:
    wire = panel_that_heard_the_cabin()
    wire.write(0x1016, 1, 0x000A0064)
    assert ERROR_CONTROL_BASE + DRIVE not in wire.device.identifiers
    wire.send(error_control(10, NmtState.OPERATIONAL))
    assert wire.wait(0.1).lost == (10,)


def test_a_changed_producer_time_is_live() -> None:
    wire = wired()
    wire.write(0x1017, 0, 50, size=2)
    assert wire.wait(0.05).frames == [error_control(DRIVE, NmtState.OPERATIONAL)]
    wire.write(0x1017, 0, 0, size=2)
    assert wire.device.next_wakeup == inf
