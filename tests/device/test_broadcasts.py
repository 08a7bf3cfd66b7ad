"""Emergencies: reported once, in the order they came, as fast as the inhibit time allows (CiA 301, 7.2.7)."""

from __future__ import annotations

from math import inf

import pytest

from eurobot_od.device.broadcasts import HISTORY, PASSING, WAITING, Emergencies
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.frame import Frame
from eurobot_od.od.standard import ErrorCode
from tests.device.master import wired
from tests.kit.lift import MoveTo, Ride

COB_ID = 0x082


def emergencies(inhibit: float = 0.0) -> Emergencies:
    return Emergencies(lambda: COB_ID, lambda: inhibit)


def report(code: int, register: int, info: str = "") -> Frame:
    return Frame(COB_ID, code.to_bytes(2, "little") + bytes([register]) + bytes.fromhex(info).ljust(5, b"\0"))


CODES = [
    (ErrorCode.PDO_TOO_SHORT, 0x8210, 0x11),
    (ErrorCode.PDO_TOO_LONG, 0x8220, 0x11),
    (ErrorCode.HEARTBEAT_LOST, 0x8130, 0x11),
    (ErrorCode.OVERRUN, 0x8110, 0x11),
    (ErrorCode.ERROR_PASSIVE, 0x8120, 0x11),
    (ErrorCode.RECOVERED_FROM_BUS_OFF, 0x8140, 0x11),
    (0xFF01, 0xFF01, 0x81),
]


@pytest.mark.parametrize(("error", "code", "register"), CODES)
def test_an_error_is_reported_when_it_comes_and_when_it_goes(error: ErrorCode, code: int, register: int) -> None:
    ours = emergencies()
    ours.raised(error, "what", b"\x07")
    ours.raised(error, "what")
    assert ours.due(0.0) == [report(code, register, "07")]
    ours.cleared("what")
    ours.cleared("what")
    assert ours.due(0.0) == [report(0, 0)]


def test_the_register_shows_all_that_is_there() -> None:
    ours = emergencies()
    ours.raised(ErrorCode.PDO_TOO_SHORT, "one")
    ours.raised(0xFF01, "other")
    assert ours.register == 0x91
    ours.cleared("one")
    assert ours.register == 0x81


def test_the_history_has_the_newest_first_and_an_end() -> None:
    ours = emergencies()
    for number in range(HISTORY):
        ours.raised(ErrorCode.PDO_TOO_SHORT, number)
    ours.raised(ErrorCode.OVERRUN, "newest")
    assert ours.history == [ErrorCode.OVERRUN] + [ErrorCode.PDO_TOO_SHORT] * (HISTORY - 1)


def test_the_inhibit_time_spaces_reports() -> None:
    ours = emergencies(inhibit=0.1)
    ours.raised(ErrorCode.PDO_TOO_SHORT, "one")
    ours.raised(ErrorCode.PDO_TOO_LONG, "other")
    assert ours.due(1.0) == [report(0x8210, 0x11)]
    assert ours.next == 1.1
    assert ours.due(1.05) == []
    assert ours.due(1.1) == [report(0x8220, 0x11)]
    assert ours.next == inf


def test_a_full_emergency_queue_keeps_the_newest() -> None:
    ours = emergencies(inhibit=1.0)
    for number in range(WAITING + 5):
        ours.raised(ErrorCode.PDO_TOO_SHORT, number)
    ours.raised(ErrorCode.OVERRUN, "newest")
    sent = [frame for second in range(WAITING + 5) for frame in ours.due(float(second))]
    assert len(sent) == WAITING
    assert sent[-1] == report(0x8110, 0x11)


def test_an_error_of_a_moment_passes() -> None:
    ours = emergencies()
    ours.happened(ErrorCode.OVERRUN, 0.0)
    ours.happened(ErrorCode.OVERRUN, 0.5)
    assert ours.due(0.5) == [report(0x8110, 0x11)]
    assert ours.next == 0.5 + PASSING
    assert ours.due(0.5 + PASSING) == [report(0, 0)]
    assert ours.next == inf


def test_a_device_without_an_identifier_for_it_reports_nothing() -> None:
    ours = Emergencies(lambda: None, lambda: 0.0)
    ours.raised(ErrorCode.OVERRUN, "what")
    assert ours.due(0.0) == []
    assert ours.history == [ErrorCode.OVERRUN]


# The device

TOO_SHORT = Frame(0x108, bytes(2))
TOO_LONG = Frame(0x110, bytes(1))


def test_errors_are_read_and_cleared_over_sdo() -> None:
    wire = wired()
    wire.send(TOO_SHORT)
    wire.send(TOO_LONG)
    assert wire.read(0x1001) == 0x11
    assert [wire.read(0x1003, subindex) for subindex in range(3)] == [2, 0x8220, 0x8210]
    wire.write(0x1003, 0, 0, size=1)
    assert wire.read(0x1003, 0) == 0
    assert wire.read(0x1001) == 0x11, "the errors are still there"


def test_stock_canopen_understands_the_emergencies() -> None:
    wire = wired()
    remote = wire.add_node(2, wire.device.dictionary.objects)
    wire.send(TOO_SHORT)
    (entry,) = remote.emcy.active
    assert (entry.code, entry.register, entry.data) == (0x8210, 0x11, b"\x08\x01\x02\x00\x00")
    wire.send(wired("panel").device.pdo_service.transmit(MoveTo(0, Ride.NORMAL, 0)))
    assert remote.emcy.active == []


def test_the_inhibit_time_is_the_object_s() -> None:
    wire = wired()
    wire.write(0x1015, 0, 1000, size=2)
    assert len(wire.send(TOO_SHORT).frames) == 1
    assert wire.send(TOO_LONG).frames == []
    assert wire.wait(0.0999).frames == []
    assert wire.wait(0.0001).frames == [report(0x8220, 0x11, "100101")]


def test_a_stopped_device_keeps_its_reports_until_it_may_talk() -> None:
    wire = wired()
    wire.command(NmtCommand.STOP)
    wire.send(Frame(0x104, bytes(1)))
    assert [*wire.device.emergencies.errors.values()] == [ErrorCode.PDO_TOO_LONG]
    wire.sent()
    assert wire.command(NmtCommand.START).frames == [report(0x8220, 0x11, "040101")]


def test_controller_errors_become_emergencies() -> None:
    wire = wired()
    wire.device.emergencies.happened(ErrorCode.OVERRUN, wire.now)
    assert wire.wait(0.0).frames == [report(0x8110, 0x11)]
    assert report(0, 0) in wire.wait(PASSING).frames
