"""PDOs changed over SDO: CiA 301's procedure, what it refuses, and what the bus and the objects see of it."""

from __future__ import annotations

from math import inf
from typing import Any

import pytest
from canopen import SdoAbortedError

from eurobot_od.device.nmt import NmtCommand
from eurobot_od.errors import FieldError, StateError
from eurobot_od.frame import Frame
from eurobot_od.od.values import Address
from eurobot_od.pdo.kinds import Message, flagged_fields
from eurobot_od.robot import dialects
from eurobot_od.robot.model.messages import (
    CheckDriveResponse,
    EmergencyStop,
    Enemy2PositionResponse,
    GotoStateResponse,
    GotoXY,
    KalmanPositionResponse,
    StartConfigurationSet,
    StopDrive,
)
from eurobot_od.robot.model.values import Barriers, GotoFault, Obstacle, Source, TeamColour
from eurobot_od.robot.nodes import Drive
from eurobot_od.sdo.wire import AbortCode
from tests.device.master import NodeWire, Wire, wired
from tests.rows import rows

NOT_VALID = 1 << 31
GOTO_RPDO = 0x1403
"""Index of Goto XY in the drive; the core has it as a TPDO at 0x1803."""

GOTO_TPDO = 0x1803
GOTO = GotoXY(x=1234, y=567, angle=89, speed=75)
WIDE_X = (0x20000110, 0x2000020C, 0x2000030A, 0x20000408, 0x20000510)
"""Goto XY with 16 bits for x: 62 bits."""


def test_the_index_is_that_of_goto_xy() -> None:
    assert wired("drive").device.dictionary.objects[GOTO_RPDO].name == "Goto XY"
    assert wired("core").device.dictionary.objects[GOTO_TPDO].name == "Goto XY"


# The procedure


def test_a_receiver_follows_a_new_identifier_and_mapping() -> None:
    wire = wired()
    wire.map_pdo(GOTO_RPDO, 0x123, *WIDE_X)
    word = 1234 | 567 << 16 | 89 << 28 | 75 << 38
    reaction = wire.send(Frame(0x123, word.to_bytes(8, "little")))
    assert reaction.message == GOTO
    assert wire.send(Frame(0x008, word.to_bytes(8, "little"))).message is None
    assert 0x123 in wire.device.identifiers
    assert 0x008 not in wire.device.identifiers


def test_a_sender_follows_a_new_identifier_and_mapping() -> None:
    wire = wired("core")
    wire.map_pdo(GOTO_TPDO, 0x123, *WIDE_X)
    assert wire.device.transmit(GOTO) == Frame(0x123, (1234 | 567 << 16 | 89 << 28 | 75 << 38).to_bytes(8, "little"))


def test_a_pdo_that_is_not_valid_is_neither_sent_nor_heard() -> None:
    core, drive = wired("core"), wired("drive")
    frame = core.device.transmit(GOTO)
    core.write(GOTO_TPDO, 1, NOT_VALID | 0x008)
    drive.write(GOTO_RPDO, 1, NOT_VALID | 0x008)
    with pytest.raises(StateError, match="core has no TPDO for GotoXY"):
        core.device.transmit(GOTO)
    assert drive.send(frame).message is None


def test_a_frame_is_packed_by_one_mapping_whatever_step_a_change_has_reached() -> None:
    wire = wired("core")
    old, new = wire.device.transmit(GOTO), Frame(0x008, (1234 | 567 << 16 | 89 << 28 | 75 << 38).to_bytes(8, "little"))
    steps: list[tuple[int, int, int, int]] = [
        (GOTO_TPDO, 1, NOT_VALID | 0x008, 4),
        (GOTO_TPDO + 0x200, 0, 0, 1),
        *((GOTO_TPDO + 0x200, subindex, entry, 4) for subindex, entry in enumerate(WIDE_X, 1)),
        (GOTO_TPDO + 0x200, 0, len(WIDE_X), 1),
        (GOTO_TPDO, 1, 0x008, 4),
    ]
    sent: list[Frame | None] = [wire.device.transmit(GOTO)]
    for index, subindex, value, size in steps:
        wire.write(index, subindex, value, size)
        valid = not wire.read(GOTO_TPDO, 1) & NOT_VALID
        sent.append(wire.device.transmit(GOTO) if valid else None)
    assert sent == [old, *[None] * (len(steps) - 1), new]


def test_a_pdo_without_data_is_sent_and_heard() -> None:
    wire = wired()
    wire.map_pdo(index_of(wire, "Check Drive Response"), 0x33)
    assert wire.device.transmit(CheckDriveResponse()) == Frame(0x33, b"")


def index_of(wire: Wire, name: str) -> int:
    return next(pdo.index for pdo in wire.device.dictionary.pdos if pdo.name == name)


@pytest.mark.parametrize("dialect", ["canopen", "firmware2014"])
@pytest.mark.parametrize("node", ["core", "drive", "navigation"])
def test_stock_canopen_reads_and_rewrites_all_pdos(node: str, dialect: str) -> None:
    wire = wired(node, dialect)
    before = [binding.layout.slots for binding in wire.device.protocol.bindings]
    remote: Any = wire.add_node(wire.device.node_id, str(wire.device.dictionary.file))
    for pdos in (remote.tpdo, remote.rpdo):
        pdos.read()
        pdos.save()
    assert [binding.layout.slots for binding in wire.device.protocol.bindings] == before


def test_stock_canopen_moves_a_pdo() -> None:
    wire = wired("core")
    remote: Any = wire.add_node(1, str(wire.device.dictionary.file))
    remote.tpdo.read()
    pdo = remote.tpdo[GOTO_TPDO - 0x1800 + 1]
    pdo.cob_id = 0x234
    pdo.save()
    assert wire.device.transmit(GOTO).cob_id == 0x234


# What is refused

REFUSED: list[tuple[str, Address, int, int, AbortCode, str]] = [
    ("core", (0x1803, 1), 0x009, 4, AbortCode.STATE, "another identifier while the PDO is valid"),
    ("core", (0x1803, 1), 0x0000_0008, 4, AbortCode.STATE, "another RTR bit while the PDO is valid"),
    ("core", (0x1803, 1), 0xA000_0008, 4, AbortCode.VALUE, "a 29-bit identifier"),
    ("core", (0x1803, 1), 0x8000_0800, 4, AbortCode.VALUE, "more than 11 bits"),
    ("core", (0x1803, 2), 1, 1, AbortCode.VALUE, "synchronous, without SYNC"),
    ("core", (0x1803, 2), 252, 1, AbortCode.VALUE, "on remote request"),
    ("core", (0x1803, 3), 10, 2, AbortCode.STATE, "an inhibit time while the PDO is valid"),
    ("drive", (0x1403, 3), 10, 2, AbortCode.VALUE, "an inhibit time of an RPDO"),
    ("core", (0x1A03, 0), 0, 1, AbortCode.STATE, "the mapping's length while the PDO is valid"),
    ("core", (0x1A03, 1), 0x20000110, 4, AbortCode.STATE, "a mapping entry while the PDO is valid"),
    ("core", (0x1A03, 0), 99, 1, AbortCode.TOO_HIGH, "more entries than there are"),
    ("core", (0x1A03, 99), 0, 4, AbortCode.NO_SUBINDEX, "an entry that is not there"),
]


@rows("node, address, value, size, code, why", REFUSED)
def test_a_valid_pdo_cannot_be_changed(
    node: str, address: Address, value: int, size: int, code: AbortCode, why: str
) -> None:
    wire = wired(node)
    before, values = wire.device.protocol, dict(wire.device.objects.values)
    assert wire.refused(address, value, size) == code, why
    assert wire.device.protocol is before
    assert wire.device.objects.values == values


UNMAPPABLE: list[tuple[str, int, int, AbortCode, str]] = [
    ("core", 0x1803, 0x29990108, AbortCode.NO_OBJECT, "no such object"),
    ("core", 0x1803, 0x20000908, AbortCode.NO_OBJECT, "no such sub-index"),
    ("core", 0x1803, 0x10170010, AbortCode.NOT_MAPPABLE, "an object that is not mappable"),
    ("core", 0x1803, 0x20000111, AbortCode.NOT_MAPPABLE, "17 bits of UNSIGNED16"),
    ("core", 0x1803, 0x20000100, AbortCode.NOT_MAPPABLE, "no bits"),
    ("core", 0x1803, 0x00050008, AbortCode.NO_OBJECT, "a dummy that the EDS does not have"),
    ("core", 0x1803, 0x2010010C, AbortCode.NOT_MAPPABLE, "an object for RPDOs in a TPDO"),
    ("drive", 0x1403, 0x2011010C, AbortCode.NOT_MAPPABLE, "an object for TPDOs in an RPDO"),
]


@rows("node, index, entry, code, why", UNMAPPABLE)
def test_what_cannot_be_mapped_is_refused(node: str, index: int, entry: int, code: AbortCode, why: str) -> None:
    wire = wired(node)
    wire.write(index, 1, NOT_VALID | 0x008)
    wire.write(index + 0x200, 0, 0, size=1)
    assert wire.refused((index + 0x200, 1), entry, size=4) == code, why


def open_goto(*entries: int) -> Wire:
    """Return the core with Goto XY not valid and these entries written, none of them in use yet."""
    wire = wired("core")
    wire.write(GOTO_TPDO, 1, NOT_VALID | 0x008)
    wire.write(GOTO_TPDO + 0x200, 0, 0, size=1)
    for subindex, entry in enumerate(entries, 1):
        wire.write(GOTO_TPDO + 0x200, subindex, entry)
    return wire


def test_over_64_bits_are_refused() -> None:
    wire = open_goto(*[0x20000110] * 4, 0x20000408)
    assert wire.refused((GOTO_TPDO + 0x200, 0), 5, size=1) == AbortCode.MAPPING_TOO_LONG
    assert wire.read(GOTO_TPDO + 0x200, 0) == 0


def test_an_entry_in_use_is_fixed() -> None:
    wire = open_goto(*WIDE_X)
    wire.write(GOTO_TPDO + 0x200, 0, 5, size=1)
    assert wire.refused((GOTO_TPDO + 0x200, 1), 0x2000010C, size=4) == AbortCode.STATE


def test_an_empty_entry_in_the_middle_is_refused() -> None:
    wire = open_goto(0x20000110, 0, 0x20000210)
    assert wire.refused((GOTO_TPDO + 0x200, 0), 3, size=1) == AbortCode.NO_OBJECT


NOT_TO_VALIDATE: list[tuple[tuple[int, ...], int, AbortCode, str]] = [
    (WIDE_X, 0x000, AbortCode.VALUE, "the identifier of NMT"),
    (WIDE_X, 0x601, AbortCode.VALUE, "the identifier of an SDO"),
    (WIDE_X, 0x581, AbortCode.VALUE, "the identifier of an SDO's answer"),
    (WIDE_X, 0x702, AbortCode.VALUE, "the identifier of a heartbeat"),
    (WIDE_X, 0x081, AbortCode.VALUE, "the identifier of our own EMCY"),
    (WIDE_X, 0x004, AbortCode.INCOMPATIBLE, "the identifier of another message"),
    (WIDE_X[:3], 0x008, AbortCode.INCOMPATIBLE, "a goto without its speed"),
    ((*WIDE_X[:4], 0x20000408), 0x008, AbortCode.INCOMPATIBLE, "a field twice"),
    ((0x20200101,), 0x008, AbortCode.INCOMPATIBLE, "fields of another message"),
]


@rows("entries, cob_id, code, why", NOT_TO_VALIDATE)
def test_what_does_not_hold_together_does_not_become_valid(
    entries: tuple[int, ...], cob_id: int, code: AbortCode, why: str
) -> None:
    wire = open_goto(*entries)
    wire.write(GOTO_TPDO + 0x200, 0, len(entries), size=1)
    before = wire.device.protocol
    assert wire.refused((GOTO_TPDO, 1), cob_id, size=4) == code, why
    assert wire.device.protocol is before
    assert wire.read(GOTO_TPDO, 1) == NOT_VALID | 0x008


POSITIONS = [(0, 0, 0), (3000, 2000, 359), (255, 255, 254), (254, 255, None), (None, None, None)]
VALUES: list[Message] = [
    *(KalmanPositionResponse(*place, source) for place in POSITIONS for source in Source),
    *(Enemy2PositionResponse(*place, source) for place in POSITIONS for source in Source),
    *map(GotoStateResponse, (0, 1, 0x0FFFFE, None, *GotoFault)),
    *(EmergencyStop(each) for each in Obstacle),
    *(GotoXY(x, y, angle, speed, Barriers(0xFFFF)) for x, y, angle, speed in ((0, 0, 0, 0), (3000, 2000, 359, 100))),
    *(StartConfigurationSet(each, 2, 1, 50, 50) for each in TeamColour),
]
"""The extremes of every field, and what means "unknown"."""

SENDERS = [
    ("drive", KalmanPositionResponse),
    ("drive", GotoStateResponse),
    ("navigation", Enemy2PositionResponse),
    ("core", EmergencyStop),
    ("core", GotoXY),
    ("core", StartConfigurationSet),
]


def refusal_of(wire: Wire, index: int, cob_id: int, widths: list[int]) -> AbortCode | None:
    """Map a PDO's own objects with these bits; return why the device does not take that, None if it does."""
    objects = [wire.read(index + 0x200, sub) & 0xFFFFFF00 for sub in range(1, len(widths) + 1)]
    try:
        wire.map_pdo(index, cob_id, *(each | bits for each, bits in zip(objects, widths)))
    except SdoAbortedError as refusal:
        return AbortCode(refusal.code)
    return None


@pytest.mark.parametrize(("node", "kind"), SENDERS, ids=lambda each: getattr(each, "__name__", each))
def test_a_mapping_that_sdo_accepts_encodes_every_value(node: str, kind: type[Message]) -> None:
    wire = wired(node)
    own = wire.device.protocol.binding(kind)
    values = [each for each in VALUES if type(each) is kind]
    bits = [entry.bits for entry in own.pdo.mapping]
    most = [entry.type.size * 8 for entry in own.pdo.mapping]
    for place, top in enumerate(most):
        for width in range(1, min(top, bits[place] + 64 - sum(bits)) + 1):
            widths = [*bits[:place], width, *bits[place + 1 :]]
            refusal = refusal_of(wire, own.pdo.index, own.cob_id, widths)
            if refusal is None:
                assert [wire.device.protocol.decode(*wire.device.transmit(each)) for each in values] == values, widths
            else:
                assert (refusal, width < bits[place]) == (AbortCode.INCOMPATIBLE, True)


def test_a_position_in_natural_widths_is_sent_when_it_is_known_unknown_and_asked_for() -> None:
    wire = NodeWire(Drive(dialects.load("drive")))
    assert refusal_of(wire, 0x1802, 0x100, [16, 16, 16, 8]) is None
    assert wire.send(Frame(0x0C0)).frames == [Frame(0x100, bytes.fromhex("ff00ff00ff0300"))]
    read = wire.device.protocol.decode(0x100, bytes.fromhex("a10ff00a100007"))
    assert flagged_fields(read) == ["x", "y", "source"]
    with pytest.raises(FieldError):
        wire.device.transmit(read)


# Values


@pytest.mark.parametrize("dialect", ["canopen", "firmware2014"])
def test_what_was_received_is_read_over_sdo(dialect: str) -> None:
    core, drive = wired("core", dialect), wired("drive", dialect)
    drive.send(core.device.transmit(GOTO))
    assert [drive.read(0x2000, subindex) for subindex in range(1, 6)] == [1234, 567, 89, 75, 0]


def test_what_was_received_under_an_old_mapping_keeps_its_meaning() -> None:
    core, drive = wired("core"), wired("drive")
    drive.send(core.device.transmit(GOTO))
    drive.map_pdo(GOTO_RPDO, 0x123, *WIDE_X)
    assert [drive.read(0x2000, subindex) for subindex in range(1, 6)] == [1234, 567, 89, 75, 0]


def test_what_was_sent_is_read_over_sdo() -> None:
    wire = wired()
    wire.device.send(KalmanPositionResponse(1500, 1000, 90, Source.INTERNAL), wire.now)
    assert [wire.read(0x2011, subindex) for subindex in range(1, 5)] == [1500, 1000, 90, 0]


def test_a_frame_too_short_changes_no_value() -> None:
    core, drive = wired("core"), wired("drive")
    drive.send(core.device.transmit(GOTO))
    drive.send(Frame(0x008, bytes(7)))
    assert drive.read(0x2000, 1) == 1234


@pytest.mark.parametrize("dialect", ["canopen", "firmware2014"])
def test_what_a_core_sent_last_is_what_its_timed_tpdo_sends(dialect: str) -> None:
    wire = wired("core", dialect)
    wire.write(GOTO_TPDO, 5, 100, size=2)
    wire.device.send(GOTO, wire.now)
    wire.wait(0.1)
    assert wire.sent()[-1] == wire.device.protocol.encode(GOTO)


# Times


def test_an_event_timer_sends_a_tpdo_again_and_again_while_operational() -> None:
    wire = wired()
    index = index_of(wire, "Goto State Response")
    wire.write(0x1017, 0, 0, size=2)
    wire.write(index, 5, 200, size=2)
    wire.device.send(GotoStateResponse(1500), wire.now)
    wire.sent()
    assert wire.device.next_wakeup == pytest.approx(0.2)
    for _ in range(4):
        wire.wait(0.1)
    assert wire.sent() == [wire.device.protocol.encode(GotoStateResponse(1500))] * 2
    wire.command(NmtCommand.ENTER_PRE_OPERATIONAL)
    assert wire.device.next_wakeup == inf
    assert wire.wait(1.0).frames == []


def test_an_inhibit_time_holds_a_tpdo_back_and_the_newest_is_sent() -> None:
    wire = wired()
    index = index_of(wire, "Goto State Response")
    wire.write(0x1017, 0, 0, size=2)
    wire.write(index, 1, NOT_VALID | 0x014)
    wire.write(index, 3, 1000, size=2)
    wire.write(index, 1, 0x014)
    first, second, third = (wire.device.protocol.encode(GotoStateResponse(time)) for time in (3, 2, 1))
    assert wire.device.send(GotoStateResponse(3), 0.0) == [first]
    assert wire.device.send(GotoStateResponse(2), 0.01) == []
    assert wire.device.send(GotoStateResponse(1), 0.02) == []
    assert wire.device.next_wakeup == 0.1
    assert wire.wait(0.1).frames == [third]
    assert wire.device.send(GotoStateResponse(2), 0.15) == []
    assert wire.wait(0.1).frames == [second]


def test_a_stop_is_never_held_back() -> None:
    wire = wired("core")
    index = index_of(wire, "Stop Drive")
    wire.write(index, 1, NOT_VALID | 0x004)
    wire.write(index, 3, 1000, size=2)
    wire.write(index, 1, 0x004)
    assert [wire.device.send(StopDrive(), 0.0) for _ in range(3)] == [[Frame(0x004)]] * 3
