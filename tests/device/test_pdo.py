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
from eurobot_od.sdo.wire import AbortCode
from tests.device.master import NodeWire, Wire, wired
from tests.kit import lift
from tests.kit.lift import (
    Brake,
    Building,
    Cabin,
    CheckCabinResponse,
    Configure,
    FloorResponse,
    Halt,
    MoveTo,
    NoTime,
    PlaceResponse,
    Ride,
    Sensor,
    StateResponse,
    Trouble,
)

NOT_VALID = 1 << 31
MOVE_RPDO = 0x1403
"""Index of Move To in the cabin; the panel has it as a TPDO at 0x1803."""

MOVE_TPDO = 0x1803
MOVE = MoveTo(1234, Ride.NORMAL, 75)
WIDE = (0x20000110, 0x20000208, 0x20000308, 0x20000410)
"""Move To in whole bytes: 48 bits."""

WORD = 1234 | 75 << 24


def test_the_index_is_that_of_move_to() -> None:
    assert wired("cabin").device.dictionary.objects[MOVE_RPDO].name == "Move To"
    assert wired("panel").device.dictionary.objects[MOVE_TPDO].name == "Move To"


# The procedure


def test_a_receiver_follows_a_new_identifier_and_mapping() -> None:
    wire = wired()
    wire.map_pdo(MOVE_RPDO, 0x123, *WIDE)
    reaction = wire.send(Frame(0x123, WORD.to_bytes(6, "little")))
    assert reaction.message == MOVE
    assert wire.send(Frame(0x108, WORD.to_bytes(6, "little"))).message is None
    assert 0x123 in wire.device.identifiers
    assert 0x108 not in wire.device.identifiers


def test_a_sender_follows_a_new_identifier_and_mapping() -> None:
    wire = wired("panel")
    wire.map_pdo(MOVE_TPDO, 0x123, *WIDE)
    assert wire.device.pdo_service.transmit(MOVE) == Frame(0x123, WORD.to_bytes(6, "little"))


def test_a_pdo_that_is_not_valid_is_neither_sent_nor_heard() -> None:
    panel, cabin = wired("panel"), wired("cabin")
    frame = panel.device.pdo_service.transmit(MOVE)
    panel.write(MOVE_TPDO, 1, NOT_VALID | 0x108)
    cabin.write(MOVE_RPDO, 1, NOT_VALID | 0x108)
    with pytest.raises(StateError, match="panel has no TPDO for MoveTo"):
        panel.device.pdo_service.transmit(MOVE)
    assert cabin.send(frame).message is None


def test_a_frame_is_packed_by_one_mapping_whatever_step_a_change_has_reached() -> None:
    wire = wired("panel")
    old, new = wire.device.pdo_service.transmit(MOVE), Frame(0x108, WORD.to_bytes(6, "little"))
    steps: list[tuple[int, int, int, int]] = [
        (MOVE_TPDO, 1, NOT_VALID | 0x108, 4),
        (MOVE_TPDO + 0x200, 0, 0, 1),
        *((MOVE_TPDO + 0x200, subindex, entry, 4) for subindex, entry in enumerate(WIDE, 1)),
        (MOVE_TPDO + 0x200, 0, len(WIDE), 1),
        (MOVE_TPDO, 1, 0x108, 4),
    ]
    sent: list[Frame | None] = [wire.device.pdo_service.transmit(MOVE)]
    for index, subindex, value, size in steps:
        wire.write(index, subindex, value, size)
        valid = not wire.read(MOVE_TPDO, 1) & NOT_VALID
        sent.append(wire.device.pdo_service.transmit(MOVE) if valid else None)
    assert sent == [old, *[None] * (len(steps) - 1), new]


def test_a_pdo_without_data_is_sent_and_heard() -> None:
    wire = wired()
    wire.map_pdo(index_of(wire, "Check Cabin Response"), 0x33)
    assert wire.device.pdo_service.transmit(CheckCabinResponse()) == Frame(0x33, b"")


def index_of(wire: Wire, name: str) -> int:
    return next(pdo.index for pdo in wire.device.dictionary.pdos if pdo.name == name)


@pytest.mark.parametrize("dialect", [lift.DIALECT, lift.REVERSED])
@pytest.mark.parametrize("node", ["panel", "cabin", "door"])
def test_stock_canopen_reads_and_rewrites_all_pdos(node: str, dialect: str) -> None:
    wire = wired(node, dialect)
    before = [binding.layout.slots for binding in wire.device.protocol.bindings]
    remote: Any = wire.add_node(wire.device.node_id, wire.device.dictionary.objects)
    for pdos in (remote.tpdo, remote.rpdo):
        pdos.read()
        pdos.save()
    assert [binding.layout.slots for binding in wire.device.protocol.bindings] == before


def test_stock_canopen_moves_a_pdo() -> None:
    wire = wired("panel")
    remote: Any = wire.add_node(1, wire.device.dictionary.objects)
    remote.tpdo.read()
    pdo = remote.tpdo[MOVE_TPDO - 0x1800 + 1]
    pdo.cob_id = 0x234
    pdo.save()
    assert wire.device.pdo_service.transmit(MOVE).cob_id == 0x234


# What is refused

REFUSED: list[tuple[str, Address, int, int, AbortCode, str]] = [
    ("panel", (0x1803, 1), 0x109, 4, AbortCode.STATE, "another identifier while the PDO is valid"),
    ("panel", (0x1803, 1), 0x0000_0108, 4, AbortCode.STATE, "another RTR bit while the PDO is valid"),
    ("panel", (0x1803, 1), 0xA000_0108, 4, AbortCode.VALUE, "a 29-bit identifier"),
    ("panel", (0x1803, 1), 0x8000_0800, 4, AbortCode.VALUE, "more than 11 bits"),
    ("panel", (0x1803, 2), 1, 1, AbortCode.VALUE, "synchronous, without SYNC"),
    ("panel", (0x1803, 2), 252, 1, AbortCode.VALUE, "on remote request"),
    ("panel", (0x1803, 3), 10, 2, AbortCode.STATE, "an inhibit time while the PDO is valid"),
    ("cabin", (0x1403, 3), 10, 2, AbortCode.VALUE, "an inhibit time of an RPDO"),
    ("panel", (0x1A03, 0), 0, 1, AbortCode.STATE, "the mapping's length while the PDO is valid"),
    ("panel", (0x1A03, 1), 0x20000110, 4, AbortCode.STATE, "a mapping entry while the PDO is valid"),
    ("panel", (0x1A03, 0), 99, 1, AbortCode.TOO_HIGH, "more entries than there are"),
    ("panel", (0x1A03, 99), 0, 4, AbortCode.NO_SUBINDEX, "an entry that is not there"),
]


@pytest.mark.parametrize(("node", "address", "value", "size", "code", "why"), REFUSED)
def test_a_valid_pdo_cannot_be_changed(
    node: str, address: Address, value: int, size: int, code: AbortCode, why: str
) -> None:
    wire = wired(node)
    before, values = wire.device.protocol, dict(wire.device.objects.values)
    assert wire.refused(address, value, size) == code, why
    assert wire.device.protocol is before
    assert wire.device.objects.values == values


UNMAPPABLE: list[tuple[str, int, int, AbortCode, str]] = [
    ("panel", 0x1803, 0x29990108, AbortCode.NO_OBJECT, "no such object"),
    ("panel", 0x1803, 0x20000908, AbortCode.NO_OBJECT, "no such sub-index"),
    ("panel", 0x1803, 0x10170010, AbortCode.NOT_MAPPABLE, "an object that is not mappable"),
    ("panel", 0x1803, 0x20000111, AbortCode.NOT_MAPPABLE, "17 bits of UNSIGNED16"),
    ("panel", 0x1803, 0x20000100, AbortCode.NOT_MAPPABLE, "no bits"),
    ("panel", 0x1803, 0x00050008, AbortCode.NO_OBJECT, "a dummy that the EDS does not have"),
    ("panel", 0x1803, 0x2010010C, AbortCode.NOT_MAPPABLE, "an object for RPDOs in a TPDO"),
    ("cabin", 0x1403, 0x2011010C, AbortCode.NOT_MAPPABLE, "an object for TPDOs in an RPDO"),
]


@pytest.mark.parametrize(("node", "index", "entry", "code", "why"), UNMAPPABLE)
def test_unmappable_objects_are_refused(node: str, index: int, entry: int, code: AbortCode, why: str) -> None:
    wire = wired(node)
    wire.write(index, 1, NOT_VALID | 0x108)
    wire.write(index + 0x200, 0, 0, size=1)
    assert wire.refused((index + 0x200, 1), entry, size=4) == code, why


def open_move(*entries: int) -> Wire:
    """Return the panel with Move To not valid and these entries written, none of them in use yet."""
    wire = wired("panel")
    wire.write(MOVE_TPDO, 1, NOT_VALID | 0x108)
    wire.write(MOVE_TPDO + 0x200, 0, 0, size=1)
    for subindex, entry in enumerate(entries, 1):
        wire.write(MOVE_TPDO + 0x200, subindex, entry)
    return wire


def test_over_64_bits_are_refused() -> None:
    wire = open_move(*[0x20000110] * 4, 0x20000308)
    assert wire.refused((MOVE_TPDO + 0x200, 0), 5, size=1) == AbortCode.MAPPING_TOO_LONG
    assert wire.read(MOVE_TPDO + 0x200, 0) == 0


def test_an_entry_in_use_is_fixed() -> None:
    wire = open_move(*WIDE)
    wire.write(MOVE_TPDO + 0x200, 0, len(WIDE), size=1)
    assert wire.refused((MOVE_TPDO + 0x200, 1), 0x2000010C, size=4) == AbortCode.STATE


def test_an_empty_entry_in_the_middle_is_refused() -> None:
    wire = open_move(0x20000110, 0, 0x20000310)
    assert wire.refused((MOVE_TPDO + 0x200, 0), 3, size=1) == AbortCode.NO_OBJECT


NOT_TO_VALIDATE: list[tuple[tuple[int, ...], int, AbortCode, str]] = [
    (WIDE, 0x000, AbortCode.VALUE, "the identifier of NMT"),
    (WIDE, 0x601, AbortCode.VALUE, "the identifier of an SDO"),
    (WIDE, 0x581, AbortCode.VALUE, "the identifier of an SDO's answer"),
    (WIDE, 0x702, AbortCode.VALUE, "the identifier of a heartbeat"),
    (WIDE, 0x081, AbortCode.VALUE, "the identifier of our own EMCY"),
    (WIDE, 0x104, AbortCode.INCOMPATIBLE, "the identifier of another message"),
    (WIDE[:2], 0x108, AbortCode.INCOMPATIBLE, "a move without its speed"),
    ((*WIDE[:3], 0x20000308), 0x108, AbortCode.INCOMPATIBLE, "a field twice"),
    ((0x20200101,), 0x108, AbortCode.INCOMPATIBLE, "fields of another message"),
]


@pytest.mark.parametrize(("entries", "cob_id", "code", "why"), NOT_TO_VALIDATE)
def test_an_inconsistent_pdo_does_not_become_valid(
    entries: tuple[int, ...], cob_id: int, code: AbortCode, why: str
) -> None:
    wire = open_move(*entries)
    wire.write(MOVE_TPDO + 0x200, 0, len(entries), size=1)
    before = wire.device.protocol
    assert wire.refused((MOVE_TPDO, 1), cob_id, size=4) == code, why
    assert wire.device.protocol is before
    assert wire.read(MOVE_TPDO, 1) == NOT_VALID | 0x108


POSITIONS = [(0, 0, 0), (3000, 2000, 359), (255, 255, 254), (254, 255, None), (None, None, None)]
VALUES: list[Message] = [
    *(PlaceResponse(*place, sensor) for place in POSITIONS for sensor in Sensor),
    *(FloorResponse(*place, sensor) for place in POSITIONS for sensor in Sensor),
    *map(StateResponse, (0, 1, 60000, *NoTime)),
    *(Brake(each) for each in Trouble),
    MoveTo(0, Ride.NORMAL, 0),
    MoveTo(3000, Ride.FIRE, 100, 600),
    *(Configure(each, 2, 1, 50) for each in Building),
]
"""The extremes of every field, and what means "unknown"."""

SENDERS = [
    ("cabin", PlaceResponse),
    ("cabin", StateResponse),
    ("door", FloorResponse),
    ("panel", Brake),
    ("panel", MoveTo),
    ("panel", Configure),
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
                assert [
                    wire.device.protocol.decode(*wire.device.pdo_service.transmit(each)) for each in values
                ] == values, widths
            else:
                assert (refusal, width < bits[place]) == (AbortCode.INCOMPATIBLE, True)


class LostCabin(Cabin):
    """A cabin that does not know where it is."""

    def place(self) -> PlaceResponse:
        return PlaceResponse(None, None, None, Sensor.NONE)


def test_a_position_in_natural_widths_is_sent_when_it_is_known_unknown_and_asked_for() -> None:
    wire = NodeWire(LostCabin(lift.dictionary("cabin")))
    assert refusal_of(wire, 0x1802, 0x205, [16, 16, 16, 8]) is None
    assert wire.send(Frame(0x1C5)).frames == [Frame(0x205, bytes.fromhex("ff00ff00ff0300"))]
    read = wire.device.protocol.decode(0x205, bytes.fromhex("a10ff00a100007"))
    assert flagged_fields(read) == ["height", "sway", "sensor"]
    with pytest.raises(FieldError):
        wire.device.pdo_service.transmit(read)


# Values


@pytest.mark.parametrize("dialect", [lift.DIALECT, lift.REVERSED])
def test_received_values_are_read_over_sdo(dialect: str) -> None:
    panel, cabin = wired("panel", dialect), wired("cabin", dialect)
    cabin.send(panel.device.pdo_service.transmit(MOVE))
    assert [cabin.read(0x2000, subindex) for subindex in range(1, 6)] == [1234, 0, 75, 0, 0]


def test_values_received_under_an_old_mapping_keep_their_meaning() -> None:
    panel, cabin = wired("panel"), wired("cabin")
    cabin.send(panel.device.pdo_service.transmit(MOVE))
    cabin.map_pdo(MOVE_RPDO, 0x123, *WIDE)
    assert [cabin.read(0x2000, subindex) for subindex in range(1, 6)] == [1234, 0, 75, 0, 0]


def test_sent_values_are_read_over_sdo() -> None:
    wire = wired()
    wire.device.pdo_service.send(PlaceResponse(1500, 1000, 90, Sensor.BELT), wire.now)
    assert [wire.read(0x2011, subindex) for subindex in range(1, 5)] == [1500, 1000, 90, 3]


def test_a_frame_too_short_changes_no_value() -> None:
    panel, cabin = wired("panel"), wired("cabin")
    cabin.send(panel.device.pdo_service.transmit(MOVE))
    cabin.send(Frame(0x108, bytes(4)))
    assert cabin.read(0x2000, 1) == 1234


@pytest.mark.parametrize("dialect", [lift.DIALECT, lift.REVERSED])
def test_a_timed_tpdo_repeats_the_values_sent_last(dialect: str) -> None:
    wire = wired("panel", dialect)
    wire.write(MOVE_TPDO, 5, 100, size=2)
    wire.device.pdo_service.send(MOVE, wire.now)
    wire.wait(0.1)
    assert wire.sent()[-1] == wire.device.protocol.encode(MOVE)


# Times


def test_an_event_timer_sends_a_tpdo_again_and_again_while_operational() -> None:
    wire = wired()
    index = index_of(wire, "State Response")
    wire.write(0x1017, 0, 0, size=2)
    wire.write(index, 5, 200, size=2)
    wire.device.pdo_service.send(StateResponse(1500), wire.now)
    wire.sent()
    assert wire.device.next_wakeup == pytest.approx(0.2)
    for _ in range(4):
        wire.wait(0.1)
    assert wire.sent() == [wire.device.protocol.encode(StateResponse(1500))] * 2
    wire.command(NmtCommand.ENTER_PRE_OPERATIONAL)
    assert wire.device.next_wakeup == inf
    assert wire.wait(1.0).frames == []


def test_an_inhibit_time_holds_a_tpdo_back_and_the_newest_is_sent() -> None:
    wire = wired()
    index = index_of(wire, "State Response")
    wire.write(0x1017, 0, 0, size=2)
    wire.write(index, 1, NOT_VALID | 0x114)
    wire.write(index, 3, 1000, size=2)
    wire.write(index, 1, 0x114)
    first, second, third = (wire.device.protocol.encode(StateResponse(time)) for time in (3, 2, 1))
    assert wire.device.pdo_service.send(StateResponse(3), 0.0) == [first]
    assert wire.device.pdo_service.send(StateResponse(2), 0.01) == []
    assert wire.device.pdo_service.send(StateResponse(1), 0.02) == []
    assert wire.device.next_wakeup == 0.1
    assert wire.wait(0.1).frames == [third]
    assert wire.device.pdo_service.send(StateResponse(2), 0.15) == []
    assert wire.wait(0.1).frames == [second]


def test_a_stop_is_never_held_back() -> None:
    wire = wired("panel")
    index = index_of(wire, "Halt")
    wire.write(index, 1, NOT_VALID | 0x104)
    wire.write(index, 3, 1000, size=2)
    wire.write(index, 1, 0x104)
    assert [wire.device.pdo_service.send(Halt(), 0.0) for _ in range(3)] == [[Frame(0x104)]] * 3
