"""The settings of transmission: mailboxes, how long a frame waits for one, the listener table (document, 6)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from time import perf_counter

import pytest

from eurobot_od.controller import Event, Report
from eurobot_od.device.station import Station
from eurobot_od.errors import ListenerError
from eurobot_od.frame import Frame
from eurobot_od.robot import dialects
from eurobot_od.robot.gatekeeper import MAILBOX_WAIT, MAILBOXES
from eurobot_od.robot.model.messages import StopDrive
from eurobot_od.robot.nodes import Core, Drive, Navigation


def ignore(*_: object) -> None:
    """A listener that does nothing."""


@pytest.mark.parametrize("kind", [Core, Drive, Navigation])
def test_a_robot_s_node_has_the_mailboxes_of_the_document(kind: type[Core | Drive | Navigation]) -> None:
    mailboxes = kind(dialects.load(kind.__name__.lower())).controller(None, perf_counter).mailboxes
    assert (mailboxes.count, mailboxes.wait) == (MAILBOXES, MAILBOX_WAIT) == (3, 0.050)


def test_settings_size_mailboxes_and_wait(spoil_eds: Callable[..., Path]) -> None:
    folder = spoil_eds(("drive", "2110sub1", "DefaultValue", "1"), ("drive", "2110sub2", "DefaultValue", "20"))
    reports: list[Report] = []
    station = Station(Drive(dialects.load("drive", folder)), report=reports.append)
    station.controller.start()
    for number in range(3):
        station.controller.queue.submit(Frame(number), 0.0)
    assert station.controller.queue.load(0.0) == [Frame(0)]
    station.controller.queue.load(0.019)
    assert reports == []
    station.controller.queue.load(0.020)
    assert [(report.event, report.name) for report in reports] == [
        (Event.FRAME_DROPPED, "0x001"),
        (Event.FRAME_DROPPED, "0x002"),
    ]


def test_settings_size_the_listener_table_in_which_the_node_has_a_place(spoil_eds: Callable[..., Path]) -> None:
    station = Station(Drive(dialects.load("drive", spoil_eds(("drive", "2110sub3", "DefaultValue", "20")))))
    for number in range(19):
        station.controller.add_function(StopDrive, ignore, f"listener {number}")
    with pytest.raises(ListenerError, match=r"^lamp: the listener table is full, it has 20 places"):
        station.controller.add_function(StopDrive, ignore, "lamp")
