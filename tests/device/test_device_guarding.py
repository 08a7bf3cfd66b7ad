"""Node guarding: the toggle bit, the state, the life time, and heartbeats that take its place."""

from __future__ import annotations

import pytest

from eurobot_od.device.nmt import NmtCommand, NmtState
from eurobot_od.frame import Frame
from tests.device.io_module import NODE_ID, TEXT, module
from tests.device.master import NodeWire
from tests.eds_text import DEVICE_TYPE

ERROR_CONTROL, EMERGENCIES = 0x700 + NODE_ID, 0x080 + NODE_ID
LOST, FOUND = "3081110000000000", "0000000000000000"


def guard(wire: NodeWire) -> list[int]:
    """Ask whether the module is there; return what it says."""
    return [frame.data[0] for frame in wire.node.requested(ERROR_CONTROL, wire.now)]


def emergencies(wire: NodeWire) -> list[str]:
    return [frame.data.hex() for frame in wire.sent() if frame.cob_id == EMERGENCIES]


def test_the_answer_has_the_state_and_a_bit_that_toggles() -> None:
    wire = module()
    assert [guard(wire) for _ in range(3)] == [[0x7F], [0xFF], [0x7F]]
    wire.command(NmtCommand.START)
    assert guard(wire) == [0x85]
    wire.command(NmtCommand.STOP)
    assert guard(wire) == [0x04]


def test_the_toggle_bit_begins_anew_with_a_reset() -> None:
    wire = module()
    guard(wire)
    wire.command(NmtCommand.RESET_COMMUNICATION)
    assert guard(wire) == [0x7F]


def test_a_master_is_missed_after_the_life_time_from_its_first_question_on() -> None:
    wire = module()
    wire.run(1.0)
    assert emergencies(wire) == []
    guard(wire)
    wire.run(0.29)
    guard(wire)
    wire.run(0.29)
    assert emergencies(wire) == []
    wire.run(0.02)
    assert emergencies(wire) == [LOST]
    wire.run(1.0)
    wire.node.requested(ERROR_CONTROL, wire.now)
    wire.run(0.0)
    assert wire.device.emergencies.register == 0


def test_an_operational_device_that_is_no_longer_guarded_stops_working() -> None:
    wire = module()
    wire.command(NmtCommand.START)
    guard(wire)
    wire.run(0.4)
    assert wire.device.state is NmtState.PRE_OPERATIONAL  # 0x1029 is not there: its default (CiA 301, 7.5.2.32)


NEVER_MISSED = [(0x100C, 2, "no guard time"), (0x100D, 1, "no life time factor")]


@pytest.mark.parametrize(("index", "size", "why"), NEVER_MISSED)
def test_without_a_life_time_nobody_is_missed(index: int, size: int, why: str) -> None:
    wire = module()
    wire.write(index, 0, 0, size)
    assert guard(wire) == [0x7F]
    wire.run(10.0)
    assert emergencies(wire) == [], why


def test_heartbeats_take_the_place_of_guarding() -> None:
    wire = module()
    guard(wire)
    wire.write(0x1017, 0, 1000, size=2)
    assert guard(wire) == []
    wire.run(5.0)
    assert emergencies(wire) == []


def test_a_device_without_a_guard_time_is_not_guarded() -> None:
    assert guard(module(text=DEVICE_TYPE)) == []
    assert ERROR_CONTROL not in module(text=DEVICE_TYPE).device.identifiers
    assert ERROR_CONTROL in module(text=TEXT).device.identifiers


def test_a_data_frame_with_the_devices_own_identifier_says_nothing() -> None:
    wire = module()
    assert wire.send(Frame(ERROR_CONTROL, b"\x05")).frames == []
