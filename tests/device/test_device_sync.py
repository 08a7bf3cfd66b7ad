"""PDOs that follow SYNC: when TPDOs are sent, when RPDOs take effect, and what never waits."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from eurobot_od.device.device import Device
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.device.reaction import Reaction
from eurobot_od.frame import Frame
from eurobot_od.od.standard import SYNC_PRODUCER
from eurobot_od.od.values import SYNC_COB_ID
from eurobot_od.pdo.kinds import Message
from eurobot_od.sdo.wire import Abort, AbortCode
from tests.device.io_module import module
from tests.device.master import NodeWire, Wire, wired, with_sync
from tests.kit import lift
from tests.kit.lift import CATALOGUE, Brake, MoveTo, Ride, StateResponse, Trouble

STATE_TPDO, MOVE_RPDO, STOP_RPDO = 0x1801, 0x1403, 0x1401
"""Communication records of the cabin's State Response, Move To and Brake."""

STATE = 0x114
MOVE = MoveTo(1234, Ride.NORMAL, 75)
SYNC = Frame(SYNC_COB_ID, b"")


def synchronous(*pdos: tuple[int, int]) -> Wire:
    """Return a cabin with SYNC and with these transmission types."""
    wire = Wire(Device(with_sync(lift.dictionary("cabin")), None, CATALOGUE))
    for index, transmission_type in pdos:
        wire.write(index, 2, transmission_type, size=1)
    wire.sent()
    return wire


def states(wire: Wire, syncs: int) -> list[int]:
    """Return how many states each of so many SYNCs brings."""
    return [sum(frame.cob_id == STATE for frame in wire.send(SYNC).frames) for _ in range(syncs)]


def move(message: Message = MOVE) -> Frame:
    return wired("panel").device.pdo_service.transmit(message)


# TPDOs

CYCLES = [
    (1, [1, 1, 1, 1, 1, 1], "every SYNC"),
    (2, [0, 1, 0, 1, 0, 1], "every second one"),
    (3, [0, 0, 1, 0, 0, 1], "every third one"),
    (240, [0, 0, 0, 0, 0, 0], "the longest period there is"),
    (0, [0, 0, 0, 0, 0, 0], "only after the application has sent it"),
    (254, [0, 0, 0, 0, 0, 0], "event-driven"),
]


@pytest.mark.parametrize(("transmission_type", "sent", "why"), CYCLES)
def test_a_tpdo_goes_with_every_nth_sync(transmission_type: int, sent: list[int], why: str) -> None:
    assert states(synchronous((STATE_TPDO, transmission_type)), 6) == sent, why


def test_type_0_goes_with_the_next_sync_after_the_application_has_sent_it() -> None:
    wire = synchronous((STATE_TPDO, 0))
    assert wire.device.pdo_service.send(StateResponse(1), wire.now) == []
    assert wire.device.pdo_service.send(StateResponse(1500), wire.now) == []
    assert wire.send(SYNC).frames == [wire.device.protocol.encode(StateResponse(1500))]
    assert states(wire, 2) == [0, 0]


def test_a_tpdo_that_follows_sync_goes_at_no_other_time() -> None:
    wire = synchronous((STATE_TPDO, 1))
    wire.write(0x1017, 0, 0, size=2)
    wire.write(STATE_TPDO, 5, 100, size=2)
    assert wire.device.pdo_service.send(StateResponse(1500), wire.now) == []
    assert wire.wait(1.0).frames == []
    assert states(wire, 1) == [1]


@pytest.mark.parametrize("command", [NmtCommand.ENTER_PRE_OPERATIONAL, NmtCommand.STOP])
def test_sync_does_nothing_unless_operational_and_counts_anew_then(command: NmtCommand) -> None:
    wire = synchronous((STATE_TPDO, 2), (MOVE_RPDO, 1))
    wire.send(move())
    wire.command(command)
    assert wire.send(SYNC) == Reaction([])
    wire.command(NmtCommand.START)
    assert wire.send(SYNC).synchronous == ()
    assert states(wire, 2) == [1, 0]


# RPDOs


@pytest.mark.parametrize("transmission_type", [0, 1, 240])
def test_synchronous_rpdos_take_effect_with_the_next_sync(transmission_type: int) -> None:
    wire = synchronous((MOVE_RPDO, transmission_type))
    assert wire.send(move(MOVE._replace(height=1))).message is None
    assert wire.send(move()).message is None
    assert wire.read(0x2000, 1) == 0
    assert wire.send(SYNC).synchronous == (MOVE,)
    assert wire.read(0x2000, 1) == 1234
    assert wire.send(SYNC).synchronous == ()


def test_a_stop_never_waits() -> None:
    wire = synchronous((STOP_RPDO, 1))
    assert wire.send(move(Brake(Trouble.OBSTACLE))).message == Brake(Trouble.OBSTACLE)


def test_a_frame_too_short_is_reported_at_once_and_never_takes_effect() -> None:
    wire = synchronous((MOVE_RPDO, 1))
    assert [frame.data[:2] for frame in wire.send(Frame(0x108, bytes(2))).frames] == [b"\x10\x82"]
    assert wire.send(SYNC).synchronous == ()


# Over SDO

REFUSED_TYPES = [
    ("without SYNC", wired, 0),
    ("without SYNC", wired, 1),
    ("without SYNC", wired, 240),
    ("reserved", synchronous, 241),
    ("sampled at SYNC, sent by remote frame", synchronous, 252),
    ("sent by remote frame", synchronous, 253),
]


@pytest.mark.parametrize("index", [STATE_TPDO, MOVE_RPDO])
@pytest.mark.parametrize(("why", "made", "transmission_type"), REFUSED_TYPES)
def test_other_transmission_types_are_refused(
    why: str, made: Callable[[], Wire], transmission_type: int, index: int
) -> None:
    assert made().refused((index, 2), transmission_type, size=1) == AbortCode.VALUE, why


def test_a_master_moves_sync() -> None:
    wire = synchronous((STATE_TPDO, 1))
    wire.write(0x1005, 0, 0x0F1)
    assert wire.send(SYNC).frames == []
    assert [frame.cob_id for frame in wire.send(Frame(0x0F1, b"\x07")).frames] == [STATE]


REFUSED_SYNCS = [
    (1 << 30 | 0x0F0, "it sends none"),
    (1 << 29 | 0x0F0, "a 29-bit one"),
    (0x701, "that of a heartbeat"),
]


@pytest.mark.parametrize(("entry", "why"), REFUSED_SYNCS)
def test_a_sync_that_the_device_cannot_have_is_refused(entry: int, why: str) -> None:
    assert synchronous().refused((0x1005, 0), entry, size=4) == AbortCode.VALUE, why


def test_a_program_in_the_device_is_told_why_a_sync_is_refused() -> None:
    with pytest.raises(Abort, match="0x1005 gets a 29-bit COB-ID"):
        synchronous().device.objects.write((0x1005, 0), (1 << 29 | 0x0F0).to_bytes(4, "little"))


def test_no_pdo_may_have_the_identifier_of_sync() -> None:
    wire = synchronous()
    wire.write(STATE_TPDO, 1, 1 << 31 | STATE)
    assert wire.refused((STATE_TPDO, 1), SYNC_COB_ID, size=4) == AbortCode.VALUE


# The producer: a device with a period


def producer(*settings: tuple[int, int, int]) -> NodeWire:
    """Return an I/O module that is told, by index, value and size, to send SYNC."""
    wire = module()
    for index, value, size in settings:
        wire.write(index, 0, value, size)
    wire.sent()
    return wire


EVERY_100_MS, SENDS = (0x1006, 100_000, 4), (0x1005, SYNC_PRODUCER | 0x080, 4)


def syncs(wire: NodeWire, seconds: float) -> list[bytes]:
    wire.sent()
    wire.run(seconds)
    return [frame.data for frame in wire.sent() if frame.cob_id == 0x080]


def test_a_producer_sends_sync_at_its_period_unless_stopped() -> None:
    wire = producer(EVERY_100_MS, SENDS)
    assert syncs(wire, 0.35) == [b""] * 3
    wire.command(NmtCommand.START)
    assert syncs(wire, 0.1) == [b""], "the period goes on"
    wire.command(NmtCommand.STOP)
    assert syncs(wire, 1.0) == []


@pytest.mark.parametrize("settings", [(EVERY_100_MS,), (SENDS,)], ids=["no producer", "no period"])
def test_without_both_no_sync_is_sent(settings: tuple[tuple[int, int, int], ...]) -> None:
    assert syncs(producer(*settings), 1.0) == []


def test_a_producer_counts_up_to_the_overflow() -> None:
    wire = producer((0x1019, 3, 1), EVERY_100_MS, SENDS)
    assert syncs(wire, 0.45) == [b"\1", b"\2", b"\3", b"\1"]


def test_a_producers_own_pdos_follow_its_sync() -> None:
    wire = producer(EVERY_100_MS, SENDS)
    wire.command(NmtCommand.START)
    wire.sent()
    wire.run(0.25)
    assert [frame.cob_id for frame in wire.sent()] == [0x080, 0x285, 0x080, 0x285]


REFUSED_SETTINGS = [
    ([SENDS], (0x1005, SYNC_PRODUCER | 0x081, 4), AbortCode.STATE, "another identifier while it sends"),
    ([EVERY_100_MS], (0x1019, 3, 1), AbortCode.STATE, "a counter while there is a period"),
    ([], (0x1019, 1, 1), AbortCode.VALUE, "a counter up to 1"),
    ([], (0x1019, 241, 1), AbortCode.VALUE, "a counter above 240"),
    ([], (0x1005, 1 << 29 | 0x080, 4), AbortCode.VALUE, "a 29-bit identifier"),
]


@pytest.mark.parametrize(("before", "setting", "code", "why"), REFUSED_SETTINGS)
def test_a_producer_refuses(
    before: list[tuple[int, int, int]], setting: tuple[int, int, int], code: AbortCode, why: str
) -> None:
    index, value, size = setting
    assert producer(*before).refused((index, 0), value, size) == code, why


def test_a_tpdo_begins_with_the_sync_of_its_start_value() -> None:
    """CiA 301, 7.5.2.37, sub-index 6: that SYNC counts as the first one; before it the TPDO is not sent."""
    wire = synchronous((STATE_TPDO, 2))
    wire.device.objects.values |= {(0x1019, 0): 10, (STATE_TPDO, 6): 3}
    wire.send(Frame(0, b"\x80\x00"))
    wire.send(Frame(0, b"\x01\x00"))
    numbered = [wire.send(Frame(SYNC_COB_ID, bytes([number]))).frames for number in range(1, 8)]
    assert [sum(frame.cob_id == STATE for frame in each) for each in numbered] == [0, 0, 0, 1, 0, 1, 0]
