"""A station: what its node's settings size, and the way of frames to the node and from it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from eurobot_od.device.station import Station
from eurobot_od.errors import ListenerError
from eurobot_od.frame import Frame
from eurobot_od.gatekeeper import Event, Report
from eurobot_od.robot import dialects
from eurobot_od.robot.messages import CheckDriveRequest, CheckDriveResponse, GotoConfirm, GotoXY, StopDrive
from eurobot_od.robot.nodes import Drive
from eurobot_od.robot.protocol import EurobotProtocol

PROTOCOL = EurobotProtocol.load()
BOOT_UP = Frame(0x702, b"\x00")


def ignore(*_: object) -> None:
    """A listener that does nothing."""


@pytest.fixture
def station() -> Station:
    station = Station(Drive(dialects.load("drive")))
    station.gatekeeper.start()
    return station


def sent(station: Station, now: float = 0.0) -> list[Frame]:
    """Take the frames out of the mailboxes, as a controller without a queue would send them."""
    frames = []
    station.gatekeeper.mailboxes.load(now)
    while (frame := station.gatekeeper.mailboxes.urgent()) is not None:
        frames.append(frame)
        station.gatekeeper.mailboxes.complete(frame)
        station.gatekeeper.mailboxes.load(now)
    return frames


def test_what_the_node_sends_goes_to_the_mailboxes(station: Station) -> None:
    station.start(0.0)
    assert sent(station) == [BOOT_UP]


def test_what_finds_a_mailbox_is_in_it_at_once_and_does_not_expire(station: Station) -> None:
    station.start(0.0)
    assert sent(station, 1.0) == [BOOT_UP]


def test_what_comes_for_the_node_goes_to_it_and_its_answer_to_the_mailboxes(station: Station) -> None:
    station.start(0.0)
    station.gatekeeper.receive(PROTOCOL.encode(CheckDriveRequest()), 0.5)
    station.gatekeeper.receive(PROTOCOL.encode(GotoXY(500, 500, 0, 50)), 0.5)
    answers = [PROTOCOL.encode(GotoConfirm()), PROTOCOL.encode(CheckDriveResponse())]
    assert sent(station) == [*answers, BOOT_UP]  # the most urgent first


def test_the_station_wakes_when_its_node_wants_to(station: Station) -> None:
    station.start(0.0)
    sent(station)
    wakeup = station.next_wakeup
    assert wakeup == station.node.next_wakeup == 1.0
    station.tick(1.0)
    assert sent(station, 1.0) == [Frame(0x702, b"\x05")]  # the heartbeat


def test_filters_let_through_what_the_node_listens_to() -> None:
    node = Drive(dialects.load("drive"))
    station = Station(node)
    filters = [each["can_id"] for each in station.gatekeeper.start()]
    assert filters == sorted(node.device.identifiers)
    assert {0x000, PROTOCOL.cob_id(StopDrive), PROTOCOL.cob_id(GotoXY)} <= set(filters)
    assert PROTOCOL.cob_id(GotoConfirm) not in filters


def test_settings_size_mailboxes_and_wait(spoil_eds: Callable[..., Path]) -> None:
    folder = spoil_eds(("drive", "2110sub1", "DefaultValue", "1"), ("drive", "2110sub2", "DefaultValue", "20"))
    reports: list[Report] = []
    station = Station(Drive(dialects.load("drive", folder)), report=reports.append)
    station.gatekeeper.start()
    for number in range(3):
        station.gatekeeper.mailboxes.submit(Frame(number), 0.0)
    assert station.gatekeeper.mailboxes.load(0.0) == [Frame(0)]
    station.gatekeeper.mailboxes.load(0.019)
    assert reports == []
    station.gatekeeper.mailboxes.load(0.020)
    assert [(report.event, report.name) for report in reports] == [
        (Event.FRAME_DROPPED, "0x001"),
        (Event.FRAME_DROPPED, "0x002"),
    ]


def test_settings_size_the_listener_table_in_which_the_node_has_a_place(spoil_eds: Callable[..., Path]) -> None:
    station = Station(Drive(dialects.load("drive", spoil_eds(("drive", "2110sub3", "DefaultValue", "20")))))
    for number in range(19):
        station.gatekeeper.add_function(StopDrive, ignore, f"listener {number}")
    with pytest.raises(ListenerError, match=r"^lamp: the listener table is full, it has 20 places"):
        station.gatekeeper.add_function(StopDrive, ignore, "lamp")


def test_a_node_wakes_nobody_for_an_answer_that_goes_out_at_once(station: Station) -> None:
    woken: list[float] = []
    station.node.wake = lambda: woken.append(station.node.now)
    station.start(0.0)
    station.gatekeeper.receive(PROTOCOL.encode(CheckDriveRequest()), 0.5)
    station.tick(1.0)
    assert woken == []
    station.node.offer(GotoConfirm())  # from outside: nobody else would see to it
    assert woken == [1.0]
