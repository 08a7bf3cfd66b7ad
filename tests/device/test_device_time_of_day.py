"""TIME: a device sets its clock by it, and tells the time if it is to."""

from __future__ import annotations

from datetime import datetime

import pytest

from eurobot_od.device.broadcasts import Clock
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.frame import Frame
from eurobot_od.od.values import EPOCH
from tests.device.io_module import module

NOON = datetime(2026, 11, 22, 12, 0, 0, 250_000)
TOLD = bytes.fromhex("fa2e 9302 323d")
"""Noon and 250 ms as TIME_OF_DAY: 43 200 250 ms, 15 666 days after 1984-01-01."""


def test_the_form_of_a_time() -> None:
    clock = Clock()
    clock.set(NOON, 7.0)
    assert clock.told(7.0) == TOLD
    other = Clock()
    other.receive(TOLD, 100.0)
    assert other.at(100.0) == NOON


NO_TIMES = [
    (b"", "nothing"),
    (TOLD[:5], "too short"),
    (TOLD + b"\0", "too long"),
    (bytes.fromhex("005c2605323d"), "24 h after midnight"),
]


@pytest.mark.parametrize(("data", "why"), NO_TIMES)
def test_an_invalid_time_leaves_the_clock_alone(data: bytes, why: str) -> None:
    clock = Clock()
    clock.receive(data, 1.0)
    assert clock.at(0.0) == EPOCH, why


def test_reserved_bits_do_not_count() -> None:
    clock = Clock()
    clock.receive(bytes([*TOLD[:3], TOLD[3] | 0xF0, *TOLD[4:]]), 0.0)
    assert clock.at(0.0) == NOON


def test_a_consumer_hears_time_and_keeps_it_over_a_reset() -> None:
    wire = module()
    wire.send(Frame(0x100, TOLD))
    wire.command(NmtCommand.RESET_NODE)
    assert wire.device.time_of_day.at(wire.now) == NOON


def test_a_device_that_is_no_consumer_hears_none() -> None:
    wire = module()
    wire.write(0x1012, 0, 0x100)
    wire.send(Frame(0x100, TOLD))
    assert wire.device.time_of_day.at(wire.now) == EPOCH


def test_a_producer_tells_the_time_every_second_unless_stopped() -> None:
    wire = module()
    wire.device.time_of_day.set(NOON, -1.0)
    wire.write(0x1012, 0, 1 << 30 | 0x100)
    wire.run(2.5)
    assert next(frame.data for frame in wire.sent() if frame.cob_id == 0x100) == bytes.fromhex("ca369302 323d")
    wire.command(NmtCommand.STOP)
    wire.run(5.0)
    assert [frame for frame in wire.sent() if frame.cob_id == 0x100] == []
